"""Attitude and gyro bias by the multiplicative extended Kalman filter: the gyro carries the attitude on, each new
attitude of the star trackers corrects both, by gains that follow from their covariances."""

from __future__ import annotations

import math
from functools import cache, reduce
from typing import Annotated, Any, NamedTuple, TypeAlias, cast

import numpy as np

from starhold.algebra.cosines import from_quaternion
from starhold.algebra.quantity import Quantity
from starhold.algebra.quaternion import NO_TURN, Quaternion, multiply, renormalise
from starhold.algebra.rotation import short_turn
from starhold.algebra.scalar import Scalar, Truth, both, less, less_equal, maximum, where
from starhold.algebra.structure import chosen
from starhold.algebra.structured import when
from starhold.algebra.vector import (
    IDENTITY,
    ZERO,
    Matrix,
    Vector,
    add,
    along_axis,
    apply,
    combine,
    diagonal,
    inverse,
    most,
    scale,
    subtract,
    transpose,
)
from starhold.algebra.vector import multiply as product
from starhold.parts.attitudes import attitudes_of, small_turn, together, turned_by
from starhold.parts.boresight import unit_boresight
from starhold.parts.contract import FIX, Card, Noise, Parameter, Recursion
from starhold.parts.covariance import (
    GYRO_BIAS,
    GYRO_NOISE,
    GYRO_WALK,
    along_diagonal,
    carried,
    deviations,
    summed,
    symmetric,
)
from starhold.parts.craft import Craft
from starhold.parts.stated_attitude import START, VALID, unit_quaternion

CARD = Card(
    title="Multiplicative extended Kalman filter",
    summary="q' = q (w_m - b)/2, P by the linearised errors of attitude and bias; q <- q (1, K_a e/2), b <- b + K_b e",
    sources=(
        "Fundamentals of Spacecraft Attitude Determination and Control (2014)",
        "Kalman Filtering for Spacecraft Attitude Estimation (1982)",
    ),
    assumptions=(
        "errors of gyro and star trackers are white, of the deviations that the filter assumes",
        "attitudes come without delay",
        "the rate changes in proportion to time between control steps",
        "the error of the attitude is small",
        "the first attitude of a star tracker takes the place of the one stated for the start; that of the estimator that "
        "starts it does so with the deviation stated for the start",
    ),
)
ROLE = "estimator"
NEEDS = ("attitude", "rate")
SEVERAL = {"attitude": "more_trackers"}
STARTABLE = True
ASSUMES = {"attitude": ("cross", "roll", "boresight")}
FIRST = {"gyro_bias": ZERO, "attitude_deviation": ZERO, "gyro_bias_deviation": ZERO, "is_valid": 0.0}
HOUR = 3600.0
MOST = 100_000
"""Control periods after which a filter has settled, or does not."""
UNKNOWN = math.sqrt(math.pi**2 / 9.0 + 2.0 / 3.0)
"""Standard deviation about each axis (rad) of the rotation vector of an attitude that may be any."""

Tracker: TypeAlias = tuple[float, float, float, float, float]


class Params(NamedTuple):
    """The noise of gyro and star tracker that the filter assumes, in the terms of those sensors."""

    noise: Annotated[float, GYRO_NOISE]
    bias_walk: Annotated[float, GYRO_WALK]
    bias: Annotated[float, GYRO_BIAS]
    cross: Annotated[
        float, Parameter("rad", above=0.0, text="of the star tracker: deviation across the boresight; its own if absent")
    ] = math.inf
    roll: Annotated[
        float, Parameter("rad", above=0.0, text="of the star tracker: deviation about the boresight; its own if absent")
    ] = math.inf
    boresight: Annotated[
        Vector, Parameter("1", shape=(3,), spread=False, text="of the star tracker, body axes; its own if absent")
    ] = (0.0, 0.0, 1.0)
    start: Annotated[Quaternion, START] = NO_TURN
    start_deviation: Annotated[
        float, Parameter("rad", above=0.0, text="of that attitude: deviation about each axis; 76 deg if nothing is known")
    ] = UNKNOWN
    valid_within: Annotated[
        float, Parameter("rad", above=0.0, text="largest deviation of an attitude that counts as valid; any if absent")
    ] = math.inf
    more_trackers: Annotated[
        tuple[Tracker, ...],
        Parameter(
            "rad, rad, 1, 1, 1",
            columns=("cross", "roll", "x", "y", "z"),
            text="a row for each star tracker after the first: its deviations and boresight; theirs if absent",
        ),
    ] = ()


class Numbers(NamedTuple):
    """The attitude stated for the start. Variances: of it (rad2), of the bias then (rad2/s2), of the tracker's attitude
    (rad2, body axes), and what the noise of one reading of the gyro adds to that of the attitude; what the walk of the bias
    adds in a control period to those of attitude, attitude with bias, and bias. The inverse variances of all trackers'
    attitudes (1/rad2), where there are several. The largest deviation of an attitude that counts as valid (rad)."""

    start: Quaternion
    start_turn: Scalar
    bias: Scalar
    tracker: Matrix
    reading: Scalar
    turned: Scalar
    mixed: Scalar
    walked: Scalar
    weights: tuple[Matrix, ...] = ()
    valid_within: Scalar = math.inf


class Estimate(NamedTuple):
    """Attitude, rate without the bias, the bias, the standard deviations of attitude and bias, and whether a first attitude
    has come and that of the attitude is small enough."""

    attitude: Annotated[Quaternion, Quantity("1", "estimated attitude, inertial to body, scalar first", "quaternion")]
    rate: Annotated[Vector, Quantity("rad/s", "estimated angular velocity, body axes", "axis")]
    gyro_bias: Annotated[Vector, Quantity("rad/s", "estimated bias of the gyro", "axis")]
    attitude_deviation: Annotated[Vector, Quantity("rad", "standard deviation of its error, body axes", "axis")]
    gyro_bias_deviation: Annotated[Vector, Quantity("rad/s", "standard deviation of its error, body axes", "axis")]
    is_valid: Annotated[float, VALID]


class Memory(NamedTuple):
    """The attitude at the last control step, the bias and the gyro's reading then (rad/s), the covariance of the errors of
    attitude (rad, body axes) and bias in blocks, and 0 before the first reading, 1 before the first attitude, 2 after it.

    Half the noise of that reading has turned the attitude in the period before, half will turn it in the period that
    begins. A new attitude corrects this noise too, because the attitude and its error are kept less half a period of it.
    """

    attitude: Quaternion
    bias: Vector
    rate: Vector
    turn: Matrix
    mixed: Matrix
    walk: Matrix
    stage: Scalar


class Gains(NamedTuple):
    """The gains from the deviation of a new attitude from the one foretold: to the attitude, to the one that is kept, and to
    the bias (1/s); and the inverse of its covariance (1/rad2)."""

    turn: Matrix
    ahead: Matrix
    bias: Matrix
    sure: Matrix


class Instant(NamedTuple):
    """The attitude at a control step, the covariance of its error, the noise of the gyro's reading as far as it is
    known (rad/s), and the memory."""

    attitude: Quaternion
    turn: Matrix
    noise: Vector
    memory: Memory


def prepare(params: Params, period: float) -> Numbers:
    """The numbers of a control step. ValueError for a boresight without direction, a start that is no quaternion, or a
    tracker without noise."""
    trackers: list[Matrix] = []
    for cross, roll, *boresight in ((params.cross, params.roll, *params.boresight), *params.more_trackers):
        if not 0.0 < min(cross, roll) <= max(cross, roll) < math.inf:
            raise ValueError("the deviations cross and roll of each star tracker must be above 0, here or in its own table")
        trackers.append(spread_of(cross, roll, cast(Vector, tuple(boresight))))
    # The rate between two readings is their mean: each turns the attitude by its noise for half a period, and so does the
    # step of the bias between them.
    walk = params.bias_walk**2 / HOUR * period
    reading = 0.25 * params.noise**2 * period
    turned, mixed = 0.25 * walk * period**2, -0.5 * walk * period
    start = unit_quaternion(params.start)
    weights = tuple(map(inverse, trackers)) if params.more_trackers else ()
    return Numbers(
        start,
        params.start_deviation**2,
        params.bias**2,
        trackers[0],
        reading,
        turned,
        mixed,
        walk,
        weights,
        params.valid_within,
    )


def spread_of(cross: float, roll: float, boresight: Vector) -> Matrix:
    """The covariance of the error of a star tracker's attitude (rad2, body axes)."""
    return along_axis(unit_boresight(boresight), roll**2, cross**2)


def remember(params: Numbers, state: Any) -> Memory:
    """The filter begins with the attitude stated for the start."""
    square, begin = params.start_turn, params.bias
    nothing: Matrix = (ZERO, ZERO, ZERO)
    turn, walk = diagonal((square, square, square)), diagonal((begin, begin, begin))
    return Memory(params.start, ZERO, ZERO, turn, nothing, walk, 0.0)


def estimate(readings: Any, memory: Memory, params: Numbers, craft: Craft, period: Scalar) -> tuple[Estimate, Memory]:
    """The estimate at a control step."""
    measured, new, params = latest(readings, params)
    foretold = propagated(memory, readings.rate, params, period)
    before = chosen(less(0.5, memory.stage), foretold, memory)._replace(rate=readings.rate, stage=maximum(memory.stage, 1.0))

    def correct(now: Instant) -> tuple[Instant]:
        known = less(1.5, now.memory.stage)
        after = chosen(known, corrected(now, measured, params, period), taken(now, measured, params))
        return (after._replace(memory=after.memory._replace(stage=2.0)),)

    (now,) = when(new, correct, started(arrived(before, params), readings, params))
    after = now.memory
    rate = subtract(subtract(readings.rate, after.bias), now.noise)
    spread, walked = deviations(now.turn), deviations(after.walk)
    valid = both(less(1.5, after.stage), less_equal(most(spread), params.valid_within))
    return Estimate(now.attitude, rate, after.bias, spread, walked, where(valid, 1.0, 0.0)), after


def latest(readings: Any, params: Numbers) -> tuple[Quaternion, Truth, Numbers]:
    """The attitude by all star trackers, whether it is new, and the numbers with its covariance for that of one tracker."""
    seen = attitudes_of(readings)
    if not params.weights:
        return (*seen[0], params)
    measured, spread, new = together(seen, params.weights)
    return measured, new, params._replace(tracker=spread)


def arrived(before: Memory, params: Numbers) -> Instant:
    """The estimate at a control step before it is corrected."""
    ahead = along_diagonal(before.turn, 3.0 * params.reading)
    return Instant(before.attitude, before.turn, ZERO, before._replace(turn=ahead))


def started(now: Instant, readings: Any, params: Numbers) -> Instant:
    """The estimate with the attitude of another estimator in place of the one stated for the start, with that deviation."""
    if not hasattr(readings, FIX):
        return now
    square = params.start_turn
    begun = taken(now, readings.fix.attitude, params._replace(tracker=diagonal((square, square, square))))
    first = both(less(0.5, readings.fix.is_valid), less(now.memory.stage, 1.5))
    return chosen(first, begun._replace(memory=begun.memory._replace(stage=2.0)), now)


def taken(now: Instant, measured: Quaternion, params: Numbers) -> Instant:
    """The first attitude, taken as it is: its error has nothing to do with the bias, nor with the noise of the gyro."""
    ahead = along_diagonal(params.tracker, params.reading)
    memory = now.memory._replace(attitude=measured, turn=ahead, mixed=(ZERO, ZERO, ZERO))
    return Instant(measured, params.tracker, ZERO, memory)


def corrected(now: Instant, measured: Quaternion, params: Numbers, period: Scalar) -> Instant:
    """The estimate of attitude, bias and noise, corrected by a new attitude."""
    before = now.memory
    turn = small_turn(now.attitude, measured)
    gain = gains(now, params)
    memory = before._replace(
        attitude=turned_by(now.attitude, apply(gain.ahead, turn)),
        bias=add(before.bias, apply(gain.bias, turn)),
        turn=symmetric(combine(1.0, before.turn, -1.0, product(gain.ahead, twice_read(now, params)))),
        mixed=combine(1.0, before.mixed, -1.0, product(gain.ahead, before.mixed)),
        walk=symmetric(combine(1.0, before.walk, -1.0, product(gain.bias, before.mixed))),
    )
    return Instant(
        turned_by(now.attitude, apply(gain.turn, turn)),
        symmetric(combine(1.0, now.turn, -1.0, product(gain.turn, now.turn))),
        scale(-2.0 * params.reading / period, apply(gain.sure, turn)),
        memory,
    )


def gains(now: Instant, params: Numbers) -> Gains:
    """The gains for a new attitude."""
    sure = inverse(summed(now.turn, params.tracker))
    ahead, bias = product(twice_read(now, params), sure), product(transpose(now.memory.mixed), sure)
    return Gains(product(now.turn, sure), ahead, bias, sure)


def twice_read(now: Instant, params: Numbers) -> Matrix:
    """The covariance of the attitude that is kept with the present one: it has the noise of the reading twice."""
    return along_diagonal(now.turn, params.reading)


def propagated(memory: Memory, rate: Vector, params: Numbers, period: Scalar) -> Memory:
    """The estimate a control period on: the rate between the gyro's two readings is their mean."""
    mean = subtract(scale(0.5, add(memory.rate, rate)), memory.bias)
    turn, axes, drift = turned(mean, period)
    spread, mixed = carried(memory.turn, memory.mixed, memory.walk, axes, drift)
    return memory._replace(
        attitude=renormalise(multiply(memory.attitude, turn)),
        turn=symmetric(along_diagonal(spread, params.reading + params.turned)),
        mixed=along_diagonal(mixed, params.mixed),
        walk=along_diagonal(memory.walk, params.walked),
    )


def turned(rate: Vector, period: Scalar) -> tuple[Quaternion, Matrix, Matrix]:
    """How a body turns in a control period, and by what errors of attitude and bias are multiplied."""
    turn = short_turn(scale(0.5 * period, rate))
    axes = from_quaternion(turn)
    # d(error)/dt = -w x error - error of the bias, over the period.
    return turn, axes, combine(-0.5 * period, axes, -0.5 * period, IDENTITY)


def recursion(params: Params, noise: Noise, period: float, rate: Vector) -> Recursion | None:
    """How noise of gyro and star trackers drives the errors of attitude and bias and that of the gyro's last reading, at a
    constant rate (rad/s, body axes) of a filter that has settled; None for one that does not, or that counts other trackers
    than there are."""
    numbers = prepare(params, period)
    if len(params.more_trackers) != len(noise.more):
        return None
    seen = [noise.attitude]
    if noise.more:
        numbers = numbers._replace(tracker=inverse(reduce(summed, numbers.weights)))
        shares = [product(numbers.tracker, weight) for weight in numbers.weights]
        seen = [product(share, root) for share, root in zip(shares, (noise.attitude, *noise.more), strict=True)]
    gain = settled(numbers, noise.every, rate, period)
    if gain is None:
        return None
    (_, axes, drift), reading, walk = turned(rate, period), noise.rate, noise.walk
    known = -2.0 * numbers.reading / period

    def drifted(errors: tuple[Vector, ...], random: tuple[Vector, ...]) -> tuple[tuple[Vector, ...], Vector, Vector]:
        (turn, bias, last), now, walked = errors, scale(reading, random[0]), scale(walk, random[1])
        mean = subtract(scale(0.5, add(add(last, now), walked)), bias)
        ahead, bias = subtract(apply(axes, turn), apply(drift, mean)), subtract(bias, walked)
        return (ahead, bias, now), ahead, subtract(now, bias)

    def corrected(errors: tuple[Vector, ...], random: tuple[Vector, ...]) -> tuple[tuple[Vector, ...], Vector, Vector]:
        (ahead, bias, now), *_ = drifted(errors, random)
        deviation = subtract(reduce(add, map(apply, seen, random[2:])), ahead)
        bias = add(bias, apply(gain.bias, deviation))
        rate = subtract(subtract(now, bias), scale(known, apply(gain.sure, deviation)))
        kept = (add(ahead, apply(gain.ahead, deviation)), bias, now)
        return kept, add(ahead, apply(gain.turn, deviation)), rate

    return Recursion(corrected, drifted, noise.every, 3, 2 + len(seen))


@cache
def settled(params: Numbers, every: int, rate: Vector, period: float) -> Gains | None:
    """The gains after many new attitudes at a constant rate; None where they go on changing."""
    memory, before = remember(params, None)._replace(rate=rate), np.zeros((4, 3, 3))
    for _ in range(MOST // every):
        for _ in range(every - 1):
            memory = arrived(propagated(memory, rate, params, period), params).memory
        now = arrived(propagated(memory, rate, params, period), params)
        gain, memory = gains(now, params), corrected(now, now.attitude, params, period).memory
        change, size = (np.abs(np.array(x)).max(axis=(1, 2)) for x in (np.subtract(gain, before), gain))
        if (change <= 1e-9 * size).all():
            return gain
        before = gain
    return None


def examples() -> list[Params]:
    """A small tracker with a MEMS gyro, and a good gyro with a tracker that is as sure about every axis."""
    arcsec = math.radians(1.0 / 3600.0)
    small = Params(math.radians(0.15) / 60.0, math.radians(3.0) / HOUR, 1e-3, 6.0 * arcsec, 40.0 * arcsec, (0.0, 0.6, 0.8))
    fine = Params(1e-6, 1e-7, 1e-5, 3.0 * arcsec, 3.0 * arcsec)
    return [small, fine._replace(start=(0.6, 0.0, 0.8, 0.0), start_deviation=0.02)]
