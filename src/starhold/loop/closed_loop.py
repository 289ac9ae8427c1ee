"""The closed loop: plant, target, sensors, law and actuators put together. The only place a law meets a plant."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.quaternion import NO_TURN, Quaternion, relative
from starhold.algebra.scalar import side
from starhold.algebra.structure import unflatten
from starhold.algebra.vector import ZERO, Vector
from starhold.laws.catalogue import Law
from starhold.laws.double_cover import COVERS
from starhold.laws.interface import NoMemory
from starhold.models import actuator, environment, sensor, target
from starhold.models.craft import Craft
from starhold.models.rigid_body import State

Cover = Literal["as_published", "shortest", "hysteresis"]
Limit = Literal["axis", "norm", "none"]
LIMITS = {"axis": actuator.limit_axis, "norm": actuator.limit_norm, "none": actuator.limit_none}


class Setup(NamedTuple):
    """The numbers of a loop that are neither the craft's nor the law's; kernels take them as an argument."""

    period: float
    substep: float
    target: Any
    noise: sensor.Noise
    seed: int
    width: float
    dynamics: actuator.Dynamics


class Parts(NamedTuple):
    """The equations of a loop; each combination is compiled once."""

    environment: Callable[..., Any]
    target: Callable[..., Any]
    sense: Callable[..., Any]
    disturb: Callable[..., Any]
    cover: Callable[..., Any]
    law: Callable[..., Any]
    limit: Callable[..., Any]
    begin: Callable[..., Any]
    response: Callable[..., Any]


class Carry(NamedTuple):
    """What a trajectory carries from step to step: the state, the law's memory, the target attitude seen last (only where
    the target has to be continued from it), the side h = +-1 of the double cover, the command and the random torque held,
    and the control step at which the motion was lost (-1: not lost)."""

    state: State
    memory: Any
    goal: Any
    h: float
    command: Vector
    disturbance: Vector
    lost_at: float


@dataclass(frozen=True)
class ClosedLoop:
    """One law on one spacecraft in one setting; SI units and radians.

    target: a quaternion (inertial to target axes), "orbital", or a table of `models.target.tabulate` with a row for each
    control step and one more. noise adds to what the sensors say and to the torque.
    """

    craft: Craft
    law: Law
    gains: Any
    start: State
    period: float
    substeps: int = 1
    orbit: bool = False
    gravity_gradient: bool = False
    target: Quaternion | Literal["orbital"] | NDArray[np.float64] = NO_TURN
    noise: sensor.Noise = sensor.SILENT
    limit: Limit = "axis"
    dynamics: actuator.Dynamics = actuator.IDEAL
    cover: Cover = "as_published"
    hysteresis_width: float = 0.5
    seed: int = 1

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
        return Parts(
            around,
            goal,
            sensor.noisy if seen_noise else sensor.exact,
            sensor.gaussian_disturbance if self.noise.torque > 0.0 else sensor.no_disturbance,
            COVERS[self.cover],
            self.law.torque,
            LIMITS[self.limit],
            actuator.start_ideal if ideal else actuator.start_lagging,
            actuator.ideal if ideal else response,
        )

    def setup(self) -> Setup:
        """The numbers of this loop."""
        goal = NO_TURN if isinstance(self.target, str) else self.target
        substep = self.period / self.substeps
        return Setup(self.period, substep, goal, self.noise, self.seed, self.hysteresis_width, self.dynamics)

    def carry(self, start: State | None = None) -> Carry:
        """What a trajectory starts with."""
        start = self.start if start is None else start
        memory = self.law.remember(self.gains, self.craft, self.period)
        goal = NoMemory()
        if isinstance(self.target, str):
            goal = target.orbital(None, start.position, start.velocity, 0, NO_TURN).attitude
        error = relative(self._goal_at_start(goal), start.attitude)
        return Carry(start, memory, goal, side(error[0]), ZERO, ZERO, -1.0)

    def _goal_at_start(self, followed: Any) -> Quaternion:
        if isinstance(self.target, np.ndarray):
            return unflatten(self.target[0, :4], NO_TURN)
        return followed if isinstance(self.target, str) else self.target
