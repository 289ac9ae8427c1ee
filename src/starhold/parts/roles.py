"""The roles of the parts of a closed loop: protocols of the equations that parts of each role define.

A part is a module; `parts.contract` says what all parts contain. Equations take and return numbers and tuples of numbers,
so that floats, traces and exact polynomials read them alike. `params` is the part's `Params` (or the result of its
`prepare`); `state` is the body's state, but for effectors their own, with `body` the body's; `craft` has the numbers of the
body, `dice` the part's random numbers, and `step` is the number of the control step.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, NamedTuple, Protocol, TypeAlias

from starhold.algebra.quaternion import Quaternion
from starhold.algebra.scalar import Scalar, Truth
from starhold.algebra.vector import Matrix, Vector
from starhold.parts.contract import Motion, Orbit
from starhold.parts.random import Dice

State: TypeAlias = Any
"""A NamedTuple of numbers and tuples of them, which the part or its body defines."""


class Goal(NamedTuple):
    """The target attitude q_RN (inertial to target axes), and the target's angular velocity (rad/s) and acceleration
    (rad/s2), both in target axes."""

    attitude: Quaternion
    rate: Vector
    acceleration: Vector


class Loads(NamedTuple):
    """All loads on a body, each None if the loop has none: the acceleration by environments and effectors, the torque by
    environments, the reaction of the effectors (N m, body), and the inertia that these add (3, 3; kg m2); `direct`: whether
    the actuators act on the body itself, because no effector takes the command."""

    acceleration: Vector | None
    torque: Vector | None
    reaction: Vector | None
    inertia: Matrix | None
    direct: bool


class Scene(NamedTuple):
    """The inputs of a measurement besides the state: the goal (None without a target), whether it never turns, the modelled
    external torque (N m, body), the effectors' momentum (N m s, body), the control period (s), the limit of the command,
    and all readings of the sensors, one attribute each."""

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

    A body without tables of its own in scenarios has a [body] table, whose keys are the fields of its `Params`, if any; the
    keys of [initial] are the fields of its `State` except the command, annotated with `Parameter`. Its craft is its
    `Params`, or the result of its `make`."""

    COMMAND: str
    TIME_UNIT: str
    SIGN_POLICIES: dict[str, Callable[..., Any]]
    State: type
    Measurement: type
    Sample: type

    def rates(self, state: State, loads: Loads, command_rate: Vector | None, craft: Any, /) -> Any:
        """Return d(state)/dt; command_rate is the rate of the acting command, None if it is held."""
        ...

    def renormalised(self, state: State, /) -> State:
        """Return the state with its constraints restored, such as the length of a quaternion."""
        ...

    def is_sound(self, state: State, setup: Any, /) -> Truth:
        """Return whether the motion is finite and slow enough to integrate; setup has `substep` and `divergence_bound`."""
        ...

    def observe(self, state: State, scene: Scene, /) -> Any:
        """Return the measurement of a state from sensors or estimators."""
        ...

    def sample(self, state: State, goal: Any, applied: Vector, command: Vector, /) -> Any:
        """Return the recorded quantities."""
        ...


class Environment(Protocol):
    """A torque (N m, body), a force or a field; it has `torque`, `acceleration` or both. `MODELLED`: whether laws know the
    torque; `ACROSS_FIELD`: whether it is perpendicular to the Earth's magnetic field. A memory has `remember`, and `update`
    renews it at each control step."""

    MODELLED: bool
    ACROSS_FIELD: bool

    def torque(self, state: State, params: Any, craft: Any, memory: Any, /) -> Vector:
        """Return the torque on the body (N m, body axes)."""
        ...

    def acceleration(self, state: State, params: Any, craft: Any, memory: Any, /) -> Vector | None:
        """Return the acceleration of the body, in the axes of its position; None if the parameters do not move it."""
        ...

    def perturbation(self, params: Any, craft: Any, distance: float, /) -> tuple[float, float]:
        """Return the largest `acceleration` (m/s2) and its largest gradient (1/s2) at this distance (m) or a larger one."""
        ...

    def remember(self, params: Any, /) -> Any:
        """Return the memory at the start."""
        ...

    def update(self, memory: Any, state: State, params: Any, dice: Dice, step: int, /) -> Any:
        """Return the memory for this control step."""
        ...


class Effector(Protocol):
    """A mechanism that moves with the body and shares its momentum. Effectors are independent: each adds its reaction and,
    if needed, its inertia, and takes the body's angular acceleration for its own rates. With `ACTS` it takes the law's
    command. An effector that decides only at control instants, or without the law, has `switch`; `OUTSIDE`: whether its
    torque is external, from a field or expelled mass, and not from its own momentum; `KNOWN`: the names of the parameters
    that flight software uses to distribute the command. In a mode in which it is inactive, an effector with `ACTS` gets a
    zero command, and one with `OUTSIDE` alone has its initial state."""

    ACTS: bool
    OUTSIDE: bool
    KNOWN: tuple[str, ...]

    def command(self, applied: Vector, params: Any, /) -> Any:
        """Return the commands of its motors for a desired torque on the body (N m)."""
        ...

    def switch(self, state: Any, wanted: Vector, measurement: Any, body: State, params: Any, step: int, /) -> Any:
        """Return its state at the start of a control step, in place of `command`; wanted: the command (N m), measurement:
        the law's, body: the body's state."""
        ...

    def pulse(self, state: Any, substep: Scalar, params: Any, /) -> Any:
        """Return the command for the next substep, for an effector with `switch`; without it there is no command."""
        ...

    def reaction(self, state: Any, command: Any, body: State, params: Any, /) -> Vector:
        """Return the torque on the body (N m), with -w x h of its momentum h and without the terms in the body's angular
        acceleration."""
        ...

    def push(self, state: Any, command: Any, body: State, params: Any, /) -> Vector | None:
        """Return the body's acceleration by its force, in the axes of its position; None if the parameters do not move
        it."""
        ...

    def inertia(self, state: Any, params: Any, /) -> Matrix:
        """Return the inertia (3, 3; kg m2) to add to the body's own in its angular acceleration."""
        ...

    def rates(self, state: Any, command: Any, body: State, acceleration: Vector, params: Any, /) -> Any:
        """Return d(state)/dt, None for constant parts; acceleration: the body's angular acceleration (rad/s2)."""
        ...

    def momentum(self, state: Any, params: Any, /) -> Vector:
        """Return its angular momentum relative to the body (N m s, body axes)."""
        ...

    def measured_momentum(self, state: Any, params: Any, /) -> Vector:
        """Return this momentum as given to laws; `momentum` if it is not defined."""
        ...

    def inertia_change(self, state: Any, params: Any, /) -> Matrix:
        """Return the change of the total inertia (3, 3; kg m2) with the shape, whose product with the body's rate is part
        of the momentum."""
        ...

    def sure_torque(self, params: Any, kind: Literal["axis", "norm"], /) -> float:
        """Return the torque (N m) available on the body in every direction, in norm or about each axis at once."""
        ...

    def gives_allocated_torque(self, params: Any, /) -> bool:
        """Return whether, within its limits, the torque on the body is the one allocated to it, and the momentum given to
        laws is correct; true if it is not defined."""
        ...

    def record(self, state: Any, command: Any, body: State, params: Any, /) -> Any:
        """Return its recorded quantities, a NamedTuple."""
        ...


class Sensor(Protocol):
    """A sensor of the body's state. `Reading` is a NamedTuple whose fields have the names of the measured fields of the
    body's state; further fields are for estimators."""

    Reading: type

    def measure(self, state: State, memory: Any, params: Any, dice: Dice, step: int, /) -> tuple[Any, Any]:
        """Return the reading, and the memory for the next one."""
        ...

    def remember(self, params: Any, state: State, /) -> Any:
        """Return the memory at the start."""
        ...


class Estimator(Protocol):
    """An estimator computes the state from readings. `NEEDS`: the names of the readings that it takes; `Estimate` is a
    NamedTuple whose fields have the names of the estimated fields of the body's state. `SEVERAL`: a dict from the name of a
    reading taken from several sensors to the parameter with a row for each sensor after the first, "" for none. `ASSUMES`:
    a dict from a reading to parameters that default to those of the sensor. `STARTABLE`: whether it takes its first
    attitude from the estimate of another estimator, read as `fix`, once that is valid."""

    NEEDS: tuple[str, ...]
    STARTABLE: bool
    Estimate: type

    def estimate(self, readings: Any, memory: Any, params: Any, craft: Any, period: Scalar, /) -> tuple[Any, Any]:
        """Return the estimate and the memory for the next one; `readings` has an attribute for each name, with the reading
        of the first sensor, and `every`, the readings of all sensors in the order of the file; craft is the nominal
        model."""
        ...

    def remember(self, params: Any, state: State, /) -> Any:
        """Return the memory at the start."""
        ...


class Target(Protocol):
    """The target attitude over time. `STILL`: whether it never turns. `FOLLOWS`: whether it continues from its attitude at
    the previous control step."""

    STILL: bool
    FOLLOWS: bool

    def goal(self, params: Any, state: State, step: int, before: Any, /) -> Goal:
        """Return the goal at a control step; before: its attitude at the previous step if it has `FOLLOWS`, else ()."""
        ...

    def motion(self, params: Any, orbit: Orbit, /) -> Motion:
        """Return bounds on the rate (rad/s) and acceleration (rad/s2) of its attitude, on an orbit within these bounds."""
        ...


class Actuator(Protocol):
    """An actuator turns the command of a law into the one that acts. Without `rates` it changes the command only at control
    instants; with `rates` it has an output that follows its input."""

    def command(self, command: Vector, params: Any, /) -> Vector:
        """Return the command that is passed on."""
        ...

    def rates(self, output: Vector, target: Vector, begun: Vector, substep: Scalar, params: Any, /) -> Vector:
        """Return d(output)/dt towards an input; begun: the output at the start of the substep."""
        ...


ROLES = ("body", "effector", "environment", "sensor", "estimator", "target", "law", "actuator")
"""The roles in the order of a loop's description; each has a package under `parts`, except laws, which have their own."""
