"""The Kalman filter against the most likely motion given all readings at once, and its errors in 10 000 flights."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from starhold.algebra.quaternion import relative, vector_part
from starhold.algebra.scalar import side
from starhold.algebra.structure import places
from starhold.algebra.vector import scale, subtract
from starhold.conformance.bench import CRAFT
from starhold.loop.kernels import Observer, numbers_of
from starhold.parts.estimators import mekf
from starhold.scenario.building import build
from starhold.scenario.reading import parse
from starhold.simulation.lanes import Crew, Fleet

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
    """The attitudes and biases of greatest likelihood given all readings, by nonlinear least squares over all of them, and
    the covariance of the last six numbers: attitude (rad, body axes) and bias."""
    steps = len(rates)
    measured = Rotation.from_quat(attitudes, scalar_first=True)
    axis = np.array(PARAMS.boresight)
    walk = PARAMS.bias_walk**2 / 3600.0
    turned, mixed = PARAMS.noise**2 * PERIOD + walk * PERIOD**3 / 3.0, -0.5 * walk * PERIOD**2
    noise = np.kron([[turned, mixed], [mixed, walk * PERIOD]], np.eye(3))
    process = np.linalg.inv(np.linalg.cholesky(noise))
    tracker = np.linalg.inv(PARAMS.cross * np.eye(3) + (PARAMS.roll - PARAMS.cross) * np.outer(axis, axis))
    # From a guess that the gyro carries on.
    means = 0.5 * (rates[1:] + rates[:-1])
    guess = [measured[0]]
    for mean in means:
        guess.append(guess[-1] * Rotation.from_rotvec(PERIOD * mean))
    guess = Rotation.concatenate(guess)

    def residuals(x):
        errors, biases = x.reshape(2, steps, 3)
        turns = guess * Rotation.from_rotvec(errors)
        seen = (turns.inv() * measured).as_rotvec()[new] @ tracker.T
        ahead = turns[:-1] * Rotation.from_rotvec(PERIOD * (means - biases[:-1]))
        steps_off = np.hstack([(ahead.inv() * turns[1:]).as_rotvec(), np.diff(biases, axis=0)]) @ process.T
        return np.concatenate([seen.ravel(), steps_off.ravel(), biases[0] / PARAMS.bias])

    # The covariance is that in the axes of the attitudes found, so these are the guess in the end.
    scales = np.repeat([1e-4, 1e-3], 3 * steps)
    biases = np.zeros((steps, 3))
    for _ in range(2):
        begin = np.concatenate([np.zeros(3 * steps), biases.ravel()])
        found = least_squares(residuals, begin, x_scale=scales, xtol=1e-13, ftol=1e-13)
        errors, biases = found.x.reshape(2, steps, 3)
        guess = guess * Rotation.from_rotvec(errors)
    covariance = np.linalg.inv(found.jac.T @ found.jac)
    last = [*range(3 * steps - 3, 3 * steps), *range(6 * steps - 3, 6 * steps)]
    return guess[-1], biases[-1], covariance[np.ix_(last, last)]


@pytest.mark.parametrize("steps", [1, 19, pytest.param(26, marks=pytest.mark.slow)])
def test_estimate_is_the_most_likely_one(steps):
    # The last one filters what all readings up to now say: a smoother's last state. Among the ends some have a new attitude.
    attitudes, rates, new = flight(steps, seed=steps)
    estimate, memory = filtered(attitudes, rates, new)[-1]
    turn, bias, covariance = most_likely(attitudes, rates, new)
    apart = (turn.inv() * Rotation.from_quat(estimate.attitude, scalar_first=True)).as_rotvec()
    deviations = np.sqrt(np.diag(covariance))
    assert np.abs(apart / deviations[:3]).max() < 4e-3
    assert np.abs((np.array(estimate.gyro_bias) - bias) / deviations[3:]).max() < 4e-3
    assert np.array((estimate.attitude_deviation, estimate.gyro_bias_deviation)).ravel() == pytest.approx(
        deviations, rel=4e-3
    )
    blocks = np.block([[np.array(memory.turn), np.array(memory.mixed)], [np.array(memory.mixed).T, np.array(memory.walk)]])
    scaled = np.outer(deviations, deviations)
    assert np.abs((blocks - covariance) / scaled).max() < 4e-3


SCENARIO = f"""
name = "kalman"
[spacecraft]
inertia = [0.05, 0.065, 0.025]
torque_limit = "1 mN m"
[initial]
angles = ["50 deg", "-20 deg", "10 deg"]
rate = ["2 deg/s", "-3 deg/s", "1 deg/s"]
[simulation]
duration = 120.0
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
interval = 1.0
outage = [60, 90]
[[part]]
type = "mekf"
noise = {PARAMS.noise}
bias_walk = {PARAMS.bias_walk}
bias = {PARAMS.bias}
cross = {PARAMS.cross}
roll = {PARAMS.roll}
boresight = [0, 0.6, 0.8]
[[law]]
type = "pd"
k_rate = 0.004
k_attitude = 0.0008
"""


def noted(notes, decided, carry, step, setup, numbers):
    """The errors of the estimate at a control instant (attitude in rad, body axes, and bias), and the covariance."""
    estimate, gyro = decided.memories.estimate, decided.memories.sensors[0]
    error = relative(estimate.attitude, decided.state.attitude)
    angles = scale(2.0 * side(error[0]), vector_part(error))
    memory = decided.memories.estimator
    return (angles, subtract(gyro, estimate.gyro_bias), memory.turn, memory.mixed, memory.walk)


def fly_all(lanes):
    """Errors (lanes, 6) and the filter's covariances (lanes, 6, 6) in many flights before, at the end of, and after an
    outage."""
    scenario = parse(SCENARIO, "kalman")
    loop = build(scenario, scenario.laws[0])
    like = loop.carry()
    rows = places(like)
    columns = np.repeat(np.array(numbers_of(like))[:, None], lanes, axis=1)
    assert [fitted.called for fitted in loop.used("sensor")] == ["gyro", "star-tracker"]
    # Each gyro has a bias of its own, as the filter expects.
    columns[list(rows.memories.sensors[0])] = np.random.default_rng(2).normal(scale=PARAMS.bias, size=(3, lanes))
    square = ((0.0,) * 3,) * 3
    observer = Observer(noted, ((0.0,) * 3, (0.0,) * 3, square, square, square), ())
    fleet = Fleet(loop, columns, 0, 8, observer, np.zeros((33, lanes)))
    (phase,) = loop.phases(240)
    begun = 0
    for stop in (119, 180, 239):
        with Crew(2) as crew:
            crew.share(lambda piece, begun=begun, stop=stop: fleet.fly(phase, piece, begun, stop - begun), fleet.count)()
        begun = stop
        notes = fleet.notes().T
        turn, mixed, walk = notes[:, 6:].reshape(lanes, 3, 3, 3).swapaxes(0, 1)
        # The bias that a gyro keeps is that of the next control step.
        walk = walk + PARAMS.bias_walk**2 / 3600.0 * PERIOD * np.eye(3)
        yield notes[:, :6], np.block([[turn, mixed], [mixed.swapaxes(1, 2), walk]])


def test_errors_are_within_three_deviations_in_997_of_1000_flights():
    lanes = 10_000
    sizes = []
    for errors, covariances in fly_all(lanes):
        deviations = np.sqrt(np.einsum("lii->li", covariances))
        inside = (np.abs(errors) < 3.0 * deviations).mean(axis=0)
        # Of 10 000 flights the share scatters by 0.0005.
        assert (np.abs(inside - 0.9973) < 0.002).all(), inside
        # All six together: chi-square of six degrees of freedom, whose mean over the flights scatters by 0.035.
        squares = np.einsum("li,lij,lj->l", errors, np.linalg.inv(covariances), errors)
        assert abs(squares.mean() - 6.0) < 0.15
        sizes.append(deviations[:, :3].mean())
    # Thirty seconds on the gyro alone.
    assert sizes[1] > 2.0 * sizes[0] > 1.5 * sizes[2]


def test_first_attitude_is_taken_and_counted_once():
    attitudes, rates, _ = flight(3, seed=8)
    (first, _), (second, memory), _ = filtered(attitudes, rates, [False, True, False])
    assert Rotation.from_quat(first.attitude, scalar_first=True).approx_equal(
        Rotation.from_quat(attitudes[0], scalar_first=True), 1e-12
    )
    assert np.abs(np.array(second.attitude) - attitudes[1]).max() < 1e-15
    assert np.abs(np.subtract(memory.turn, mekf.prepare(PARAMS, PERIOD).tracker)).max() < 1e-20


def test_bad_numbers():
    with pytest.raises(ValueError, match="boresight"):
        mekf.prepare(PARAMS._replace(boresight=(0.0, 0.0, 0.0)), PERIOD)
