"""Feedback on modified Rodrigues parameters, against what is published of it and the parameters' own definition."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from starhold.algebra.vector import ZERO
from starhold.conformance.bench import random_quaternions
from starhold.laws.catalogue import catalogue
from starhold.laws.interface import Measurement, NoMemory
from starhold.laws.mrp import Gains, design, torque
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.bodies.rigid_body import State
from starhold.parts.craft import make_craft
from starhold.synthesis.response import Bandwidth
from tests.making import flown

CRAFT = make_craft((2.0, 3.0, 4.0), np.inf)
GAINS = Gains(k_rate=0.3, k_attitude=0.7)


def parameters(attitude):
    """The modified Rodrigues parameters of the short turn, by SciPy."""
    w, *xyz = attitude
    return Rotation.from_quat([*xyz, w]).as_mrp()


@pytest.mark.parametrize("attitude", random_quaternions(20))
def test_the_torque_is_that_of_the_parameters(attitude):
    rate = (0.02, -0.05, 0.01)
    seen = Measurement(attitude, rate, rate, ZERO, ZERO, ZERO, ZERO, 0.1)
    given, _ = torque(seen, GAINS, CRAFT, NoMemory())
    expected = -GAINS.k_rate * np.array(rate) - GAINS.k_attitude * parameters(attitude)
    assert given == pytest.approx(expected, abs=1e-14)


def test_the_published_function_never_rises():
    """V = w.Jw/2 + 2 k_attitude ln(1 + s.s) is non-increasing while the turn stays short."""
    start = State((0.1, 0.7, 0.1, -0.7), (0.1, -0.05, 0.02), ZERO, ZERO, ZERO)
    loop = ClosedLoop(CRAFT, catalogue()["mrp"], GAINS, start, 0.01, limit="none")
    run = flown(loop, 10_000)
    energy = 0.5 * (run["rate"] ** 2 @ np.array([2.0, 3.0, 4.0]))
    potential = [np.log1p(parameters(q) @ parameters(q)) for q in run["attitude"]]
    levels = energy + 2.0 * GAINS.k_attitude * np.array(potential)
    assert np.diff(levels).max() <= 1e-12
    assert levels[-1] < 1e-3 * levels[0]


def test_the_bandwidth_is_that_of_the_linear_loop():
    gains = design(CRAFT, Bandwidth(0.1, 0.7))
    # Near rest the parameters are a quarter of the angle.
    roots = np.roots([4.0, gains.k_rate, 0.25 * gains.k_attitude])
    assert abs(roots[0]) == pytest.approx(0.1)
    assert -roots[0].real / abs(roots[0]) == pytest.approx(0.7)
