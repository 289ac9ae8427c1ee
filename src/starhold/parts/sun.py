"""The Sun: its direction and distance over time, and how much of it the Earth leaves in view."""

from __future__ import annotations

from math import cos, pi, radians, sin
from typing import NamedTuple, TypeAlias

from starhold.algebra.circular import cosine_sine
from starhold.algebra.rotation import rotation_vector
from starhold.algebra.scalar import Scalar, both, clip, less, maximum, sqrt, where
from starhold.algebra.structured import when
from starhold.algebra.vector import Vector, dot
from starhold.parts import ephemeris as series
from starhold.parts.epoch import DAY, Date, date_text, days_of
from starhold.parts.orbit import BODIES

SOURCES = ("The Astronomical Almanac: low-precision formulas for the Sun", *series.SOURCES)
ASSUMPTIONS = (
    "the Sun's direction, as the Earth sees it, to 0.011 deg from 1950 to 2050, or to 1e-3 deg by the precise ephemeris",
    "inertial axes of the equator and equinox of date",
)
SHADOW = "the Earth's shadow is that of a sphere without air, its edge straight across the Sun's disc"
"""Assumption on the cards of parts that use the shadow."""
UNIT = 1.495978707e11
"""The astronomical unit, m."""
PRESSURE = 1361.0 / 299792458.0
"""The pressure of sunlight on an absorbing surface, at one astronomical unit, N/m2 (Kopp and Lean 2011)."""
FASTEST, QUICKENING = 2.07e-7, 2e-15
"""Bounds on the rate of the Sun's direction (rad/s), 1.0193 deg per day at the perihelion, and on that rate's derivative
(rad/s2), for the almanac and the series."""
STEEPEST = radians(23.45)
"""An upper bound on the obliquity of the ecliptic (rad)."""
STRONGEST = PRESSURE / 0.983**2
"""This pressure at the perihelion, rounded up."""
RADIUS, EARTH = BODIES["Sun"].radius, BODIES["Earth"].radius
# Degrees at J2000, and degrees per day.
_LONGITUDE, _ANOMALY = (280.460, 0.9856474), (357.528, 0.9856003)


class Almanac(NamedTuple):
    """The Sun at the start: mean longitude and mean anomaly (turns), and cosine and sine of the obliquity."""

    longitude: Scalar
    anomaly: Scalar
    cosine: Scalar
    sine: Scalar


Numbers: TypeAlias = Almanac | series.Solar


class Sun(NamedTuple):
    """The unit vector from the Earth to the Sun, inertial axes, and the distance (astronomical units)."""

    direction: Vector
    distance: Scalar


def prepared(epoch: Date, ephemeris: int = 0) -> Numbers:
    """Return the numbers of the Sun for a flight that begins at an epoch (UTC), by the almanac or by precise series.

    Raise ValueError for an epoch that is no date, or not from 1950 to 2050."""
    days = days_of(epoch)
    if not 1950.0 <= epoch[0] <= 2050.0:
        raise ValueError(f"the Sun's place is known from 1950 to 2050, not at the epoch {date_text(epoch)}")
    if ephemeris:
        return series.solar(epoch)
    longitude, anomaly = (((at_j2000 + daily * days) / 360.0) % 1.0 for at_j2000, daily in (_LONGITUDE, _ANOMALY))
    slope = radians(23.439 - 4e-7 * days)
    return Almanac(longitude, anomaly, cos(slope), sin(slope))


def sun(time: Scalar, params: Numbers) -> Sun:
    """Return the Sun at a time (s) after the start."""
    if isinstance(params, series.Solar):
        return Sun(*series.sun_at(time, params))
    c, s = cosine_sine(params.anomaly + _ANOMALY[1] / (360.0 * DAY) * time)
    ahead = 1.915 * s + 0.040 * (s * c)
    x, along = cosine_sine(params.longitude + _LONGITUDE[1] / (360.0 * DAY) * time + (1.0 / 360.0) * ahead)
    # cos 2g = 2 c2 - 1.
    distance = (1.00014 + 0.00014) - 0.01671 * c - 0.00028 * (c * c)
    return Sun((x, params.cosine * along, params.sine * along), distance)


def in_view(position: Vector, seen: Sun) -> Scalar:
    """Return the visible share of the Sun's disc, from 0 to 1, at a position (m, inertial) outside the Earth.

    The Earth's edge is modelled as straight across the disc, which is much smaller: up to geostationary height this changes
    the share by less than 0.4 %."""
    square = dot(position, position)
    # In the form used by the Earth's attraction, so that a kernel computes it once.
    inverse = sqrt(1.0 / square)
    # Cosine and sine of the angle between the Sun and the Earth's centre, and of the Earth's angular radius.
    toward = -inverse * dot(position, seen.direction)
    across = sqrt(maximum(1.0 - toward * toward, 0.0))
    half = EARTH * inverse
    open_sky = sqrt(maximum(1.0 - half * half, 0.0))
    # The height of the Sun's centre above the edge, in radii of its disc: such small angles equal their sines.
    height = (across * open_sky - toward * half) * (seen.distance * (UNIT / RADIUS))
    # The Sun's direction is that from the Earth's centre.
    height = height - (1.0 / RADIUS) * across * (square * inverse)
    # If the Sun is on the other side, the sine of the distance from the edge is meaningless.
    height = where(less(toward, 0.0), 1.0, clip(height, 1.0))

    def cut(_: Scalar) -> tuple[Scalar]:
        return (_of_disc(height),)

    # A branch, because the edge is rarely in view.
    (share,) = when(both(less(height, 1.0), less(-1.0, height)), cut, 0.0)
    return where(less(height, 1.0), share, 1.0)


def _of_disc(height: Scalar) -> Scalar:
    """Return the share of a disc above a straight edge, for its centre's height above that in radii, from -1 to 1."""
    cosine = sqrt(maximum(1.0 - height * height, 0.0))
    arc = 0.5 * rotation_vector((cosine, height, 0.0, 0.0))[0]
    return 0.5 + (1.0 / pi) * (arc + height * cosine)


def pressure(seen: Sun) -> Scalar:
    """Return the pressure of sunlight on an absorbing surface, without shadow (N/m2)."""
    return PRESSURE / (seen.distance * seen.distance)
