"""An attitude from two directions that move: one body axis points along the first, another as near to the second as it can.

A direction is given with its first and second derivative over time in inertial axes, so that the rate and the acceleration
of the attitude are exact."""

from __future__ import annotations

import math
from typing import NamedTuple

from starhold.algebra.cosines import to_quaternion
from starhold.algebra.quaternion import Quaternion, nearer
from starhold.algebra.scalar import Scalar, sqrt
from starhold.algebra.vector import Matrix, Vector, add, apply, cross, dot, multiply, norm, scale, subtract, transpose
from starhold.parts import sun
from starhold.parts.contract import Parameter
from starhold.parts.epoch import DAY, SIDEREAL
from starhold.parts.roles import Goal

AXIS = Parameter("1", shape=(3,), spread=False, text="body axis that points there")
OTHER = Parameter("1", shape=(3,), spread=False, text="body axis that points as near as it can to the second direction")
GRAVITY = Parameter("m^3/s^2", above=0.0, text="gravitational parameter of the body that it orbits")
"""The declaration of the axes, common to all targets."""
SPIN = math.tau * SIDEREAL / DAY
"""The rate of the Earth (rad/s)."""
FLATTENING, RADIUS = 1.0 / 298.257223563, 6378137.0
POLAR = RADIUS * (1.0 - FLATTENING)
"""The ellipsoid of WGS 84: its flattening, and its radii at the equator and the poles (m)."""


class Moving(NamedTuple):
    """A vector and its derivatives over time, inertial axes."""

    value: Vector
    first: Vector
    second: Vector


def body_axes(axis: Vector, other: Vector) -> Matrix:
    """The columns of the triad that `aligned` turns with, in body axes. ValueError for axes that do not span a plane."""
    if not norm(axis) > 0.0 or not norm(cross(axis, other)) > 1e-6 * norm(axis) * norm(other):
        raise ValueError("the two body axes must have directions, and different ones")
    z = scale(1.0 / norm(axis), axis)
    y = cross(z, other)
    y = scale(1.0 / norm(y), y)
    return transpose((cross(y, z), y, z))


def aligned(first: Moving, second: Moving, axes: Matrix, before: Quaternion) -> Goal:
    """The goal in which the first body axis of `axes` points along the first direction, the other as near to the second as
    it can; of the two quaternions the one nearer to `before`."""
    z = unit_of(first)
    y = unit_of(cross_of(z, second))
    x = cross_of(y, z)
    attitude = nearer(to_quaternion(multiply(axes, (x.value, y.value, z.value))), before)
    rate = (dot(y.first, z.value), dot(z.first, x.value), dot(x.first, y.value))
    acceleration = (_slope(y, z), _slope(z, x), _slope(x, y))
    return Goal(attitude, apply(axes, rate), apply(axes, acceleration))


def _slope(a: Moving, b: Moving) -> Scalar:
    """d(a'.b)/dt."""
    return dot(a.second, b.value) + dot(a.first, b.first)


def cross_of(a: Moving, b: Moving) -> Moving:
    """The vector product of two moving vectors."""
    first = add(cross(a.first, b.value), cross(a.value, b.first))
    middle = scale(2.0, cross(a.first, b.first))
    return Moving(cross(a.value, b.value), first, add(add(cross(a.second, b.value), middle), cross(a.value, b.second)))


def unit_of(a: Moving) -> Moving:
    """The direction of a moving vector; not defined where it is zero."""
    inverse = 1.0 / norm(a.value)
    unit = scale(inverse, a.value)
    growth = dot(unit, a.first)
    first = scale(inverse, subtract(a.first, scale(growth, unit)))
    more = dot(first, a.first) + dot(unit, a.second)
    second = subtract(a.second, add(scale(more, unit), scale(2.0 * growth, first)))
    return Moving(unit, first, scale(inverse, second))


def orbiting(position: Vector, velocity: Vector, gravity: Scalar) -> Moving:
    """A position in two-body motion."""
    square = dot(position, position)
    return Moving(position, velocity, scale(-gravity / (square * sqrt(square)), position))


def opposite_of(a: Moving) -> Moving:
    """The vector that points the other way."""
    return Moving(scale(-1.0, a.value), scale(-1.0, a.first), scale(-1.0, a.second))


STRIDE = 600.0
"""The step over which the Sun's motion is differenced (s), with an error of its rate of 1e-15 rad/s."""


def towards_sun(time: Scalar, params: sun.Numbers) -> Moving:
    """The direction of the Sun at a time (s) after the start."""
    before, now, after = (sun.sun(time + stride, params).direction for stride in (-STRIDE, 0.0, STRIDE))
    first = scale(0.5 / STRIDE, subtract(after, before))
    second = scale(1.0 / STRIDE**2, subtract(add(after, before), scale(2.0, now)))
    return Moving(now, first, second)


def geodetic(latitude: float, longitude: float, height: float) -> tuple[Vector, Vector]:
    """The place (m) and the vertical, in axes of the Earth, of a geodetic latitude and longitude (rad) and height (m) on the
    ellipsoid of WGS 84."""
    up = (math.cos(latitude) * math.cos(longitude), math.cos(latitude) * math.sin(longitude), math.sin(latitude))
    eccentric = FLATTENING * (2.0 - FLATTENING)
    across = RADIUS / math.sqrt(1.0 - eccentric * up[2] ** 2)
    place = ((across + height) * up[0], (across + height) * up[1], (across * (1.0 - eccentric) + height) * up[2])
    return place, up
