"""The equations of the multiplicative extended Kalman filter: how attitude, gyro bias and the covariances of their errors
are carried on by the gyro and corrected by attitudes and directions."""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias

from starhold.algebra.cosines import from_quaternion
from starhold.algebra.quaternion import Quaternion, multiply, renormalise
from starhold.algebra.rotation import short_turn
from starhold.algebra.scalar import Scalar, Truth
from starhold.algebra.structure import chosen
from starhold.algebra.vector import (
    IDENTITY,
    ZERO,
    Matrix,
    Vector,
    add,
    apply,
    combine,
    inverse,
    scale,
    subtract,
    transpose,
)
from starhold.algebra.vector import multiply as product
from starhold.parts.attitudes import small_turn, turned_by
from starhold.parts.covariance import along_diagonal, carried, summed, symmetric
from starhold.parts.vectors import Known, Pair, information

Head: TypeAlias = tuple[Quaternion, Truth]
"""An attitude that star trackers show, and whether it is new."""


class Numbers(NamedTuple):
    """The attitude stated for the start. Variances: of it (rad2), of the bias then (rad2/s2), of the tracker's attitude
    (rad2, body axes; () without one), and what the noise of one reading of the gyro adds to that of the attitude; what the
    walk of the bias adds in a control period to those of attitude, attitude with bias, and bias. The inverse variances of
    all trackers' attitudes (1/rad2), where there are several. The largest deviation of an attitude that counts as valid
    (rad). The directions that are taken, () for none."""

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
    directions: Known | tuple[()] = ()


class Memory(NamedTuple):
    """The attitude at the last control step, the bias and the gyro's reading then (rad/s), the covariance of the errors of
    attitude (rad, body axes) and bias in blocks, 0 before the first reading, 1 before the first attitude, 2 after it, and
    the number of the control step, () where nothing depends on it.

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
    step: tuple[Scalar, ...] = ()


class Gains(NamedTuple):
    """The gains from what a measurement is off: to the attitude, to the one that is kept, and to the bias; and what all of
    them have in common, for a new attitude the inverse of the covariance of its deviation from the one foretold (1/rad2)."""

    turn: Matrix
    ahead: Matrix
    bias: Matrix
    common: Matrix


class Correction(NamedTuple):
    """The gains for the deviation of an attitude, which the covariances follow from; those for what is off, and this."""

    whole: Gains
    gain: Gains
    off: Vector


class Instant(NamedTuple):
    """The attitude at a control step, the covariance of its error, the noise of the gyro's reading as far as it is
    known (rad/s), and the memory."""

    attitude: Quaternion
    turn: Matrix
    noise: Vector
    memory: Memory


def arrived(before: Memory, params: Numbers) -> Instant:
    """The estimate at a control step before it is corrected."""
    ahead = along_diagonal(before.turn, 3.0 * params.reading)
    return Instant(before.attitude, before.turn, ZERO, before._replace(turn=ahead))


def taken(now: Instant, measured: Quaternion, params: Numbers) -> Instant:
    """The first attitude, taken as it is: its error has nothing to do with the bias, nor with the noise of the gyro."""
    ahead = along_diagonal(params.tracker, params.reading)
    memory = now.memory._replace(attitude=measured, turn=ahead, mixed=(ZERO, ZERO, ZERO))
    return Instant(measured, params.tracker, ZERO, memory)


def correction(now: Instant, heads: list[Head], pairs: list[Pair], params: Numbers) -> Correction:
    """The gains for what is measured at a control step, all at once, which is as good as one after the other."""
    if not params.directions:
        off = small_turn(now.attitude, heads[0][0])
        gain = gains(now, params, inverse(summed(now.turn, params.tracker)))
        return Correction(gain, gain, off)
    sure, pull = information(pairs, now.attitude)
    for measured, new in heads:
        more = chosen(new, inverse(params.tracker), (ZERO, ZERO, ZERO))
        sure, pull = summed(sure, more), add(pull, apply(more, small_turn(now.attitude, measured)))
    share = inverse(along_diagonal(product(sure, now.turn), 1.0))
    return Correction(gains(now, params, product(share, sure)), gains(now, params, share), pull)


def corrected(now: Instant, by: Correction, params: Numbers, period: Scalar) -> Instant:
    """The estimate of attitude, bias and noise, corrected by what is measured."""
    before, (whole, gain, off) = now.memory, by
    memory = before._replace(
        attitude=turned_by(now.attitude, apply(gain.ahead, off)),
        bias=add(before.bias, apply(gain.bias, off)),
        turn=symmetric(combine(1.0, before.turn, -1.0, product(whole.ahead, twice_read(now, params)))),
        mixed=combine(1.0, before.mixed, -1.0, product(whole.ahead, before.mixed)),
        walk=symmetric(combine(1.0, before.walk, -1.0, product(whole.bias, before.mixed))),
    )
    return Instant(
        turned_by(now.attitude, apply(gain.turn, off)),
        symmetric(combine(1.0, now.turn, -1.0, product(whole.turn, now.turn))),
        scale(-2.0 * params.reading / period, apply(gain.common, off)),
        memory,
    )


def gains(now: Instant, params: Numbers, common: Matrix) -> Gains:
    """The gains that have this in common."""
    ahead, bias = product(twice_read(now, params), common), product(transpose(now.memory.mixed), common)
    return Gains(product(now.turn, common), ahead, bias, common)


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
