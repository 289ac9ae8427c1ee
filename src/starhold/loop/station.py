"""Station keeping: plant, law and control surfaces put together, and the equations of its control step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

from starhold.algebra.scalar import both, is_finite, less, opposite, where
from starhold.algebra.vector import ZERO, Vector, dot
from starhold.algebra.words import number_of
from starhold.laws.point import PointMeasurement, StationLaw
from starhold.loop.closed_loop import LIMITS
from starhold.loop.step import Step, runge_kutta
from starhold.parts.actuators import dynamics as actuator
from starhold.parts.bodies import libration_point as libration
from starhold.parts.bodies.libration_point import Libration, PointState

MODELS = {"linear": libration.linear, "nonlinear": libration.nonlinear}


class StationSetup(NamedTuple):
    """The numbers of a loop that are neither the plant's nor the law's. `far`: the distance at which the motion is lost."""

    period: float
    substep: float
    limit: float
    far: float
    dynamics: actuator.Dynamics


class StationParts(NamedTuple):
    """The equations of a loop."""

    motion: Callable[..., Any]
    law: Callable[..., Any]
    limit: Callable[..., Any]
    begin: Callable[..., Any]
    response: Callable[..., Any]


class StationCarry(NamedTuple):
    """What a trajectory carries from step to step; lost_at is the control step at which it was lost (-1: not lost)."""

    state: PointState
    memory: Any
    command: Vector
    lost_at: float


class StationSample(NamedTuple):
    """One recorded instant: the state, the control that acts, the control commanded."""

    position: Vector
    velocity: Vector
    control: Vector
    command: Vector


class StationPhase(NamedTuple):
    """Control steps first .. last-1 of a run, which is all of it, and the numbers they are flown with."""

    first: int
    last: int
    gains: Any
    craft: Libration
    known: Libration
    setup: StationSetup

    def entered(self, carry: StationCarry) -> StationCarry:
        """What is carried into the phase."""
        return carry


@dataclass(frozen=True)
class StationLoop:
    """One law at one libration point, in the scaled units of `models.libration`.

    limit: largest control (scaled), of the norm or of each axis; lag: time constant of the control surfaces; far: the
    distance from the point at which the motion counts as lost.
    """

    plant: Libration
    law: StationLaw
    gains: Any
    start: PointState
    period: float
    substeps: int = 1
    model: Literal["linear", "nonlinear"] = "linear"
    limit: float = float("inf")
    limit_kind: Literal["norm", "axis", "none"] = "norm"
    lag: float = 0.0
    far: float = 1e3

    @property
    def seed(self) -> int:
        """The seed of random numbers, of which this kind of loop draws none."""
        return 0

    @property
    def fastest(self) -> float:
        """The fastest rate at which the control comes to its command by itself: 1/lag."""
        return 1.0 / self.lag if self.lag > 0.0 else 0.0

    def parts(self) -> StationParts:
        """The equations this loop is made of."""
        lags = self.lag > 0.0
        return StationParts(
            MODELS[self.model],
            self.law.control,
            LIMITS[self.limit_kind],
            actuator.start_lagging if lags else actuator.start_ideal,
            actuator.lagging if lags else actuator.ideal,
        )

    def setup(self) -> StationSetup:
        """The numbers of this loop."""
        dynamics = actuator.Dynamics(self.lag, float("inf"))
        return StationSetup(self.period, self.period / self.substeps, self.limit, self.far, dynamics)

    def phases(self, steps: int) -> list[StationPhase]:
        """A run of so many control steps."""
        return [StationPhase(0, steps, self.gains, self.plant, self.plant, self.setup())]

    def carry(self, start: PointState | None = None) -> StationCarry:
        """What a trajectory starts with."""
        memory = self.law.remember(self.gains, self.plant, self.period)
        return StationCarry(self.start if start is None else start, memory, ZERO, -1.0)

    @property
    def craft(self) -> Libration:
        """The plant, under the name that kernels have for what a law acts on."""
        return self.plant


def station_step(parts: StationParts) -> Step:
    """The equations of a control step made of these parts."""
    motion, law, limit, begin, response = parts

    def look(carry, step, key, plant, setup):
        return PointMeasurement(carry.state.position, carry.state.velocity, setup.period, setup.limit)

    def decide(carry, step, key, gains, plant, setup):
        command, memory = law(look(carry, step, key, plant, setup), gains, plant, carry.memory)
        command = limit(command, setup.limit)
        state = carry.state._replace(control=begin(carry.state.control, command))
        return StationCarry(state, memory, command, carry.lost_at)

    def slope(state, begun, carry, plant, setup):
        acceleration = motion(state.position, state.velocity, plant)
        control_rate = response(state.control, carry.command, begun, setup.substep, setup.dynamics)
        return libration.motion(state, acceleration, control_rate)

    advance = runge_kutta(slope)

    def hold(carry, plant, setup):
        """One substep."""
        end = advance(carry.state, carry.state.control, carry, plant, setup)
        return carry._replace(state=end)

    def check(carry, step, setup):
        """Note the step at which the motion is not finite or far away."""
        s = carry.state
        sound = both(is_finite(dot(s.velocity, s.velocity)), less(dot(s.position, s.position), setup.far * setup.far))
        lost = where(both(opposite(sound), less(carry.lost_at, 0.0)), number_of(step), carry.lost_at)
        return carry._replace(lost_at=lost)

    def sample(carry, step, setup):
        s = carry.state
        return StationSample(s.position, s.velocity, s.control, carry.command)

    return Step(look, decide, hold, check, sample)
