"""The closed loop: plant, target, sensors, law and actuators put together. The only place a law meets a plant."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.quaternion import NO_TURN, Quaternion, relative
from starhold.algebra.scalar import side
from starhold.algebra.structure import alike, leaves, unflatten
from starhold.algebra.structured import Buffer
from starhold.algebra.vector import ZERO, Vector, apply
from starhold.laws.catalogue import Law
from starhold.laws.interface import NoMemory
from starhold.parts.actuators import dynamics as actuator
from starhold.parts.bodies import rigid_body
from starhold.parts.bodies.rigid_body import State
from starhold.parts.craft import Craft
from starhold.parts.effectors import wheeled_body
from starhold.parts.effectors.envelope import with_facets
from starhold.parts.effectors.wheeled_body import WheeledState
from starhold.parts.effectors.wheels import Wheels, allocate, allocate_peak, relaxation
from starhold.parts.environments import gravity as environment
from starhold.parts.quaternion_sign import SIGN_POLICIES
from starhold.parts.sensors import gaussian as sensor
from starhold.parts.targets import target

SignPolicy = Literal["as_published", "shortest", "hysteresis"]
Limit = Literal["axis", "norm", "none"]
Allocation = Literal["least-squares", "least-peak"]
ALLOCATIONS = {"least-squares": allocate, "least-peak": allocate_peak}
LIMITS = {"axis": actuator.limit_axis, "norm": actuator.limit_norm, "none": actuator.limit_none}


class Setup(NamedTuple):
    """The numbers of a loop that are neither the craft's nor the law's; kernels take them as an argument."""

    period: float
    substep: float
    target: Any
    noise: sensor.Noise
    width: float
    command_limit: float
    dynamics: actuator.Dynamics
    wheels: Any


class Parts(NamedTuple):
    """The equations of a loop."""

    environment: Callable[..., Any]
    target: Callable[..., Any]
    sense: Callable[..., Any]
    disturb: Callable[..., Any]
    cover: Callable[..., Any]
    law: Callable[..., Any]
    limit: Callable[..., Any]
    begin: Callable[..., Any]
    response: Callable[..., Any]
    tidy: Callable[..., Any]
    with_torque: Callable[..., Any]
    rates: Callable[..., Any]
    wheel_momentum: Callable[..., Any]
    record: Callable[..., Any]
    share: Callable[..., Any]


class Carry(NamedTuple):
    """What a trajectory carries from step to step: the state, the law's memory, the target attitude seen last (only where
    the target has to be continued from it), the side h = +-1 of the double cover, the command and the random torque held,
    and the control step at which the motion was lost (-1: not lost)."""

    state: State | WheeledState
    memory: Any
    goal: Any
    h: float
    command: Vector
    disturbance: Vector
    lost_at: float


class Event(NamedTuple):
    """From a control step on: other wheels (None for a craft without), gains or craft than before, and what the law then
    takes the craft for."""

    step: int
    wheels: Wheels | None
    gains: Any
    craft: Craft
    known: Craft


class Phase(NamedTuple):
    """Control steps first .. last-1 of a run, and the numbers they are flown with."""

    first: int
    last: int
    gains: Any
    craft: Craft
    known: Craft
    setup: Setup
    before: Craft
    """What the craft was until this phase."""

    @property
    def turns(self) -> bool:
        """Whether the body's rate jumps as the phase begins."""
        pairs = zip(leaves(self.craft.inertia), leaves(self.before.inertia), strict=True)
        return not all(np.array_equal(*pair) for pair in pairs)

    def rate_from(self, rate: Vector) -> Vector:
        """The body's rate (rad/s) as the phase begins, from that at the end of the one before: what moves inside the craft
        leaves its angular momentum."""
        if not self.turns:
            return rate
        return apply(self.craft.inverse_inertia, apply(self.before.inertia, rate))

    def entered(self, carry: Carry) -> Carry:
        """What is carried into the phase."""
        return carry._replace(state=carry.state._replace(rate=self.rate_from(carry.state.rate)))


@dataclass(frozen=True)
class ClosedLoop:
    """One law on one spacecraft in one setting; SI units and radians.

    target: a quaternion (inertial to target axes), "orbital", or a table of `models.target.tabulate` with a row for each
    control step and one more; knots: of the spline that the table was taken from. noise adds to what the sensors say and to
    the torque.
    """

    craft: Craft
    law: Law
    gains: Any
    start: State | WheeledState
    period: float
    substeps: int = 1
    orbit: bool = False
    gravity_gradient: bool = False
    target: Quaternion | Literal["orbital"] | NDArray[np.float64] = NO_TURN
    knots: target.Knots | None = None
    noise: sensor.Noise = sensor.SILENT
    limit: Limit = "axis"
    command_limit: float | None = None
    """Where the command is cut off, in the way of `limit` (N m); None: at the torque limit that the law sees, the craft's.
    Beside wheels the law sees what they surely give together, and the wheels cut off what is more."""
    dynamics: actuator.Dynamics = actuator.IDEAL
    sign_policy: SignPolicy = "as_published"
    hysteresis_width: float = 0.5
    seed: int = 1
    wheels: Wheels | None = None
    """Wheels that give the torque; `start` then is a `WheeledState`, and the craft's inertia that without their rotors'
    moments about their spin axes."""
    allocation: Allocation = "least-squares"
    events: tuple[Event, ...] = ()
    """What changes during a run, in order of time."""

    def parts(self) -> Parts:
        """The equations this loop is made of."""
        around = environment.two_body if self.orbit else environment.free_space
        if self.gravity_gradient:
            around = environment.two_body_gravity_gradient
        goal = target.history if isinstance(self.target, np.ndarray) else target.inertial
        if isinstance(self.target, str):
            goal = target.orbital
        seen_noise = self.noise.attitude > 0.0 or self.noise.rate > 0.0
        ideal = self.dynamics.lag == 0.0 and math.isinf(self.dynamics.rate_limit)
        response = actuator.lagging if self.dynamics.lag > 0.0 else actuator.ramping
        body = rigid_body if self.wheels is None else wheeled_body
        return Parts(
            around,
            goal,
            sensor.noisy if seen_noise else sensor.exact,
            sensor.gaussian_disturbance if self.noise.torque > 0.0 else sensor.no_disturbance,
            SIGN_POLICIES[self.sign_policy],
            self.law.torque,
            LIMITS[self.limit],
            actuator.start_ideal if ideal else actuator.start_lagging,
            actuator.ideal if ideal else response,
            body.tidy,
            body.with_torque,
            body.rates,
            body.wheel_momentum,
            body.record,
            ALLOCATIONS[self.allocation],
        )

    @property
    def fastest(self) -> float:
        """The fastest rate (1/s) at which an actuator or a rotor comes to rest by itself, which the integration must
        resolve: 1/lag, and friction over a rotor's inertia."""
        rates = [1.0 / self.dynamics.lag if self.dynamics.lag > 0.0 else 0.0]
        wheels = [event.wheels for event in self.events] + [self.wheels]
        rates += [relaxation(found) for found in wheels if found is not None]
        return max(rates)

    @property
    def remembers(self) -> bool:
        """Whether the law keeps anything from call to call."""
        return any(True for _ in leaves(self.law.remember(self.gains, self.craft, self.period)))

    def setup(self) -> Setup:
        """The numbers of this loop."""
        goal = NO_TURN if isinstance(self.target, str) else self.target
        if isinstance(goal, np.ndarray):
            goal = Buffer(goal.ravel().tolist())
        substep = self.period / self.substeps
        wheels: Any = NoMemory() if self.wheels is None else self.wheels
        if self.wheels is not None and self.allocation == "least-peak":
            wheels = with_facets(self.wheels)
        cut = self.craft.torque_limit if self.command_limit is None else self.command_limit
        return Setup(self.period, substep, goal, self.noise, self.hysteresis_width, cut, self.dynamics, wheels)

    def phases(self, steps: int) -> list[Phase]:
        """A run of so many control steps, cut where something changes."""
        events = (Event(0, self.wheels, self.gains, self.craft, self.craft), *self.events)
        # Of one form in all phases, so that one kernel flies them all.
        gains = alike([event.gains for event in events])
        crafts = alike([event.craft for event in events] + [event.known for event in events])
        lasts = [*(min(event.step, steps) for event in self.events), steps]
        found: list[Phase] = []
        before = crafts[0]
        for event, last, own, craft, known in zip(events, lasts, gains, crafts, crafts[len(events) :], strict=False):
            if last > event.step:
                setup = replace(self, wheels=event.wheels).setup()
                found.append(Phase(event.step, last, own, craft, known, setup, before))
                before = craft
        return found

    def carry(self, start: State | WheeledState | None = None, gains: Any = None, known: Craft | None = None) -> Carry:
        """What a trajectory starts with; from another start, with other gains or a craft that the law takes it for."""
        start = self.start if start is None else start
        memory = self.law.remember(gains or self.gains, known or self.craft, self.period)
        goal = NoMemory()
        if isinstance(self.target, str):
            goal = target.orbital(None, start.position, start.velocity, 0, NO_TURN).attitude
        error = relative(self._goal_at_start(goal), start.attitude)
        return Carry(start, memory, goal, side(error[0]), ZERO, ZERO, -1.0)

    def _goal_at_start(self, followed: Any) -> Quaternion:
        if isinstance(self.target, np.ndarray):
            return unflatten(self.target[0, :4], NO_TURN)
        return followed if isinstance(self.target, str) else self.target
