"""Attitude and rate with independent Gaussian errors, drawn at each control step."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from starhold.algebra.quaternion import Quaternion, multiply, normalise
from starhold.algebra.vector import Vector, add, diagonal
from starhold.parts.contract import NO_ERRORS, Card, Errors, Noise, NoMemory, Parameter
from starhold.parts.random import Dice

CARD = Card(
    title="Attitude and rate with Gaussian noise",
    summary="q turned by Gaussian angles about the body axes, w + Gaussian",
    sources=("published comparison of Lyapunov, sliding-mode and predictive attitude control: the noise study",),
    assumptions=("errors independent from step to step",),
)
ROLE = "sensor"
TABLE = "sensor"
RECORDED = False
NUMBERS_FROM = 3


class Params(NamedTuple):
    """The standard deviations of the errors."""

    attitude: Annotated[float, Parameter("rad", at_least=0.0, text="standard deviation of the angle about each body axis")]
    rate: Annotated[float, Parameter("rad/s", at_least=0.0, text="standard deviation of each component")]


class Reading(NamedTuple):
    """Attitude (inertial to body) and angular velocity (rad/s, body)."""

    attitude: Quaternion
    rate: Vector


def measure(state: Any, memory: NoMemory, params: Params, dice: Dice, step: int) -> tuple[Reading, NoMemory]:
    """Return the attitude turned by Gaussian angles about the body axes, and the rate with a Gaussian error."""
    # The vector part of a small rotation's quaternion is half the angle.
    d, turning = dice.vectors(0, 0.5 * params.attitude, params.rate)
    attitude = normalise(multiply(state.attitude, (1.0, d[0], d[1], d[2])))
    return Reading(attitude, add(state.rate, turning)), memory


def error(params: Params) -> Errors:
    """Return no errors besides noise."""
    return NO_ERRORS


def noise(params: Params, period: float) -> Noise:
    """Return the noise of angles and rates."""
    return Noise(diagonal((params.attitude, params.attitude, params.attitude)), rate=params.rate)


def examples() -> list[Params]:
    """Return the published noise, and zero noise."""
    return [Params(1e-3, 1e-4), Params(0.0, 0.0)]
