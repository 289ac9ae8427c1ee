"""Attitude, and rate or gyro bias, from the magnetic field alone, for a tumbling body of unknown attitude, by an extended
Kalman filter that restarts when the measured fields contradict it."""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from starhold.algebra.cosines import from_quaternion
from starhold.algebra.quantity import Quantity
from starhold.algebra.quaternion import NO_TURN, Quaternion, multiply, normalise, to_body
from starhold.algebra.rotation import short_turn
from starhold.algebra.scalar import Scalar, both, either, less, less_equal, maximum, where
from starhold.algebra.structure import chosen
from starhold.algebra.vector import (
    IDENTITY,
    ZERO,
    Matrix,
    Vector,
    add,
    along_axis,
    apply,
    combine,
    cross,
    diagonal,
    dot,
    gyroscopic_torque,
    inverse,
    most,
    norm,
    scale,
    skew,
    subtract,
    transpose,
)
from starhold.algebra.vector import multiply as product
from starhold.parts import magnetic_field
from starhold.parts.attitudes import turned_by
from starhold.parts.contract import Card, Parameter
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
from starhold.parts.epoch import EPOCH, START, Date
from starhold.parts.stated_attitude import START as ATTITUDE
from starhold.parts.stated_attitude import VALID, unit_quaternion

CARD = Card(
    title="Magnetometer filter",
    summary="q' = q w/2 with w = w_m - b of a gyro, else J w' = -w x J w; both corrected by B_m - A(q) B",
    sources=(
        "Three-Axis Attitude Determination via Kalman Filtering of Magnetometer Data (1990)",
        "Fundamentals of Spacecraft Attitude Determination and Control (2014)",
        magnetic_field.SOURCE,
    ),
    assumptions=(
        *magnetic_field.ASSUMPTIONS,
        "what the field is measured off is white, of the deviation that the filter assumes",
        "the rate changes in proportion to time between control steps",
        "without a gyro: wheels at rest, and white torques, which those of a law that is at work are not",
        "the field turns along the orbit: at once it says nothing about a turn about itself",
    ),
)
ROLE = "estimator"
ABOUT = "Earth"
NEEDS = ("magnetic_field", "position")
FIRST = dict.fromkeys(("rate", "gyro_bias", "attitude_deviation", "rate_deviation"), ZERO) | {
    "surprise": 0.0,
    "is_valid": 0.0,
}
HOUR = 3600.0
MEAN = 100.0
"""Number of measurements over which squared residuals are averaged."""
DOUBT, TRUST = 2.0, 1.25
"""The filter restarts if that mean, 1 for a consistent filter, is above the first, and is not valid above the second."""
SPREAD = 0.5
"""The sine of the angle by which the field must have turned, in inertial axes, since the filter began."""
TINY = 1e-12


class Params(NamedTuple):
    """The standard deviations that the filter assumes: of the field, and of a gyro in that sensor's terms, or without one
    of the rate."""

    field: Annotated[
        float, Parameter("T", above=0.0, text="standard deviation of each field component from the model, bias included")
    ]
    noise: Annotated[float, GYRO_NOISE] = 0.0
    bias_walk: Annotated[float, GYRO_WALK] = 0.0
    bias: Annotated[float, GYRO_BIAS] = 0.01
    rate: Annotated[
        float, Parameter("rad/s", above=0.0, text="without a gyro: standard deviation of the initial rate about each axis")
    ] = math.radians(10.0)
    rate_walk: Annotated[
        float,
        Parameter(
            "rad/s",
            also="rad/s/sqrt(s)",
            at_least=0.0,
            text="without a gyro: standard deviation of the rate's change in 1 s by unknown torques",
        ),
    ] = 3e-4
    start: Annotated[Quaternion, ATTITUDE] = NO_TURN
    start_deviation: Annotated[
        float, Parameter("rad", above=0.0, text="standard deviation of that attitude about each axis; unknown if absent")
    ] = math.inf
    valid_within: Annotated[float, Parameter("rad", above=0.0, text="largest standard deviation of a valid attitude")] = (
        math.radians(5.0)
    )
    epoch: Annotated[Date, EPOCH] = START


class Drive(NamedTuple):
    """Variances of the initial bias or rate, and of a gyro's reading (rad2/s2); the process noise of a control period in
    the covariances of attitude, attitude with bias or rate, and bias or rate."""

    begin: Scalar
    reading: Scalar
    turned: Scalar
    mixed: Scalar
    walked: Scalar


class Numbers(NamedTuple):
    """The stated initial attitude, whether the filter relies on it (1), and its variance (rad2); the field and its variance
    (T2); the variances with a gyro and without; the largest standard deviation of a valid attitude (rad)."""

    start: Quaternion
    begun: Scalar
    start_turn: Scalar
    field: magnetic_field.Numbers
    seen: Scalar
    gyro: Drive
    free: Drive
    valid_within: Scalar


class Estimate(NamedTuple):
    """Attitude, rate, gyro bias, standard deviations, the mean square residual, and whether the estimate is valid."""

    attitude: Annotated[Quaternion, Quantity("1", "estimated attitude, inertial to body, scalar first", "quaternion")]
    rate: Annotated[Vector, Quantity("rad/s", "estimated angular velocity, body axes", "axis")]
    gyro_bias: Annotated[Vector, Quantity("rad/s", "estimated bias of the gyro, 0 without one", "axis")]
    attitude_deviation: Annotated[Vector, Quantity("rad", "standard deviation of its error, body axes", "axis")]
    rate_deviation: Annotated[Vector, Quantity("rad/s", "standard deviation of its error, body axes", "axis")]
    surprise: Annotated[float, Quantity("1", "mean square residual of the field, over that expected")]
    is_valid: Annotated[float, VALID]


class Memory(NamedTuple):
    """The attitude, the bias or rate, and the gyro's reading (rad/s) at the last control step; the block covariance of the
    errors of attitude (rad, body axes) and bias or rate; the mean square residual; whether the filter has begun (1); the
    field's direction then (inertial), and the largest sine of its angle to a later one; and the number of control steps."""

    attitude: Quaternion
    slow: Vector
    reading: Vector
    turn: Matrix
    mixed: Matrix
    walk: Matrix
    surprise: Scalar
    begun: Scalar
    first: Vector
    spread: Scalar
    steps: Scalar


def prepare(params: Params, period: float) -> Numbers:
    """Return the numbers of a control step. Raise ValueError for an initial attitude that is no quaternion, and an epoch at
    which the field is not known."""
    known = params.start_deviation < math.inf
    return Numbers(
        unit_quaternion(params.start),
        1.0 if known else 0.0,
        params.start_deviation**2 if known else math.pi**2 / 3.0,
        magnetic_field.prepared(params.epoch),
        params.field**2,
        _drive(params.bias, params.noise, params.bias_walk**2 / HOUR, -1.0, period),
        _drive(params.rate, 0.0, params.rate_walk**2, 1.0, period),
        params.valid_within,
    )


def _drive(begin: float, noise: float, walk: float, sign: float, period: float) -> Drive:
    turned = noise**2 * period + walk * period**3 / 3.0
    return Drive(begin**2, noise**2 / period, turned, sign * 0.5 * walk * period**2, walk * period)


def remember(params: Numbers, state: Any) -> Memory:
    """Return the initial memory, with the stated initial attitude, at rest."""
    square, nothing = params.start_turn, (ZERO, ZERO, ZERO)
    turn = diagonal((square, square, square))
    return Memory(params.start, ZERO, ZERO, turn, nothing, nothing, 1.0, params.begun, ZERO, params.begun, 0.0)


def estimate(readings: Any, memory: Memory, params: Numbers, craft: Craft, period: Scalar) -> tuple[Estimate, Memory]:
    """Return the estimate at a control step, and the new memory."""
    with_gyro = hasattr(readings, "rate")
    drive = params.gyro if with_gyro else params.free
    reading = readings.rate if with_gyro else ZERO
    begin = diagonal((drive.begin, drive.begin, drive.begin))
    ahead = propagated(memory, reading, drive, craft, period, with_gyro)
    # Before the first step there is nothing to propagate.
    before = chosen(less(0.5, memory.steps), ahead, memory._replace(walk=begin))
    true = magnetic_field.field(readings.position, memory.steps * period, params.field)
    astray = either(less(memory.begun, 0.5), less(DOUBT, memory.surprise))
    shown = readings.magnetic_field
    after = chosen(astray, aligned(before, shown, true, params, begin), corrected(before, shown, true, params))
    new = less(0.5, getattr(readings, "magnetic_field_is_new", 1.0))
    now = chosen(new, after, before)._replace(reading=reading, steps=memory.steps + 1.0)
    spread, of_rate = deviations(now.turn), deviations(along_diagonal(now.walk, drive.reading))
    sure = both(less_equal(most(spread), params.valid_within), less(now.surprise, TRUST))
    valid = where(both(less(SPREAD, now.spread), sure), 1.0, 0.0)
    rate, bias = (subtract(reading, now.slow), now.slow) if with_gyro else (now.slow, ZERO)
    return Estimate(now.attitude, rate, bias, spread, of_rate, now.surprise, valid), now


def propagated(memory: Memory, reading: Vector, drive: Drive, craft: Craft, period: Scalar, with_gyro: bool) -> Memory:
    """Return the estimate propagated by a control period."""
    slow = memory.slow
    if with_gyro:
        old, new, kept, sign = subtract(memory.reading, slow), subtract(reading, slow), IDENTITY, -1.0
    else:
        middle = add(slow, scale(0.5 * period, _acceleration(slow, craft)))
        old = slow
        slow = new = add(slow, scale(period, _acceleration(middle, craft)))
        sign, slope = 1.0, _slope(middle, craft)
        kept = summed(IDENTITY, product(slope, combine(period, IDENTITY, 0.5 * period * period, slope)))
    # The second term accounts for the changing direction of the rate.
    turn = short_turn(add(scale(0.25 * period, add(old, new)), scale(period * period / 24.0, cross(old, new))))
    axes = from_quaternion(turn)
    drift = combine(0.5 * sign * period, axes, 0.5 * sign * period, kept)
    spread, mixed = carried(memory.turn, memory.mixed, memory.walk, axes, drift)
    walk = memory.walk
    if not with_gyro:
        mixed, walk = product(mixed, transpose(kept)), product(product(kept, walk), transpose(kept))
    return memory._replace(
        attitude=normalise(multiply(memory.attitude, turn)),
        slow=slow,
        turn=symmetric(along_diagonal(spread, drive.turned)),
        mixed=along_diagonal(mixed, drive.mixed),
        walk=symmetric(along_diagonal(walk, drive.walked)),
    )


def _acceleration(rate: Vector, craft: Craft) -> Vector:
    """Return the angular acceleration of a body without torque (rad/s2)."""
    return scale(-1.0, apply(craft.inverse_inertia, gyroscopic_torque(craft.inertia, rate)))


def _slope(rate: Vector, craft: Craft) -> Matrix:
    """Return the derivative of that acceleration with respect to the rate (1/s)."""
    inertia, inverted = craft.inertia, craft.inverse_inertia
    spun = apply(inertia, rate)
    x, y, z = (apply(inverted, subtract(cross(spun, axis), cross(rate, apply(inertia, axis)))) for axis in IDENTITY)
    return transpose((x, y, z))


def aligned(now: Memory, shown: Vector, true: Vector, params: Numbers, begin: Matrix) -> Memory:
    """Return the estimate at a restart: the attitude is turned by the smallest rotation onto the measured field, and its
    rotation about the field is unknown; bias or rate are kept, with the initial variance."""
    foretold, size = to_body(now.attitude, true), maximum(norm(shown), TINY)
    old, new = scale(1.0 / maximum(norm(foretold), TINY), foretold), scale(1.0 / size, shown)
    # For opposite fields the axis of the rotation is arbitrary.
    turn = normalise((maximum(1.0 + dot(old, new), 1e-6), *cross(new, old)))
    return now._replace(
        attitude=normalise(multiply(now.attitude, turn)),
        turn=along_axis(new, math.pi**2 / 3.0, params.seen / (size * size)),
        mixed=(ZERO, ZERO, ZERO),
        walk=begin,
        surprise=DOUBT,
        begun=1.0,
        first=scale(1.0 / maximum(norm(true), TINY), true),
        spread=0.0,
    )


def corrected(now: Memory, shown: Vector, true: Vector, params: Numbers) -> Memory:
    """Return the estimate corrected by a field measurement: an attitude error turns the field, off = B x error."""
    foretold = to_body(now.attitude, true)
    off, row = subtract(shown, foretold), skew(foretold)
    # Covariances of the predicted field with the errors of attitude and of bias or rate.
    of_turn, of_slow = product(row, now.turn), product(row, now.mixed)
    sure = inverse(symmetric(along_diagonal(product(of_turn, transpose(row)), params.seen)))
    turning, slowing = product(transpose(of_turn), sure), product(transpose(of_slow), sure)
    square = dot(off, apply(sure, off)) / 3.0
    return now._replace(
        attitude=turned_by(now.attitude, apply(turning, off)),
        slow=add(now.slow, apply(slowing, off)),
        turn=symmetric(combine(1.0, now.turn, -1.0, product(turning, of_turn))),
        mixed=combine(1.0, now.mixed, -1.0, product(turning, of_slow)),
        walk=symmetric(combine(1.0, now.walk, -1.0, product(slowing, of_slow))),
        surprise=now.surprise + (square - now.surprise) / MEAN,
        spread=maximum(now.spread, norm(cross(now.first, true)) / maximum(norm(true), TINY)),
    )


def examples() -> list[Params]:
    """Return a magnetometer with a MEMS gyro, and a known initial attitude."""
    small = Params(2e-7, math.radians(0.3) / 60.0, math.radians(5.0) / HOUR)
    return [small, small._replace(rate=0.02, start=(0.6, 0.0, 0.8, 0.0), start_deviation=0.02)]
