import math

import erfa
import numpy as np
import pytest

from starhold.parts.epoch import DAY, days_of
from starhold.parts.sun import EARTH, RADIUS, UNIT, Sun, in_view, prepared, sun

AU_PER_DAY = UNIT / DAY / 299792458.0
EPOCHS = ((2025.0, 1.0, 4.0, 0.0, 0.0, 0.0), (2026.0, 3.0, 20.0, 12.0, 0.0, 0.0), (2029.0, 8.0, 3.0, 5.0, 6.0, 7.0))


def test_direction_against_the_ephemeris_over_a_century():
    """As the Earth sees it, so with the aberration by its velocity, in the mean axes of date."""
    worst = 0.0
    for year in range(1950, 2050):
        numbers, days = prepared((float(year), 1.0, 1.0, 0.0, 0.0, 0.0)), np.arange(0.0, 365.0, 4.3)
        found = np.array([sun(time, numbers).direction for time in days * DAY])
        dates = days_of((float(year), 1.0, 1.0, 0.0, 0.0, 0.0)) + days + 69.2 / DAY
        heliocentric, barycentric = erfa.epv00(2451545.0, dates)
        seen = -heliocentric["p"] / np.linalg.norm(heliocentric["p"], axis=1)[:, None] + barycentric["v"] * AU_PER_DAY
        expected = np.einsum("nij,nj->ni", erfa.pmat06(2451545.0, dates), seen / np.linalg.norm(seen, axis=1)[:, None])
        worst = max(worst, np.linalg.norm(np.cross(found, expected), axis=1).max())
    assert math.radians(0.01) < worst < math.radians(0.011)


def test_direction_and_distance_against_the_ephemeris():
    # The Earth about the Sun by the series of ERFA, turned into the axes of date.
    for epoch in EPOCHS:
        numbers = prepared(epoch)
        for time in (0.0, 5e4, 30.0 * DAY):
            days = days_of(epoch) + time / DAY + 69.2 / DAY
            heliocentric, _ = erfa.epv00(2451545.0, days)
            expected = -erfa.pmat06(2451545.0, days) @ heliocentric["p"]
            found = sun(time, numbers)
            distance = np.linalg.norm(expected)
            assert found.distance == pytest.approx(distance, abs=1e-4)
            assert math.hypot(*found.direction) == pytest.approx(1.0, abs=1e-15)
            assert np.dot(found.direction, expected) > 0.0


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
    seen = sun(0.0, prepared(EPOCHS[1]))
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


def test_far_from_shadow():
    seen = Sun((1.0, 0.0, 0.0), 1.0)
    assert in_view((7e6, 0.0, 0.0), seen) == 1.0
    assert in_view((-7e6, 0.0, 0.0), seen) == 0.0
    assert in_view((0.0, 7e6, 0.0), seen) == 1.0
    edge = (-1.0, EARTH, 0.0)
    assert in_view(edge, seen) == pytest.approx(by_discs(np.array(edge), seen), abs=1e-3)
