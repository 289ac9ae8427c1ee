"""Sensors and the random torque: errors of the stated size, and the same for the same seed, run and step."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from starhold.algebra.quaternion import relative, stretch
from starhold.algebra.vector import ZERO, add
from starhold.parts.environments import random_torque
from starhold.parts.random import Dice
from starhold.parts.sensors import gaussian, gyro, magnetometer
from tests.algebra.readers import quaternions, small_vectors
from tests.tiers import fewer

KEY = 7, 2
indices = st.integers(0, 10**9)


def measured(attitude, rate, deviations, step):
    """The attitude and the rate that a sensor with these deviations (rad, rad/s) shows."""
    dice = Dice(KEY, step, gaussian.NUMBERS_FROM)
    state = SimpleNamespace(attitude=attitude, rate=rate)
    return tuple(gaussian.measure(state, (), gaussian.Params(*deviations), dice, step)[0])


def drawn(place, step, deviation):
    return Dice(KEY, step, place).vector(0, deviation)


@settings(max_examples=30)
@given(quaternions, small_vectors, indices)
def test_errors_are_angles_about_the_body_axes_and_those_of_their_places(attitude, rate, step):
    """Whatever the attitude: ten arc seconds are ten arc seconds, at half a turn too."""
    deviation = math.radians(10.0 / 3600.0)
    seen, turning = measured(attitude, rate, (deviation, 3e-3), step)
    assert abs(math.hypot(*seen) - 1.0) < 1e-15
    angles = Rotation.from_quat(relative(attitude, seen), scalar_first=True).as_rotvec()
    assert angles == pytest.approx(drawn(gaussian.NUMBERS_FROM, step, deviation), rel=1e-6, abs=1e-9 * deviation)
    assert turning == add(rate, drawn(gaussian.NUMBERS_FROM + 3, step, 3e-3))
    # Opposite quaternions are one attitude, and seen as one.
    assert measured(stretch(-1.0, attitude), rate, (deviation, 3e-3), step)[0] == stretch(-1.0, seen)
    exact, still = measured(attitude, rate, (0.0, 0.0), step)
    assert np.abs(np.subtract(exact, attitude)).max() < 1e-15
    assert still == rate


@given(indices)
def test_a_random_torque_has_places_of_its_own(step):
    assert gaussian.NUMBERS_FROM == 3
    for deviation in (0.02, 0.0):
        found = random_torque.update(ZERO, None, random_torque.Params(deviation), Dice(KEY, step, 0), step)
        assert found == drawn(0, step, deviation)


def allan_deviation(rates, count):
    """Of averages of so many readings, over all axes; rates: (readings, axes)."""
    means = rates[: len(rates) // count * count].reshape(-1, count, rates.shape[1]).mean(axis=1)
    return math.sqrt(0.5 * np.mean(np.diff(means, axis=0) ** 2))


@pytest.mark.slow
def test_the_allan_deviation_of_the_gyro_is_that_of_its_data_sheet():
    """IEEE 952: angle random walk N and rate random walk K give N^2/t + K^2 t/3 as its square over an averaging time t. At
    3 s the one is all of it, at 300 s the other, and between them both."""
    walk, rate_walk, period = math.radians(0.15) / 60.0, math.radians(30.0) / 3600.0 / 60.0, 1.0
    count = fewer(30_000, 3)
    params = gyro.prepare(gyro.Params(noise=walk, bias_walk=rate_walk * 60.0), period)
    still, memory, rates = SimpleNamespace(rate=ZERO), ZERO, []
    for step in range(count):
        reading, memory = gyro.measure(still, memory, params, Dice(KEY, step, 0), step)
        rates.append(reading.rate)
    for time in (3.0, 30.0, 300.0):
        expected = math.sqrt(walk**2 / time + rate_walk**2 * time / 3.0)
        # Averages beside each other, white ones at worst: two thirds of them, of each axis, are degrees of freedom.
        deviation = 1.0 / math.sqrt(2.0 * 3.0 * (2.0 / 3.0) * count * period / time)
        found = allan_deviation(np.array(rates), round(time / period))
        assert found == pytest.approx(expected, rel=3.0 * deviation)


@given(st.floats(1e-12, 1e-6), st.floats(0.01, 10.0))
def test_a_density_is_the_power_below_half_the_rate_of_readings(density, period):
    deviation = density * math.sqrt(0.5 / period)
    alone, both = (magnetometer.Params(noise=noise, noise_density=density) for noise in (0.0, 2.0 * deviation))
    assert magnetometer.prepare(alone, period).noise == pytest.approx(deviation, rel=1e-14)
    assert magnetometer.noise(both, period).field == pytest.approx(math.sqrt(5.0) * deviation, rel=1e-14)
    assert magnetometer.prepare(magnetometer.Params(noise=density), period).noise == density
