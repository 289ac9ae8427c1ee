"""The model of the predictive law against the true motion, and its sampling."""

from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from starhold.algebra.quaternion import conjugate, derivative, multiply, normalise
from starhold.algebra.structured import Buffer
from starhold.laws.predictive.motion import Linear, linearise, sample
from starhold.laws.predictive.problem import Problem, motion, size
from starhold.parts.bodies.rigid_body import angular_acceleration
from tests.equations import two_body_gravity_gradient
from tests.mpc.setting import CRAFTS, POSITION, seen_at


def whole(linear: Linear) -> tuple[Any, Any]:
    """A (6, 6) and B (6, 3) of its blocks."""
    a = np.block([[np.array(linear.turning), 0.5 * np.eye(3)], [np.array(linear.stiffness), np.array(linear.damping)]])
    return a, np.vstack([np.zeros((3, 3)), np.array(linear.push)])


@pytest.mark.parametrize("craft", CRAFTS.values(), ids=CRAFTS)
@pytest.mark.parametrize(("rate", "period"), [((0.04, 0.03, 0.02), 0.1), ((1.0, -2.0, 1.5), 0.7), ((3.0, 5.0, -4.0), 2.0)])
def test_sampling_is_exact(craft: Any, rate: Any, period: float):
    linear = linearise(seen_at((0.3, 0.5, -0.2, 0.7), rate, POSITION), craft)
    joint = np.zeros((9, 9))
    joint[:6] = np.hstack(whole(linear))
    exact = expm(joint * period)
    problem = Problem(Buffer([np.nan] * size(1)), 1, ball=False)
    sample(problem, linear, period)
    a, b = map(np.array, motion(problem))
    assert np.abs(a - exact[:6, :6]).max() <= 1e-13 * np.abs(exact[:6, :6]).max()
    assert np.abs(b - exact[:6, 6:]).max() <= 1e-13 * np.abs(exact[:6, 6:]).max()


@pytest.mark.parametrize("craft", CRAFTS.values(), ids=CRAFTS)
def test_model_is_the_derivative_of_the_motion(craft: Any):
    q, w = normalise((0.4, 0.3, -0.6, 0.2)), (0.05, -0.03, 0.08)
    # Closer than any orbit, so that gravity is not lost beside the gyroscopic terms.
    place = (3e4, -2e4, 5e4)

    def error_rate(x: Any, u: Any) -> Any:
        # Of (q; w) relative to the motion through q, w: the error quaternion is q* o disturbed q.
        small = (np.sqrt(1.0 - x[:3] @ x[:3]), *x[:3].tolist())
        attitude, rate = multiply(q, small), tuple((np.array(w) + x[3:]).tolist())
        external = two_body_gravity_gradient(place, attitude, craft)[1]
        total = tuple((np.array(external) + u).tolist())
        before = multiply(conjugate(derivative(q, w)), attitude)
        after = multiply(conjugate(q), derivative(attitude, rate))
        return np.array([*(before[i] + after[i] for i in (1, 2, 3)), *angular_acceleration(rate, total, craft)])

    here = multiply(multiply(conjugate(q), (0.0, *place)), q)[1:]
    a, b = whole(linearise(seen_at(q, w, here), craft))
    step = 1e-4
    steps = [step * unit for unit in np.eye(9)]
    slopes = [(error_rate(d[:6], d[6:]) - error_rate(-d[:6], -d[6:])) / (2.0 * step) for d in steps]
    true = np.array(slopes).T
    assert a == pytest.approx(true[:, :6], rel=1e-6, abs=1e-7)
    assert b == pytest.approx(true[:, 6:], rel=1e-6, abs=1e-9)
    # The gravity block is not negligible here, so its factor 6 is tested.
    assert np.abs(true[3:, :3]).max() > 1e-3
