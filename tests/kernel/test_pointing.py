"""The loop that flies: what is proved of it, flights that are chosen against that, and certificates with one thing changed."""

import math
import time

import numpy as np
import pytest

from starhold.kernel.check import check
from tests.kernel.certificates import POINTING, contents, text
from tests.kernel.flights import Fleet, feedback, turn
from tests.kernel.oracle import Oracle, number
from tests.tiers import leading

PROVED = {"body": 0.13, "cubesat": 0.10, "moving": 0.13, "skew": 0.10}
"""Within how many degrees motions are to end."""


def numbers(content):
    return {name: number(x) for name, x in content["claims"][0]["numbers"].items()}


@pytest.mark.parametrize("name", PROVED)
def test_the_loop_is_proved_to_point(name):
    content = contents("flying", name)
    begun = time.process_time()
    (proved,) = check(text(content))
    assert time.process_time() - begun < 4.0
    assert math.degrees(numbers(content)["end.angle"]) <= PROVED[name]
    assert "the torque is what the law asks for at the last sample" in proved.statement.written()


@pytest.mark.parametrize(("name", "reached"), leading([("cubesat", 0.8), ("body", 0.8), ("skew", 0.8)], 2))
def test_no_flight_leaves_what_is_proved_and_some_come_near(name, reached):
    (J, k_rate, k_attitude, h), told = POINTING[name]
    J = np.diag(J) if np.ndim(J) == 1 else np.array(J)
    n = numbers(contents("flying", name))
    slow = math.sqrt(k_attitude / 2 / np.linalg.eigvalsh(J).max())
    fleet = Fleet(J, feedback(J, k_rate, k_attitude), h, *told[:2], slow)
    # A half from rest at the largest angle, and a half from rest on target, which lies in the last ellipsoid.
    (q, w), (target, _) = fleet.at_rest(told[2]), fleet.at_rest(0.0)
    near = np.arange(fleet.lanes) >= fleet.lanes // 2
    q[:, near], worst, V = target[:, near], 0.0, Oracle(contents("flying", name), contents("flying", name)["claims"][0])
    for k, q, w in fleet.fly(q, w, 3000):
        ended = near | (k * h > n["settling"])
        worst = max(worst, float(turn(q)[ended].max()))
        assert np.linalg.norm(w, axis=0)[ended].max() <= n["end.rate"]
        assert V.lyapunov(q, w).max() <= n["highest"]
    assert reached * n["end.angle"] <= worst <= n["end.angle"]
