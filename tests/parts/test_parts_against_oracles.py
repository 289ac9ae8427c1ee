"""Parts against oracles: SciPy's integrator, interpolation, and statistics with bounds of their own standard errors."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from starhold.algebra.vector import ZERO
from starhold.parts.bodies.rigid_body import State
from starhold.parts.catalogue import fit
from starhold.parts.random import Dice
from starhold.simulation.lane import fly
from tests.making import flown, hub, spun


def free(*parts, limit=0.0, **options):
    """A body under these parts; with a limit of zero no command acts."""
    return hub(*parts, **{"command_limit": limit} | options)


def turns(attitudes):
    return Rotation.from_quat(attitudes, scalar_first=True)


def angles(true, measured):
    """Rotation vectors (n, 3) from true attitudes (n, 4) to measured ones, body axes."""
    return (turns(true).inv() * turns(measured)).as_rotvec()


def acting(axes, torque):
    """A torque (N m) in these axes as one in body axes at an attitude."""
    return lambda t, q: np.array(torque) if axes == "body" else turns(q).inv().apply(torque)


@pytest.mark.parametrize("axes", ["body", "inertial"])
def test_a_constant_torque_turns_the_body_as_euler_s_equations_say(axes):
    torque = (2e-3, -1e-3, 3e-3)
    run = flown(free(fit("environment", "constant-torque", torque, ("body", "inertial").index(axes))), 300)
    attitude, rate = spun(acting(axes, torque), run["time"], run["attitude"][0], run["rate"][0])
    assert np.abs(run["attitude"] - attitude).max() < 1e-8
    assert np.abs(run["rate"] - rate).max() < 1e-9


@pytest.mark.parametrize("axes", ["body", "inertial"])
def test_a_table_is_interpolated_at_control_steps_and_held_between(axes):
    rows = ((0.55, 1e-3, 0.0, 0.0), (1.0, 2e-3, -3e-3, 1e-3), (2.5, 0.0, 4e-3, -1e-3), (4.25, 3e-3, 1e-3, 2e-3))
    columns = np.array(rows).T
    run = flown(free(fit("environment", "torque-table", rows, ("body", "inertial").index(axes))), 60)
    held = np.array([np.interp(run["time"], columns[0], column, left=0.0, right=0.0) for column in columns[1:]]).T
    assert not held[[1, 5, 43, 59]].any()
    assert np.abs(held[[6, 10, 25, 42]]).max(axis=1).min() > 1e-4
    for k in range(60):
        # A step at a time, for the torque jumps between them.
        _, end = spun(acting(axes, held[k]), (0.0, 0.1), run["attitude"][k], run["rate"][k])
        assert np.abs(end[-1] - run["rate"][k + 1]).max() < 1e-11, k


def test_a_gyro_s_scale_and_limit():
    fitted = fit("sensor", "gyro", 0.0, (0.01, 0.0, 0.0), 0.0, 0.05, 0.2)
    state, numbers = State((1.0, 0.0, 0.0, 0.0), (0.1, -0.3, 0.02), ZERO, ZERO, ZERO), fitted.prepared(0.1)
    reading, _ = fitted.part.module.measure(state, fitted.remembered(numbers, state), numbers, Dice((3, 0), 0, 0), 0)
    assert reading.rate == pytest.approx((0.115, -0.2, 0.021))


@pytest.mark.parametrize(("interval", "delay", "every", "late"), [(0.0, 0.3, 1, 3), (0.5, 0.0, 5, 0), (0.4, 0.7, 4, 7)])
def test_a_star_tracker_tells_of_the_true_attitude_some_steps_ago_at_its_own_rate(interval, delay, every, late):
    tracker = fit("sensor", "star-tracker", 0.0, 0.0, (0.0, 0.0, 1.0), interval, delay)
    run = flown(free(tracker, rate=(0.2, -0.1, 0.3)), 40)
    told, new = run["star_tracker_attitude"], run["star_tracker_attitude_is_new"]
    # A sample shows the state at its time and what was measured of it.
    steps = np.arange(40)
    assert np.abs(told[:-1] - run["attitude"][np.maximum(steps // every * every - late, 0)]).max() < 1e-15
    np.testing.assert_array_equal(new[:-1], (steps % every == 0) * 1.0)


def test_a_law_is_told_what_the_star_tracker_says():
    tracker = fit("sensor", "star-tracker", 0.0, 0.0, (0.0, 0.0, 1.0), 0.0, 0.5)
    run = flown(replace(free(tracker, rate=(0.02, 0.0, 0.0)), limit="none"), 30)
    # The rate is the true one: what is left of u = -k_rate w - k_attitude q is the attitude of five steps before.
    felt = -(run["command"] + 0.9 * run["rate"]) / 0.09
    told = run["attitude"][np.maximum(np.arange(31) - 5, 0), 1:]
    assert np.abs(felt - told).max() < 1e-14
    assert np.abs(felt - run["attitude"][:, 1:]).max() > 1e-3


def test_a_filter_finds_the_bias_of_the_gyro():
    bias = np.array([2e-3, -1e-3, 3e-3])
    parts = (fit("sensor", "gyro", 0.0, tuple(bias.tolist())), fit("sensor", "star-tracker", 0.0, 0.0))
    filtering = fit("estimator", "complementary-filter", 0.1, 0.05)
    run = flown(free(*parts, filtering, rate=ZERO), 3000)
    found = run["complementary_filter_gyro_bias"]
    assert np.abs(found[-1] - bias).max() < 1e-9
    assert np.abs(run["complementary_filter_rate"][-1]).max() < 1e-9
    assert np.abs(angles(run["attitude"], run["complementary_filter_attitude"])[-1]).max() < 1e-9
    # It settles as the linear recursion of its errors does: foretold with the bias of the step before, then put right.
    error, left = np.zeros(3), -bias
    for k in range(1, 300):
        error = error - 0.1 * left
        left = left + 0.05 * 0.1 * error
        error = 0.9 * error
        assert np.abs(found[k] - bias - left).max() < 1e-6, k


def test_a_filter_halves_the_noise_as_its_gain_says():
    gain, noise, steps = 0.05, 1e-3, 6000
    parts = (fit("sensor", "gyro"), fit("sensor", "star-tracker", noise, noise))
    run = flown(free(*parts, fit("estimator", "complementary-filter", gain, 0.0), rate=ZERO), steps)
    error = angles(run["attitude"], run["complementary_filter_attitude"])[200:-1]
    # A first-order filter passes gain / (2 - gain) of white noise's variance, with a memory of about 1 / gain steps.
    wanted = noise * math.sqrt(gain / (2.0 - gain))
    independent = error.size * gain / 2.0
    assert abs(error.std() / wanted - 1.0) < 4.0 / math.sqrt(2.0 * independent)


def test_a_lag_and_then_a_rate_limit_act_in_their_order():
    lag, rate_limit, period = 0.5, 0.02, 0.1
    chain = (fit("actuator", "lag", lag), fit("actuator", "rate-limit", rate_limit))
    run = flown(free(*chain, rate=ZERO, limit=0.05, substeps=10), 60)
    command, torque = run["command"], run["torque"]
    assert np.abs(np.diff(torque, axis=0)).max() <= rate_limit * period * (1.0 + 1e-9)
    assert np.abs(np.diff(torque, axis=0)).max() > 0.99 * rate_limit * period
    # The lag's output is exact between control steps; the limited one follows it on straight lines over substeps.
    between, acts, h = np.zeros(3), np.zeros(3), period / 10
    for k in range(60):
        assert np.abs(acts - torque[k]).max() < 1e-8, k
        for _ in range(10):
            # As the method of fourth order sees it: at the start, the middle and the end of a substep.
            begun, gap = acts, between - command[k]
            for share, weight in ((0.0, 1.0), (0.5, 4.0), (1.0, 1.0)):
                between = command[k] + gap * math.exp(-share * h / lag)
                acts = acts + weight / 6.0 * np.clip(between - begun, -h * rate_limit, h * rate_limit)
    lone = flown(free(chain[0], rate=ZERO, limit=0.05, substeps=10), 60)
    exact = np.zeros(3)
    for k in range(60):
        assert np.abs(exact - lone["torque"][k]).max() < 1e-9, k
        exact = lone["command"][k] + (exact - lone["command"][k]) * math.exp(-period / lag)


def test_two_random_torques_draw_different_numbers():
    loop = free(*(fit("environment", "random-torque", 1e-3, called=name) for name in ("one", "two")))
    memories = [fly(loop, steps)[1].memories.environments for steps in range(1, 120)]
    first, second = (np.array([memory[place] for memory in memories]) for place in (0, 1))
    assert not (first == second).any()
    assert abs(np.corrcoef(first.ravel(), second.ravel())[0, 1]) < 4.0 / math.sqrt(first.size)
    # The first draws what it draws alone.
    alone = fly(replace(loop, parts=loop.parts[:1]), 119)[1].memories.environments
    assert alone[0] == memories[-1][0]
