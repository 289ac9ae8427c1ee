"""A receiver of satellite navigation: position and velocity with noise."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from starhold.algebra.quantity import Quantity
from starhold.algebra.vector import Vector, add
from starhold.parts.contract import Card, NoMemory, Parameter
from starhold.parts.random import Dice

CARD = Card(
    title="Satellite navigation",
    summary="r_m = r + noise, v_m = v + noise",
    sources=("definition",),
    assumptions=("always in view of enough satellites", "white noise from control step to control step"),
)
ROLE = "sensor"
NEEDS = ("two-body",)


class Params(NamedTuple):
    """The errors of the receiver."""

    position: Annotated[float, Parameter("m", at_least=0.0, text="standard deviation of each component")] = 0.0
    velocity: Annotated[float, Parameter("m/s", at_least=0.0, text="standard deviation of each component")] = 0.0


class Reading(NamedTuple):
    """Position and velocity in inertial axes."""

    position: Annotated[Vector, Quantity("m", "as measured, inertial", "axis")]
    velocity: Annotated[Vector, Quantity("m/s", "as measured, inertial", "axis")]


def measure(state: Any, memory: NoMemory, params: Params, dice: Dice, step: int) -> tuple[Reading, NoMemory]:
    """Position and velocity at this control step, with noise."""
    position = add(state.position, dice.vector(0, params.position))
    return Reading(position, add(state.velocity, dice.vector(3, params.velocity))), memory


def examples() -> list[Params]:
    """One of a CubeSat, and an exact one."""
    return [Params(10.0, 0.1), Params()]
