import tracemalloc
from datetime import datetime

import erfa
import numpy as np
import ppigrf
import pytest

from starhold.parts.epoch import DAY, days_of, sidereal
from starhold.parts.magnetic_field import RADIUS, ROWS, earth_fixed, field, prepared, steepest, strongest, weakest
from starhold.trace.straight_line import evaluated, straight_line
from tests.parts.fields import reference

NEW_YEAR = (2025.0, 1.0, 1.0, 0.0, 0.0, 0.0)
ALTITUDE = 5e5


def places(count=400, seed=1):
    """Positions (m) all over a sphere, two beside the poles, where angles are hard, among them."""
    found = np.random.default_rng(seed).normal(size=(count, 3))
    found[0], found[1] = (1e-6, 0.0, 1.0), (0.0, 1e-6, -1.0)
    return (RADIUS + ALTITUDE) * found / np.linalg.norm(found, axis=1)[:, None]


def full_rows():
    g, h = ppigrf.ppigrf.read_shc()
    first, last = g.index.get_loc(datetime(2025, 1, 1)), g.index.get_loc(datetime(2030, 1, 1))
    return tuple(
        (n, m, g[n, m].iloc[first], h[n, m].iloc[first], *((c[n, m].iloc[last] - c[n, m].iloc[first]) / 5 for c in (g, h)))
        for n, m in g.columns
    )


def computed(positions, numbers):
    return np.array([earth_fixed(tuple(position), numbers) for position in positions.tolist()])


def test_what_rows_lack_is_zero_and_there_is_no_more_than_their_highest_degree():
    left_out = {(2, 1), (3, 0)}
    zeroed = tuple((n, m, *([0.0] * 4 if (n, m) in left_out else given)) for n, m, *given in ROWS)
    told = prepared(NEW_YEAR, rows=tuple(row for row in ROWS if row[:2] not in left_out))
    assert told == prepared(NEW_YEAR, rows=zeroed)
    highest = ROWS[-1][0]
    for numbers in told[:2]:
        assert list(map(len, numbers)) == [highest + 1 - max(m, 1) for m in range(highest + 1)]


def test_with_all_coefficients_it_is_the_field_of_ppigrf():
    for epoch in (NEW_YEAR, (2027.0, 7.0, 3.0, 18.0, 0.0, 0.0)):
        expected = reference(places(), datetime(*(int(part) for part in epoch)))
        found = computed(places(), prepared(epoch, rows=full_rows()))
        assert np.abs(found - expected).max() < 1e-12 * np.abs(expected).max()


def test_coefficients_are_those_of_the_model():
    given = {row[:2]: row[2:] for row in full_rows() if row[0] <= 8}
    assert {row[:2] for row in ROWS} == set(given)
    for n, m, *numbers in ROWS:
        assert numbers == pytest.approx(given[n, m], abs=1e-9)


def test_truncation_costs_a_fifth_of_a_percent():
    expected = reference(places(), datetime(2025, 1, 1))
    apart = np.linalg.norm(computed(places(), prepared(NEW_YEAR)) - expected, axis=1)
    rms = float(np.sqrt((apart**2).mean()))
    assert 40e-9 < rms < 70e-9
    assert apart.max() < 160e-9
    assert rms < 0.0022 * np.linalg.norm(expected, axis=1).mean()


def test_it_turns_with_the_earth():
    epoch = (2026.0, 3.0, 5.0, 6.0, 7.0, 8.5)
    numbers = prepared(epoch)
    for time in (0.0, 1.25, 4321.0, 3.0 * DAY):
        # The angle of the Earth by another formula, of the IAU 2006, from the time in UT1 and TT.
        day = days_of(epoch) + time / DAY
        angle = erfa.gmst06(2451545.0, day, 2451545.0, day + 69.2 / DAY)
        turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
        for place in places(20):
            expected = turn @ computed((turn.T @ place)[None], numbers)[0]
            # The formulas differ by 0.2 arcsec.
            assert np.abs(np.array(field(tuple(place.tolist()), time, numbers)) - expected).max() < 1e-10


def test_no_place_has_a_stronger_field_than_the_bound():
    surface = places(8000) * (RADIUS / (RADIUS + ALTITUDE))
    sizes = np.linalg.norm(reference(surface, datetime(2025, 1, 1)), axis=1)
    assert sizes.max() < strongest(NEW_YEAR, RADIUS) < 1.04 * sizes.max()
    assert strongest(NEW_YEAR, 1.1 * RADIUS) < strongest(NEW_YEAR, RADIUS)


def test_sidereal_time_against_the_astronomical_union():
    for days in (0.0, 9496.25, 10592.5, -3652.75):
        apart = (sidereal(days) - erfa.gmst82(2451545.0, days) / (2.0 * np.pi) + 0.5) % 1.0 - 0.5
        assert abs(apart) < 1e-9


def test_days_and_bad_epochs():
    assert days_of((2000.0, 1.0, 2.0, 0.0, 0.0, 0.0)) == 0.5
    assert days_of((2026.0, 2.0, 28.0, 23.0, 59.0, 59.5)) == erfa.cal2jd(2026, 2, 28)[1] - 51544.5 + 86399.5 / DAY
    for epoch, words in (
        ((2026.0, 2.0, 29.0, 0.0, 0.0, 0.0), "no date"),
        ((2026.5, 2.0, 2.0, 0.0, 0.0, 0.0), "whole"),
        ((2026.0, 2.0, 2.0, 0.0, 0.0, 60.0), "below 60"),
        ((2031.0, 2.0, 2.0, 0.0, 0.0, 0.0), "2025 to 2030"),
    ):
        with pytest.raises(ValueError, match=words):
            prepared(epoch)


def test_nowhere_is_the_field_weaker_or_steeper_than_its_bounds():
    random, epoch = np.random.default_rng(5), (2026.0, 3.0, 20.0, 12.0, 0.0, 0.0)
    numbers, low, high = prepared(epoch), 6.85e6, 6.9e6
    least, steep, curved = weakest(epoch, low, high), steepest(epoch, low), steepest(epoch, low, 2)

    def equation(position):
        return earth_fixed(position, numbers)

    program = straight_line(equation, position=(0.0, 0.0, 0.0))

    def at(where):
        return np.array(evaluated(program, position=tuple(where)))

    many = random.normal(size=(3, 5_000))
    # Where it is weakest, over the South Atlantic, too.
    many[:, ::2] = np.array([[0.55], [-0.72], [-0.43]]) + 0.2 * many[:, ::2]
    many *= random.uniform(low, high, size=5_000) / np.linalg.norm(many, axis=0)
    found = np.linalg.norm(at(many), axis=0).min()
    assert 0.97 * found < least < found
    way = random.normal(size=(3, 5_000))
    way *= 100.0 / np.linalg.norm(way, axis=0)
    ahead, here, behind = (at(many + k * way) for k in (1.0, 0.0, -1.0))
    assert 0.25 * steep < np.linalg.norm(ahead - behind, axis=0).max() / 200.0 < steep
    assert 0.1 * curved < np.linalg.norm(ahead - 2.0 * here + behind, axis=0).max() / 1e4 < curved


def test_the_least_strength_on_an_eccentric_orbit_costs_little_memory():
    tracemalloc.start()
    try:
        assert weakest((2026.0, 3.0, 20.0, 12.0, 0.0, 0.0), 6.6e6, 7.8e6) > 1e-5
        assert tracemalloc.get_traced_memory()[1] < 2e8
    finally:
        tracemalloc.stop()
