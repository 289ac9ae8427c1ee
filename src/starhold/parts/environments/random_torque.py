"""A random torque, drawn at each control step and held in between."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from starhold.algebra.vector import ZERO, Vector
from starhold.parts.contract import Card, Noise, Parameter
from starhold.parts.random import Dice

CARD = Card(
    title="Random torque",
    summary="M = Gaussian on each axis, independent from control step to control step",
    sources=("published comparison of Lyapunov, sliding-mode and predictive attitude control: the noise study",),
    assumptions=("held for a control period",),
)
ROLE = "environment"
NUMBERS_FROM = 0


class Params(NamedTuple):
    """The standard deviation of the torque."""

    deviation: Annotated[
        float, Parameter("N m", at_least=0.0, plain=(10.0, "mN m"), text="standard deviation on each body axis")
    ]


def remember(params: Params) -> Vector:
    """Return the initial memory, without torque."""
    return ZERO


def update(memory: Vector, state: Any, params: Params, dice: Dice, step: int) -> Vector:
    """Return the torque of this control step (N m)."""
    return dice.vector(0, params.deviation)


def torque(state: Any, params: Params, craft: Any, memory: Vector) -> Vector:
    """Return the torque on the body (N m, body axes)."""
    return memory


def noise(params: Params, period: float) -> Noise:
    """Return the noise of the torque."""
    return Noise(torque=params.deviation)


def examples() -> list[Params]:
    """Return the torque of the published noise study, and zero torque."""
    return [Params(1e-4), Params(0.0)]
