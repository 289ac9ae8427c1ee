"""The rotation vector of a quaternion, and the quaternion of a short one, by arithmetic alone: where laws and kernels have
no arc functions and no sines."""

from __future__ import annotations

from fractions import Fraction
from math import comb

from starhold.algebra.quaternion import Quaternion, vector_part
from starhold.algebra.scalar import absolute, minimum, side, sqrt
from starhold.algebra.vector import Vector, dot, scale

_TERMS = 20
"""The series of asin(x) / x is cut after so many, in x^2 <= sin(pi/8)^2: the rest is below 2^-55."""
_SERIES = tuple(float(Fraction(comb(2 * n, n), 4**n * (2 * n + 1))) for n in range(_TERMS))


def rotation_vector(q: Quaternion) -> Vector:
    """The axis of the rotation times its angle (rad), the shorter way: at most pi long. To a few units in the last place."""
    # Half the rotation, and half of that again: the half angle of what is left, a quarter of the first, is below pi/8.
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


def short_turn(half: Vector) -> Quaternion:
    """The quaternion of half a rotation vector (rad), with an error below |half|^7 / 5000: below rounding up to 0.02 rad."""
    square = dot(half, half)
    scalar = 1.0 - square * (0.5 - square * (1.0 / 24.0 - square * (1.0 / 720.0)))
    x, y, z = scale(1.0 - square * (1.0 / 6.0 - square * (1.0 / 120.0)), half)
    return (scalar, x, y, z)
