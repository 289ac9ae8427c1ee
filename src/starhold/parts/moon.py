"""The Moon's position over time."""

from __future__ import annotations

from math import cos, radians, sin
from typing import NamedTuple, TypeAlias

from starhold.algebra.circular import cosine_sine
from starhold.algebra.scalar import Scalar
from starhold.algebra.vector import Vector
from starhold.parts import ephemeris as series
from starhold.parts.epoch import DAY, Date, days_of
from starhold.parts.orbit import BODIES

SOURCES = ("The Astronomical Almanac: low-precision formulas for the Moon",)
ASSUMPTIONS = (
    "the Moon's direction, as the Earth sees it, to 0.4 deg from 1950 to 2050, or to 0.005 deg by the precise ephemeris",
)
EARTH = BODIES["Earth"].radius
CENTURY, LATE = 36525.0, 69.2
"""Days in a Julian century, and the lead of Terrestrial Time over UTC (s)."""
_MEAN = (218.32, 481267.881)
# Amplitude (deg), and each term's angle at J2000 (deg) and its rate (deg per century).
_LONGITUDE = (
    (6.29, 135.0, 477198.87),
    (-1.27, 259.3, -413335.36),
    (0.66, 235.7, 890534.22),
    (0.21, 269.9, 954397.74),
    (-0.19, 357.5, 35999.05),
    (-0.11, 186.5, 966404.03),
)
_LATITUDE = ((5.13, 93.3, 483202.02), (0.28, 228.2, 960400.89), (-0.28, 318.3, 6003.15), (-0.17, 217.6, -407332.21))
_PARALLAX = (0.0518, 0.0095, 0.0078, 0.0028)
"""Coefficients (deg) of the cosines of the longitude's first angles in the parallax, in addition to 0.9508 deg."""


class Almanac(NamedTuple):
    """The Moon at the start: mean longitude and angles of the terms of longitude and latitude (turns), and cosine and sine
    of the obliquity."""

    mean: Scalar
    longitude: tuple[Scalar, ...]
    latitude: tuple[Scalar, ...]
    cosine: Scalar
    sine: Scalar


Numbers: TypeAlias = Almanac | series.Lunar


def prepared(epoch: Date, ephemeris: int = 0) -> Numbers:
    """Return the numbers of the Moon for a flight that begins at an epoch (UTC), by the almanac's formulas or by precise
    series. Raise ValueError for an epoch that is no date."""
    if ephemeris:
        return series.lunar(epoch)
    days = days_of(epoch)
    centuries = (days + LATE / DAY) / CENTURY

    def begun(first: float, rate: float) -> float:
        return ((first + rate * centuries) / 360.0) % 1.0

    along, across = (tuple(begun(*term[1:]) for term in terms) for terms in (_LONGITUDE, _LATITUDE))
    slope = radians(23.439 - 4e-7 * days)
    return Almanac(begun(*_MEAN), along, across, cos(slope), sin(slope))


def position(time: Scalar, params: Numbers) -> Vector:
    """Return the Moon's position (m, inertial axes, from the Earth's centre) at a time (s) after the start."""
    if isinstance(params, series.Lunar):
        return series.moon_at(time, params)

    def angle(begin: Scalar, rate: float) -> Scalar:
        return begin + rate / (360.0 * CENTURY * DAY) * time

    along = [cosine_sine(angle(begin, rate)) for begin, (_, _, rate) in zip(params.longitude, _LONGITUDE, strict=True)]
    across = [cosine_sine(angle(begin, rate)) for begin, (_, _, rate) in zip(params.latitude, _LATITUDE, strict=True)]
    ahead = sum(term[0] / 360.0 * s for term, (_, s) in zip(_LONGITUDE, along, strict=True))
    x, y = cosine_sine(angle(params.mean, _MEAN[1]) + ahead)
    level, north = cosine_sine(sum(term[0] / 360.0 * s for term, (_, s) in zip(_LATITUDE, across, strict=True)))
    parallax = 0.9508 + sum(size * c for size, (c, _) in zip(_PARALLAX, along, strict=False))
    # Angles of about a degree equal their sines to 5e-5.
    distance = EARTH / (radians(1.0) * parallax)
    x, y = distance * (level * x), level * y
    return (x, distance * (params.cosine * y - params.sine * north), distance * (params.sine * y + params.cosine * north))
