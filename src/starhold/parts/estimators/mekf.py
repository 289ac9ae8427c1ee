"""Attitude and gyro bias by the multiplicative extended Kalman filter: the gyro carries the attitude on, each new attitude
of the star tracker corrects both, by gains that follow from how sure either is."""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple, cast

from starhold.algebra.cosines import from_quaternion
from starhold.algebra.quantity import Quantity
from starhold.algebra.quaternion import Quaternion, multiply, normalise, relative, renormalise, vector_part
from starhold.algebra.rotation import short_turn
from starhold.algebra.scalar import Scalar, Truth, both, less, side, sqrt, where
from starhold.algebra.structure import rebuild
from starhold.algebra.structured import when
from starhold.algebra.vector import (
    IDENTITY,
    ZERO,
    Matrix,
    Vector,
    add,
    apply,
    combine,
    diagonal,
    inverse,
    scale,
    subtract,
    transpose,
)
from starhold.algebra.vector import multiply as product
from starhold.parts.contract import Card, Parameter
from starhold.parts.craft import Craft

CARD = Card(
    title="Multiplicative extended Kalman filter",
    summary="q' = q (w_m - b)/2, P by the linearised errors of attitude and bias; q <- q (1, K_a e/2), b <- b + K_b e",
    sources=(
        "Fundamentals of Spacecraft Attitude Determination and Control (2014)",
        "Kalman Filtering for Spacecraft Attitude Estimation (1982)",
    ),
    assumptions=(
        "errors of gyro and star tracker are white, and as large as the filter is told",
        "attitudes come without delay",
        "the rate changes in proportion to time between control steps",
        "the error of the attitude is small",
    ),
)
ROLE = "estimator"
NEEDS = ("attitude", "rate")
FIRST = {"gyro_bias": ZERO, "attitude_deviation": ZERO, "gyro_bias_deviation": ZERO}
HOUR = 3600.0


class Params(NamedTuple):
    """How good the filter takes the gyro and the star tracker to be, in the words of these."""

    noise: Annotated[float, Parameter("rad/s", at_least=0.0, text="of the gyro: deviation of the mean over a second")]
    bias_walk: Annotated[float, Parameter("rad/s", at_least=0.0, text="of the gyro: deviation of the bias's change in 1 h")]
    bias: Annotated[float, Parameter("rad/s", above=0.0, text="of the gyro: deviation of the bias at the start")]
    cross: Annotated[float, Parameter("rad", above=0.0, text="of the star tracker: deviation across the boresight")]
    roll: Annotated[float, Parameter("rad", above=0.0, text="of the star tracker: deviation about the boresight")]
    boresight: Annotated[Vector, Parameter("1", shape=(3,), spread=False, text="of the star tracker, body axes")] = (
        0.0,
        0.0,
        1.0,
    )


class Numbers(NamedTuple):
    """Variances: of the tracker's attitude (rad2, body axes), of the bias at the start (rad2/s2), and what a control period
    adds to those of attitude, attitude with bias, and bias."""

    tracker: Matrix
    bias: Scalar
    turned: Scalar
    mixed: Scalar
    walked: Scalar


class Estimate(NamedTuple):
    """Attitude, rate without the bias, the bias, and how sure the filter is of them."""

    attitude: Annotated[Quaternion, Quantity("1", "estimated attitude, inertial to body, scalar first", "quaternion")]
    rate: Annotated[Vector, Quantity("rad/s", "estimated angular velocity, body axes", "axis")]
    gyro_bias: Annotated[Vector, Quantity("rad/s", "estimated bias of the gyro", "axis")]
    attitude_deviation: Annotated[Vector, Quantity("rad", "standard deviation of its error, body axes", "axis")]
    gyro_bias_deviation: Annotated[Vector, Quantity("rad/s", "standard deviation of its error, body axes", "axis")]


class Memory(NamedTuple):
    """The estimate at the last control step, the gyro's reading then (rad/s), the covariance of the errors of attitude
    (rad, body axes) and bias in blocks, and whether an attitude has come yet (1)."""

    attitude: Quaternion
    bias: Vector
    rate: Vector
    turn: Matrix
    mixed: Matrix
    walk: Matrix
    begun: Scalar


def prepare(params: Params, period: float) -> Numbers:
    """The numbers of a control step. ValueError for a boresight without direction."""
    size = math.hypot(*params.boresight)
    if not size > 0.0:
        raise ValueError("the boresight needs a direction")
    axis = scale(1.0 / size, params.boresight)
    cross, roll = params.cross**2, params.roll**2
    tracker = (
        add((cross, 0.0, 0.0), scale((roll - cross) * axis[0], axis)),
        add((0.0, cross, 0.0), scale((roll - cross) * axis[1], axis)),
        add((0.0, 0.0, cross), scale((roll - cross) * axis[2], axis)),
    )
    # Of a rate with white noise whose bias is a random walk (Farrenkopf).
    walk = params.bias_walk**2 / HOUR
    turned = params.noise**2 * period + walk * period**3 / 3.0
    return Numbers(tracker, params.bias**2, turned, -0.5 * walk * period**2, walk * period)


def remember(params: Numbers, state: Any) -> Memory:
    """Nothing is known before the first attitude."""
    begin = diagonal((params.bias, params.bias, params.bias))
    nothing: Matrix = (ZERO, ZERO, ZERO)
    return Memory((1.0, 0.0, 0.0, 0.0), ZERO, ZERO, params.tracker, nothing, begin, 0.0)


def estimate(readings: Any, memory: Memory, params: Numbers, craft: Craft, period: Scalar) -> tuple[Estimate, Memory]:
    """The estimate at a control step."""
    measured = readings.attitude
    # A sensor that does not tell whether its attitude is new gives a new one at each control step.
    new = less(0.5, getattr(readings, "attitude_is_new", 1.0))
    begun = less(0.5, memory.begun)
    foretold = propagated(memory, readings.rate, params, period)
    start: Any = remember(params, None)._replace(attitude=measured)
    before: Memory = chosen(begun, foretold, start)

    def correct(before: Memory) -> tuple[Memory]:
        return (corrected(before, measured, params),)

    # The first attitude has been taken as it is.
    (after,) = when(both(new, begun), correct, before)
    after = after._replace(rate=readings.rate, begun=where(new, 1.0, memory.begun))
    rate = subtract(readings.rate, after.bias)
    return Estimate(after.attitude, rate, after.bias, deviations(after.turn), deviations(after.walk)), after


def corrected(before: Memory, measured: Quaternion, params: Numbers) -> Memory:
    """The estimate with what a new attitude tells."""
    error = relative(before.attitude, measured)
    turn = scale(2.0 * side(error[0]), vector_part(error))
    sure = inverse(summed(before.turn, params.tracker))
    gain, mixed_gain = product(before.turn, sure), product(transpose(before.mixed), sure)
    return before._replace(
        attitude=normalise(multiply(before.attitude, (1.0, *scale(0.5, apply(gain, turn))))),
        bias=add(before.bias, apply(mixed_gain, turn)),
        turn=symmetric(combine(1.0, before.turn, -1.0, product(gain, before.turn))),
        mixed=combine(1.0, before.mixed, -1.0, product(gain, before.mixed)),
        walk=symmetric(combine(1.0, before.walk, -1.0, product(mixed_gain, before.mixed))),
    )


def propagated(memory: Memory, rate: Vector, params: Numbers, period: Scalar) -> Memory:
    """The estimate a control period on: the rate between the gyro's two readings is their mean."""
    mean = subtract(scale(0.5, add(memory.rate, rate)), memory.bias)
    turn = short_turn(scale(0.5 * period, mean))
    axes = from_quaternion(turn)
    # d(error)/dt = -w x error - error of the bias, over the period.
    drift = combine(-0.5 * period, axes, -0.5 * period, IDENTITY)
    mixed = summed(product(axes, memory.mixed), product(drift, memory.walk))
    spread = summed(
        product(summed(product(axes, memory.turn), product(drift, transpose(memory.mixed))), transpose(axes)),
        product(mixed, transpose(drift)),
    )
    return memory._replace(
        attitude=renormalise(multiply(memory.attitude, turn)),
        turn=symmetric(combine(1.0, spread, params.turned, IDENTITY)),
        mixed=combine(1.0, mixed, params.mixed, IDENTITY),
        walk=combine(1.0, memory.walk, params.walked, IDENTITY),
    )


def chosen(condition: Truth, one: Any, other: Any) -> Any:
    """Choose one nested tuple or another of the same form."""
    if not isinstance(one, tuple):
        return where(condition, one, other)
    pairs: Any = zip(cast(Any, one), other, strict=True)
    return rebuild(cast(Any, one), [chosen(condition, *pair) for pair in pairs])


def summed(a: Matrix, b: Matrix) -> Matrix:
    """Return a + b."""
    return combine(1.0, a, 1.0, b)


def symmetric(a: Matrix) -> Matrix:
    """Return the mean of a matrix and its transposed one, which rounding keeps apart."""
    x, y, z = 0.5 * (a[0][1] + a[1][0]), 0.5 * (a[0][2] + a[2][0]), 0.5 * (a[1][2] + a[2][1])
    return ((a[0][0], x, y), (x, a[1][1], z), (y, z, a[2][2]))


def deviations(a: Matrix) -> Vector:
    """Return the roots of the diagonal."""
    return (sqrt(a[0][0]), sqrt(a[1][1]), sqrt(a[2][2]))


def examples() -> list[Params]:
    """A small tracker with a MEMS gyro, and a good gyro with a tracker that is as sure about every axis."""
    arcsec = math.radians(1.0 / 3600.0)
    small = Params(math.radians(0.15) / 60.0, math.radians(3.0) / HOUR, 1e-3, 6.0 * arcsec, 40.0 * arcsec, (0.0, 0.6, 0.8))
    return [small, Params(1e-6, 1e-7, 1e-5, 3.0 * arcsec, 3.0 * arcsec)]
