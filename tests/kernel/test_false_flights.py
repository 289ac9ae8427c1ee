"""False claims that one hypothesis alone refuses, and flights against them, pushed one way after the other."""

from fractions import Fraction

import numpy as np
import pytest

from starhold.algebra.quaternion import vector_part
from starhold.algebra.scalar import less, where
from starhold.algebra.vector import add, apply, cross, scale, subtract
from tests.kernel.certificates import POINTING, contents, failing
from tests.kernel.flights import feedback, moved, rates, stepped, turn
from tests.kernel.handmade import case
from tests.kernel.oracle import Oracle, number
from tests.kernel.programs import run

REST = np.array([[1.0], [0.0], [0.0], [0.0]]), np.zeros((3, 1))


def about(angle):
    """A turn about the first axis."""
    return np.array([[np.cos(angle / 2)], [np.sin(angle / 2)], [0.0], [0.0]])


@pytest.mark.slow
def test_errors_of_the_attitude_hold_a_body_at_a_half_turn_where_the_sign_changes():
    content = contents("flying", "half turn")
    (claim,) = content["claims"]
    assert failing(claim, content["programs"]) == set()
    claim["taken"].append("shortest sign")
    assert failing(claim, content["programs"]) == {"the sign never changes"}
    oracle, (_, *gains, h) = Oracle(content, claim), POINTING["half turn"][0]
    n, J, law = oracle.numbers, oracle.J, feedback(oracle.J, *gains)
    q, w = about(n["angle"]), np.zeros((3, 1))
    assert oracle.lyapunov(q[:, 0], w[:, 0]) <= n["level"]
    for _ in range(int(1.2 * n["settling"] / h)):
        angle = 2 * np.arctan2(q[1, 0], q[0, 0])
        told = about(angle + np.copysign(n["error.attitude"], np.pi - angle - 5.0 * w[0, 0]))
        q, w = moved(J, np.linalg.inv(J), q, w, law(np.copysign(told, told[0]), w), h)
    assert turn(q) > 10 * n["end.angle"]


def test_between_samples_a_body_turns_as_far_as_its_acceleration_takes_it():
    """Damped almost twice as much as a period takes, the rate changes its sign from one sample to the next."""
    content = contents("flying", "overdamped")
    (claim,) = content["claims"]
    assert failing(claim, content["programs"]) == set()
    gains = claim["evidence"]["response"]["gains"]
    gains[2] = [str(Fraction(number(x)) / 10000) for x in gains[2]]
    claim["numbers"]["end.angle"] = str(Fraction(number(claim["numbers"]["end.angle"])) * Fraction(34, 100))
    assert failing(claim, content["programs"]) == {"response of the acceleration"}
    (J, *gains, h), (outside, *_) = POINTING["overdamped"]
    J, (q, w), far = np.diag(J), REST, 0.0
    law, inverse = feedback(J, *gains), np.linalg.inv(J)
    for k in range(700):
        torque = law(q, w) + np.array([[outside * (-1) ** k], [0.0], [0.0]])
        for _ in range(4):
            q, w = moved(J, inverse, q, w, torque, h / 4)
            far = max(far, turn(q)[0])
    assert 700 * h > number(claim["numbers"]["settling"])
    assert far > 1.2 * number(claim["numbers"]["end.angle"])


SKEW = ((0.407, 0.035, -0.166), (0.035, 0.474, 0.075), (-0.166, 0.075, 0.119))
SOFT, SIZE, SLOPE = np.array([2.2, 0.0128, 18.4]), np.array([1.0, 109.0, 0.53]) / 5000, 1.0
"""Slopes of the layers, how large s is where they balance the torque from outside, and the slope of the surface."""
ROUND = ((0, -1), (1, 1), (2, 1), (0, 1), (1, 1), (0, 1), (1, -1))
"""The axes that one after the other are pushed one way, until s comes to where the layer balances that."""
FARTHEST = np.array([165.47, -1.0, 1032.3])


def slope_of(w, q):
    return w + SLOPE * q[1:]


def layered(m):
    """Feedback that reaches w + q = 0 and, beyond its layer, hardly withstands the torque from outside."""
    q, w = vector_part(m.attitude), m.rate
    turned = scale(-0.5 * SLOPE, add(scale(m.attitude[0], w), cross(q, w)))
    own = add(cross(w, apply(SKEW, w)), apply(SKEW, turned))
    s, held = add(w, scale(SLOPE, q)), SOFT * SIZE * (1.0 + 2.0**-20)
    clipped = [(c * x, float(most)) for c, x, most in zip(SOFT.tolist(), s, held, strict=True)]
    return subtract(own, tuple(where(less(most, x), most, where(less(x, -most), -most, x)) for x, most in clipped))


@pytest.mark.slow
def test_axes_that_gain_one_after_the_other_take_a_body_out_of_its_layer():
    moments, gain = np.linalg.eigvalsh(SKEW), (SOFT * SIZE**2).sum() / 4
    far = 1.0001 * (SIZE / 2 + np.sqrt(SIZE**2 / 4 + gain / SOFT))
    size = 1.0001 * np.sqrt(moments[2] / moments[0] * (far**2).sum())
    told = dict(zip(("far_0", "far_1", "far_2"), far, strict=True))
    told |= dict(zip(("outside_0", "outside_1", "outside_2"), SOFT * SIZE, strict=True))
    told |= {"inertia_low": 0.99999 * moments[0], "inertia_high": 1.00001 * moments[2], "surface": size}
    told |= {"surface_low": 0.99999 * SLOPE, "surface_high": 1.00001 * SLOPE, "end_rate": 2.01 * size}
    told |= {"end_angle": 2 * np.arcsin(1.001 * size / SLOPE)}

    def surface(m):
        return add(m.rate, scale(SLOPE, vector_part(m.attitude)))

    claim, programs = case(layered, theorem="reaches its surface", s=surface, taken=["outside torque"], **told)
    claim["subject"] = {f"body.inertia.{i}.{k}": str(Fraction(SKEW[i][k])) for i in range(3) for k in range(i, 3)}
    assert failing(claim, programs) == {"beyond the layer"}
    J, most, law = np.array(SKEW), (SOFT * SIZE)[:, None], programs[claim["programs"]["law"]]
    inverse = np.linalg.inv(J)

    def after(q, w, h, axis, sign):
        """The state after a time in which torques hold all axes that they can, but one that they push."""

        def slope(q, w):
            pushed = np.clip(SOFT[:, None] * slope_of(w, q), -most, most)
            pushed[axis] = sign * most[axis] if sign else pushed[axis]
            values = {f"measurement.{name}.{k}": x for name, v in (("attitude", q), ("rate", w)) for k, x in enumerate(v)}
            return rates(J, inverse, q, w, run(law, values) + pushed)

        return stepped(slope, (q, w), h)

    q, w = REST
    w = (0.995 * FARTHEST * SIZE)[:, None]
    for axis, sign in ROUND:
        while sign * (s := slope_of(w, q)[axis, 0]) < 0.999 * SIZE[axis]:
            slow = max(1.0, abs(s) / SIZE[axis] / 2)
            q, w = after(q, w, min(0.5 * slow / inverse[axis, axis] / SOFT[axis], 0.5), axis, sign)
    assert np.linalg.norm(slope_of(w, q)) > np.linalg.norm(0.995 * FARTHEST * SIZE)
    for _ in range(60):
        q, w = after(q, w, 0.5, 0, 0)
    assert turn(q) > 1.02 * told["end_angle"]
