"""The Kalman filter against the most likely motion given all readings at once."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from starhold.conformance.bench import CRAFT
from starhold.parts.estimators import mekf
from tests.tiers import leading

ARCSEC = math.radians(1.0 / 3600.0)
PERIOD = 0.5
PARAMS = mekf.Params(5e-5, 3e-3, 1e-3, 20.0 * ARCSEC, 120.0 * ARCSEC, (0.0, 0.6, 0.8))
SECOND = (15.0 * ARCSEC, 200.0 * ARCSEC, (1.0, 0.0, 0.0))
"""Deviations and boresight of a second tracker."""


def filtered(attitudes, rates, new, params=PARAMS, period=PERIOD, second=None):
    """The filter's estimates and memories at all control steps; second: attitudes of another tracker, and which are new."""
    numbers = mekf.prepare(params, period)
    memory, found = mekf.remember(numbers, None), []
    for k, (attitude, rate, fresh) in enumerate(zip(attitudes, rates, new, strict=True)):
        readings = SimpleNamespace(attitude=tuple(attitude), rate=tuple(rate), attitude_is_new=float(fresh))
        if second is not None:
            other = SimpleNamespace(attitude=tuple(second[0][k]), attitude_is_new=float(second[1][k]))
            readings.every = (SimpleNamespace(rate=readings.rate), SimpleNamespace(**vars(readings)), other)
        estimate, memory = mekf.estimate(readings, memory, numbers, CRAFT, period)
        found.append((estimate, memory))
    return found


def flight(steps, seed, cross=PARAMS.cross, roll=PARAMS.roll, boresight=PARAMS.boresight):
    """Readings of a body that turns ever faster: attitudes (scalar first), rates, and which attitudes are new."""
    random = np.random.default_rng(seed)
    axis = np.array(boresight)
    bias = random.normal(scale=PARAMS.bias, size=3)
    rate, turn = np.array([0.02, -0.05, 0.03]), Rotation.from_rotvec([0.4, -1.0, 2.0])
    attitudes, rates = [], []
    for _ in range(steps):
        angles = random.normal(size=3)
        error = cross * (angles - axis * (axis @ angles)) + roll * axis * (axis @ angles)
        attitudes.append((turn * Rotation.from_rotvec(error)).as_quat(scalar_first=True))
        rates.append(rate + bias + random.normal(scale=PARAMS.noise / math.sqrt(PERIOD), size=3))
        push = random.normal(scale=2e-3, size=3)
        turn, rate = turn * Rotation.from_rotvec(PERIOD * (rate + 0.5 * push)), rate + push
        bias = bias + random.normal(scale=PARAMS.bias_walk * math.sqrt(PERIOD / 3600.0), size=3)
    return np.array(attitudes), np.array(rates), np.arange(steps) % 3 == 0


def whitening(cross, roll, boresight):
    """What takes the error of a tracker's attitude to standard normal numbers."""
    return np.linalg.inv(cross * np.eye(3) + (roll - cross) * np.outer(boresight, boresight))


def most_likely(attitudes, rates, new, second=None):
    """The attitude, bias and noise of the gyro's reading at the last step, of greatest likelihood given all readings, by
    nonlinear least squares over all of them, and the covariance of these nine numbers."""
    steps = len(rates)
    measured = Rotation.from_quat(attitudes, scalar_first=True)
    trackers = [(measured, new, whitening(PARAMS.cross, PARAMS.roll, PARAMS.boresight))]
    if second is not None:
        trackers.append((Rotation.from_quat(second[0], scalar_first=True), second[1], whitening(*SECOND)))
    deviation, walk = PARAMS.noise / math.sqrt(PERIOD), PARAMS.bias_walk * math.sqrt(PERIOD / 3600.0)
    # From a guess that the gyro carries on.
    carried = [measured[0]]
    for mean in 0.5 * (rates[1:] + rates[:-1]):
        carried.append(carried[-1] * Rotation.from_rotvec(PERIOD * mean))
    guess = Rotation.concatenate(carried)

    def noises(turns, biases, first):
        """The noise of each reading: between two the body turns by the mean of both, less bias and noise."""
        turned = (turns[:-1].inv() * turns[1:]).as_rotvec() / PERIOD
        clean = rates - biases
        found = [first]
        for means, turn in zip(clean[1:] + clean[:-1], turned, strict=True):
            found.append(means - 2.0 * turn - found[-1])
        return np.array(found)

    def residuals(x):
        errors, biases = x[3:].reshape(2, steps, 3)
        turns = guess * Rotation.from_rotvec(errors)
        seen = [(turns.inv() * shown).as_rotvec()[fresh] @ tracker.T for shown, fresh, tracker in trackers]
        noise = noises(turns, biases, x[:3]) / deviation
        parts = [*seen, noise, np.diff(biases, axis=0) / walk, biases[:1] / PARAMS.bias]
        return np.concatenate([part.ravel() for part in parts])

    # The covariance is that in the axes of the attitudes found, so these are the guess in the end.
    scales = np.repeat([1e-4, 1e-4, 1e-3], [3, 3 * steps, 3 * steps])
    x = np.zeros(len(scales))
    jacobian = np.zeros((0, len(x)))
    for _ in range(2):
        x[3 : 3 * steps + 3] = 0.0
        found = least_squares(residuals, x, x_scale=scales, xtol=1e-13, ftol=1e-13)
        x, jacobian = found.x, found.jac
        guess = guess * Rotation.from_rotvec(x[3 : 3 * steps + 3].reshape(steps, 3))
    first, biases = x[:3], x[3 * steps + 3 :].reshape(steps, 3)
    # The last noise as a sum of the others', small changes of attitude taken for vectors.
    last = np.zeros((9, len(x)))
    last[:3, 3 * steps : 3 * steps + 3] = last[3:6, -3:] = np.eye(3)
    noise = noises(guess, biases, first)[-1]
    for k, own in enumerate(1e-6 * np.eye(len(x))):
        errors, others = own[3:].reshape(2, steps, 3)
        moved = noises(guess * Rotation.from_rotvec(errors), biases + others, first + own[:3])[-1]
        last[6:, k] = (moved - noise) / 1e-6
    return guess[-1], biases[-1], noise, last @ np.linalg.inv(jacobian.T @ jacobian) @ last.T


@pytest.mark.parametrize("steps", [1, 19, pytest.param(26, marks=pytest.mark.slow)])
def test_estimate_is_the_most_likely_one(steps):
    # The last one filters what all readings up to now say: a smoother's last state. Among the ends some have a new attitude.
    attitudes, rates, new = flight(steps, seed=steps)
    agrees(filtered(attitudes, rates, new)[-1], most_likely(attitudes, rates, new), rates[-1])


@pytest.mark.parametrize("steps", leading([1, 13, 15, 17], 2))
def test_estimate_of_two_trackers_is_the_most_likely_one(steps):
    """At the last step both attitudes are new, or the second, or none; the first is the second's alone or both's."""
    attitudes, rates, new = flight(steps, seed=steps)
    second = flight(steps, steps, *SECOND)[0], np.arange(steps) % 2 == 0
    params = PARAMS._replace(more_trackers=((*SECOND[:2], *SECOND[2]),))
    new = np.arange(steps) % 3 == (0 if steps != 17 else 2)
    agrees(filtered(attitudes, rates, new, params, second=second)[-1], most_likely(attitudes, rates, new, second), rates[-1])


def agrees(found, wanted, reading):
    """An estimate and what is remembered are of greatest likelihood; reading: the gyro's last one."""
    (estimate, memory), (turn, bias, noise, covariance) = found, wanted
    apart = (turn.inv() * Rotation.from_quat(estimate.attitude, scalar_first=True)).as_rotvec()
    deviations = np.sqrt(np.diag(covariance))
    assert np.abs(apart / deviations[:3]).max() < 4e-3
    assert np.abs((np.array(estimate.gyro_bias) - bias) / deviations[3:6]).max() < 4e-3
    of_rate = np.hstack([np.zeros((3, 3)), np.eye(3), np.eye(3)])
    slack = np.sqrt(np.diag(of_rate @ covariance @ of_rate.T))
    assert np.abs((np.array(estimate.rate) - (reading - bias - noise)) / slack).max() < 4e-3
    assert np.array((estimate.attitude_deviation, estimate.gyro_bias_deviation)).ravel() == pytest.approx(
        deviations[:6], rel=4e-3
    )
    # What is remembered is the attitude less half a period of that noise.
    ahead = np.eye(6, 9)
    ahead[:3, 6:] = -0.5 * PERIOD * np.eye(3)
    kept = Rotation.from_quat(memory.attitude, scalar_first=True)
    wanted = turn * Rotation.from_rotvec(-0.5 * PERIOD * noise)
    scaled = np.sqrt(np.diag(ahead @ covariance @ ahead.T))
    assert np.abs((wanted.inv() * kept).as_rotvec() / scaled[:3]).max() < 4e-3
    blocks = np.block([[np.array(memory.turn), np.array(memory.mixed)], [np.array(memory.mixed).T, np.array(memory.walk)]])
    assert np.abs((blocks - ahead @ covariance @ ahead.T) / np.outer(scaled, scaled)).max() < 4e-3


def test_first_attitude_is_taken_and_counted_once():
    attitudes, rates, _ = flight(3, seed=8)
    _, (second, memory), _ = filtered(attitudes, rates, [False, True, False])
    assert np.abs(np.array(second.attitude) - attitudes[1]).max() < 1e-15
    tracker = np.array(mekf.prepare(PARAMS, PERIOD).tracker)
    assert np.array(second.attitude_deviation) ** 2 == pytest.approx(np.diag(tracker), rel=1e-12)
    # With half a period of the gyro's noise, whose variance over a period is that of a second times it.
    assert np.abs(memory.turn - tracker - 0.25 * PARAMS.noise**2 * PERIOD * np.eye(3)).max() < 1e-20


def test_before_the_first_attitude_the_gyro_carries_the_stated_start_on():
    """What a sensor shows meanwhile counts for nothing."""
    attitudes, rates, _ = flight(9, seed=8)
    params = PARAMS._replace(start=(0.9, 0.0, 1.2, 0.0), start_deviation=0.02)
    one, other = (filtered(shown, rates, [False] * 9, params) for shown in (attitudes, attitudes[::-1]))
    assert [estimate for estimate, _ in one] == [estimate for estimate, _ in other]
    turn = Rotation.from_quat([0.6, 0.0, 0.8, 0.0], scalar_first=True)
    for k, (estimate, _) in enumerate(one):
        turn = turn * Rotation.from_rotvec(0.5 * PERIOD * (rates[k - 1] + rates[k])) if k else turn
        assert (turn.inv() * Rotation.from_quat(estimate.attitude, scalar_first=True)).magnitude() < 1e-9
        # Nearly all that grows is the bias's: error times time.
        wanted = math.hypot(0.02, PARAMS.bias * PERIOD * k)
        assert estimate.attitude_deviation == pytest.approx((wanted,) * 3, rel=2e-3)


def test_deviation_of_an_unknown_attitude():
    turns = Rotation.random(20_000, rng=np.random.default_rng(4)).as_rotvec()
    assert mekf.Params._field_defaults["start_deviation"] == pytest.approx(np.sqrt((turns**2).mean()), rel=0.01)


def test_bad_numbers():
    with pytest.raises(ValueError, match="boresight"):
        mekf.prepare(PARAMS._replace(boresight=(0.0, 0.0, 0.0)), PERIOD)
    with pytest.raises(ValueError, match="quaternion of length 1"):
        mekf.prepare(PARAMS._replace(start=(0.0, 0.0, 0.0, 0.0)), PERIOD)


def test_settled_gains_are_those_to_which_steps_lead():
    """They are found in machine code; here step by step, with a bias that wanders so much that they settle soon."""
    rate, every = (0.0, -2e-3, 1e-3), 3
    numbers = mekf.prepare(PARAMS._replace(bias_walk=0.3), 1.0)
    memory, gains, change, size = mekf.remember(numbers, None)._replace(rate=rate), [np.zeros((4, 3, 3))], 1.0, 0.0
    while np.any(change > 1e-9 * size):
        for _ in range(every):
            now = mekf.arrived(mekf.propagated(memory, rate, numbers, 1.0), numbers)
            memory = now.memory
        by = mekf.correction(now, [(now.attitude, True)], [], numbers)
        memory = mekf.corrected(now, by, numbers, 1.0).memory
        gains.append(by.gain)
        change, size = (np.abs(x).max(axis=(1, 2)) for x in (np.subtract(*gains[-2:]), np.array(by.gain)))
    assert 3 < len(gains) < 1000
    assert mekf.settled(numbers, every, rate, 1.0) == gains[-1]
