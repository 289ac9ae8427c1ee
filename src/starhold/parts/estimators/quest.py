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
from starhold.parts import directions, magnetic_field, sun, vectors
from starhold.parts.contract import Card, Direction, Errors, Noise, Parameter
from starhold.parts.craft import Craft
from starhold.parts.directions import APART, Estimate, Memory, attitude_at_start, fixed, measured_or_carried
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
ROUNDED = 1e-14
"""The error (rad) of the computed attitude over the square of the ratio of the largest to the least eigenvalue of F."""
STEPS = 8
"""Number of Newton steps from the sum of the weights down to the largest eigenvalue."""
remember, recursion = attitude_at_start, directions.recursion


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


def combined(params: Params, seen: tuple[Direction, ...]) -> tuple[Errors, Noise] | None:
    """Return errors and noise of the attitude from these directions, of which at least two are available that are `apart`;
    None for too large errors.

    Let r_i be the true unit vectors, b_i = r_i + d_i the measured ones, those of r_i + x_i, w_i the weights, and F = sum w
    (1 - r r'). Where the weighted sum of squares is least, sum w b x Rr = 0 for the rotation R by an angle T about a, or
    sin T F a + (1 - cos T)(sum w r r')a x a + sum w d x Rr = 0. Let E^2 = sum w |d|^2. Multiplied by a it gives sin T
    (a.F a)^(1/2) <= E, because |a x Rr| = |a x r| and a.F a = sum w |a x r|^2; and sin T/2 (a.F a)^(1/2) <= E, because the
    sum is no more than at T = 0, so that T is less than a quarter turn where 2 E^2 < f, the least eigenvalue of F. To the
    first order T a is e = F^-1 sum w r x x, of a norm of at most (sum w |x|^2/f)^(1/2), and of the covariance F^-1 for noise
    with the variances 1/w (Shuster and Oh, 1981), at most that times the largest ratio of variances.

    Beyond the first order: F has the eigenvalues f_1 <= f_2 <= f_3, with W = sum w = (f_1 + f_2 + f_3)/2, f_3 <= W and f_3 -
    f_2 <= f_1. (sum w r r')a x a has the components (f_2 - f_3) a_2 a_3, …, each over its f_k no more than |a_2 a_3|, …,
    while sin T |a_k| <= E/f_k^(1/2): with f_2 f_3 >= W^2/3 the second term is at most E^2 (6/f W)^(1/2)/(1 + cos T). The sum
    of w d x (Rr - r) is at most E^2/cos T/2, for |Rr - r| = 2 sin T/2 |a x r|; d is x across r but for |x|^2/(1 - |x|). For
    two directions alone 2f = W - (W^2 - 4 w_1 w_2 sin^2)^(1/2), and others make F larger. The last term is for rounding."""
    weigh = {kind: getattr(params, kind) ** -2.0 for kind in vectors.KINDS}
    given = [(weigh[one.of], one) for one in seen]
    squares, weakest, whole = [0.0, 0.0, 0.0], math.inf, math.inf
    for weight, one in given:
        if not one.most < 0.5:
            return None
        chord = (one.most, one.error, one.most**2 / (1.0 - one.most))
        squares = [square + weight * x * x for square, x in zip(squares, (math.asin(chord[0]), *chord[1:]), strict=True)]
    for (w, first), (v, second) in combinations(given, 2):
        angle = params.apart - math.asin(first.most) - math.asin(second.most)
        if angle <= 0.0:
            return None
        product = w * v * math.sin(angle) ** 2
        least = 2.0 * product / (w + v + math.sqrt((w + v) ** 2 - 4.0 * product))
        weakest, whole = min(weakest, least), min(whole, least * (w + v))
    large, steady, bent = (square / weakest for square in squares)
    if len(given) < 2 or not 2.0 * large < 1.0:
        return None
    sine = math.sqrt(large)
    angle, cosine = math.asin(sine), math.sqrt(1.0 - large)
    second = large * weakest * math.sqrt(6.0 / whole) / (1.0 + cosine) + large / math.cos(angle / 2.0)
    error = (
        math.sqrt(steady) + math.sqrt(bent) + second + (angle - sine) + ROUNDED * (sum(w for w, _ in given) / weakest) ** 2
    )
    return fixed(seen, error, math.sqrt(max(w * one.deviation**2 for w, one in given) / weakest))


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
