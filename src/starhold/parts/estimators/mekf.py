"""Attitude and gyro bias by the multiplicative extended Kalman filter: the gyro propagates the attitude; new attitudes of
star trackers, and directions if selected, correct both with gains from the covariances."""

from __future__ import annotations

import math
from functools import cache, reduce
from typing import Annotated, Any, NamedTuple, TypeAlias, cast

import numpy as np

from starhold.algebra.quantity import Quantity
from starhold.algebra.quaternion import NO_TURN, Quaternion
from starhold.algebra.scalar import Scalar, Truth, both, either, less, less_equal, maximum, where
from starhold.algebra.structure import chosen
from starhold.algebra.structured import repeat, until, when
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
)
from starhold.algebra.vector import multiply as product
from starhold.parts import vectors
from starhold.parts.attitudes import attitudes_of, together
from starhold.parts.boresight import unit_boresight
from starhold.parts.contract import FIX, Card, Noise, Parameter, Recursion
from starhold.parts.covariance import GYRO_BIAS, GYRO_NOISE, GYRO_WALK, deviations, summed
from starhold.parts.craft import Craft
from starhold.parts.ephemeris import EPHEMERIS
from starhold.parts.epoch import EPOCH, Date
from starhold.parts.epoch import START as FIRST_DAY
from starhold.parts.kalman import (
    Gains,
    Head,
    Instant,
    Memory,
    Numbers,
    arrived,
    corrected,
    correction,
    propagated,
    taken,
    turned,
)
from starhold.parts.stated_attitude import START, VALID, unit_quaternion

CARD = Card(
    title="Multiplicative extended Kalman filter",
    summary="q' = q (w_m - b)/2, P by the linearised errors of attitude and bias; q <- q (1, K_a e/2), b <- b + K_b e",
    sources=(
        "Fundamentals of Spacecraft Attitude Determination and Control (2014)",
        "Kalman Filtering for Spacecraft Attitude Estimation (1982)",
    ),
    assumptions=(
        "errors of gyro, star trackers and directions are white, of the deviations that the filter assumes",
        "attitudes and directions come without delay",
        "the rate changes in proportion to time between control steps",
        "the error of the attitude is small",
        "the first attitude of a star tracker takes the place of the one stated for the start; that of the estimator that "
        "starts it does so with the deviation stated for the start; directions count from the control step after that on",
    ),
)
ROLE = "estimator"
NEEDS = ("attitude", "rate")
SEVERAL = {"attitude": "more_trackers", **vectors.SEVERAL}
STARTABLE = True
ASSUMES = {"attitude": ("cross", "roll", "boresight")}
FIRST = {"gyro_bias": ZERO, "attitude_deviation": ZERO, "gyro_bias_deviation": ZERO, "is_valid": 0.0}
HOUR = 3600.0
MOST = 100_000
"""Control periods within which a filter settles or never does."""
UNKNOWN = math.sqrt(math.pi**2 / 9.0 + 2.0 / 3.0)
"""Standard deviation about each axis (rad) of the rotation vector of a uniformly distributed attitude."""

Tracker: TypeAlias = tuple[float, float, float, float, float]


class Params(NamedTuple):
    """The noise of gyro and star tracker that the filter assumes, in those sensors' terms."""

    noise: Annotated[float, GYRO_NOISE]
    bias_walk: Annotated[float, GYRO_WALK]
    bias: Annotated[float, GYRO_BIAS]
    cross: Annotated[
        float, Parameter("rad", above=0.0, text="star tracker: standard deviation across boresight; the sensor's if absent")
    ] = math.inf
    roll: Annotated[
        float, Parameter("rad", above=0.0, text="star tracker: standard deviation about boresight; the sensor's if absent")
    ] = math.inf
    boresight: Annotated[
        Vector, Parameter("1", shape=(3,), spread=False, text="of the star tracker, body axes; the sensor's if absent")
    ] = (0.0, 0.0, 1.0)
    start: Annotated[Quaternion, START] = NO_TURN
    start_deviation: Annotated[
        float, Parameter("rad", above=0.0, text="standard deviation of that attitude about each axis; 76 deg if unknown")
    ] = UNKNOWN
    valid_within: Annotated[
        float, Parameter("rad", above=0.0, text="largest standard deviation of a valid attitude; any if absent")
    ] = math.inf
    more_trackers: Annotated[
        tuple[Tracker, ...],
        Parameter(
            "rad, rad, 1, 1, 1",
            columns=("cross", "roll", "x", "y", "z"),
            text="a row for each star tracker after the first: standard deviations and boresight; the sensors' if absent",
        ),
    ] = ()
    sun: Annotated[float, vectors.deviation("the Sun's direction")] = math.inf
    field: Annotated[float, vectors.deviation("the magnetic field's direction")] = math.inf
    nadir: Annotated[float, vectors.deviation("the nadir")] = math.inf
    epoch: Annotated[Date, EPOCH] = FIRST_DAY
    ephemeris: Annotated[int, EPHEMERIS] = 0


class Estimate(NamedTuple):
    """Attitude, rate corrected for the bias, the bias, the standard deviations of attitude and bias, and whether a first
    attitude has arrived and its standard deviation is small enough."""

    attitude: Annotated[Quaternion, Quantity("1", "estimated attitude, inertial to body, scalar first", "quaternion")]
    rate: Annotated[Vector, Quantity("rad/s", "estimated angular velocity, body axes", "axis")]
    gyro_bias: Annotated[Vector, Quantity("rad/s", "estimated bias of the gyro", "axis")]
    attitude_deviation: Annotated[Vector, Quantity("rad", "standard deviation of its error, body axes", "axis")]
    gyro_bias_deviation: Annotated[Vector, Quantity("rad/s", "standard deviation of its error, body axes", "axis")]
    is_valid: Annotated[float, VALID]


def needs(params: Params) -> tuple[str, ...]:
    """Return the readings that it takes: those of star trackers, or the estimate of another estimator, and directions."""
    return ("attitude" if trackers_of(params) else FIX, "rate", *vectors.needed(params))


def about(params: Params) -> str:
    """Return the body that it must orbit: Sun and field are modelled near the Earth."""
    return "Earth" if min(params.sun, params.field) < math.inf else ""


def trackers_of(params: Params) -> tuple[Tracker, ...]:
    """Return the star trackers; with directions there may be none."""
    first = (params.cross, params.roll, *params.boresight)
    none = vectors.needed(params) and not params.more_trackers and params.cross == params.roll == math.inf
    return () if none else (first, *params.more_trackers)


def prepare(params: Params, period: float) -> Numbers:
    """Return the numbers of a control step. Raise ValueError for a boresight without direction, an initial attitude that is
    no quaternion, a tracker without noise, or an epoch at which a direction is not known."""
    directions = vectors.known_from(params, params.epoch, params.ephemeris) if vectors.needed(params) else ()
    trackers: list[Matrix] = []
    for cross, roll, *boresight in trackers_of(params):
        if not 0.0 < min(cross, roll) <= max(cross, roll) < math.inf:
            raise ValueError("the deviations cross and roll of each star tracker must be above 0, here or in its own table")
        trackers.append(spread_of(cross, roll, cast(Vector, tuple(boresight))))
    # The rate between two readings is their mean: the noise of each turns the attitude for half a period, and so does the
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
        trackers[0] if trackers else cast(Any, ()),
        reading,
        turned,
        mixed,
        walk,
        weights,
        params.valid_within,
        directions,
    )


def spread_of(cross: float, roll: float, boresight: Vector) -> Matrix:
    """Return the covariance of a star tracker's attitude error (rad2, body axes)."""
    return along_axis(unit_boresight(boresight), roll**2, cross**2)


def remember(params: Numbers, state: Any) -> Memory:
    """Return the initial memory, with the stated initial attitude."""
    square, begin = params.start_turn, params.bias
    nothing: Matrix = (ZERO, ZERO, ZERO)
    turn, walk = diagonal((square, square, square)), diagonal((begin, begin, begin))
    return Memory(params.start, ZERO, ZERO, turn, nothing, walk, 0.0, (0.0,) if params.directions else ())


def estimate(readings: Any, memory: Memory, params: Numbers, craft: Craft, period: Scalar) -> tuple[Estimate, Memory]:
    """Return the estimate at a control step, and the new memory."""
    heads, params = latest(readings, params)
    pairs = directed(readings, memory, params, period)
    foretold = propagated(memory, readings.rate, params, period)
    before = chosen(less(0.5, memory.stage), foretold, memory)._replace(
        rate=readings.rate, stage=maximum(memory.stage, 1.0), step=tuple(step + 1.0 for step in memory.step)
    )

    def correct(now: Instant) -> tuple[Instant]:
        known = less(1.5, now.memory.stage)
        after = corrected(now, correction(now, heads, pairs, params), params, period)
        for measured, _ in heads:
            after = chosen(known, after, taken(now, measured, params))
        return (after._replace(memory=after.memory._replace(stage=2.0)),)

    new = reduce(either, [head[1] for head in heads] + [pair[3] for pair in pairs])
    (now,) = when(new, correct, started(arrived(before, params), readings, params))
    after = now.memory
    rate = subtract(subtract(readings.rate, after.bias), now.noise)
    spread, walked = deviations(now.turn), deviations(after.walk)
    valid = both(less(1.5, after.stage), less_equal(most(spread), params.valid_within))
    return Estimate(now.attitude, rate, after.bias, spread, walked, where(valid, 1.0, 0.0)), after


def latest(readings: Any, params: Numbers) -> tuple[list[Head], Numbers]:
    """Return the combined attitude of all star trackers, if there are any, and whether it is new; and the numbers with its
    covariance in place of one tracker's."""
    seen = attitudes_of(readings) if params.tracker else []
    if not params.weights:
        return seen[:1], params
    measured, spread, new = together(seen, params.weights)
    return [(measured, new)], params._replace(tracker=spread)


def directed(readings: Any, memory: Memory, params: Numbers, period: Scalar) -> list[vectors.Pair]:
    """Return the directions, none until the step after the first attitude, which may have been computed from them."""
    if not params.directions:
        return []
    begun = less(1.5, memory.stage)
    pairs = vectors.pairs_of(readings, memory.step[0] * period, params.directions)
    return [(seen, reference, weight, both(begun, there)) for seen, reference, weight, there in pairs]


def started(now: Instant, readings: Any, params: Numbers) -> Instant:
    """Return the estimate with the attitude of another estimator in place of the stated initial one, with the latter's
    standard deviation."""
    if not hasattr(readings, FIX):
        return now
    square = params.start_turn
    begun = taken(now, readings.fix.attitude, params._replace(tracker=diagonal((square, square, square))))
    first = both(less(0.5, readings.fix.is_valid), less(now.memory.stage, 1.5))
    return chosen(first, begun._replace(memory=begun.memory._replace(stage=2.0)), now)


def recursion(params: Params, noise: Noise, period: float, rate: Vector) -> Recursion | None:
    """Return the recursion by which noise of gyro and star trackers drives the errors of attitude, bias and the gyro's last
    reading, for a settled filter at a constant rate (rad/s, body axes); None if it does not settle, has rows for other
    trackers than exist, or takes directions."""
    numbers = prepare(params, period)
    if numbers.directions or len(params.more_trackers) != len(noise.more):
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
        rate = subtract(subtract(now, bias), scale(known, apply(gain.common, deviation)))
        kept = (add(ahead, apply(gain.ahead, deviation)), bias, now)
        return kept, add(ahead, apply(gain.turn, deviation)), rate

    return Recursion(corrected, drifted, noise.every, 3, 2 + len(seen), strays=True)


@cache
def settled(params: Numbers, every: int, rate: Vector, period: float) -> Gains | None:
    """Return the gains after many new attitudes at a constant rate; None if they do not converge."""
    memory, none = remember(params, None)._replace(rate=rate), (ZERO, ZERO, ZERO)
    begun, gain = Instant(memory.attitude, memory.turn, ZERO, memory), Gains(none, none, none, none)
    other = Gains(IDENTITY, IDENTITY, IDENTITY, IDENTITY)
    _, gain, before = _settling(every, len(params.weights))(begun, gain, other, rate, params, period)
    change, size = (np.abs(np.array(x)).max(axis=(1, 2)) for x in (np.subtract(gain, before), gain))
    return gain if (change <= 1e-9 * size).all() else None


@cache
def _settling(every: int, trackers: int) -> Any:
    """Return in machine code, because it takes thousands of steps, what goes on from an instant and two different gains to
    the last two gains."""
    from starhold.trace.calling import Compiled

    def find(begun: Instant, gain: Gains, before: Gains, rate: Vector, params: Numbers, period: Scalar) -> Any:
        def turn(_: int, now: Instant) -> tuple[Instant]:
            return (arrived(propagated(now.memory, rate, params, period), params),)

        def cycle(now: Instant, gain: Gains, _: Gains) -> tuple[Instant, Gains, Gains]:
            (now,) = repeat(every, turn, now)
            by = correction(now, [(now.attitude, True)], [], params)
            return corrected(now, by, params, period), by.gain, gain

        def done(_: Instant, gain: Gains, before: Gains) -> Truth:
            return reduce(both, map(alike, gain, before))

        return until(done, cycle, begun, gain, before, at_most=MOST // every)

    def alike(a: Matrix, b: Matrix) -> Truth:
        change, size = (most((*x, *y, *z)) for x, y, z in (combine(1.0, a, -1.0, b), a))
        return less_equal(change, 1e-9 * size)

    numbers = Numbers(NO_TURN, 1.0, 1.0, IDENTITY, 1.0, 1.0, 1.0, 1.0, (IDENTITY,) * trackers)
    gains = Gains(IDENTITY, IDENTITY, IDENTITY, IDENTITY)
    return Compiled(find, Instant(NO_TURN, IDENTITY, ZERO, remember(numbers, None)), gains, gains, ZERO, numbers, 1.0)


def examples() -> list[Params]:
    """Return a small tracker with a MEMS gyro, a good gyro with a tracker of equal accuracy about all axes, and the first
    with Sun, field and nadir."""
    arcsec = math.radians(1.0 / 3600.0)
    small = Params(math.radians(0.15) / 60.0, math.radians(3.0) / HOUR, 1e-3, 6.0 * arcsec, 40.0 * arcsec, (0.0, 0.6, 0.8))
    fine = Params(1e-6, 1e-7, 1e-5, 3.0 * arcsec, 3.0 * arcsec)
    stated = fine._replace(start=(0.6, 0.0, 0.8, 0.0), start_deviation=0.02)
    return [small, stated, small._replace(sun=2e-3, field=1e-2, nadir=5e-3)]
