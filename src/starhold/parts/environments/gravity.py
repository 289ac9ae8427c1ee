"""What surrounds the spacecraft: each function gives the acceleration of its centre of mass (inertial, m/s2) and the
external torque (body, N m) at a position and attitude. A scenario picks one of them."""

from __future__ import annotations

from starhold.algebra.quaternion import Quaternion, to_body
from starhold.algebra.scalar import Scalar, sqrt
from starhold.algebra.vector import ZERO, Vector, dot, gyroscopic_torque, scale
from starhold.parts.craft import Craft, total_inertia


def free_space(position: Vector, attitude: Quaternion, craft: Craft) -> tuple[Vector, Vector]:
    """No forces and no torques."""
    return ZERO, ZERO


def two_body(position: Vector, attitude: Quaternion, craft: Craft) -> tuple[Vector, Vector]:
    """Attraction by a point mass."""
    return scale(-_attraction(position, craft)[0], position), ZERO


def two_body_gravity_gradient(position: Vector, attitude: Quaternion, craft: Craft) -> tuple[Vector, Vector]:
    """Attraction by a point mass, and its torque 3 (mu/r5) R x J R on the body."""
    n2, inverse_square = _attraction(position, craft)
    return scale(-n2, position), gravity_gradient(to_body(attitude, position), 3.0 * n2 * inverse_square, craft)


def gravity_gradient(position: Vector, strength: Scalar, craft: Craft) -> Vector:
    """Gravity-gradient torque (N m) for the position in body axes (m) and strength 3 mu/r5 (1/(m2 s2))."""
    return scale(strength, gyroscopic_torque(total_inertia(craft), position))


def _attraction(position: Vector, craft: Craft) -> tuple[Scalar, Scalar]:
    """mu/r3 and 1/r2, with one division."""
    inverse_square = 1.0 / dot(position, position)
    return craft.gravity * inverse_square * sqrt(inverse_square), inverse_square
