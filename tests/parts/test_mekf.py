"""The Kalman filter against the most likely motion given all readings at once, and its errors in 10 000 flights."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from starhold.algebra.quaternion import multiply, relative, vector_part
from starhold.algebra.scalar import side
from starhold.algebra.structure import flatten, places
from starhold.algebra.vector import scale, subtract
from starhold.conformance.bench import CRAFT
from starhold.loop.kernels import Observer, numbers_of
from starhold.parts.estimators import mekf
from starhold.scenario.building import build
from starhold.scenario.reading import parse
from starhold.simulation.lanes import RunningBatch, ThreadPool

ARCSEC = math.radians(1.0 / 3600.0)
PERIOD = 0.5
PARAMS = mekf.Params(5e-5, 3e-3, 1e-3, 20.0 * ARCSEC, 120.0 * ARCSEC, (0.0, 0.6, 0.8))


def filtered(attitudes, rates, new, params=PARAMS, period=PERIOD):
    """The filter's estimates and memories at all control steps."""
    numbers = mekf.prepare(params, period)
    memory, found = mekf.remember(numbers, None), []
    for attitude, rate, fresh in zip(attitudes, rates, new, strict=True):
        readings = SimpleNamespace(attitude=tuple(attitude), rate=tuple(rate), attitude_is_new=float(fresh))
        estimate, memory = mekf.estimate(readings, memory, numbers, CRAFT, period)
        found.append((estimate, memory))
    return found


def flight(steps, seed):
    """Readings of a body that turns ever faster: attitudes (scalar first), rates, and which attitudes are new."""
    random = np.random.default_rng(seed)
    axis = np.array(PARAMS.boresight)
    bias = random.normal(scale=PARAMS.bias, size=3)
    rate, turn = np.array([0.02, -0.05, 0.03]), Rotation.from_rotvec([0.4, -1.0, 2.0])
    attitudes, rates = [], []
    for _ in range(steps):
        angles = random.normal(size=3)
        error = PARAMS.cross * (angles - axis * (axis @ angles)) + PARAMS.roll * axis * (axis @ angles)
        attitudes.append((turn * Rotation.from_rotvec(error)).as_quat(scalar_first=True))
        rates.append(rate + bias + random.normal(scale=PARAMS.noise / math.sqrt(PERIOD), size=3))
        push = random.normal(scale=2e-3, size=3)
        turn, rate = turn * Rotation.from_rotvec(PERIOD * (rate + 0.5 * push)), rate + push
        bias = bias + random.normal(scale=PARAMS.bias_walk * math.sqrt(PERIOD / 3600.0), size=3)
    return np.array(attitudes), np.array(rates), np.arange(steps) % 3 == 0


def most_likely(attitudes, rates, new):
    """The attitude, bias and noise of the gyro's reading at the last step, of greatest likelihood given all readings, by
    nonlinear least squares over all of them, and the covariance of these nine numbers."""
    steps = len(rates)
    measured = Rotation.from_quat(attitudes, scalar_first=True)
    axis = np.array(PARAMS.boresight)
    tracker = np.linalg.inv(PARAMS.cross * np.eye(3) + (PARAMS.roll - PARAMS.cross) * np.outer(axis, axis))
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
        seen = (turns.inv() * measured).as_rotvec()[new] @ tracker.T
        noise = noises(turns, biases, x[:3]) / deviation
        parts = [seen, noise, np.diff(biases, axis=0) / walk, biases[:1] / PARAMS.bias]
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
    estimate, memory = filtered(attitudes, rates, new)[-1]
    turn, bias, noise, covariance = most_likely(attitudes, rates, new)
    apart = (turn.inv() * Rotation.from_quat(estimate.attitude, scalar_first=True)).as_rotvec()
    deviations = np.sqrt(np.diag(covariance))
    assert np.abs(apart / deviations[:3]).max() < 4e-3
    assert np.abs((np.array(estimate.gyro_bias) - bias) / deviations[3:6]).max() < 4e-3
    of_rate = np.hstack([np.zeros((3, 3)), np.eye(3), np.eye(3)])
    slack = np.sqrt(np.diag(of_rate @ covariance @ of_rate.T))
    assert np.abs((np.array(estimate.rate) - (rates[-1] - bias - noise)) / slack).max() < 4e-3
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


SCENARIO = f"""
name = "kalman"
[spacecraft]
inertia = [0.05, 0.065, 0.025]
torque_limit = "1 mN m"
[initial]
angles = ["50 deg", "-20 deg", "10 deg"]
rate = ["2 deg/s", "-3 deg/s", "1 deg/s"]
[simulation]
duration = 80.0
control_period = {PERIOD}
[[part]]
type = "gyro"
noise = {PARAMS.noise}
bias_walk = {PARAMS.bias_walk}
[[part]]
type = "star-tracker"
cross = {PARAMS.cross}
roll = {PARAMS.roll}
boresight = [0, 0.6, 0.8]
interval = 2.0
[[part]]
type = "mekf"
noise = {PARAMS.noise}
bias_walk = {PARAMS.bias_walk}
bias = {PARAMS.bias}
cross = {PARAMS.cross}
roll = {PARAMS.roll}
boresight = [0, 0.6, 0.8]
start_deviation = "1 deg"
[[law]]
type = "pd"
k_rate = 0.004
k_attitude = 0.0008
"""
ERRORS = ((0.0,) * 3,) * 3
SQUARE = ((0.0,) * 3,) * 3


def noted(notes, decided, carry, step, setup, numbers):
    """At a control instant: errors of the estimate (attitude in rad, body axes, and bias) and their deviations; the error
    of the attitude that is remembered, and its covariance with the bias."""
    memories = decided.memories
    estimate, memory, reading = memories.estimate, memories.estimator, memories.readings[0]
    # The bias of this instant, for what the gyro keeps is that of the next.
    bias, true = notes[-1], decided.state.attitude
    noise = subtract(subtract(reading.rate, decided.state.rate), bias)
    kept = multiply(true, (1.0, *scale(-0.25 * PERIOD, noise)))
    found = (between(estimate.attitude, true), subtract(bias, estimate.gyro_bias), between(memory.attitude, kept))
    deviations = (estimate.attitude_deviation, estimate.gyro_bias_deviation)
    return (found, deviations, memory.turn, memory.mixed, memory.walk, memories.sensors[0])


def between(one, other):
    """The rotation vector from an attitude to one near to it."""
    error = relative(one, other)
    return scale(2.0 * side(error[0]), vector_part(error))


def flown_by_many(outage, lanes, steps):
    """At each of these control steps: errors (lanes, 6) in many flights and the filter's deviations of them, and the errors
    of what is remembered with their covariances (lanes, 6, 6)."""
    scenario = parse(SCENARIO, "kalman").with_({"part.star-tracker.outage": outage})
    loop = build(scenario, scenario.laws[0])
    like = loop.carry()
    rows = places(like)
    columns = np.repeat(np.array(numbers_of(like))[:, None], lanes, axis=1)
    assert [fitted.called for fitted in loop.used("sensor")] == ["gyro", "star-tracker"]
    # Each has a bias of its own, and an attitude near the stated one, as the filter expects.
    random = np.random.default_rng(2)
    biases = random.normal(scale=PARAMS.bias, size=(3, lanes))
    columns[list(rows.memories.sensors[0])] = biases
    turns = Rotation.from_rotvec(random.normal(scale=math.radians(1.0), size=(lanes, 3)))
    columns[list(rows.state.attitude)] = turns.as_quat(scalar_first=True).T
    first = (ERRORS, ERRORS[:2], SQUARE, SQUARE, SQUARE, (0.0,) * 3)
    begin = np.zeros((len(flatten(first)), lanes))
    begin[-3:] = biases
    batch = RunningBatch(loop, columns, 0, 8, Observer(noted, first, ()), begin)
    (phase,) = loop.phases(160)
    flown = 0
    for step in steps:
        with ThreadPool(2) as pool:
            pool.share(lambda piece, flown=flown, step=step: batch.fly(phase, piece, flown, step + 1 - flown), batch.count)()
        flown = step + 1
        notes = batch.notes().T
        turn, mixed, walk = notes[:, 15:42].reshape(lanes, 3, 3, 3).swapaxes(0, 1)
        covariance = np.block([[turn, mixed], [mixed.swapaxes(1, 2), walk]])
        yield notes[:, :6], notes[:, 9:15], notes[:, [6, 7, 8, 3, 4, 5]], covariance


LANES = 10_000


@pytest.mark.parametrize(
    ("outage", "steps"),
    [
        # A second and a half after an update, at it, and in between; at the end of thirty seconds on the gyro, and after.
        ((30.0, 60.0), (55, 56, 57, 58, 119, 144)),
        # Before the first attitude, at it, and after it.
        ((0.0, 10.0), (0, 1, 19, 20, 21, 22)),
    ],
)
def test_errors_are_as_large_as_the_filter_says(outage, steps):
    sizes = []
    for errors, deviations, kept, covariances in flown_by_many(outage, LANES, steps):
        sizes.append(deviations[:, :3].mean())
        inside = (np.abs(errors) < 3.0 * deviations).mean(axis=0)
        # Of 10 000 flights the share scatters by 0.0005, the mean square by 0.014.
        assert (np.abs(inside - 0.9973) < 0.002).all(), inside
        squares = ((errors / deviations) ** 2).mean(axis=0)
        assert (np.abs(squares - 1.0) < 0.05).all(), squares
        # All six together: chi-square of six degrees of freedom, whose mean over the flights scatters by 0.035.
        together = np.einsum("li,lij,lj->l", kept, np.linalg.inv(covariances), kept).mean()
        assert abs(together - 6.0) < 0.12
    if outage[0] > 0.0:
        assert sizes[4] > 2.0 * sizes[3] > 1.5 * sizes[5]


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
