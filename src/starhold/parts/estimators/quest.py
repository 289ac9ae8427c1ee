"""The attitude of best weighted fit to the directions of Sun, magnetic field and the Earth's centre; the gyro propagates it
while fewer than two are available."""

from __future__ import annotations

import math
from functools import reduce
from itertools import combinations
from typing import Annotated, Any, NamedTuple

from starhold.algebra.quaternion import Quaternion, normalise, stretch
from starhold.algebra.scalar import Scalar, Truth, absolute, both, either, less, maximum, where
from starhold.algebra.structure import chosen
from starhold.algebra.vector import Vector, cross, determinant, dot, scale
from starhold.parts import magnetic_field, sun, vectors
from starhold.parts.contract import Card, Parameter
from starhold.parts.craft import Craft
from starhold.parts.directions import APART, Estimate, Memory, attitude_at_start, measured_or_carried
from starhold.parts.ephemeris import EPHEMERIS
from starhold.parts.epoch import EPOCH, START, Date
from starhold.parts.vectors import TINY, Known, Pair, known_from, pairs_of

CARD = Card(
    title="QUEST",
    summary="q the eigenvector of Davenport's K to its largest eigenvalue, weights 1/deviation^2",
    sources=(
        "Three-Axis Attitude Determination from Vector Observations (1981)",
        "Fundamentals of Spacecraft Attitude Determination and Control (2014): Davenport's K, Newton's method",
        *sun.SOURCES,
        magnetic_field.SOURCE,
    ),
    assumptions=(
        *magnetic_field.ASSUMPTIONS,
        "errors of directions are independent, alike about every axis across them, and of the deviations assumed",
        "the gyro's bias is small while fewer than two directions are there",
    ),
)
ROLE = "estimator"
ABOUT = "Earth"
NEEDS = ("sun", "sun_is_seen", "magnetic_field", "position", "rate")
SEVERAL = vectors.SEVERAL
FIRST = {"attitude_age": 0.0, "is_valid": 0.0}
STEPS = 8
"""Number of Newton steps from the sum of the weights down to the largest eigenvalue."""
remember = attitude_at_start


class Params(NamedTuple):
    """The epoch, the standard deviations of directions that give the weights, and the least angle between two of them."""

    epoch: Annotated[Date, EPOCH] = START
    sun: Annotated[float, Parameter("rad", above=0.0, text="assumed standard deviation")] = math.radians(0.5)
    field: Annotated[float, Parameter("rad", above=0.0, text="assumed standard deviation")] = math.radians(1.0)
    nadir: Annotated[float, Parameter("rad", above=0.0, text="assumed standard deviation")] = math.radians(0.5)
    apart: Annotated[float, APART] = math.radians(5.0)
    ephemeris: Annotated[int, EPHEMERIS] = 0


class Numbers(NamedTuple):
    """The three kinds of direction, and the squared sine of the least angle."""

    known: Known
    sine_squared: Scalar


def prepare(params: Params, period: float) -> Numbers:
    """Return the numbers of a flight. Raise ValueError for an epoch at which the field is not known."""
    # Only ratios of weights matter; the largest is 1.
    least = min(params.sun, params.field, params.nadir)
    return Numbers(known_from(params, params.epoch, params.ephemeris, least), math.sin(params.apart) ** 2)


def estimate(readings: Any, memory: Memory, params: Numbers, craft: Craft, period: Scalar) -> tuple[Estimate, Memory]:
    """Return the best attitude from the available directions, else the one propagated by the gyro, and the new memory."""

    def observe(time: Scalar) -> tuple[Quaternion, Truth]:
        pairs = pairs_of(readings, time, params.known)
        clear = reduce(either, [_apart(*two, params.sine_squared) for two in combinations(pairs, 2)])
        return best(pairs, clear), clear

    return measured_or_carried(readings, memory, period, observe)


def _apart(one: Pair, other: Pair, sine_squared: Scalar) -> Truth:
    across = cross(one[1], other[1])
    return both(both(one[3], other[3]), less(sine_squared, dot(across, across)))


def best(pairs: list[Pair], clear: Truth) -> Quaternion:
    """Return the attitude (inertial to body) with the least weighted sum of squared residuals of the directions; the
    identity if it is not determined.

    The matrix K has the trace 0. Newton's method descends to the largest eigenvalue from the sum of the weights, an upper
    bound; the eigenvector is the longest column of the adjugate of K - eigenvalue."""
    weights = [where(there, weight, 0.0) for _, _, weight, there in pairs]
    columns = [scale(w, seen) for w, (seen, _, _, _) in zip(weights, pairs, strict=True)]
    b: Any = [[sum(c[i] * pair[1][j] for c, pair in zip(columns, pairs, strict=True)) for j in range(3)] for i in range(3)]
    trace = b[0][0] + b[1][1] + b[2][2]
    z = (b[1][2] - b[2][1], b[2][0] - b[0][2], b[0][1] - b[1][0])
    below = [(z[i], *(b[i][j] + b[j][i] - (trace if i == j else 0.0) for j in range(3))) for i in range(3)]
    k = chosen(clear, ((trace, *z), *below), UNTURNED)
    value = where(clear, sum(weights), 1.0)
    second, first, whole = _characteristic(k)
    for _ in range(STEPS):
        square = value * value
        height = (square + second) * square + first * value + whole
        value = value - height / (4.0 * square * value + 2.0 * second * value + first)
    rows = [[k[i][j] - (value if i == j else 0.0) for j in range(4)] for i in range(4)]
    adjugate: Any = [tuple(_cofactor(rows, i, j) for j in range(4)) for i in range(4)]
    longest, size = adjugate[0], absolute(adjugate[0][0])
    for i in range(1, 4):
        other = absolute(adjugate[i][i])
        longest, size = chosen(less(size, other), adjugate[i], longest), maximum(size, other)
    return normalise(stretch(1.0 / maximum(size, TINY), longest))


UNTURNED = ((1.0, 0.0, 0.0, 0.0), (0.0, -1.0 / 3.0, 0.0, 0.0), (0.0, 0.0, -1.0 / 3.0, 0.0), (0.0, 0.0, 0.0, -1.0 / 3.0))
"""The matrix K of three orthogonal directions at the identity attitude."""


def _characteristic(k: Any) -> Vector:
    """Return the coefficients of the quadratic, linear and constant terms of the characteristic polynomial of a symmetric
    4x4 matrix of trace 0."""
    minors = sum(k[i][i] * k[j][j] - k[i][j] * k[i][j] for i, j in combinations(range(4), 2))
    thirds = sum(_cofactor(k, i, i) for i in range(4))
    last = sum(k[0][j] * _cofactor(k, 0, j) for j in range(4))
    return minors, -thirds, last


def _cofactor(rows: Any, i: int, j: int) -> Scalar:
    x, y, z = (tuple(row[k] for k in range(4) if k != j) for place, row in enumerate(rows) if place != i)
    minor = determinant((x, y, z))
    return minor if (i + j) % 2 == 0 else -minor


def examples() -> list[Params]:
    """Return the default epoch, and another one with a good Sun sensor."""
    return [Params(), Params((2027.0, 6.0, 21.0, 12.0, 30.0, 15.0), math.radians(0.05), apart=math.radians(20.0))]
