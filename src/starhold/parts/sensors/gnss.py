"""A satellite-navigation receiver: position and velocity with noise."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from starhold.algebra.quantity import Quantity
from starhold.algebra.scalar import Scalar
from starhold.algebra.vector import Vector, add
from starhold.parts import as_built
from starhold.parts.contract import DEVIATIONS, Card, NoMemory, Parameter, Place, Sky
from starhold.parts.random import Dice

CARD = Card(
    title="Satellite navigation",
    summary="r_m = r + noise, v_m = v + noise",
    sources=("definition",),
    assumptions=("always in view of enough satellites", "white noise from control step to control step"),
)
ROLE = "sensor"
NEEDS = ("two-body",)
SEEN = ("position", "velocity")


class Params(NamedTuple):
    """The errors of the receiver."""

    position: Annotated[float, Parameter("m", at_least=0.0, text="standard deviation of each component")] = 0.0
    velocity: Annotated[float, Parameter("m/s", at_least=0.0, text="standard deviation of each component")] = 0.0
    delay: Annotated[float, as_built.DELAY] = 0.0
    jitter: Annotated[float, as_built.JITTER] = 0.0


class Numbers(NamedTuple):
    """Standard deviations of position (m) and velocity (m/s), and the delay."""

    position: Scalar
    velocity: Scalar
    late: as_built.Late


class Reading(NamedTuple):
    """Position and velocity in inertial axes."""

    position: Annotated[Vector, Quantity("m", "as measured, inertial", "axis")]
    velocity: Annotated[Vector, Quantity("m/s", "as measured, inertial", "axis")]


def prepare(params: Params, period: float) -> Numbers:
    """Return the numbers of a flight. Raise ValueError for too long a delay."""
    return Numbers(params.position, params.velocity, as_built.late_by(params.delay, period, params.jitter))


def remember(params: Numbers, state: Any) -> Any:
    """Return the initial memory: the initial state if the receiver is delayed."""
    return as_built.awaited(NoMemory(), params.late, state, SEEN)


def measure(state: Any, memory: Any, params: Numbers, dice: Dice, step: int) -> tuple[Reading, Any]:
    """Return position and velocity at this control step, with noise, and the memory."""
    state, memory, waiting = as_built.arrived(state, memory, params.late, SEEN, dice, 6)
    away, faster = dice.vectors(0, params.position, params.velocity)
    reading = Reading(add(state.position, away), add(state.velocity, faster))
    return reading, as_built.kept(memory, waiting)


def place(params: Params, sky: Sky) -> Place:
    """Return how far off the position is, by noise and by the way that the craft goes until a reading arrives."""
    error = DEVIATIONS * params.position + sky.speed * as_built.latest(params.delay, params.jitter)
    return Place(error, (params.position > 0.0) + (params.jitter > 0.0))


def examples() -> list[Params]:
    """Return one of a CubeSat, an exact one, and a delayed one."""
    return [Params(10.0, 0.1), Params(), Params(10.0, 0.1, 0.12, 1e-3)]
