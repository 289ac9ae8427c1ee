"""The Sun's place and the Earth's shadow, against ERFA's ephemeris and the discs on the sky."""

import math

import erfa
import numpy as np

from starhold.parts.epoch import DAY, days_of
from starhold.parts.sun import EARTH, RADIUS, UNIT, in_view, prepared, sun

AU_PER_DAY = UNIT / DAY / 299792458.0
EPOCH = (2026.0, 3.0, 20.0, 12.0, 0.0, 0.0)


def test_direction_and_distance_against_the_ephemeris_over_a_century():
    """As the Earth sees it, so with the aberration by its velocity, in the mean axes of date."""
    worst, off = 0.0, 0.0
    for year in map(float, range(1950, 2050, 3)):
        epoch, days = (year, 1.0, 1.0, 0.0, 0.0, 0.0), np.arange(0.0, 365.0, 4.3)
        found, distances = zip(*(sun(time, prepared(epoch)) for time in days * DAY), strict=True)
        dates = days_of(epoch) + days + 69.2 / DAY
        heliocentric, barycentric = erfa.epv00(2451545.0, dates)
        exact = np.linalg.norm(heliocentric["p"], axis=1)
        seen = -heliocentric["p"] / exact[:, None] + barycentric["v"] * AU_PER_DAY
        expected = np.einsum("nij,nj->ni", erfa.pmat06(2451545.0, dates), seen / np.linalg.norm(seen, axis=1)[:, None])
        worst = max(worst, np.linalg.norm(np.subtract(found, expected), axis=1).max())
        off = max(off, np.abs(distances - exact).max())
    assert math.radians(0.0095) < worst < math.radians(0.011)
    assert off < 1e-4


def by_discs(position, seen):
    """The share in view of two discs on the sky: their common area by the formula for circles."""
    to_sun = np.array(seen.direction) * seen.distance * UNIT - position
    distance = np.linalg.norm(position)
    a, b = math.asin(RADIUS / np.linalg.norm(to_sun)), math.asin(EARTH / distance)
    toward = np.linalg.norm(np.cross(-position, to_sun)), np.dot(-position, to_sun)
    c = math.atan2(*toward)
    if c >= a + b:
        return 1.0
    if c <= b - a:
        return 0.0
    x = (c * c + a * a - b * b) / (2.0 * c)
    y = math.sqrt(max(a * a - x * x, 0.0))
    hidden = a * a * math.acos(x / a) + b * b * math.acos((c - x) / b) - c * y
    return 1.0 - hidden / (math.pi * a * a)


def test_shadow_against_two_discs():
    seen = sun(0.0, prepared(EPOCH))
    side = np.cross(seen.direction, (0.0, 0.0, 1.0))
    side /= np.linalg.norm(side)
    for altitude, off in ((3e5, 5e-4), (2e6, 7e-4), (2.4e7, 3e-3), (3.6e7, 4e-3)):
        worst, partly = 0.0, 0
        edge = np.pi - math.asin(EARTH / (EARTH + altitude))
        for angle in np.concatenate([np.linspace(0.0, 2.0 * np.pi, 100), np.linspace(edge - 0.02, edge + 0.02, 801)]):
            position = (EARTH + altitude) * (math.cos(angle) * np.array(seen.direction) + math.sin(angle) * side)
            found, expected = in_view(tuple(position), seen), by_discs(position, seen)
            worst, partly = max(worst, abs(found - expected)), partly + (0.0 < expected < 1.0)
        assert partly > 30
        assert worst < off, (altitude, worst)
