"""The roles of the parts of a closed loop: for each the equations that its parts define, as protocols.

A part is a module; `parts.contract` says what all of them hold. Equations take and give numbers and tuples of numbers,
so that floats, traces and exact polynomials read them alike. `params` is the part's `Params` (or what its `prepare`
makes of them), `state` the body's state, for effectors their own and `body` the body's; `craft` the numbers of the
body, `dice` random numbers of the part's own, `step` the number of the control step.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, NamedTuple, Protocol, TypeAlias

from starhold.algebra.quaternion import Quaternion
from starhold.algebra.scalar import Scalar, Truth
from starhold.algebra.vector import Matrix, Vector
from starhold.parts.random import Dice

State: TypeAlias = Any
"""A NamedTuple of numbers and tuples of them, which the part or its body defines."""


class Goal(NamedTuple):
    """The attitude to be reached: q_RN (inertial to target axes), and the target's angular velocity (rad/s) and acceleration
    (rad/s2), both in target axes."""

    attitude: Quaternion
    rate: Vector
    acceleration: Vector


class Loads(NamedTuple):
    """All that acts on a body, None for a kind that the loop lacks: the acceleration by environments and
    effectors, the torque by environments, the reaction of the effectors (N m, body), and the inertia that these add
    (3, 3); `direct`: whether the actuators act on the body itself, because no effector takes the command."""

    acceleration: Vector | None
    torque: Vector | None
    reaction: Vector | None
    inertia: Matrix | None
    direct: bool


class Scene(NamedTuple):
    """All that a measurement is made of besides the state: the goal (None where the loop has no target), whether it never
    turns, the modelled torque from outside (N m, body), the effectors' momentum (N m s, body), the control period, the limit
    of the command, and all readings of the sensors, an attribute for each."""

    goal: Any
    still: bool
    torque: Vector
    momentum: Vector
    period: Scalar
    limit: Scalar
    readings: Any


class Body(Protocol):
    """The part that moves. `State` has a field named `COMMAND` for the command that acts, three numbers; `Measurement`
    is the input of laws, `Sample` the recorded quantities, with fields annotated with `Quantity`. `SIGN_POLICIES`: by
    name, the choice among equivalent measurements; none if there is no choice. `TIME_UNIT`: "s" by default.

    A body without tables of its own in scenarios is given by a [body] table, whose keys are the fields of its `Params`,
    if it has any; the keys of [initial] are the fields of its `State` except the command, annotated with `Parameter`.
    Its craft is its `Params`, or what its `make` makes of them."""

    COMMAND: str
    TIME_UNIT: str
    SIGN_POLICIES: dict[str, Callable[..., Any]]
    State: type
    Measurement: type
    Sample: type

    def rates(self, state: State, loads: Loads, command_rate: Vector | None, craft: Any, /) -> Any:
        """d(state)/dt; command_rate is the rate of the acting command, None if it is held."""
        ...

    def renormalised(self, state: State, /) -> State:
        """The state with its constraints restored, such as the length of a quaternion."""
        ...

    def is_sound(self, state: State, setup: Any, /) -> Truth:
        """Whether the motion is finite and slow enough for the integration; setup has `substep` and `divergence_bound`."""
        ...

    def observe(self, state: State, scene: Scene, /) -> Any:
        """The measurement of a state as sensors or estimators give it."""
        ...

    def sample(self, state: State, goal: Any, applied: Vector, command: Vector, /) -> Any:
        """The quantities that are recorded."""
        ...


class Environment(Protocol):
    """A torque (N m, body), a force or a field; at least one of `torque` and `acceleration`. `MODELLED`: whether laws know
    the torque; `ACROSS_FIELD`: whether it is at right angles to the Earth's magnetic field. With a memory, `remember` and
    `update` renew it at each control step."""

    MODELLED: bool
    ACROSS_FIELD: bool

    def torque(self, state: State, params: Any, craft: Any, memory: Any, /) -> Vector:
        """The torque on the body (N m, body axes)."""
        ...

    def acceleration(self, state: State, params: Any, craft: Any, memory: Any, /) -> Vector | None:
        """The acceleration of the body, in the axes of its position; None for numbers that do not move it."""
        ...

    def perturbation(self, params: Any, craft: Any, distance: float, /) -> tuple[float, float]:
        """The largest `acceleration` (m/s2) and its largest gradient (1/s2) at this distance (m) or a larger one."""
        ...

    def remember(self, params: Any, /) -> Any:
        """The memory at the start."""
        ...

    def update(self, memory: Any, state: State, params: Any, dice: Dice, step: int, /) -> Any:
        """The memory for the control step that begins."""
        ...


class Effector(Protocol):
    """A mechanism that moves with the body and shares its momentum. Effectors are independent: each adds its reaction and,
    if needed, its inertia, and takes the body's angular acceleration for its own rates. With `ACTS` it takes the law's
    command. One that decides only at control instants, or without the law, has `switch`; `OUTSIDE`: whether its torque comes
    from outside, as of a field or of mass that is expelled, and not from momentum of its own; `KNOWN`: the parameters, by
    name, that flight software uses to share the command out. In a mode in which it is inactive, one with `ACTS` gets a
    zero command, and one with `OUTSIDE` alone has its initial state."""

    ACTS: bool
    OUTSIDE: bool
    KNOWN: tuple[str, ...]

    def command(self, applied: Vector, params: Any, /) -> Any:
        """The commands of its motors for a desired torque on the body (N m)."""
        ...

    def switch(self, state: Any, wanted: Vector, measurement: Any, body: State, params: Any, step: int, /) -> Any:
        """Its state at the start of a control step, in place of `command`; wanted: the command (N m), measurement: the
        law's, body: the body's state."""
        ...

    def pulse(self, state: Any, substep: Scalar, params: Any, /) -> Any:
        """The command for the next substep, of an effector with `switch`; none if it is absent."""
        ...

    def reaction(self, state: Any, command: Any, body: State, params: Any, /) -> Vector:
        """The torque on the body (N m), with -w x h of its momentum h and without the terms in the body's angular
        acceleration."""
        ...

    def push(self, state: Any, command: Any, body: State, params: Any, /) -> Vector | None:
        """The acceleration of the body by its force, in the axes of its position; None for numbers that do not move it."""
        ...

    def inertia(self, state: Any, params: Any, /) -> Matrix:
        """The inertia (3, 3; kg m2) that the body's angular acceleration meets besides the body's own."""
        ...

    def rates(self, state: Any, command: Any, body: State, acceleration: Vector, params: Any, /) -> Any:
        """d(state)/dt, None for constant parts; acceleration: the body's angular one (rad/s2)."""
        ...

    def momentum(self, state: Any, params: Any, /) -> Vector:
        """Its angular momentum relative to the body (N m s, body axes)."""
        ...

    def measured_momentum(self, state: Any, params: Any, /) -> Vector:
        """This momentum as laws are given it; `momentum` itself where it is absent."""
        ...

    def inertia_change(self, state: Any, params: Any, /) -> Matrix:
        """The inertia (3, 3; kg m2) that the whole has beyond the body's numbers as its shape changes; times the body's
        rate it belongs to the momentum."""
        ...

    def sure_torque(self, params: Any, kind: Literal["axis", "norm"], /) -> float:
        """The torque (N m) that it surely gives on the body, in norm or about each axis at once."""
        ...

    def gives_allocated_torque(self, params: Any, /) -> bool:
        """Whether, within its limits, the torque on the body is the one allocated to it, and its momentum the one that laws
        are told; true where it is absent."""
        ...

    def record(self, state: Any, command: Any, body: State, params: Any, /) -> Any:
        """Its recorded quantities, a NamedTuple."""
        ...


class Sensor(Protocol):
    """A sensor measures the body's state. `Reading` is a NamedTuple whose fields are named as those of the body's state
    that it measures; further fields are for estimators."""

    Reading: type

    def measure(self, state: State, memory: Any, params: Any, dice: Dice, step: int, /) -> tuple[Any, Any]:
        """The reading, and the memory for the next."""
        ...

    def remember(self, params: Any, state: State, /) -> Any:
        """The memory at the start."""
        ...


class Estimator(Protocol):
    """The state as it is computed from readings. `NEEDS`: the readings that it takes, by name; `Estimate` is a
    NamedTuple whose fields are named as those of the body's state that it estimates. `SEVERAL`: a dict from the name of a
    reading that it takes of several sensors to the parameter with a row for each sensor after the first, "" for none.
    `ASSUMES`: a dict from a reading to its parameters that a scenario may leave to the sensor that has them too.
    `STARTABLE`: whether it takes its first attitude from the estimate of another one, which it reads as `fix`, once that is
    valid."""

    NEEDS: tuple[str, ...]
    STARTABLE: bool
    Estimate: type

    def estimate(self, readings: Any, memory: Any, params: Any, craft: Any, period: Scalar, /) -> tuple[Any, Any]:
        """The estimate and the memory for the next; `readings` has an attribute for each name, that of the first sensor, and
        `every`, the readings of all sensors in the order of the file; craft is the nominal model."""
        ...

    def remember(self, params: Any, state: State, /) -> Any:
        """The memory at the start."""
        ...


class Target(Protocol):
    """The attitude to be reached over time. `STILL`: whether it never turns. `FOLLOWS`: whether it is continued from the
    attitude that it had a control step before."""

    STILL: bool
    FOLLOWS: bool

    def goal(self, params: Any, state: State, step: int, before: Any, /) -> Goal:
        """The goal at a control step; before: its attitude at the step before where it follows that, else nothing."""
        ...

    def motion(self, params: Any, /) -> tuple[float, float]:
        """The largest rate (rad/s) and acceleration (rad/s2) of its attitude over the whole flight."""
        ...


class Actuator(Protocol):
    """An actuator turns the command of a law into the one that acts. One without `rates` changes the command at control
    instants alone; one with them has an output of its own that follows its input."""

    def command(self, command: Vector, params: Any, /) -> Vector:
        """The command that is passed on."""
        ...

    def rates(self, output: Vector, target: Vector, begun: Vector, substep: Scalar, params: Any, /) -> Vector:
        """d(output)/dt towards an input; begun: the output at the start of the substep."""
        ...


ROLES = ("body", "effector", "environment", "sensor", "estimator", "target", "law", "actuator")
"""The roles in the order of a loop's description; each names a package under `parts`, laws have their own."""
