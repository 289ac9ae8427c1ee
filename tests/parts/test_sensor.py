"""Sensors: unit quaternions, errors of the stated size, and the same numbers for the same seed, run and step."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from starhold.algebra.quaternion import NO_TURN, relative, stretch
from starhold.algebra.vector import ZERO, add
from starhold.algebra.words import bits_of, with_bits
from starhold.parts.random import normal_vector
from starhold.trace.calling import Compiled
from tests.algebra.readers import close, quaternions, same, small_vectors
from tests.equations import ATTITUDE, RATE, TORQUE, Noise, gaussian_disturbance, noisy

NOISE = Noise(0.02, 0.001, 0.003)
indices = st.integers(0, 10**9)
# As bits of a float, below those of NaN.
seeds = st.integers(0, 2**62)


def of_words(equation):
    """An equation of seed, run and step as one of floats, which carry the bits of the words."""
    return lambda *values: equation(*values[:-3], (bits_of(values[-3]), bits_of(values[-2])), bits_of(values[-1]))


SENSES = [of_words(sense) for sense in (noisy,)]
DISTURBANCES = [of_words(disturb) for disturb in (gaussian_disturbance,)]


@settings(max_examples=50)
@given(quaternions, small_vectors, seeds, indices, indices)
def test_compiled_equals_floats(attitude, rate, seed, run, step):
    words = with_bits(seed), with_bits(run), with_bits(step)
    for sense in SENSES:
        same(sense, attitude, rate, NOISE, *words)
    for disturb in DISTURBANCES:
        same(disturb, NOISE, *words)


@given(quaternions, small_vectors, seeds, indices, indices)
def test_without_noise_it_is_exact(attitude, rate, seed, run, step):
    seen, measured = noisy(attitude, rate, Noise(0.02, 0.0, 0.0), (seed, run), step)
    assert close(seen, attitude, 1e-15)
    assert measured == rate
    assert gaussian_disturbance(Noise(0.0, 0.1, 0.1), (seed, run), step) == ZERO


@given(quaternions, small_vectors, st.floats(0.0, 0.1), seeds, indices, indices)
def test_noisy_attitude_is_a_unit_quaternion_near_the_true_one(attitude, rate, deviation, seed, run, step):
    seen, _ = noisy(attitude, rate, Noise(0.0, deviation, 0.0), (seed, run), step)
    assert abs(sum(c * c for c in seen) - 1.0) < 1e-15
    added = math.hypot(*normal_vector((seed, run), step, ATTITUDE, 0.5 * deviation))
    # The error added is at most what is seen, by more than the length it changes.
    assert math.dist(seen, attitude) <= 2.0 * added + 1e-15


@given(small_vectors, seeds, indices, indices)
def test_errors_are_those_of_their_channels(rate, seed, run, step):
    _, measured = noisy(NO_TURN, rate, NOISE, (seed, run), step)
    assert measured == add(rate, normal_vector((seed, run), step, RATE, NOISE.rate))
    assert gaussian_disturbance(NOISE, (seed, run), step) == normal_vector((seed, run), step, TORQUE, NOISE.torque)
    seen, _ = noisy(NO_TURN, rate, NOISE, (seed, run), step)
    error = normal_vector((seed, run), step, ATTITUDE, 0.5 * NOISE.attitude)
    assert close(tuple(x / seen[0] for x in seen[1:]), error, 1e-16)
    # Three numbers each.
    assert len({place + axis for place in (TORQUE, ATTITUDE, RATE) for axis in range(3)}) == 9


def test_the_same_seed_run_and_step_give_the_same_numbers():
    rate = (0.1, 0.2, 0.3)
    first = noisy(NO_TURN, rate, NOISE, (1, 2), 3)
    assert noisy(NO_TURN, rate, NOISE, (1, 2), 3) == first
    elsewhere = ((2, 2, 3), (1, 3, 3), (1, 2, 4), (3, 2, 1), (2, 1, 3))
    others = {noisy(NO_TURN, rate, NOISE, where[:2], where[2]) for where in elsewhere}
    assert len(others | {first}) == 6
    torques = {gaussian_disturbance(NOISE, where[:2], where[2]) for where in ((1, 2, 3), (2, 2, 3), (1, 3, 3), (1, 2, 4))}
    assert len(torques) == 4


def test_opposite_quaternions_are_one_attitude_and_seen_as_one():
    seen, _ = noisy((0.6, 0.8, 0.0, 0.0), ZERO, NOISE, (1, 2), 3)
    other, _ = noisy((-0.6, -0.8, 0.0, 0.0), ZERO, NOISE, (1, 2), 3)
    assert seen == stretch(-1.0, other)


@settings(max_examples=20)
@given(quaternions, seeds, indices, indices)
def test_noise_is_an_angle_of_rotation_about_each_body_axis(attitude, seed, run, step):
    """Whatever the attitude: ten arc seconds are ten arc seconds, at half a turn too."""
    deviation = math.radians(10.0 / 3600.0)
    seen, _ = noisy(attitude, ZERO, Noise(0.0, deviation, 0.0), (seed, run), step)
    angles = Rotation.from_quat(relative(attitude, seen), scalar_first=True).as_rotvec()
    assert angles == pytest.approx(normal_vector((seed, run), step, ATTITUDE, deviation), rel=1e-6, abs=1e-9 * deviation)


COUNT = 20000
RATES = (0.1, -0.2, 0.3)


def series(count):
    """What is seen of one state at steps 0, 1, ..., and the torque: attitude (4), rate (3), torque (3), one row a step."""

    def at_step(bits):
        step = bits_of(bits)
        return noisy(NO_TURN, RATES, NOISE, (5, 0), step), gaussian_disturbance(NOISE, (5, 0), step)

    steps = np.arange(count, dtype=np.int64).view(np.float64)
    return Compiled(at_step, 0.0).over(steps[None]).T


SERIES = series(COUNT)


def test_statistics():
    errors = np.hstack([2.0 * SERIES[:, 1:4], SERIES[:, 4:7] - RATES, SERIES[:, 7:]])
    deviations = np.repeat([NOISE.attitude, NOISE.rate, NOISE.torque], 3)
    bound = 4.0 / math.sqrt(COUNT)
    assert np.all(np.abs(errors.mean(axis=0)) < bound * deviations)
    # The variance of as many normal numbers is uncertain by the root of 2 / count.
    assert np.all(np.abs(errors.var(axis=0) / deviations**2 - 1.0) < bound * math.sqrt(2.0) + 1e-5)
    correlation = np.corrcoef(errors.T) - np.eye(9)
    assert np.abs(correlation).max() < 5.0 / math.sqrt(COUNT)
    assert SERIES[:, 0].max() <= 1.0
    assert SERIES[:, 0] == pytest.approx(1.0, abs=50.0 * NOISE.attitude**2)
