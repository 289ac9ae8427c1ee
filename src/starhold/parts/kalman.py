"""The multiplicative extended Kalman filter: propagation of attitude, gyro bias and error covariances by the gyro, and
their correction by attitudes and directions."""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias

from starhold.algebra.cosines import from_quaternion
from starhold.algebra.quaternion import Quaternion, multiply, renormalise
from starhold.algebra.rotation import short_turn
from starhold.algebra.scalar import Scalar, Truth
from starhold.algebra.structure import chosen
from starhold.algebra.vector import IDENTITY, ZERO, Matrix, Vector, add, apply, combine, inverse, scale, subtract, transpose
from starhold.algebra.vector import multiply as product
from starhold.parts.attitudes import small_turn, turned_by
from starhold.parts.covariance import along_diagonal, carried, summed, symmetric
from starhold.parts.vectors import Known, Pair, information

Head: TypeAlias = tuple[Quaternion, Truth]
"""An attitude from star trackers, and whether it is new."""


class Numbers(NamedTuple):
    """The stated initial attitude. Variances: of it (rad2), of the initial bias (rad2/s2), of the tracker's attitude (rad2,
    body axes; () without one), and of the attitude due to the noise of one gyro reading; the process noise of the bias's
    walk in a control period in the covariances of attitude, attitude with bias, and bias. The inverse covariances of the
    attitudes of several trackers (1/rad2). The largest standard deviation of a valid attitude (rad). The directions that
    are used, () for none."""

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
    """The attitude at the last control step, the bias and the gyro's reading then (rad/s), the block covariance of the
    errors of attitude (rad, body axes) and bias, the phase (0 before the first reading, 1 before the first attitude, 2
    after it), and the number of the control step, () if nothing depends on it.

    Half the noise of that reading has turned the attitude in the previous period, and half will turn it in the next. A new
    attitude corrects this noise too, because the stored attitude and its error exclude half a period of it.
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
    """The gains on a residual for the attitude, the stored attitude and the bias; and their common factor, which for a new
    attitude is the inverse covariance of the innovation (1/rad2)."""

    turn: Matrix
    ahead: Matrix
    bias: Matrix
    common: Matrix


class Correction(NamedTuple):
    """The gains for the residual of an attitude, which give the new covariances; those for the actual residual, and this."""

    whole: Gains
    gain: Gains
    off: Vector


class Instant(NamedTuple):
    """The attitude at a control step, the covariance of its error, the estimated noise of the gyro's reading (rad/s), and
    the memory."""

    attitude: Quaternion
    turn: Matrix
    noise: Vector
    memory: Memory


def arrived(before: Memory, params: Numbers) -> Instant:
    """Return the estimate at a control step before its correction."""
    ahead = along_diagonal(before.turn, 3.0 * params.reading)
    return Instant(before.attitude, before.turn, ZERO, before._replace(turn=ahead))


def taken(now: Instant, measured: Quaternion, params: Numbers) -> Instant:
    """Return the estimate with the first attitude: its error is independent of the bias and of the gyro's noise."""
    ahead = along_diagonal(params.tracker, params.reading)
    memory = now.memory._replace(attitude=measured, turn=ahead, mixed=(ZERO, ZERO, ZERO))
    return Instant(measured, params.tracker, ZERO, memory)


def correction(now: Instant, heads: list[Head], pairs: list[Pair], params: Numbers) -> Correction:
    """Return the gains for all measurements of a control step at once, which is equivalent to one after the other."""
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
    """Return the estimate of attitude, bias and noise, corrected by the measurements."""
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
    """Return the gains with this common factor."""
    ahead, bias = product(twice_read(now, params), common), product(transpose(now.memory.mixed), common)
    return Gains(product(now.turn, common), ahead, bias, common)


def twice_read(now: Instant, params: Numbers) -> Matrix:
    """Return the cross-covariance of the stored and the present attitude, which has the noise of the reading twice."""
    return along_diagonal(now.turn, params.reading)


def propagated(memory: Memory, rate: Vector, params: Numbers, period: Scalar) -> Memory:
    """Return the estimate propagated by a control period: the rate between two gyro readings is their mean."""
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
    """Return the rotation of a body in a control period, and the transition matrices of the errors of attitude and bias."""
    turn = short_turn(scale(0.5 * period, rate))
    axes = from_quaternion(turn)
    # d(error)/dt = -w x error - error of the bias, over the period.
    return turn, axes, combine(-0.5 * period, axes, -0.5 * period, IDENTITY)
