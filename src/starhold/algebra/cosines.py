"""Direction cosines take reference axes to body axes; Tait-Bryan angles serve for input and plots.

Tait-Bryan (3-2-1) angles are yaw, pitch, roll: turns about the third, the new second, the new first axis.
Trigonometric functions appear only in the angle conversions, which are never part of a simulation step.
"""

from __future__ import annotations

import math

from starhold.algebra.quaternion import Quaternion, multiply, normalise
from starhold.algebra.scalar import less, where
from starhold.algebra.vector import Matrix, Vector


def from_quaternion(q: Quaternion) -> Matrix:
    """Return the matrix A with R_body = A r_reference. Its rows are the body axes in reference components."""
    return (
        (
            q[0] * q[0] + q[1] * q[1] - q[2] * q[2] - q[3] * q[3],
            2.0 * (q[1] * q[2] + q[0] * q[3]),
            2.0 * (q[1] * q[3] - q[0] * q[2]),
        ),
        (
            2.0 * (q[1] * q[2] - q[0] * q[3]),
            q[0] * q[0] - q[1] * q[1] + q[2] * q[2] - q[3] * q[3],
            2.0 * (q[2] * q[3] + q[0] * q[1]),
        ),
        (
            2.0 * (q[1] * q[3] + q[0] * q[2]),
            2.0 * (q[2] * q[3] - q[0] * q[1]),
            q[0] * q[0] - q[1] * q[1] - q[2] * q[2] + q[3] * q[3],
        ),
    )


def _choose(condition: bool, a: Quaternion, b: Quaternion) -> Quaternion:
    return (
        where(condition, a[0], b[0]),
        where(condition, a[1], b[1]),
        where(condition, a[2], b[2]),
        where(condition, a[3], b[3]),
    )


def to_quaternion(a: Matrix) -> Quaternion:
    """Return the quaternion of a rotation matrix, from the largest of its four squared components (Shepperd's method).

    Accurate at every attitude, 180 degrees included. The largest component of the result is positive."""
    trace = a[0][0] + a[1][1] + a[2][2]
    x, y, z = a[1][2] - a[2][1], a[2][0] - a[0][2], a[0][1] - a[1][0]
    xy, yz, zx = a[0][1] + a[1][0], a[1][2] + a[2][1], a[2][0] + a[0][2]
    scalar = (1.0 + trace, x, y, z)
    first = (x, 1.0 + 2.0 * a[0][0] - trace, xy, zx)
    second = (y, xy, 1.0 + 2.0 * a[1][1] - trace, yz)
    third = (z, zx, yz, 1.0 + 2.0 * a[2][2] - trace)
    largest = _choose(less(scalar[0], first[1]), first, scalar)
    size = where(less(scalar[0], first[1]), first[1], scalar[0])
    largest = _choose(less(size, second[2]), second, largest)
    size = where(less(size, second[2]), second[2], size)
    return normalise(_choose(less(size, third[3]), third, largest))


def from_angles(yaw: float, pitch: float, roll: float) -> Quaternion:
    """Return the quaternion of Tait-Bryan (3-2-1) angles (rad)."""

    def turn(axis: int, angle: float) -> Quaternion:
        s = math.sin(0.5 * angle)
        return (math.cos(0.5 * angle), s * (axis == 1), s * (axis == 2), s * (axis == 3))

    return multiply(multiply(turn(3, yaw), turn(2, pitch)), turn(1, roll))


def to_angles(q: Quaternion) -> Vector:
    """Return the Tait-Bryan (3-2-1) angles yaw, pitch, roll (rad) of a quaternion; at pitch = +-90 degrees roll is zero."""
    a = from_quaternion(q)
    pitch = math.asin(max(-1.0, min(1.0, -a[0][2])))
    if abs(a[0][2]) > 1.0 - 1e-14:
        return (math.atan2(-a[1][0], a[1][1]), pitch, 0.0)
    return (math.atan2(a[0][1], a[0][0]), pitch, math.atan2(a[1][2], a[2][2]))
