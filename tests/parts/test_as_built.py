"""Sensors as they are built: what law and filter do not know of them, against SciPy and IEEE 952."""

import math
from collections import namedtuple
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import starhold as sh
from starhold.algebra.quaternion import multiply
from starhold.algebra.vector import ZERO
from starhold.parts.effectors import magnetorquers, thrusters
from starhold.parts.random import Dice, Silent
from starhold.parts.sensors import gyro, magnetometer, star_tracker, sun_sensor
from tests.parts.fields import states
from tests.parts.trackers import ARCSEC, FILTER, FIRST, GYRO, errors, scenario

MOUNTING = (0.01, -0.02, 0.015)
ASKEW = Rotation.from_rotvec(MOUNTING)
SKEWED = ((1e-3, 2e-4, 0.0), (0.0, -2e-3, 5e-4), (3e-4, 0.0, 4e-3))
SMALL = 1e-6
"""A turn of 0.027 rad given as small angles, in rad."""


def reading(sensor, params, state, period=0.5):
    numbers = sensor.prepare(params, period)
    memory = sensor.remember(numbers, state) if hasattr(sensor, "remember") else ()
    return sensor.measure(state, memory, numbers, Silent(), 0)[0]


@pytest.mark.parametrize("sensor", [gyro, magnetometer])
def test_a_vector_is_shown_along_the_axes_as_they_are(sensor):
    for state in states(5):
        exact, shown = (
            np.array(reading(sensor, params, state)[0])
            for params in (sensor.Params(), sensor.Params(mounting_error=MOUNTING, axis_errors=SKEWED, scale_error=0.01))
        )
        expected = 1.01 * (np.eye(3) + SKEWED) @ ASKEW.inv().apply(exact)
        assert np.abs(shown - expected).max() < 3.0 * SMALL * np.linalg.norm(exact)
        assert np.abs(shown - exact).max() > 1e-3 * np.linalg.norm(exact)


def test_head_and_sun_sensor_are_turned_as_they_are_mounted():
    seen = 0
    for state in states(20):
        head = reading(star_tracker, star_tracker.Params(0.0, 0.0, mounting_error=MOUNTING), state)
        true = Rotation.from_quat(state.attitude, scalar_first=True)
        shown = Rotation.from_quat(head.attitude, scalar_first=True)
        assert ((true * ASKEW).inv() * shown).magnitude() < 3.0 * SMALL
        plain, askew = (reading(sun_sensor, sun_sensor.Params(mounting_error=m), state).sun for m in (ZERO, MOUNTING))
        assert np.abs(ASKEW.inv().apply(plain) - askew).max() < 3.0 * SMALL
        seen += any(plain)
    assert seen > 5


@pytest.mark.parametrize("sensor", [magnetometer, star_tracker, sun_sensor])
def test_jitter_turns_what_is_shown_by_the_rate(sensor):
    """By 0.01 s on average, about the axis of the rate alone: what lies along it stays."""
    given = {star_tracker: {"cross": 0.0, "roll": 0.0}, sun_sensor: {"half_angle": math.pi}}.get(sensor, {})
    seen = (one for one in states(20) if any(reading(sensor, sensor.Params(**given), one)[0]))
    of_state = vars(next(seen)) | {"rate": (0.0, 0.0, 0.5)}
    state = namedtuple("State", of_state)(**of_state)
    exact, off = np.array(reading(sensor, sensor.Params(**given), state)[0]), []
    numbers = sensor.prepare(sensor.Params(**given, jitter=0.01), 0.5)
    before = multiply(state.attitude, (math.cos(0.125), 0.0, 0.0, -math.sin(0.125)))
    memory = sensor.remember(numbers, state._replace(attitude=before))
    for step in range(400):
        shown = np.array(sensor.measure(state, memory, numbers, Dice((1, 2), step, 0), 0)[0][0])
        if sensor is star_tracker:
            ends = [Rotation.from_quat(q, scalar_first=True) for q in (exact, shown)]
            off.append((ends[0].inv() * ends[1]).as_rotvec())
        else:
            angle = math.atan2(shown[1], shown[0]) - math.atan2(exact[1], exact[0])
            off.append([0.0, shown[2] / exact[2] - 1.0, -math.remainder(angle, math.tau)])
    assert np.abs(np.array(off)[:, :2]).max() < 1e-12
    assert np.std(off, axis=0)[2] == pytest.approx(0.5 * 0.01, rel=0.15)


def test_steps_and_limits():
    state = SimpleNamespace(rate=(0.0123456, -0.0765432, 0.5))
    shown = reading(gyro, gyro.Params(resolution=1e-3, limit=0.1), state).rate
    assert shown == pytest.approx((0.012, -0.077, 0.1), abs=1e-15)
    for state in states(3):
        exact = reading(magnetometer, magnetometer.Params(), state).magnetic_field
        shown = reading(magnetometer, magnetometer.Params(resolution=1e-7, limit=2e-5), state).magnetic_field
        assert shown == pytest.approx(np.clip(1e-7 * np.round(np.array(exact) / 1e-7), -2e-5, 2e-5), abs=1e-18)


def test_the_instability_of_the_bias_has_its_allan_deviation():
    """That of a Gauss-Markov process, IEEE 952, at three averaging times about the largest."""
    size, time, period = 2e-5, 20.0, 1.0
    wandering = {"type": "gyro", "bias_instability": size, "correlation_time": time}
    run = sh.simulate(scenario(wandering, duration="30000 s", control_period=period, record_every=1))
    settled = (run["gyro_rate"].values - run["rate"].values)[200:]
    for length in (10, 38, 150):
        means = settled[: len(settled) // length * length].reshape(-1, length, 3).mean(axis=1)
        found = math.sqrt(0.5 * np.mean(np.diff(means, axis=0) ** 2))
        x = length * period / time
        expected = size * math.sqrt((2.0 / x) * (1.0 - (3.0 - 4.0 * math.exp(-x) + math.exp(-2.0 * x)) / (2.0 * x)))
        assert found == pytest.approx(expected, rel=0.08), length
    assert found < 0.62 * size


def test_neither_law_nor_filter_knows_the_mounting():
    """Gyro and head turned alike are a body turned: the filter settles at an attitude that is off by the mounting."""
    turned = {"mounting_error": ["0.2 deg", 0, "-0.1 deg"]}
    fine = GYRO | {"noise": 1e-7, "bias_walk": 1e-9} | turned
    run = sh.simulate(scenario(fine, FIRST | turned, FILTER, duration="200 s"))
    off = errors(run)[-1] - np.radians([0.2, 0.0, -0.1])
    assert (np.abs(off) < 5.0 * run["mekf_attitude_deviation"].values[-1]).all()
    assert np.abs(off).max() < 80.0 * ARCSEC < math.radians(0.1)


def test_rods_and_thrusters_act_along_the_axes_they_are_mounted_with():
    state = next(states())
    wanted, measured = (1e-5, -2e-5, 3e-6), SimpleNamespace(magnetic_field=(1e-5, -2e-5, 3e-5))
    for effector, params in ((magnetorquers, magnetorquers.Params((9.0,) * 3)), (thrusters, thrusters.Params((1e-3,) * 3))):
        given = []
        for mounting in (ZERO, MOUNTING):
            numbers = effector.prepare(params._replace(mounting_error=mounting), 0.5)
            moved = effector.switch(effector.remember(numbers), wanted, measured, state, numbers, 0)
            rods = effector is magnetorquers
            given.append(
                moved.dipole if rods else effector.reaction(moved, effector.pulse(moved, 0.5, numbers), state, numbers)
            )
        assert np.abs(ASKEW.apply(given[0]) - given[1]).max() < 3.0 * SMALL * np.linalg.norm(given[0])
        assert np.abs(np.subtract(*given)).max() > 5e-3 * np.linalg.norm(given[0])
