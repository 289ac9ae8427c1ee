"""Basilisk, an independent simulator in C++, flies the same closed loops to the same states.

Both integrate with the classical Runge-Kutta method at 0.1 s under the gravity gradient and hold the torque for 0.1 s.
What is left between them is the truncation error of the attitude, for starhold integrates the quaternion and Basilisk
modified Rodrigues parameters: it falls with the fourth power of the step, and is some 1e-11 rad here.
"""

import pytest
from benchmarks import common

from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.bodies.rigid_body import State
from starhold.simulation.lane import fly

pytest.importorskip("Basilisk", reason="Basilisk comes with the test extra where it has a wheel")

STEPS = 1000
LEGS = 4
ATTITUDE, RATE, POSITION = 1e-10, 1e-11, 1e-14
"""Largest differences: rad, rad/s, and relative to the distance. Measured: 1e-11, 1e-12, 1e-16."""


def _end(loop: ClosedLoop, steps: int) -> State:
    return fly(loop, steps, steps)[1].state


@pytest.mark.parametrize("case", ["steady", "feedback"])
def test_motion_and_feedback_agree_with_compiled_basilisk(case: str) -> None:
    """A constant torque, and Basilisk's own feedback law. The body passes half a turn, where Basilisk changes to the
    other set of Rodrigues parameters and starhold to the other quaternion."""
    loop = common.FEEDBACK_LOOP if case == "feedback" else common.STEADY_LOOP
    oracle = common.in_basilisk(case)
    for leg in range(1, LEGS + 1):
        angle, rate, away = common.gap(_end(loop, STEPS // LEGS * leg), oracle(STEPS // LEGS))
        assert angle < ATTITUDE, (leg, angle)
        assert rate < RATE, (leg, rate)
        assert away < POSITION, (leg, away)
    begun, reached = loop.start.attitude[0], _end(loop, STEPS).attitude[0]
    assert begun > 0.0 > reached or case == "steady", "the run has to pass half a turn"
