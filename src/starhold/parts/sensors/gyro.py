"""A rate gyro with bias, random walk of the bias, and noise."""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from starhold.algebra.quantity import Quantity
from starhold.algebra.scalar import Scalar
from starhold.algebra.vector import ZERO, Vector, add, clip_axes, scale
from starhold.parts.contract import UNBOUNDED, Card, Errors, Noise, Parameter
from starhold.parts.random import Dice

CARD = Card(
    title="Rate gyro",
    summary="w_m = (1 + scale_error) w + b + noise, b a random walk",
    sources=("Fundamentals of Spacecraft Attitude Determination and Control (2014): Farrenkopf's gyro model",),
    assumptions=("axes along the body's", "white noise over a control period"),
)
ROLE = "sensor"
HOUR = 3600.0


class Params(NamedTuple):
    """The errors of the gyro."""

    noise: Annotated[
        float,
        Parameter(
            "rad/s",
            also="rad/sqrt(s)",
            at_least=0.0,
            text="standard deviation of the mean over a second: the angle random walk",
        ),
    ] = 0.0
    bias: Annotated[Vector, Parameter("rad/s", shape=(3,), spread=False, text="at the start")] = ZERO
    bias_walk: Annotated[
        float,
        Parameter(
            "rad/s",
            also="rad/s/sqrt(h)",
            at_least=0.0,
            text="standard deviation of the bias's change within an hour: the rate random walk",
        ),
    ] = 0.0
    scale_error: Annotated[float, Parameter("1", at_least=-0.5, at_most=0.5, text="of the scale factor")] = 0.0
    limit: Annotated[float, Parameter("rad/s", above=0.0, text="largest rate that it shows; none if absent")] = math.inf


class Numbers(NamedTuple):
    """Deviations of a reading and of the bias's step (rad/s), the bias at the start, the scale factor and the limit."""

    deviation: Scalar
    walk: Scalar
    bias: Vector
    factor: Scalar
    limit: Scalar


class Reading(NamedTuple):
    """The rate that it shows."""

    rate: Annotated[Vector, Quantity("rad/s", "angular velocity as the gyro measures it, body axes", "axis")]


def prepare(params: Params, period: float) -> Numbers:
    """The numbers of a control step."""
    walk = params.bias_walk * math.sqrt(period / HOUR)
    return Numbers(params.noise / math.sqrt(period), walk, params.bias, 1.0 + params.scale_error, params.limit)


def remember(params: Numbers, state: Any) -> Vector:
    """The bias at the start (rad/s)."""
    return params.bias


def measure(state: Any, memory: Vector, params: Numbers, dice: Dice, step: int) -> tuple[Reading, Vector]:
    """The rate with the bias and noise of this control step, and the bias of the next."""
    shown = add(add(scale(params.factor, state.rate), memory), dice.vector(0, params.deviation))
    return Reading(clip_axes(shown, params.limit)), add(memory, dice.vector(3, params.walk))


def error(params: Params) -> Errors:
    """The bias at the start; what grows with the rate has no bound."""
    return UNBOUNDED if params.scale_error or params.limit < math.inf else Errors(rate=math.hypot(*params.bias))


def noise(params: Params, period: float) -> Noise:
    """The noise of a reading, and the walk of the bias."""
    numbers = prepare(params, period)
    return Noise(rate=numbers.deviation, walk=numbers.walk)


def examples() -> list[Params]:
    """A MEMS gyro, one that has a bias alone, and one that is exact."""
    mems = Params(noise=math.radians(0.15) / 60.0, bias=(1e-4, -2e-4, 5e-5), bias_walk=math.radians(3.0) / HOUR)
    return [mems._replace(limit=math.radians(100.0)), Params(bias=mems.bias), Params()]
