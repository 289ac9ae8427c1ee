"""Attitude and gyro bias by a fixed-gain filter: the gyro propagates the attitude, and each new attitude corrects both."""

from __future__ import annotations

from functools import reduce
from typing import Annotated, Any, NamedTuple

from starhold.algebra.quantity import Quantity
from starhold.algebra.quaternion import NO_TURN, Quaternion, multiply, normalise
from starhold.algebra.scalar import Scalar, both, less, opposite, where
from starhold.algebra.structure import chosen
from starhold.algebra.vector import IDENTITY, ZERO, Vector, add, apply, diagonal, scale, subtract
from starhold.algebra.vector import multiply as product
from starhold.parts.attitudes import attitudes_of, small_turn, together
from starhold.parts.contract import FIX, Card, Noise, Parameter, Recursion
from starhold.parts.craft import Craft
from starhold.parts.kalman import turned
from starhold.parts.stated_attitude import START, VALID, unit_quaternion

CARD = Card(
    title="Complementary filter",
    summary="q' = q (w_m - b)/2 + attitude_gain e, b' = -bias_gain e, e from each new attitude",
    sources=("Nonlinear Complementary Filters on the Special Orthogonal Group (2008)",),
    assumptions=(
        "attitudes come without delay; of several that are new at once the mean is taken",
        "the bias changes slowly",
        "the first attitude, measured or of the estimator that starts it, takes the place of the one stated for the start",
    ),
)
ROLE = "estimator"
NEEDS = ("attitude", "rate")
SEVERAL = {"attitude": ""}
STARTABLE = True
FIRST = {"gyro_bias": ZERO, "is_valid": 0.0}


class Params(NamedTuple):
    """The gains of the filter, and its initial attitude."""

    attitude_gain: Annotated[
        float, Parameter("1", above=0.0, at_most=1.0, text="share of an attitude error corrected at once")
    ]
    bias_gain: Annotated[float, Parameter("1/s", at_least=0.0, text="change of the bias per second and per radian of error")]
    start: Annotated[Quaternion, START] = NO_TURN


class Estimate(NamedTuple):
    """Attitude, rate corrected for the bias, the bias, and whether an attitude has arrived yet."""

    attitude: Annotated[Quaternion, Quantity("1", "estimated attitude, inertial to body, scalar first", "quaternion")]
    rate: Annotated[Vector, Quantity("rad/s", "estimated angular velocity, body axes", "axis")]
    gyro_bias: Annotated[Vector, Quantity("rad/s", "estimated bias of the gyro", "axis")]
    is_valid: Annotated[float, VALID]


class Memory(NamedTuple):
    """The attitude predicted for the next control step, the bias (rad/s), and whether an attitude has arrived yet (1)."""

    attitude: Quaternion
    bias: Vector
    begun: Scalar


def prepare(params: Params, period: float) -> Params:
    """Return the parameters with the initial attitude as a unit quaternion. Raise ValueError if it is no quaternion."""
    return params._replace(start=unit_quaternion(params.start))


def remember(params: Params, state: Any) -> Memory:
    """Return the initial memory, with the stated initial attitude."""
    return Memory(params.start, ZERO, 0.0)


def estimate(readings: Any, memory: Memory, params: Params, craft: Craft, period: Scalar) -> tuple[Estimate, Memory]:
    """Return the estimate at a control step, and the memory with the prediction for the next."""
    memory = _started(memory, readings)
    (measured, new), *others = seen = attitudes_of(readings)
    if others:
        measured, _, new = together(seen, [IDENTITY] * len(seen))
    first = both(new, opposite(less(0.5, memory.begun)))
    foretold: Any = tuple(where(first, x, old) for x, old in zip(measured, memory.attitude, strict=True))
    turn = small_turn(foretold, measured)
    half = scale(where(new, 0.5 * params.attitude_gain, 0.0), turn)
    attitude = normalise(multiply(foretold, (1.0, *half)))
    bias = subtract(memory.bias, scale(where(new, params.bias_gain * period, 0.0), turn))
    rate = subtract(readings.rate, bias)
    step = scale(0.5 * period, rate)
    ahead = normalise(multiply(attitude, (1.0, *step)))
    begun = where(new, 1.0, memory.begun)
    return Estimate(attitude, rate, bias, begun), Memory(ahead, bias, begun)


def _started(memory: Memory, readings: Any) -> Memory:
    """Return the memory with the attitude of another estimator in place of the stated initial one."""
    if not hasattr(readings, FIX):
        return memory
    first = both(less(0.5, readings.fix.is_valid), less(memory.begun, 0.5))
    return chosen(first, memory._replace(attitude=readings.fix.attitude, begun=1.0), memory)


def recursion(params: Params, noise: Noise, period: float, rate: Vector) -> Recursion | None:
    """Return the recursion by which noise of gyro and attitudes drives the errors of attitude and bias, on a body at a
    constant rate (rad/s, body axes); None where no bias is corrected. A step holds the rate as it begins."""
    if not params.bias_gain:
        return None
    (_, axes, drift), share = turned(rate, period), 1.0 / (1 + len(noise.more))
    seen = [product(diagonal((share, share, share)), root) for root in (noise.attitude, *noise.more)]

    def amiss(turn: Vector, bias: Vector, random: tuple[Vector, ...]) -> tuple[tuple[Vector, ...], Vector, Vector]:
        rate = subtract(scale(noise.rate, random[0]), bias)
        ahead = subtract(apply(axes, turn), apply(drift, rate))
        return (ahead, subtract(bias, scale(noise.walk, random[1]))), turn, rate

    def carried(errors: tuple[Vector, ...], random: tuple[Vector, ...]) -> tuple[tuple[Vector, ...], Vector, Vector]:
        turn, bias = errors
        return amiss(turn, bias, random)

    def corrected(errors: tuple[Vector, ...], random: tuple[Vector, ...]) -> tuple[tuple[Vector, ...], Vector, Vector]:
        turn, bias = errors
        off = subtract(reduce(add, map(apply, seen, random[2:])), turn)
        turn = add(turn, scale(params.attitude_gain, off))
        return amiss(turn, subtract(bias, scale(params.bias_gain * period, off)), random)

    return Recursion(corrected, carried, noise.every, 2, 2 + len(seen), 0.5 * period)


def examples() -> list[Params]:
    """Return a slow filter, and one that trusts its attitudes."""
    return [Params(0.05, 0.002), Params(1.0, 0.0, (0.6, 0.0, 0.8, 0.0))]
