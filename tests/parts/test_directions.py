"""Directions and the attitude by them: coarse Sun sensors, a horizon sensor, and QUEST against SciPy."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import starhold as sh
from starhold.parts import sun
from starhold.parts.contract import UNBOUNDED
from starhold.parts.estimators import quest
from starhold.parts.random import Silent
from starhold.parts.sensors import coarse_sun_sensors, horizon_sensor, magnetometer
from starhold.parts.sun import EARTH
from tests.parts.fields import states
from tests.parts.trackers import scenario


def reading(sensor, params, state):
    return sensor.measure(state, (), sensor.prepare(params, 0.5), Silent(), 0)[0]


def body(state, vector):
    return Rotation.from_quat(state.attitude, scalar_first=True).inv().apply(vector)


def angle(a, b):
    return math.atan2(np.linalg.norm(np.cross(a, b)), np.dot(a, b))


@pytest.mark.parametrize("count", [2, 3, 5])
def test_quest_is_the_attitude_of_least_weighted_squares(count):
    random, worst = np.random.default_rng(count), 0.0
    for trial in range(200):
        turn = Rotation.random(random_state=random) if trial % 4 else Rotation.from_rotvec(np.pi * np.eye(3)[trial % 3])
        known = random.normal(size=(count, 3))
        known /= np.linalg.norm(known, axis=1)[:, None]
        if np.linalg.svd(known)[1][1] < 0.3:
            continue
        deviations = 10.0 ** random.uniform(-3.0, -1.5, count)
        seen = turn.inv().apply(known) + deviations[:, None] * random.normal(size=(count, 3))
        seen /= np.linalg.norm(seen, axis=1)[:, None]
        weights = (deviations.min() / deviations) ** 2
        expected, _ = Rotation.align_vectors(known, seen, weights=weights)
        unseen = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), 1.0, False)
        pairs = [(tuple(b), tuple(r), float(w), True) for b, r, w in zip(seen, known, weights, strict=True)]
        found = Rotation.from_quat(quest.best([*pairs, unseen], True), scalar_first=True)
        worst = max(worst, (expected.inv() * found).magnitude())
    assert worst < 1e-8


def test_coarse_sun_sensors():
    """Exact where three faces or a face of a cube are lit; with the Earth's light off by no more than it adds."""
    pyramid = tuple((x, y, 0.7) for x in (1.0, -1.0) for y in (1.0, -1.0))
    seen = dark = 0
    for state in states(200):
        there = sun.sun(0.0, sun.prepared((2026.0, 1.0, 1.0, 0.0, 0.0, 0.0)))
        toward, lit = body(state, there.direction), sun.in_view(state.position, there)
        cube = reading(coarse_sun_sensors, coarse_sun_sensors.Params(threshold=0.0), state)
        assert cube.sun_is_seen == float(lit > 0.0)
        if not 0.0 < lit < 1.0:
            seen, dark = seen + (lit == 1.0), dark + (lit == 0.0)
        if lit < 1.0:
            continue
        assert angle(cube.sun, toward) < 1e-5
        currents = np.maximum(np.array(pyramid) @ toward, 0.0)
        four = reading(coarse_sun_sensors, coarse_sun_sensors.Params(pyramid, threshold=0.0), state)
        if np.count_nonzero(currents) >= 3:
            assert angle(four.sun, toward) < 1e-4
        bright = reading(coarse_sun_sensors, coarse_sun_sensors.Params(albedo=0.3, threshold=0.0), state).sun
        # On a cube the light that is added is a vector of at most that length.
        assert angle(bright, toward) <= math.asin(0.3) + 1e-5
        assert angle(bright, toward) > 0.0 or np.dot(state.position, there.direction) < 0.0
    assert min(seen, dark) > 30


def test_horizon_sensor():
    half, height, counts = math.radians(15.0), 8e3, [0, 0]
    params = horizon_sensor.Params(boresight=(0.0, 3.0, 4.0), half_angle=half)
    for state in states(300):
        down = body(state, -np.array(state.position)) / np.linalg.norm(state.position)
        distance = np.linalg.norm(state.position)
        edge, off = math.asin(EARTH / distance), angle(down, (0.0, 0.6, 0.8))
        shown = reading(horizon_sensor, params, state)
        assert shown.nadir_is_seen == float(abs(off - edge) < half)
        counts[int(shown.nadir_is_seen)] += 1
        if shown.nadir_is_seen:
            assert angle(shown.nadir, down) < 1e-12
            high = reading(horizon_sensor, params._replace(limb_height=height), state).nadir
            raised = math.asin((EARTH + height) / distance) - edge
            assert angle(high, down) == pytest.approx(raised, rel=0.01)
            # Towards the limb that is seen.
            assert angle(high, (0.0, 0.6, 0.8)) < off
    assert min(counts) > 30


def test_a_flight_by_three_directions():
    orbit = {"position": [6.9e6, 0.0, 0.0], "velocity": [0.0, 5.0e3, 5.7e3]}
    sensors = (
        {"type": "gyro", "noise": 1e-5},
        {"type": "gnss"},
        {"type": "magnetometer", "noise": "300 nT"},
        {"type": "coarse-sun-sensors", "noise": 0.02},
        {"type": "horizon-sensor", "noise": "0.2 deg"},
    )
    found = {}
    for name, more in (("triad", {}), ("quest", {"sun": 0.02, "field": 0.01, "nadir": "0.2 deg"})):
        run = sh.simulate(scenario(*sensors, {"type": name} | more, orbit=orbit, duration="200 s", record_every=1))
        true, told = (Rotation.from_quat(run[key].values, scalar_first=True) for key in ("attitude", f"{name}_attitude"))
        fresh = run[f"{name}_attitude_age"].values == 0.0
        assert fresh.mean() > 0.9
        found[name] = np.sqrt(np.mean(np.square((true.inv() * told).magnitude()[fresh])))
    assert found["quest"] < 0.6 * found["triad"] < math.radians(2.0)


def test_each_sensor_shows_something_new_at_its_interval_alone():
    """The flags at all control steps; a magnetometer keeps its last reading, others see nothing between updates."""
    orbit = {"position": [6.9e6, 0.0, 0.0], "velocity": [0.0, 5.0e3, 5.7e3]}
    every = {"magnetometer": 3, "sun-sensor": 4, "coarse-sun-sensors": 2, "horizon-sensor": 5}
    flags = ("magnetic_field_is_new", "sun_is_seen", "sun_is_seen", "nadir_is_seen")
    always = [{"type": name, "outage": [12.0, 14.0]} for name in every]
    rare = [one | {"interval": 0.5 * steps} for one, steps in zip(always, every.values(), strict=True)]
    whole, thin = (sh.simulate(scenario(*parts, orbit=orbit, duration="20 s", record_every=1)) for parts in (always, rare))
    steps = np.arange(len(thin["time"]))
    for (name, count), flag in zip(every.items(), flags, strict=True):
        seen, due = whole[f"{name.replace('-', '_')}_{flag}"].values, steps % count == 0
        assert 0.2 < seen.mean() < 1.0
        assert thin[f"{name.replace('-', '_')}_{flag}"].values.tolist() == (seen * due).tolist()
    shown = thin["magnetometer_magnetic_field"].values
    # So the field is elsewhere than it was, and no bound holds.
    assert magnetometer.error(magnetometer.Params(interval=1.5)) == UNBOUNDED != magnetometer.error(magnetometer.Params())
    assert shown.tolist() == shown[[k - k % 3 if not 24 <= k < 30 else 21 for k in steps]].tolist()
