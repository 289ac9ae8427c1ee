"""The Gaussian sensor and the random torque: errors of the stated size, and the same for the same seed, run and step."""

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
from starhold.parts.random import Dice, normal_vector
from starhold.parts.sensors import gaussian
from tests.algebra.readers import quaternions, small_vectors

KEY = 7, 2
indices = st.integers(0, 10**9)


def measured(attitude, rate, deviations, step):
    """The attitude and the rate that a sensor with these deviations (rad, rad/s) shows."""
    dice = Dice(KEY, step, gaussian.NUMBERS_FROM)
    state = SimpleNamespace(attitude=attitude, rate=rate)
    return tuple(gaussian.measure(state, (), gaussian.Params(*deviations), dice, step)[0])


def drawn(place, step, deviation):
    return normal_vector(KEY, step, place, deviation)


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
