"""Basilisk, an independent simulator in C++, flies the same closed loops to the same states.

Both integrate with the classical Runge-Kutta method at 0.1 s under the gravity gradient and hold the torque for 0.1 s.
What is left between them is the truncation error of the attitude, for starhold integrates the quaternion and Basilisk
modified Rodrigues parameters: it falls with the fourth power of the step, and is some 1e-11 rad here.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from benchmarks import common

from starhold.laws.catalogue import catalogue
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.bodies.rigid_body import State
from starhold.parts.craft import EARTH
from starhold.simulation.lane import fly

pytest.importorskip("Basilisk", reason="Basilisk comes with the test extra where it has a wheel")

STEPS = 1000
LEGS = 4
ATTITUDE, RATE, POSITION = 1e-10, 1e-11, 1e-14
"""Largest differences: rad, rad/s, and relative to the distance. Measured: 1e-11, 1e-12, 1e-16."""
INERTIA = np.diag(common.INERTIA)
LIMIT = 0.01


def _end(loop: ClosedLoop, steps: int) -> State:
    return fly(loop, steps, steps)[1].state


def _flown_alike(loop: ClosedLoop, oracle: Callable[[int], State]) -> None:
    """The states agree at several instants of the run."""
    for leg in range(1, LEGS + 1):
        angle, rate, away = common.gap(_end(loop, STEPS // LEGS * leg), oracle(STEPS // LEGS))
        assert angle < ATTITUDE, (leg, angle)
        assert rate < RATE, (leg, rate)
        assert away < POSITION, (leg, away)


@pytest.mark.parametrize("case", ["steady", "feedback"])
def test_motion_and_feedback_agree_with_compiled_basilisk(case: str) -> None:
    """A constant torque, and Basilisk's own feedback law. The body passes half a turn, where Basilisk changes to the
    other set of Rodrigues parameters and starhold to the other quaternion."""
    loop = common.FEEDBACK_LOOP if case == "feedback" else common.STEADY_LOOP
    _flown_alike(loop, common.in_basilisk(case))
    begun, reached = loop.start.attitude[0], _end(loop, STEPS).attitude[0]
    assert begun > 0.0 > reached or case == "steady", "the run has to pass half a turn"


def _pull(attitude: Any, position: Any) -> Any:
    """Gravity-gradient torque."""
    q0, q = attitude[0], attitude[1:]
    away = (q0 * q0 - q @ q) * position + 2.0 * (q @ position) * q - 2.0 * q0 * np.cross(q, position)
    return 3.0 * EARTH / np.linalg.norm(away) ** 5 * np.cross(away, INERTIA @ away)


def _pd(q: Any, w: Any, position: Any) -> Any:
    return -0.09 * w - 0.009 * q[1:]


def _lyapunov(q: Any, w: Any, position: Any) -> Any:
    return _pd(q, w, position) + np.cross(w, INERTIA @ w) - _pull(q, position)


def _sliding(q: Any, w: Any, position: Any) -> Any:
    turning = 0.5 * (q[0] * w + np.cross(q[1:], w))
    equivalent = np.cross(w, INERTIA @ w) - INERTIA @ (0.08 * turning)
    return equivalent - 5e-3 * np.sign(w + 0.08 * q[1:])


def _restated(law: Callable[..., Any]) -> common.Control:
    """A law as Basilisk calls it, limited per axis, with a quaternion that never jumps to its negative."""
    last = np.array(common.PUBLISHED.attitude)

    def control(attitude: Any, rate: Any, position: Any) -> Any:
        nonlocal last
        q = np.array(attitude)
        last = q if q @ last >= 0.0 else -q
        return np.clip(law(last, rate, position), -LIMIT, LIMIT)

    return control


@pytest.mark.parametrize(("name", "law"), [("pd", _pd), ("lyapunov", _lyapunov), ("sliding", _sliding)])
def test_laws_fly_alike_in_basilisk(name: str, law: Callable[..., Any]) -> None:
    """The published experiment, with each law written a second time, in NumPy, and run as a module of Basilisk."""
    known = catalogue()[name]
    gains = known.examples()[0]
    loop = common.problem(known, gains, common.PUBLISHED, torque_limit=LIMIT, limit="axis")
    _flown_alike(loop, common.in_basilisk(_restated(law), common.PUBLISHED))
