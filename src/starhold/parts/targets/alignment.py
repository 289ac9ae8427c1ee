"""An attitude from two directions that move: one body axis points along the first, another as near to the second as it can.

A direction is given with its first and second derivative over time in inertial axes, so that the rate and the acceleration
of the attitude are exact."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise, product
from typing import NamedTuple

from starhold.algebra.cosines import to_quaternion
from starhold.algebra.quaternion import Quaternion, nearer
from starhold.algebra.scalar import Scalar, sqrt
from starhold.algebra.vector import Matrix, Vector, add, apply, cross, dot, multiply, norm, scale, subtract, transpose
from starhold.parts import sun
from starhold.parts.contract import UNLIMITED, Motion, Orbit, Parameter
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


class Turning(NamedTuple):
    """Bounds on the turning of a direction: on its rate (rad/s), on its acceleration (rad/s2) across it, and on the unknown
    part of each. sides: bounds on the components of rate and acceleration along x and y of `bounded`, where known."""

    rate: float
    acceleration: float
    off_rate: float = 0.0
    off_acceleration: float = 0.0
    sides: tuple[float, float, float, float] | tuple[()] = ()


ROOM = 1.0 + 1e-7
"""The margin for floats of bounds."""
BANDS, SIDES = 64, 32
"""Bands of the sky over a place, and sides of a craft's course, for which motions are bounded."""


def bounded(first: Turning, second: Turning, sine: float) -> Motion:
    """Bounds of the motion of `aligned`, with directions z and s whose angle has at least this sine d, and the cosine c.

    With y = z x s/d and x = y x z the rates are w_x = -z'.y, w_y = z'.x and w_z = (s'.y + c w_x)/d. Their derivatives are
    -z''.y + w_y w_z, z''.x - w_x w_z and s''.y/d + 2 S (w_x + c w_z/d) + w_x w_y - c/d z''.y + 2 c/d w_y w_z, where S is the
    part of s' across y. What is not known is in these terms."""
    if not sine > 0.0:
        return UNLIMITED
    sine /= ROOM
    cosine, (n, m, _, lost, sides), (s, q, off, unknown, _) = math.sqrt(1.0 - sine * sine), first, second
    aside, about, bent_aside, bent_about = sides or (n, n, m, m)
    slope, both = cosine / sine, min(about * aside, 0.5 * n * n)
    spun = slope * about + s / sine
    swept = slope * both + s * aside / sine
    gained = q / sine + 2.0 * s * (about + slope * spun) + both + slope * bent_about + 2.0 * slope * swept
    tilted = min(math.hypot(bent_about + swept, bent_aside + spun * about), m + spun * n)
    more = 2.0 * (lost + unknown) / sine + 3.0 * off * (2.0 * (n + s) - off) / sine**2
    return Motion(math.hypot(n, spun), math.hypot(tilted, gained), off / sine, more)


def nadir(orbit: Orbit, least: float) -> Iterator[tuple[Turning, float]]:
    """Yield bounds of how the direction z to the centre of attraction moves, with its least sine of the angle to a
    direction s that is at least an angle from the orbit's plane, for cells of that angle b and of the one from z to s in
    the plane, t: the velocity is known, and the acceleration towards the centre. Of z' and z'' in the plane the part
    along x of `bounded` is cos b sin t/d, which is largest for the least b and the largest t, and that along y is sin
    b/d, for the largest b and the least t."""
    rate, bent, off = orbit.rate, orbit.acceleration, orbit.force / orbit.nearest
    highs = [least + (0.5 * math.pi - least) * k / SIDES for k in range(SIDES + 1)]
    turns = [0.5 * math.pi * k / SIDES for k in range(SIDES + 1)]

    def away(b: float, t: float) -> float:
        return math.sqrt(max(1.0 - (math.cos(b) * math.cos(t)) ** 2, 0.0))

    for (low, high), (near, far) in product(pairwise(highs), pairwise(turns)):
        sine = away(low, near)
        aside = math.cos(low) * math.sin(far) / (away(low, far) or 1.0)
        about = math.sin(high) / away(high, near)
        yield Turning(rate, bent, 0.0, off, (rate * aside, rate * about, bent * aside + off, bent * about + off)), sine


class Seen(NamedTuple):
    """A place is seen from a craft: how far it is at least (m), between which sines of its angle to the craft's vertical,
    and the most of that to its own; the speed of the craft, its part along the vertical, and that of the place (m/s); and
    the largest acceleration across the line (m/s2) with how much of it is not known. Speeds are at most so large."""

    distance: float
    least: float
    most: float
    low: float
    speed: float
    rising: float
    drift: float
    pull: float
    off: float

    def turning(self) -> Turning:
        """Bounds of the line's motion in any direction from the craft's course."""
        fast = self.speed + self.drift
        # The place moves along the ground, but for the flattening.
        along = self.speed * self.most + self.rising + self.drift * min(self.low + 0.01, 1.0)
        # Of a speed v the part along the line and that across it have a product of v^2/2 at most.
        bent = self.pull + min(2.0 * along * fast, fast * fast) / self.distance
        return Turning(fast / self.distance, bent / self.distance, 0.0, self.off / self.distance)

    def sides(self) -> Iterator[tuple[Turning, float]]:
        """Yield bounds of the line's motion, with the least sine of its angle to the orbit's normal, for directions between
        two angles to the course, whose parts along the course and along the normal are those of x and y."""
        (u, w, *_), D = (self.least, self.most), self.distance
        for k in range(SIDES):
            (ahead, aside), (less_ahead, most_aside) = (
                (math.cos(a), math.sin(a)) for a in (0.5 * math.pi * j / SIDES for j in (k, k + 1))
            )
            sine = math.sqrt(1.0 - (w * most_aside) ** 2)
            # Of an angle from 0 to a quarter turn, sine times cosine is largest in its middle.
            skew = 0.5 if aside <= ahead and less_ahead <= most_aside else max(ahead * aside, less_ahead * most_aside)
            shares = math.sqrt(1.0 - (u * less_ahead) ** 2), math.sqrt((1.0 - u * u) / (1.0 - (u * most_aside) ** 2))
            across, about, beside, along = (
                min(self.speed * share + self.rising, self.speed) + self.drift
                for share in (*shares, w * w * skew / sine, w * ahead)
            )
            fast = (self.speed + self.drift) ** 2
            bent, bent_aside, bent_about = (
                (self.pull + min(2.0 * along * x, fast) / D) / D for x in (across, beside, about)
            )
            yield Turning(across / D, bent, 0.0, self.off / D, (beside / D, about / D, bent_aside, bent_about)), sine


def lines_of_sight(orbit: Orbit, gravity: float, radius: float, lowest: float, turn: float) -> Iterator[Seen]:
    """Yield bounds of the line to a place that is at most so far from the centre (m) and moves as if about that (rad/s), in
    bands of the angle of the craft from the place's vertical, up to the lowest (rad); gravity: the gravitational parameter
    that the target knows. With the same angle at the craft, or at the place, a higher one is farther."""
    low, speed, force = orbit.nearest, orbit.speed, orbit.force
    eccentricity = max(low * speed**2 / orbit.gravity - 1.0, 0.0) + 1e-6
    rising = min(speed, eccentricity * math.sqrt(orbit.gravity / (low * (1.0 + eccentricity)))) if not force else speed
    off = force + abs(gravity - orbit.gravity) / low**2
    for k in range(BANDS):
        least, most = (radius * math.sin(lowest * j / BANDS) / low for j in (k, k + 1))
        distance = low * math.sqrt(max(1.0 - least * least, 0.0)) - radius * math.cos(lowest * k / BANDS)
        pull = orbit.gravity / low**2 * most + force + turn**2 * radius
        if not most < 1.0 or not distance > 0.0:
            distance, most = 0.0, 1.0
        low_by = math.sin(lowest * (k + 1) / BANDS)
        yield Seen(distance, least, most, low_by, speed, rising, turn * radius, pull, off)


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
