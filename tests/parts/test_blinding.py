"""What blinds a star tracker, against ERFA's ephemerides and the limb point by point, along an orbit."""

import math
from types import SimpleNamespace

import erfa
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import starhold as sh
from starhold.algebra.vector import ZERO
from starhold.loop.kernels import numbers_of
from starhold.parts import moon
from starhold.parts.epoch import DAY, days_of
from starhold.parts.random import Silent
from starhold.parts.sensors import star_tracker
from starhold.parts.sun import EARTH, UNIT
from starhold.scenario.building import build
from tests.parts.fields import states
from tests.parts.trackers import FILTER, FIRST, GYRO, errors, scenario
from tests.sky import directions

EPOCH = (2026.0, 3.0, 1.0, 6.0, 0.0, 0.0)
ORBIT = {"position": [6.9e6, 0.0, 0.0], "velocity": [0.0, 5.0e3, 5.7e3], "epoch": "2026-03-01T06:00:00Z"}


def by_erfa(times):
    """The places of Sun and Moon (m) in the mean axes of date."""
    dates = days_of(EPOCH) + np.asarray(times) / DAY + 69.2 / DAY
    turn = erfa.pmat06(2451545.0, dates)
    pair = -erfa.epv00(2451545.0, dates)[0]["p"], erfa.moon98(2451545.0, dates)["p"]
    return [UNIT * np.einsum("nij,nj->ni", turn, place) for place in pair]


def test_moon_against_erfa_over_a_century():
    worst, off = 0.0, 0.0
    for year in map(float, range(1950, 2051, 4)):
        epoch, days = (year, 1.0, 1.0, 0.0, 0.0, 0.0), np.arange(0.0, 365.0, 2.1)
        found = np.array([moon.position(time, moon.prepared(epoch)) for time in days * DAY])
        dates = days_of(epoch) + days + 69.2 / DAY
        expected = UNIT * np.einsum("nij,nj->ni", erfa.pmat06(2451545.0, dates), erfa.moon98(2451545.0, dates)["p"])
        angles = np.linalg.norm(directions(found) - directions(expected), axis=1)
        worst, off = max(worst, angles.max()), max(off, np.abs(np.linalg.norm(found - expected, axis=1) / 3.8e8).max())
    assert math.radians(0.3) < worst < math.radians(0.4)
    assert off < 0.01


def margins(position, boresight, light, lunar):
    """Angles (rad) of a boresight from Sun, Moon and the limb, below 0 over the Earth; whether the limb's nearest point is
    lit; and how far from the shadow's edge the craft is, below 0 within."""
    up, distance = position / np.linalg.norm(position), np.linalg.norm(position)
    side = directions(np.cross(up, (0.3, 0.5, 0.8)))
    turns = np.linspace(0.0, 2.0 * np.pi, 721)[:, None]
    around = np.cos(turns) * side + np.sin(turns) * np.cross(up, side)
    # Points of the sphere whose line of sight touches it.
    limb = EARTH * (EARTH / distance * up + math.sqrt(1.0 - (EARTH / distance) ** 2) * around)
    sights = directions(limb - position) @ boresight
    over = -up @ boresight > math.sqrt(1.0 - (EARTH / distance) ** 2)
    nearest = math.acos(min(1.0, sights.max()))
    sun, seen = directions(light), directions(lunar - position)
    across = np.linalg.norm(np.cross(position, sun)) - EARTH
    shade = across if position @ sun < 0.0 else np.inf
    point = limb[sights.argmax()] @ sun
    return math.acos(sun @ boresight), math.acos(seen @ boresight), -nearest if over else nearest, point / EARTH, shade


CONES = {"sun_cone": 0.7, "moon_cone": 0.35, "limb_cones": (0.5, 0.1)}


def test_blinded_as_erfa_and_the_limb_say():
    params = star_tracker.Params(0.0, 0.0, (0.0, 0.6, 0.8), epoch=EPOCH, **CONES)
    numbers, period, count = star_tracker.prepare(params, 40.0), 40.0, {}
    steps = 800
    sun, lunar = by_erfa(period * np.arange(steps))
    memory = star_tracker.remember(numbers, next(states()))
    for step, state in enumerate(states(steps)):
        reading, memory = star_tracker.measure(state, memory, numbers, Silent(), step)
        boresight = Rotation.from_quat(state.attitude, scalar_first=True).apply(params.boresight)
        found = margins(np.array(state.position), boresight, sun[step], lunar[step])
        to_sun, to_moon, to_limb, lit, shade = found
        limb = CONES["limb_cones"][0 if lit > 0.0 else 1]
        edges = [to_sun - 0.7, to_moon - 0.35, to_limb - limb, shade / 1e7, lit if to_limb > 0.0 else 1.0]
        # The Moon's place is known to 0.4 deg.
        if np.abs(edges[:1] + edges[2:]).min() < 5e-3 or abs(edges[1]) < 8e-3:
            continue
        why = "sun" if to_sun < 0.7 and shade > 0.0 else "limb" if to_limb < limb else "moon" if to_moon < 0.35 else ""
        count[why] = count.get(why, 0) + 1
        assert reading.attitude_is_new == float(not why), (step, why, found)
    assert len(count) == 4
    assert min(count.values()) > 10


def test_each_cone_alone_and_the_rate_limit():
    """A head towards the Sun, the Moon, the Earth or none of them; and one that turns too fast."""
    state = next(states())
    for name, cone in CONES.items():
        params = star_tracker.Params(0.0, 0.0, epoch=EPOCH, **{name: cone})
        numbers = star_tracker.prepare(params, 1.0)
        sun, lunar = (place[0] for place in by_erfa([0.0]))
        place = np.array(state.position)
        at = 7e6 * directions(sun) if name == "sun_cone" else place
        toward = {"sun_cone": sun, "moon_cone": lunar - place, "limb_cones": -place}[name]
        for direction, seen in ((directions(toward), 0.0), (-directions(toward), 1.0)):
            turn, _ = Rotation.align_vectors([direction], [(0.0, 0.0, 1.0)])
            there = SimpleNamespace(attitude=turn.as_quat(scalar_first=True).tolist(), position=at.tolist(), rate=ZERO)
            memory = star_tracker.remember(numbers, there)
            assert star_tracker.measure(there, memory, numbers, Silent(), 0)[0].attitude_is_new == seen, name
    slow = star_tracker.prepare(star_tracker.Params(0.0, 0.0, rate_limit=0.03), 1.0)
    for rate, seen in ((0.029, 1.0), (0.031, 0.0)):
        state.rate = (0.0, -rate, 0.0)
        assert star_tracker.measure(state, star_tracker.remember(slow, state), slow, Silent(), 0)[0].attitude_is_new == seen


def test_a_blinded_head_leaves_the_filter_to_the_gyro():
    blinded = FIRST | {"limb_cones": ["30 deg", "30 deg"], "boresight": [0.0, 0.0, 1.0]}
    run = sh.simulate(scenario(GYRO, blinded, FILTER, orbit=ORBIT, duration="400 s"))
    fresh = run["star_tracker_attitude_is_new"].values[1:] > 0.5
    assert 0.1 < fresh.mean() < 0.9
    deviation = np.linalg.norm(run["mekf_attitude_deviation"].values[1:], axis=1)
    first = fresh.argmax() + 1
    assert deviation[first:][~fresh[first:]].max() > 1.5 * deviation[fresh].max()
    assert (np.linalg.norm(errors(run)[1 + first :], axis=1) < 5.0 * deviation[first:]).all()


def test_a_loop_without_cones_has_the_numbers_it_had():
    given = scenario(GYRO, FIRST, FILTER)
    loop = build(given, given.laws[0])
    assert len(numbers_of(loop.setup().sensors[1])) == 8
    coned = scenario(GYRO, FIRST | {"sun_cone": "40 deg"}, FILTER, orbit=ORBIT)
    assert len(numbers_of(build(coned, coned.laws[0]).setup().sensors[1])) > 8


@pytest.mark.parametrize(
    ("cones", "orbit", "words"),
    [
        ({"sun_cone": "180 deg"}, ORBIT, "whole sky: the Sun blinds always"),
        ({"limb_cones": ["20 deg", "190 deg"]}, ORBIT, "the dark limb blinds always"),
        ({"limb_cones": ["120 deg", "115 deg"]}, ORBIT, "67.5.* deg from its centre on this orbit, blinds always"),
        ({"moon_cone": "10 deg"}, None, "need an orbit about the Earth"),
        ({"moon_cone": "-10 deg"}, ORBIT, "at least 0"),
    ],
)
def test_cones_that_cannot_be_are_refused(cones, orbit, words):
    with pytest.raises(sh.InputError, match=words):
        sh.simulate(scenario(GYRO, FIRST | cones, FILTER, orbit=orbit))
