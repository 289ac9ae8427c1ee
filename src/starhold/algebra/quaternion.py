"""Quaternions of unit length, scalar first, with the Hamilton product.

`q` takes reference (usually inertial) axes to body axes: a vector with reference components r has body components
R = q* r q. The quaternions q and -q are the same attitude.
"""

from __future__ import annotations

from typing import TypeAlias

from starhold.algebra.scalar import Scalar, side, sqrt
from starhold.algebra.vector import Vector, add, cross, dot, scale

Quaternion: TypeAlias = tuple[Scalar, Scalar, Scalar, Scalar]

NO_TURN: Quaternion = (1.0, 0.0, 0.0, 0.0)


def vector_part(q: Quaternion) -> Vector:
    """Return (q1, q2, q3)."""
    return (q[1], q[2], q[3])


def multiply(a: Quaternion, b: Quaternion) -> Quaternion:
    """Return the Hamilton product a b: first the rotation a, then the rotation b about the axes already rotated."""
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] + a[2] * b[0] + a[3] * b[1] - a[1] * b[3],
        a[0] * b[3] + a[3] * b[0] + a[1] * b[2] - a[2] * b[1],
    )


def conjugate(q: Quaternion) -> Quaternion:
    """Return the inverse rotation."""
    return (q[0], -q[1], -q[2], -q[3])


def stretch(c: Scalar, q: Quaternion) -> Quaternion:
    """Return c q."""
    return (c * q[0], c * q[1], c * q[2], c * q[3])


def normalise(q: Quaternion) -> Quaternion:
    """Return q / |q|; not defined at zero."""
    return stretch(1.0 / sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]), q)


def renormalise(q: Quaternion) -> Quaternion:
    """Restore a quaternion of nearly unit length by a Newton step: an error e of |q|^2 leaves 3/8 e^2 in |q|."""
    return stretch(1.5 - 0.5 * (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]), q)


def to_body(q: Quaternion, r: Vector) -> Vector:
    """Return body components of a vector given in reference axes, R = q* r q."""
    v = vector_part(q)
    t = scale(2.0, cross(r, v))
    return add(add(r, scale(q[0], t)), cross(t, v))


def to_reference(q: Quaternion, r: Vector) -> Vector:
    """Return reference components of a vector given in body axes, r = q R q*."""
    v = vector_part(q)
    t = scale(2.0, cross(v, r))
    return add(add(r, scale(q[0], t)), cross(v, t))


def derivative(q: Quaternion, rate: Vector) -> Quaternion:
    """Return dq/dt for the angular velocity `rate` (rad/s, body axes), q' = q (0, rate) / 2."""
    v = vector_part(q)
    d = scale(0.5, add(scale(q[0], rate), cross(v, rate)))
    return (-0.5 * dot(rate, v), d[0], d[1], d[2])


def relative(target: Quaternion, q: Quaternion) -> Quaternion:
    """Return the rotation from the target axes to the body axes, target* q; the identity when the attitudes agree."""
    return multiply(conjugate(target), q)


def nearer(q: Quaternion, other: Quaternion) -> Quaternion:
    """Return whichever of q and -q, the same attitude, is nearer to `other`."""
    return stretch(side(q[0] * other[0] + q[1] * other[1] + q[2] * other[2] + q[3] * other[3]), q)


def half_angle_sine(q: Quaternion) -> Scalar:
    """Return |sin(angle/2)|, the length of the vector part."""
    return sqrt(dot(vector_part(q), vector_part(q)))
