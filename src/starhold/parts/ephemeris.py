"""Series for Sun and Moon, accurate to a thousandth of a degree, for parts that select them.

The Sun's longitude is that of VSOP87 (Bretagnon and Francou 1988) with the terms above 0.3", minus the aberration; its
latitude, below 1.2", is neglected. The Moon's position is that of Meeus, Astronomical Algorithms, chapter 47, without light
time, after ELP-2000/82 (Chapront-Touze and Chapront 1983). Both refer to the mean equator and equinox of the epoch, which
are kept fixed. Quantities that change over decades have their value and rate at the epoch, which is accurate for flights of
up to a year.
"""

from __future__ import annotations

import cmath
from math import cos, radians, sin, tau
from typing import NamedTuple, TypeAlias

import numpy as np

from starhold.algebra.circular import cosine_sine
from starhold.algebra.scalar import Scalar
from starhold.algebra.vector import Vector
from starhold.parts.contract import Parameter
from starhold.parts.epoch import DAY, Date, days_of

EPHEMERIS = Parameter(
    choices=("almanac", "precise"),
    text="how Sun and Moon move: short formulas, to 0.011 and 0.4 deg, or series, to 1e-3 deg; scenarios give it by "
    "ephemeris in [orbit]",
    shared="orbit.ephemeris",
)
"""The declaration of the choice, common to all parts; a scenario gives it to all of them."""
SOURCES = ("VSOP87 (Bretagnon and Francou 1988), ELP-2000/82 (Chapront-Touze and Chapront 1983) with `precise`",)
CENTURY = 36525.0
Turning: TypeAlias = tuple[Scalar, Scalar]
"""Cosine and sine of an angle."""
_LATE = ((1950, 29.2), (1960, 33.2), (1972, 42.2), (1980, 50.8), (1990, 57.0), (1999, 64.2), (2006, 65.2), (2017, 69.2))
"""Years, and the lead (s) of Terrestrial Time over UTC in them; constant after the last."""
_PRECESSION = 5028.796195 / 3600.0
"""General precession in longitude, degrees per century."""
_ABERRATION = 20.49552 / 1296000.0
"""Aberration at one astronomical unit, in turns."""
_MILLENNIUM = 10.0 * CENTURY * DAY
# Amplitude (1e-8 rad), phase at J2000 (rad) and rate (rad per millennium). The first two are polynomials in time.
_SUN = """3341656 4.6692568 6283.07585, 34894 4.6261 12566.1517, 3497 2.7441 5753.3849, 3418 2.8289 3.5231,
3136 3.6277 77713.7715, 2676 4.4181 7860.4194, 2343 6.1352 3930.2097, 1324 0.7425 11506.7698, 1273 2.0371 529.691,
1199 1.1096 1577.3435, 990 5.233 5884.927, 902 2.045 26.298, 857 3.508 398.149, 780 1.179 5223.694, 753 2.533 5507.553,
505 4.583 18849.228, 492 4.205 775.523, 357 2.92 0.067, 317 5.849 11790.629, 284 1.899 796.298, 271 0.315 10977.079,
243 0.345 5486.778, 206 4.806 2544.314, 205 1.869 5573.143, 202 2.458 6069.777, 156 0.833 213.299, 132 3.411 2942.463,
126 1.083 20.775"""
_GROWING = (((206059.0, 2.678235), (8720.0, 1.0721)), ((4303.0, 2.6351), (309.0, 0.867)))
_SLOW = 1000.0
"""Terms below this rate (rad per millennium) have their value and rate at the epoch."""
# Multiples of elongation, the Sun's and the Moon's anomaly and the argument of latitude; 1e-6 deg and m, or 1e-6 deg.
_PLACE = """0 0 1 0 6288774 -20905355, 2 0 -1 0 1274027 -3699111, 2 0 0 0 658314 -2955968, 0 0 2 0 213618 -569925,
0 1 0 0 -185116 48888, 0 0 0 2 -114332 -3149, 2 0 -2 0 58793 246158, 2 -1 -1 0 57066 -152138, 2 0 1 0 53322 -170733,
2 -1 0 0 45758 -204586, 0 1 -1 0 -40923 -129620, 1 0 0 0 -34720 108743, 0 1 1 0 -30383 104755, 2 0 0 -2 15327 10321,
0 0 1 2 -12528 0, 0 0 1 -2 10980 79661, 4 0 -1 0 10675 -34782, 0 0 3 0 10034 -23210, 4 0 -2 0 8548 -21636,
2 1 -1 0 -7888 24208, 2 1 0 0 -6766 30824, 1 0 -1 0 -5163 -8379, 1 1 0 0 4987 -16675, 2 -1 1 0 4036 -12831,
2 0 2 0 3994 -10445, 4 0 0 0 3861 -11650, 2 0 -3 0 3665 14403, 0 1 -2 0 -2689 -7003, 2 0 -1 2 -2602 0,
2 -1 -2 0 2390 10056, 1 0 1 0 -2348 6322, 2 -2 0 0 2236 -9884, 0 1 2 0 -2120 5751, 0 2 0 0 -2069 0, 2 -2 -1 0 2048 -4950,
2 0 1 -2 -1773 4130, 2 0 0 2 -1595 0, 4 -1 -1 0 1215 -3958, 0 0 2 2 -1110 0, 3 0 -1 0 -892 3258, 2 1 1 0 -810 2616,
4 -1 -2 0 759 -1897, 0 2 -1 0 -713 -2117, 2 2 -1 0 -700 2354, 2 1 -2 0 691 0, 2 -1 0 -2 596 0, 4 0 1 0 549 -1423,
0 0 4 0 537 -1117, 4 -1 0 0 520 -1571, 1 0 -2 0 -487 -1739, 2 1 0 -2 -399 0, 0 0 2 -2 -381 -4421, 1 1 1 0 351 0,
3 0 -2 0 -340 0, 4 0 -3 0 330 0, 2 -1 2 0 327 0, 0 2 1 0 -323 1165, 1 1 -1 0 299 0, 2 0 3 0 294 0, 2 0 -1 -2 0 8752"""
_LATITUDE = """0 0 0 1 5128122, 0 0 1 1 280602, 0 0 1 -1 277693, 2 0 0 -1 173237, 2 0 -1 1 55413, 2 0 -1 -1 46271,
2 0 0 1 32573, 0 0 2 1 17198, 2 0 1 -1 9266, 0 0 2 -1 8822, 2 -1 0 -1 8216, 2 0 -2 -1 4324, 2 0 1 1 4200, 2 1 0 -1 -3359,
2 -1 -1 1 2463, 2 -1 0 1 2211, 2 -1 -1 -1 2065, 0 1 -1 -1 -1870, 4 0 -1 -1 1828, 0 1 0 1 -1794, 0 0 0 3 -1749,
0 1 -1 1 -1565, 1 0 0 1 -1491, 0 1 1 1 -1475, 0 1 1 -1 -1410, 0 1 0 -1 -1344, 1 0 0 -1 -1335, 0 0 3 1 1107, 4 0 0 -1 1021,
4 0 -1 1 833, 0 0 1 -3 777, 4 0 -2 1 671, 2 0 0 -3 607, 2 0 2 -1 596, 2 -1 1 -1 491, 2 0 -2 1 -451, 0 0 3 -1 439,
2 0 2 1 422, 2 0 -3 -1 421, 2 1 -1 1 -366, 2 1 0 1 -351, 4 0 0 1 331, 2 -1 1 1 315, 2 -2 0 -1 302, 0 0 1 3 -283,
2 1 1 -1 -229, 1 1 0 -1 223, 1 1 0 1 223, 0 1 -2 -1 -220, 2 1 -1 -1 -220, 1 0 1 1 -185, 2 -1 -2 -1 181, 0 1 2 1 -177,
4 0 -2 -1 176, 4 -1 -1 -1 166, 1 0 1 -1 -164, 4 0 1 -1 132, 1 0 -1 -1 -119, 4 -1 0 -1 115, 2 -2 0 1 107"""
# Degrees at J2000, per century, per century squared: the mean longitude, and the four angles.
_MEAN = (218.31665436, 481267.88123421, -0.0015786)
_ANGLES = (
    (297.8501921, 445267.1114034, -0.0018819),
    (357.5291092, 35999.0502909, -0.0001536),
    (134.9633964, 477198.8675055, 0.0087414),
    (93.2720950, 483202.0175233, -0.0036539),
)


def _rows(table: str) -> list[list[float]]:
    return [[float(number) for number in row.split()] for row in table.split(",")]


SUN, PLACE, LATITUDE = _rows(_SUN), _rows(_PLACE), _rows(_LATITUDE)
QUICK = [row for row in SUN[2:] if row[2] > _SLOW]


class Solar(NamedTuple):
    """The Sun at the epoch: mean longitude (turns) and its rate (turns/s), the two largest terms (turns), the angles of the
    terms (turns), and cosine and sine of the obliquity."""

    mean: Scalar
    rate: Scalar
    sizes: tuple[Scalar, ...]
    angles: tuple[Scalar, ...]
    cosine: Scalar
    sine: Scalar


class Lunar(NamedTuple):
    """The Moon at the epoch: mean longitude (turns), the angles (turns), the factor of the Sun's anomaly; for planetary
    terms the factors (deg) of cosine and sine of the mean longitude, in longitude and in latitude, and of the cosine of the
    argument of latitude; cosine and sine of the obliquity."""

    mean: Scalar
    angles: tuple[Scalar, ...]
    eccentricity: Scalar
    along: Turning
    across: Turning
    level: Scalar
    cosine: Scalar
    sine: Scalar


def centuries_of(epoch: Date) -> float:
    """Return the Julian centuries of Terrestrial Time since J2000."""
    days = days_of(epoch)
    years, late = zip(*_LATE, strict=True)
    return (days + float(np.interp(2000.0 + days / 365.25, years, late)) / DAY) / CENTURY


def slope_of(centuries: float) -> tuple[float, float]:
    """Return cosine and sine of the mean obliquity (IAU 2006)."""
    slope = radians((84381.406 - 46.836769 * centuries) / 3600.0)
    return cos(slope), sin(slope)


def solar(epoch: Date) -> Solar:
    """Return the numbers of the Sun for a flight that begins at an epoch (UTC)."""
    centuries = centuries_of(epoch)
    t = centuries / 10.0
    mean = 175347046.0 + 628331966747.0 * t + 52919.0 * t * t
    rate = 628331966747.0 + 2.0 * 52919.0 * t
    for size, begin, speed in SUN[2:]:
        if speed <= _SLOW:
            mean += size * cos(begin + speed * t)
            rate -= size * speed * sin(begin + speed * t)
    leading = [
        sum((cmath.rect(size * t**k, begin) for k, (size, begin) in enumerate(more, 1)), cmath.rect(*row[:2]))
        for row, more in zip(SUN, _GROWING, strict=False)
    ]
    begun = [*map(cmath.phase, leading), *(begin for _, begin, _ in QUICK)]
    speeds = [speed for _, _, speed in (*SUN[:2], *QUICK)]
    return Solar(
        (0.5 + 1e-8 * mean / tau) % 1.0,
        1e-8 * rate / (tau * _MILLENNIUM) - _PRECESSION / (360.0 * CENTURY * DAY),
        tuple(1e-8 / tau * abs(one) for one in leading),
        tuple(((begin + speed * t) / tau) % 1.0 for begin, speed in zip(begun, speeds, strict=True)),
        *slope_of(centuries),
    )


def sun_at(time: Scalar, params: Solar) -> tuple[Vector, Scalar]:
    """Return the unit vector from the Earth to the apparent Sun, and its distance (astronomical units), at a time (s) after
    the start."""
    speeds = [speed for _, _, speed in (*SUN[:2], *QUICK)]
    turns = [begin + speed / (tau * _MILLENNIUM) * time for begin, speed in zip(params.angles, speeds, strict=True)]
    # The first angle is the anomaly minus a quarter turn.
    c, s = cosine_sine(turns[0])
    sizes = [params.sizes[1], *(1e-8 / tau * size for size, _, _ in QUICK)]
    ahead = params.sizes[0] * c + sum(size * cosine_sine(turn)[0] for size, turn in zip(sizes, turns[1:], strict=True))
    distance = (1.00014 + 0.00014) + 0.01671 * s - 0.00028 * (s * s)
    x, along = cosine_sine(params.mean + params.rate * time + ahead - _ABERRATION / distance)
    return (x, params.cosine * along, params.sine * along), distance


def lunar(epoch: Date) -> Lunar:
    """Return the numbers of the Moon for a flight that begins at an epoch (UTC)."""
    t = centuries_of(epoch)
    mean, *angles = (a + (b + c * t) * t for a, b, c in (_MEAN, *_ANGLES))
    venus = radians(119.75 + 131.849 * t)
    jupiter, sidereal = (radians(a + b * t - mean) for a, b in ((53.09, 479264.290), (313.45, 481266.484)))
    return Lunar(
        ((mean + 0.003958 * sin(venus)) / 360.0) % 1.0,
        tuple((angle / 360.0) % 1.0 for angle in angles),
        1.0 - (0.002516 + 0.0000074 * t) * t,
        (0.000318 * sin(jupiter), 0.000318 * cos(jupiter)),
        (0.000382 * sin(sidereal), -0.002235 + 0.000382 * cos(sidereal)),
        0.00035 * sin(venus),
        *slope_of(t),
    )


def moon_at(time: Scalar, params: Lunar) -> Vector:
    """Return the Moon's position (m, inertial axes, from the Earth's centre) at a time (s) after the start."""
    per_second = 1.0 / (360.0 * CENTURY * DAY)
    mean = params.mean + (_MEAN[1] - _PRECESSION) * per_second * time
    units = [
        cosine_sine(begin + per_second * rate * time) for begin, (_, rate, _) in zip(params.angles, _ANGLES, strict=True)
    ]
    # Terms are scaled by the eccentricity factor of the Earth's orbit, once for each multiple of the Sun's anomaly.
    units[1] = params.eccentricity * units[1][0], params.eccentricity * units[1][1]
    known: dict[tuple[int, ...], Turning] = {(0, 0, 0, 0): (1.0, 0.0)}

    def turned(*multiples: int) -> Turning:
        """Return cosine and sine of a sum of multiples of the angles, in one step from a sum with a smaller multiple."""
        if multiples not in known:
            place = next(k for k in (3, 2, 1, 0) if multiples[k])
            sense = 1 if multiples[place] > 0 else -1
            fewer = tuple(m - sense if k == place else m for k, m in enumerate(multiples))
            c, s = units[place]
            step = (c, sense * s)
            known[multiples] = _both(turned(*fewer), step) if any(fewer) else step
        return known[multiples]

    c, s = cosine_sine(mean)
    node = _both((c, s), (units[3][0], -units[3][1]))[1]
    back, on = (_both((c, s), (units[2][0], sense * units[2][1]))[1] for sense in (-1.0, 1.0))
    ahead = 0.001962 * node + params.along[0] * c + params.along[1] * s
    above = params.across[0] * c + params.across[1] * s + params.level * units[3][0] + 0.000127 * back - 0.000115 * on
    distance = 385000560.0
    for *multiples, size, length in PLACE:
        cosine, sine = turned(*map(int, multiples))
        ahead = ahead + 1e-6 * size * sine
        distance = distance + length * cosine if length else distance
    for *multiples, size in LATITUDE:
        above = above + 1e-6 * size * turned(*map(int, multiples))[1]
    x, y = cosine_sine(mean + 1.0 / 360.0 * ahead)
    level, north = cosine_sine(1.0 / 360.0 * above)
    x, y, z = distance * (level * x), distance * (level * y), distance * north
    return (x, params.cosine * y - params.sine * z, params.sine * y + params.cosine * z)


def _both(a: Turning, b: Turning) -> Turning:
    """Return cosine and sine of the sum of two angles."""
    return a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]
