"""Precise places of Sun and Moon, against ERFA's ephemerides over a century, in the axes of the epoch, and by scenarios."""

import erfa
import numpy as np
import pytest

import starhold as sh
from starhold.parts import moon, sun
from starhold.parts.ephemeris import Lunar, Solar
from starhold.parts.epoch import DAY, days_of
from starhold.parts.sun import UNIT
from starhold.scenario.building import build
from tests.refusals import refused
from tests.sky import directions

LATER = (0.0, 1.7, 30.0, 200.0, 364.0)
"""Days since the start."""


def dates(epoch):
    year, month, day = map(int, epoch[:3])
    late = erfa.dat(year, month, day, 0.0) + 32.184 if 1972 <= year <= 2026 else 69.184 if year > 2026 else 29.2
    return 2451545.0, days_of(epoch) + np.array(LATER) + late / DAY


@pytest.mark.parametrize("year", [1950, 1975, 1984, 1995, 2003, 2011, 2016, 2026, 2033, 2049])
def test_directions_are_those_of_erfa_to_a_thousandth_of_a_degree(year):
    """ERFA's Moon is itself within 0.005 deg of ELP/MPP02, and 0.0008 deg in the mean."""
    for month in (1.0, 4.0, 8.0, 11.0):
        epoch = (float(year), month, 1.0, 6.0, 0.0, 0.0)
        when, turn = dates(epoch), erfa.pmat06(2451545.0, days_of(epoch))
        earth, barycentric = erfa.epv00(*when)
        distance = np.linalg.norm(earth["p"], axis=1)
        seen = -earth["p"] / distance[:, None] + barycentric["v"] * (UNIT / DAY / 299792458.0)
        found = [sun.sun(days * DAY, sun.prepared(epoch, 1)) for days in LATER]
        off = np.linalg.norm(np.array([one.direction for one in found]) - directions(seen) @ turn.T, axis=1)
        assert np.degrees(off).max() < 7e-4
        assert np.abs([one.distance for one in found] - distance).max() < 1e-4
        places = UNIT * erfa.moon98(*when)["p"] @ turn.T
        lunar = np.array([moon.position(days * DAY, moon.prepared(epoch, 1)) for days in LATER])
        assert np.degrees(np.linalg.norm(directions(lunar) - directions(places), axis=1)).max() < 7e-4
        assert np.abs(np.linalg.norm(lunar, axis=1) - np.linalg.norm(places, axis=1)).max() < 1e3


def test_a_scenario_gives_the_choice_to_all_its_parts():
    scenario = sh.load("cubesat-nadir").with_(
        {"part.star-tracker.moon_cone": "10 deg", "simulation.duration": 60.0, "fault": None}
    )
    precise = scenario.with_({"orbit.ephemeris": "precise"})
    for one, kinds in ((scenario, (sun.Almanac, moon.Almanac)), (precise, (Solar, Lunar))):
        loop = build(one, one.laws[0])
        light, tracker = (loop.find(name).prepared(loop.period) for name in ("solar-pressure", "star-tracker"))
        assert (type(light.sun), type(tracker.cones.lunar)) == kinds
    ends = [sh.simulate(one)["attitude"].to_numpy()[-1] for one in (scenario, precise)]
    assert 0.0 < np.abs(ends[0] - ends[1]).max() < 1e-3


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"orbit.ephemeris": "jpl"}, r'orbit\.ephemeris: found "jpl"; allowed: one of almanac, precise'),
        ({"part.star-tracker.ephemeris": "precise"}, r"a key that the whole flight shares; allowed: ephemeris in \[orbit\]"),
    ],
)
def test_other_words_are_refused_in_one_line(change, said):
    with refused(match=said):
        sh.load("cubesat-nadir").with_(change)
