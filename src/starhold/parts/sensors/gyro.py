"""A rate gyro with bias, random walk of the bias, and noise."""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from starhold.algebra.quantity import Quantity
from starhold.algebra.scalar import Scalar
from starhold.algebra.vector import IDENTITY, ZERO, Matrix, Vector, add, diagonal, multiply, scale
from starhold.parts import as_built
from starhold.parts.contract import UNBOUNDED, Card, Errors, Noise, Parameter
from starhold.parts.random import Dice

CARD = Card(
    title="Rate gyro",
    summary="w_m = (1 + scale_error) w + b + noise, b a random walk and what wanders",
    sources=(
        "Fundamentals of Spacecraft Attitude Determination and Control (2014): Farrenkopf's gyro model",
        "IEEE Std 952-1997: Allan variance of correlated noise",
    ),
    assumptions=(
        "white noise over a control period",
        "the instability of the bias is a Gauss-Markov process, without any at the start; flicker noise has a flatter floor",
    ),
)
ROLE = "sensor"
HOUR = 3600.0
SEEN = ("rate",)


class Params(NamedTuple):
    """The errors of the gyro."""

    noise: Annotated[
        float,
        Parameter(
            "rad/s",
            also="rad/sqrt(s)",
            at_least=0.0,
            plain=(0.1, "deg/sqrt(h)"),
            text="standard deviation of the mean over 1 s: the angle random walk",
        ),
    ] = 0.0
    bias: Annotated[Vector, Parameter("rad/s", shape=(3,), spread=False, text="at the start")] = ZERO
    bias_walk: Annotated[
        float,
        Parameter(
            "rad/s",
            also="rad/s/sqrt(h)",
            at_least=0.0,
            plain=(0.1, "deg/h/sqrt(h)"),
            text="standard deviation of the bias's change in 1 h: the rate random walk",
        ),
    ] = 0.0
    scale_error: Annotated[float, Parameter("1", at_least=-0.5, at_most=0.5, text="of the scale factor")] = 0.0
    limit: Annotated[float, as_built.limit("rad/s")] = math.inf
    mounting_error: Annotated[Vector, as_built.MOUNTING] = ZERO
    axis_errors: Annotated[Matrix | Vector, as_built.AXES] = ZERO
    resolution: Annotated[float, as_built.resolution("rad/s")] = 0.0
    bias_instability: Annotated[
        float,
        Parameter("rad/s", at_least=0.0, plain=(0.1, "deg/h"), text="standard deviation of the wandering part of the bias"),
    ] = 0.0
    correlation_time: Annotated[
        float,
        Parameter("s", above=0.0, text="of that part: its Allan deviation has a maximum of 0.62 of it at 1.9 of this time"),
    ] = 100.0
    delay: Annotated[float, as_built.DELAY] = 0.0
    jitter: Annotated[float, as_built.JITTER] = 0.0


class Numbers(NamedTuple):
    """Standard deviations of a reading and of the bias's step (rad/s), the initial bias, the scale factor and the limit;
    each () for none: its axes, its resolution (rad/s), the decay factor and the standard deviation of the step (rad/s) of
    the wandering bias, and the delay."""

    deviation: Scalar
    walk: Scalar
    bias: Vector
    factor: Scalar
    limit: Scalar
    axes: as_built.Axes = ()
    step: as_built.Step = ()
    wander: tuple[Scalar, ...] = ()
    late: as_built.Late = ()


class Wandering(NamedTuple):
    """The bias of a control step without the wandering part, and that part (rad/s)."""

    bias: Vector
    wander: Vector


class Reading(NamedTuple):
    """The measured rate."""

    rate: Annotated[Vector, Quantity("rad/s", "angular velocity as the gyro measures it, body axes", "axis")]


def prepare(params: Params, period: float) -> Numbers:
    """Return the numbers of a control step. Raise ValueError for too long a delay."""
    walk = params.bias_walk * math.sqrt(period / HOUR)
    stays, size = math.exp(-period / params.correlation_time), params.bias_instability
    return Numbers(
        params.noise / math.sqrt(period),
        walk,
        params.bias,
        1.0 + params.scale_error,
        params.limit,
        as_built.axes_of(params.mounting_error, params.axis_errors),
        as_built.step_of(params.resolution),
        (stays, size * math.sqrt(1.0 - stays * stays)) if as_built.is_given(size) else (),
        as_built.late_by(params.delay, period, params.jitter),
    )


def remember(params: Numbers, state: Any) -> Any:
    """Return the initial memory: the bias (rad/s), and the rate if the gyro is delayed."""
    return as_built.awaited(Wandering(params.bias, ZERO) if params.wander else params.bias, params.late, state, SEEN)


def measure(state: Any, memory: Any, params: Numbers, dice: Dice, step: int) -> tuple[Reading, Any]:
    """Return the rate with the bias and noise of this control step, and the memory with the bias of the next."""
    state, memory, waiting = as_built.arrived(state, memory, params.late, SEEN, dice, 9)
    bias = add(memory.bias, memory.wander) if params.wander else memory
    seen = as_built.along(params.axes, state.rate)
    noise, walk, *added = dice.vectors(0, params.deviation, params.walk, *params.wander[1:])
    shown = add(add(scale(params.factor, seen), bias), noise)
    reading = Reading(as_built.shown(shown, params.step, params.limit))
    if not params.wander:
        return reading, as_built.kept(add(memory, walk), waiting)
    wander = add(scale(params.wander[0], memory.wander), added[0])
    return reading, as_built.kept(Wandering(add(memory.bias, walk), wander), waiting)


def error(params: Params) -> Errors:
    """Return the initial bias and half a step of the resolution, what scale factor and axes make of the rate, and its change
    during a delay with jitter; errors that wander have no bound, nor has a reading that is clipped."""
    if as_built.is_given(params.bias_instability) or params.limit < math.inf:
        return UNBOUNDED
    late = as_built.latest(params.delay, params.jitter)
    factor, bias = 1.0 + params.scale_error, math.hypot(*params.bias)
    axes = as_built.axes_of(params.mounting_error, params.axis_errors) or IDENTITY
    return Errors(
        rate=bias + as_built.off_step(params.resolution),
        bias=bias,
        turned=as_built.stretch(multiply(diagonal((factor, factor, factor)), axes)),
        late=late,
        ago=late,
        gaussian=int(params.jitter > 0.0),
    )


def noise(params: Params, period: float) -> Noise:
    """Return the noise of a reading, and the walk of the bias."""
    numbers = prepare(params, period)
    return Noise(rate=numbers.deviation, walk=numbers.walk)


def examples() -> list[Params]:
    """Return a MEMS gyro, one with only a bias, an exact one, one with errors of manufacture, a delay and jitter, and that
    without what has no bound."""
    mems = Params(noise=math.radians(0.15) / 60.0, bias=(1e-4, -2e-4, 5e-5), bias_walk=math.radians(3.0) / HOUR)
    skewed = ((1e-3, 0.0, 5e-4), (0.0, -2e-3, 0.0), (0.0, 3e-4, 0.0))
    built = mems._replace(
        mounting_error=(2e-3, 0.0, -1e-3), axis_errors=skewed, resolution=1e-4, bias_instability=1e-5, correlation_time=300.0
    )._replace(delay=0.03, jitter=1e-3)
    bounded = built._replace(bias_instability=0.0, jitter=0.0)
    return [mems._replace(limit=math.radians(100.0)), Params(bias=mems.bias), Params(), built, bounded]
