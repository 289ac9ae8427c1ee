"""Measures of the publication on modal control against SciPy's integrator and eigenvalues, and all its verdicts."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from starhold.publications.desk import Desk
from starhold.publications.papers.D import measures, placement
from starhold.publications.papers.D.placement import Case, Spectra

START = np.r_[0.3, -0.5, 0.8]
END = math.radians(0.1)
INERTIA = np.array([[3100.0, 200.0, -90.0], [200.0, 4700.0, 150.0], [-90.0, 150.0, 3900.0]])


@pytest.fixture(scope="module")
def desk():
    return Desk("D")


def under_the_printed_regulator(state, a):
    """The motion (1.1) and (1.4) under (3.2) with K of (4.11), for a body of no particular inertia."""
    q0, q, w = state[0], state[1:4], state[4:]
    gyroscopic = -np.cross(w, INERTIA @ w)
    case = Case(state[:4], w, INERTIA, gyroscopic, np.zeros((3, 7)))
    root = a * np.eye(3)
    u = case.control(placement.regulators(case, Spectra(root, root, -0.01 * float(w @ w)))[2])
    return np.r_[-0.5 * w @ q, 0.5 * (q0 * w + np.cross(q, w)), np.linalg.solve(INERTIA, u + gyroscopic)]


def by_the_printed_loop(state, a):
    """The motion (5.2)."""
    q0, q, w = state[0], state[1:4], state[4:]
    case = Case(state[:4], w, INERTIA, np.zeros(3), np.zeros((3, 7)))
    return np.r_[-0.5 * w @ q, 0.5 * (q0 * w + np.cross(q, w)), placement.closed_loop(case, a)]


def turned(motion, start, a, until):
    """When angle and rate are within their ends for good (s), the peak rate and the peak accelerations (deg), by SciPy."""
    flown = solve_ivp(
        lambda _, x: motion(x, a), (0.0, until), start, method="LSODA", rtol=1e-10, atol=1e-12, dense_output=True
    )
    at = np.linspace(0.0, until, 30001)
    states = flown.sol(at)
    angle, rate = 2.0 * np.arcsin(np.linalg.norm(states[1:4], axis=0).clip(0.0, 1.0)), np.linalg.norm(states[4:], axis=0)
    last = np.flatnonzero((angle > END) | (rate > END))[-1]
    swings = np.array([motion(x, a)[4:] for x in states.T[::20]])
    return at[last], np.degrees(rate.max()), np.degrees(np.abs(swings).max(axis=0))


def test_the_turn_is_that_of_the_printed_regulator_in_continuous_time(desk):
    start = np.r_[math.sqrt(1.0 - START @ START), START, np.radians([-10.0, -7.0, 11.0])]
    root = measures.fitted_root(desk).value
    time, rate, accelerations = turned(under_the_printed_regulator, start, root, 30.0)
    wanted = ["time", "rate", "accelerations"]
    found = measures.turn(desk, "fit", wanted, {"simulation.control_period": 0.001}).value
    assert found == pytest.approx([time, rate, *accelerations], abs=5e-3)


def test_times_that_tie_in_steps_of_a_twentieth_of_a_second():
    """From 10 degrees the fastest root within the limits ends in the same step as the printed fit's, and no slower one."""
    half = math.radians(5.0)
    axis = np.ones(3) / math.sqrt(3.0)
    start = np.r_[math.cos(half), math.sin(half) * axis, math.radians(20.0) * axis]
    steps = [math.ceil(turned(by_the_printed_loop, start, root, 6.0)[0] / 0.05) for root in (-1.565, -1.558, -1.557)]
    assert steps[0] == steps[1] < steps[2]


def test_printed_regulators_place_the_poles():
    for case, spectra in placement.cases(10):
        a, b = case.model()
        found = np.linalg.eigvals(a - b @ placement.regulators(case, spectra)[2])
        np.testing.assert_allclose(np.sort_complex(found), np.sort_complex(spectra.poles()), rtol=0, atol=1e-6)


@pytest.mark.parametrize("wanted", [(-1.018, -2.071, -0.849), (-2.177, -0.726, -0.155), (-0.5, -9.0, -1.0)])
def test_a_curve_is_found_again_from_three_of_its_points(wanted):
    angles = np.array([0.2, 0.7, 1.5])
    c, d, e = wanted
    assert measures.through(angles, c * np.exp(d * angles) + e) == pytest.approx(wanted, rel=1e-7)
