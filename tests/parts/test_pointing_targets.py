"""Targets that point somewhere: against the routines of the IAU for stations and the Sun, the published yaw of navigation
satellites, and the differences of their own attitudes."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import starhold as sh
from starhold.parts.bodies.rigid_body import State
from starhold.parts.catalogue import find, fit
from starhold.parts.craft import EARTH
from starhold.scenario.reading import parse
from tests.parts.files import part
from tests.refusals import refused

erfa = pytest.importorskip("erfa", reason="the routines of the IAU come with the test extra")
EPOCH = (2026.0, 3.0, 5.0, 6.0, 30.0, 0.0)
JULIAN = 2400000.5, sum(erfa.cal2jd(2026, 3, 5)) - 2400000.5 + 6.5 / 24.0
LATITUDE, LONGITUDE = math.radians(52.0), math.radians(80.0)
PERIOD = 0.5


def orbit(position, velocity, times):
    """Positions and velocities (n, 3) in two-body motion, by SciPy."""

    def slope(_, y):
        return [*y[3:], *(-EARTH * y[:3] / np.linalg.norm(y[:3]) ** 3)]

    found = solve_ivp(slope, (0.0, times[-1]), [*position, *velocity], "DOP853", times, rtol=1e-13, atol=1e-6).y.T
    return found[:, :3], found[:, 3:]


def goals(name, steps, places, speeds, **params):
    """The goals of an installed target at these control steps."""
    target = find("target", name)
    numbers, before, found = fit("target", name, *target.params(**params)).prepared(PERIOD), (1.0, 0.0, 0.0, 0.0), []
    for step, place, speed in zip(steps, places.tolist(), speeds.tolist(), strict=True):
        state = State(before, (0.0,) * 3, tuple(place), tuple(speed), (0.0,) * 3)
        found.append(target.module.goal(numbers, state, int(step), before))
        before = found[-1].attitude
    return found


def turns(found):
    """The rotations that take body axes to inertial ones."""
    return Rotation.from_quat(np.array([goal.attitude for goal in found]), scalar_first=True)


START = np.array([6.878e6, 0.0, 0.0]), np.array([0.0, -1.017e3, 7.544e3])
CASES = [
    ("sun", {"reference": (0.3, -0.2, 1.0)}, np.arange(0, 900, 1)),
    ("yaw-steering", {}, np.arange(0, 900, 1)),
    ("ground-station", {"latitude": 0.1, "longitude": 0.0, "elevation": 0.0}, np.arange(0, 900, 1)),
]


@pytest.mark.parametrize(("name", "params", "steps"), CASES)
def test_rates_and_accelerations_are_those_of_the_attitude(name, params, steps):
    places, speeds = orbit(*START, steps * PERIOD)
    # Near the zero meridian, over the equator: the station is in view.
    epoch = (2026.0, 3.0, 5.0, 13.0, 5.0, 0.0)
    found = goals(name, steps, places, speeds, epoch=epoch, **params)
    rotations = turns(found)
    differences = (rotations[:-2].inv() * rotations[2:]).as_rotvec() / (2.0 * PERIOD)
    rates, accelerations = (np.array([getattr(goal, key) for goal in found]) for key in ("rate", "acceleration"))
    # A jump of the target, as a station comes into view, is no rate.
    smooth = np.linalg.norm(differences, axis=1) < 0.1
    assert smooth.mean() > 0.99
    size = np.abs(rates).max()
    assert size > (1e-8 if name == "sun" else 1e-3)
    assert np.abs(differences - rates[1:-1])[smooth].max() < 2e-5 * size
    slopes = (rates[2:] - rates[:-2]) / (2.0 * PERIOD)
    steady = np.abs(slopes).max(axis=1) < 1e-3
    assert np.abs(slopes - accelerations[1:-1])[smooth & steady].max() < 1e-4 * np.abs(accelerations).max() + 1e-18


def test_a_station_is_seen_where_the_iau_s_routines_have_it():
    steps = np.arange(0, 6000, 20)
    places, speeds = orbit(*START, steps * PERIOD)
    least = math.radians(10.0)
    found = goals(
        "ground-station",
        steps,
        places,
        speeds,
        latitude=LATITUDE,
        longitude=LONGITUDE,
        height=80.0,
        elevation=least,
        epoch=EPOCH,
    )
    site = erfa.gd2gc(1, LONGITUDE, LATITUDE, 80.0)
    up = np.array(erfa.s2c(LONGITUDE, LATITUDE))
    seen = 0
    for step, place, speed, turn in zip(steps, places, speeds, turns(found), strict=True):
        angle = erfa.gmst82(JULIAN[0], JULIAN[1] + step * PERIOD / 86400.0)
        spin = Rotation.from_rotvec([0.0, 0.0, angle])
        ahead = spin.apply(site) - place
        height = math.asin(-spin.apply(up) @ ahead / np.linalg.norm(ahead))
        if abs(height - least) < 1e-6:
            continue
        wanted = ahead if height > least else -place
        pointed = turn.apply([0.0, 0.0, 1.0])
        assert np.linalg.norm(np.cross(pointed, wanted)) < 2e-7 * np.linalg.norm(wanted)
        assert pointed @ wanted > 0.0
        # The second axis lies in the plane of this direction and the orbit's normal, against that.
        normal = np.cross(place, speed)
        other = turn.apply([0.0, 1.0, 0.0])
        assert abs(other @ np.cross(wanted, normal)) < 1e-9 * np.linalg.norm(np.cross(wanted, normal))
        assert other @ normal < 0.0
        seen += height > least
    assert 0 < seen < len(steps)


def test_yaw_is_that_of_navigation_satellites():
    radius = 26560e3
    steps = np.arange(0, 80000, 800)
    speed = math.sqrt(EARTH / radius)
    tilt = math.radians(55.0)
    start = np.array([radius, 0.0, 0.0]), speed * np.array([0.0, math.cos(tilt), math.sin(tilt)])
    places, speeds = orbit(*start, steps * PERIOD)
    found = goals("yaw-steering", steps, places, speeds, epoch=EPOCH)
    yaws = []
    for step, place, speed, turn in zip(steps, places, speeds, turns(found), strict=True):
        earth = erfa.epv00(JULIAN[0], JULIAN[1] + (step * PERIOD + 69.2) / 86400.0)[0]["p"]
        # From axes of J2000 to those of date, in which starhold's orbits are.
        sun = erfa.pmat76(*JULIAN) @ (-earth / np.linalg.norm(earth))
        normal = np.cross(place, speed) / np.linalg.norm(np.cross(place, speed))
        beta = math.asin(sun @ normal)
        ahead = np.cross(normal, place / np.linalg.norm(place))
        midnight = math.atan2(sun @ ahead, -(sun @ place) / np.linalg.norm(place))
        wanted = math.atan2(-math.tan(beta), math.sin(midnight))
        x = turn.apply([1.0, 0.0, 0.0])
        yaw = math.atan2(x @ -normal, x @ ahead)
        assert abs(math.remainder(yaw - wanted, math.tau)) < 1e-3
        # The axis that panels turn about is square to the Sun.
        assert abs(turn.apply([0.0, 1.0, 0.0]) @ sun) < 3e-4
        assert turn.apply([0.0, 0.0, 1.0]) @ place < -(1.0 - 1e-12) * radius
        yaws.append(yaw)
    assert np.ptp(np.unwrap(yaws)) > 1.0


def test_the_third_axis_points_at_the_sun():
    steps = np.array([0, 7200, 172800])
    still = np.tile(START[0], (3, 1)), np.tile(START[1], (3, 1))
    for step, turn in zip(steps, turns(goals("sun", steps, *still, epoch=EPOCH)), strict=True):
        earth = erfa.epv00(JULIAN[0], JULIAN[1] + (step * PERIOD + 69.2) / 86400.0)[0]["p"]
        sun = erfa.pmat76(*JULIAN) @ (-earth / np.linalg.norm(earth))
        assert math.acos(min(1.0, turn.apply([0.0, 0.0, 1.0]) @ sun)) < math.radians(0.012)
        assert abs(turn.apply([0.0, 1.0, 0.0]) @ [0.0, 0.0, 1.0]) < 1e-12


ORBITING = """
name = "own"
[spacecraft]
inertia = [0.05, 0.065, 0.025]
torque_limit = "2 mN m"
[orbit]
position = ["6878 km", 0, 0]
velocity = [0, "-1.017 km/s", "7.544 km/s"]
[initial]
relative_to = "target"
[simulation]
duration = 300
control_period = 0.5
[[law]]
type = "lyapunov"
k_rate = 0.02
k_attitude = 0.004
"""


@pytest.mark.parametrize(
    "keys",
    [
        'type = "sun"\n',
        'type = "yaw-steering"\nother = [0, 1, 0]\n',
        'type = "ground-station"\nlatitude = "60 deg"\nlongitude = "20 deg"\n',
    ],
)
def test_a_law_holds_the_target_from_a_scenario(keys):
    run = sh.simulate(parse(ORBITING + part(keys), "own"))
    error = 2.0 * np.linalg.norm(run.attitude_error.values[:, 1:], axis=1)
    assert error.max() < 2e-4
    (certificate,) = sh.certify(parse(ORBITING + part(keys), "own"))
    name = keys.split('"')[1]
    assert all(f"without the target {name}" in claim.assumptions for claim in certificate.claims)


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ('type = "sun"\naxis = [0, 0, 2]\nother = [0, 0, -1]\n', "the two body axes must have directions"),
        ('type = "sun"\nreference = [0, 0, 0]\n', "the reference needs a direction"),
        ('type = "ground-station"\nlatitude = 2.0\nlongitude = 0.0\n', "latitude"),
    ],
)
def test_what_leaves_the_attitude_open_is_refused_in_one_line(keys, words):
    with refused(words):
        sh.simulate(parse(ORBITING + part(keys), "own"))
