"""The motion with which the predictive law plans: linearised about the measurement, and sampled with a held torque."""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce
from typing import NamedTuple

from starhold.algebra.scalar import (
    Scalar,
    Truth,
    absolute,
    both,
    divide,
    less,
    less_equal,
    maximum,
    minimum,
    opposite,
    sqrt,
    where,
)
from starhold.algebra.structured import Buffer, Index, repeat, until
from starhold.algebra.vector import IDENTITY, Matrix, Vector, apply, cross, dot, scale, skew, subtract, transpose
from starhold.laws.interface import Measurement
from starhold.laws.predictive import sixes
from starhold.laws.predictive.problem import Problem, Store, carve
from starhold.laws.predictive.sixes import Numbers, Rows, transposed
from starhold.parts.craft import Craft, total_inertia

TERMS = 30
"""Most terms of the Taylor series; it ends earlier once terms are negligible."""
NEGLIGIBLE = 1e-21
"""The size of a term's entries below which the series ends."""
DOUBLINGS = 60
"""Most halvings of the time, and doublings afterwards."""


class Linear(NamedTuple):
    """The motion x' = A x + B u for small x = (q; w) about the measured motion, in blocks of three: A = [[turning, E/2],
    [stiffness, damping]], B = [0; push]."""

    turning: Matrix
    stiffness: Matrix
    damping: Matrix
    push: Matrix


def linearise(measurement: Measurement, craft: Craft) -> Linear:
    """Return the motion linearised about the measurement (SI units).

    A = [[-[w]x, E/2], [J^-1 G, J^-1 ([Jw]x - [w]x J)]], B = [0; J^-1], G = 6 (mu/R^5) ([R]x J - [JR]x) [R]x with R the
    position relative to the centre of attraction in body axes; G = 0 if there is none (R = 0)."""
    w, position = measurement.rate, measurement.position
    momentum, pull = apply(craft.inertia, w), apply(total_inertia(craft), position)
    square = dot(position, position)
    strength = divide(6.0 * craft.gravity, square * square * sqrt(square))
    strength = where(less(0.0, square), strength, 0.0)

    def stiffness(e: Vector) -> Vector:
        lever = cross(position, e)
        tilt = subtract(cross(position, apply(total_inertia(craft), lever)), cross(pull, lever))
        return scale(strength, apply(craft.inverse_inertia, tilt))

    def damping(e: Vector) -> Vector:
        return apply(craft.inverse_inertia, subtract(cross(momentum, e), cross(w, apply(craft.inertia, e))))

    return Linear(
        transpose(skew(w)),
        _by_columns(stiffness),
        _by_columns(damping),
        _by_columns(lambda e: apply(craft.inverse_inertia, e)),
    )


def _by_columns(column: Callable[[Vector], Vector]) -> Matrix:
    """Return the matrix of a linear function."""
    e0, e1, e2 = IDENTITY
    return transpose((column(e0), column(e1), column(e2)))


class Rates(NamedTuple):
    """The blocks of A of `Linear` times some time: [[turning, half E], [stiffness, damping]]."""

    turning: Matrix
    half: Scalar
    stiffness: Matrix
    damping: Matrix


def sample(problem: Problem, linear: Linear, period: Scalar) -> None:
    """Sample exactly with a held input: A = exp(A h), B = (integral of exp(A s) over 0..h) B of the problem.

    Both come from S = sum of (A h)^k / (k + 1)!, which loses no digits where A is singular."""
    # Time is counted in periods, so that all entries of A and S have comparable size.
    square = period * period
    rates = Rates(_scaled(linear.turning, period), 0.5, _scaled(linear.stiffness, square), _scaled(linear.damping, period))
    share, doublings = _share(rates)
    store = carve(problem)
    mean, term = store.mean, store.term
    _sum_up(_during(rates, share), mean, term)

    def over(_share: Scalar, left: Scalar) -> Truth:
        return less_equal(left, 0.0)

    def double(share: Scalar, left: Scalar) -> tuple[Scalar, Scalar]:
        _double(_during(rates, share), mean, term)
        return 2.0 * share, left - 1.0

    until(over, double, share, doublings, at_most=DOUBLINGS)
    _put_motion(store, rates, _scaled(linear.push, square), period)


def _put_motion(store: Store, rates: Rates, push: Matrix, period: Scalar) -> None:
    """Set A and B from S, converted back to seconds."""
    columns = [store.mean.row(j, 6) for j in range(6)]
    a = transposed(tuple(_product(rates, column) for column in columns))
    a = tuple(tuple(1.0 + x if i == j else x for j, x in enumerate(row)) for i, row in enumerate(a))
    # The input acts only on the rates, which are the last three.
    b = [tuple(sixes.dot(row[3:], column) for column in transpose(push)) for row in transposed(tuple(columns))]
    per = divide(1.0, period)
    upper = [(*row[:3], *_times(row[3:], period)) for row in a[:3]]
    lower = [(*_times(row[:3], per), *row[3:]) for row in a[3:]]
    rows = (*upper, *lower, *b[:3], *(_times(row, per) for row in b[3:]))
    store.motion.put(0, [x for row in rows for x in row])


def _scaled(m: Matrix, c: Scalar) -> Matrix:
    return (scale(c, m[0]), scale(c, m[1]), scale(c, m[2]))


def _times(row: Numbers, c: Scalar) -> Numbers:
    return tuple(x * c for x in row)


def _during(rates: Rates, share: Scalar) -> Rates:
    """Return the rates times that share of the time."""
    return Rates(
        _scaled(rates.turning, share), rates.half * share, _scaled(rates.stiffness, share), _scaled(rates.damping, share)
    )


def _share(rates: Rates) -> tuple[Scalar, Scalar]:
    """Return the share of the period, halved until no row's absolute sum exceeds 1, and the number of halvings."""
    size = 0.0
    for row in _rows(rates):
        total = 0.0
        for x in row:
            total = total + absolute(x)
        size = maximum(total, size)

    def fits(size: Scalar, _share: Scalar, _count: Scalar) -> Truth:
        return opposite(less(1.0, size))

    def halve(size: Scalar, share: Scalar, count: Scalar) -> tuple[Scalar, Scalar, Scalar]:
        return 0.5 * size, 0.5 * share, count + 1.0

    _, share, count = until(fits, halve, size, 1.0, 0.0, at_most=DOUBLINGS)
    return share, count


def _rows(rates: Rates) -> Rows:
    """Return the whole matrix."""
    t, h = rates.turning, rates.half
    return (
        (0.0, t[0][1], t[0][2], h, 0.0, 0.0),
        (t[1][0], 0.0, t[1][2], 0.0, h, 0.0),
        (t[2][0], t[2][1], 0.0, 0.0, 0.0, h),
        *((*left, *right) for left, right in zip(rates.stiffness, rates.damping, strict=True)),
    )


def _product(rates: Rates, x: Numbers) -> Numbers:
    """Return the matrix times a column, without multiplying its zero blocks."""
    t, h = rates.turning, rates.half
    return (
        sixes.dot((t[0][1], t[0][2], h), (x[1], x[2], x[3])),
        sixes.dot((t[1][0], t[1][2], h), (x[0], x[2], x[4])),
        sixes.dot((t[2][0], t[2][1], h), (x[0], x[1], x[5])),
        *(sixes.dot(row, x) for row in _rows(rates)[3:]),
    )


def _sum_up(rates: Rates, mean: Buffer, term: Buffer) -> None:
    """Write the sum of A^k / (k + 1)! from k = 0 on into `mean`, column by column."""
    for j, column in enumerate(transposed(_rows(rates))):
        first = _times(column, 0.5)
        term.put(j, first)
        mean.put(j, [1.0 + x if i == j else x for i, x in enumerate(first)])

    def over(_divisor: Scalar, small: Truth) -> Truth:
        return small

    def add_term(divisor: Scalar, _small: Truth) -> tuple[Scalar, Truth]:
        def column(j: Index, small: Truth) -> tuple[Truth]:
            entries = tuple(divide(x, divisor) for x in _product(rates, term.row(j, 6)))
            term.put(j, entries)
            mean.put(j, sixes.plus(mean.row(j, 6), entries))
            largest, least = reduce(maximum, entries), reduce(minimum, entries)
            return (both(small, both(less(largest, NEGLIGIBLE), less(-NEGLIGIBLE, least))),)

        (small,) = repeat(6, column, True)
        return divisor + 1.0, small

    until(over, add_term, 3.0, False, at_most=TERMS - 2)


def _double(rates: Rates, mean: Buffer, term: Buffer) -> None:
    """Double the time: S becomes (S + exp(A) S) / 2 when each is divided by its own time."""

    def turn(j: Index) -> None:
        term.put(j, _product(rates, mean.row(j, 6)))

    repeat(6, turn)
    turned = transposed(tuple(term.row(j, 6) for j in range(6)))

    def column(j: Index) -> None:
        before = mean.row(j, 6)
        mean.put(j, [s + 0.5 * y for s, y in zip(before, sixes.apply(turned, before), strict=True)])

    repeat(6, column)
