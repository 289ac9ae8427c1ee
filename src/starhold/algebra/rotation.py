"""Conversions between quaternions, rotation vectors and modified Rodrigues parameters, by arithmetic alone."""

from __future__ import annotations

from fractions import Fraction
from math import comb

from starhold.algebra.quaternion import Quaternion, vector_part
from starhold.algebra.scalar import Scalar, absolute, minimum, side, sqrt
from starhold.algebra.vector import Vector, dot, scale

_TERMS = 20
"""Number of terms of the series of asin(x) / x; for x^2 <= sin(pi/8)^2 the remainder is below 2^-55."""
_SERIES = tuple(float(Fraction(comb(2 * n, n), 4**n * (2 * n + 1))) for n in range(_TERMS))


def rotation_vector(q: Quaternion) -> Vector:
    """Return the axis of the rotation times its angle (rad), at most pi, to a few units in the last place."""
    # Halving the rotation twice leaves a half angle below pi/8.
    cosine = minimum(absolute(q[0]), 1.0)
    half = sqrt(0.5 + 0.5 * cosine)
    quarter = sqrt(0.5 + 0.5 * half)
    # sin(a/2) = 4 sin(a/8) cos(a/8) cos(a/4).
    v = vector_part(q)
    shrink = 1.0 / (4.0 * half * quarter)
    square = shrink * shrink * dot(v, v)
    series = _SERIES[-1]
    for term in _SERIES[-2::-1]:
        series = series * square + term
    return scale(side(q[0]) * 8.0 * shrink * series, v)


def modified_rodrigues(q: Quaternion, factor: Scalar = 1.0) -> Vector:
    """Return the modified Rodrigues parameters, tan(angle/4) axis, of the turn below 180 degrees, times `factor`."""
    near = side(q[0])
    return scale(factor * near / (1.0 + near * q[0]), vector_part(q))


def short_turn(half: Vector) -> Quaternion:
    """Return the quaternion of half a rotation vector (rad). Its error, |half|^7 / 5000, is below rounding up to 0.02
    rad."""
    square = dot(half, half)
    scalar = 1.0 - square * (0.5 - square * (1.0 / 24.0 - square * (1.0 / 720.0)))
    x, y, z = scale(1.0 - square * (1.0 / 6.0 - square * (1.0 / 120.0)), half)
    return (scalar, x, y, z)
