"""Flights with the predictive law."""

from typing import Any

import numpy as np
import pytest

from starhold.algebra.quaternion import normalise
from starhold.algebra.vector import ZERO
from starhold.laws import mpc
from starhold.laws.catalogue import catalogue
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.bodies.rigid_body import State
from starhold.parts.craft import make_craft
from starhold.parts.targets.history import tabulate
from starhold.simulation import lane
from tests.making import ORBIT, aimed
from tests.mpc.setting import CRAFTS, WEIGHTS
from tests.tiers import leading

PUBLISHED = State((0.0, *(3.0**-0.5,) * 3), (0.04, 0.03, 0.02), (7e6, 0.0, 0.0), (0.0, 7550.0, 0.0), ZERO)
COMMAND, ERROR = slice(16, 19), slice(20, 23)


def fly(loop: ClosedLoop, steps: int) -> tuple[Any, Any]:
    """The record of every step, and what is carried at the end."""
    record, end = lane.fly(loop, steps)
    assert end.lost_at < 0.0
    assert np.isfinite(record).all()
    return record, end


def published(horizon: int, terminal: str) -> tuple[Any, Any]:
    gains = mpc.Gains(*WEIGHTS, horizon=horizon, terminal=mpc.TERMINALS.index(terminal))
    return fly(ClosedLoop(CRAFTS["principal"], catalogue()["mpc"], gains, PUBLISHED, 0.1, parts=ORBIT), 2500)


@pytest.mark.parametrize("horizon", leading([10, 5, 20]))
def test_published_experiment(horizon: int):
    record, end = published(horizon, "riccati")
    error = np.linalg.norm(record[ERROR], axis=0)
    settled = int(np.nonzero(error > 1e-3)[0][-1]) + 1
    assert 1100 < settled < 1400
    assert np.abs(record[COMMAND]).max() <= 0.01 + 1e-9
    counters = mpc.counters(end.memory)
    assert counters[mpc.CALLS] >= 2500
    assert counters[mpc.EXHAUSTED] == 0


@pytest.mark.parametrize("horizon", leading([10, 40]))
def test_without_terminal_weight_it_barely_moves(horizon: int):
    record, _ = published(horizon, "none")
    error = np.linalg.norm(record[ERROR], axis=0)
    assert error[:1400].min() > 0.3
    assert np.abs(record[COMMAND]).max() <= 0.01 + 1e-9


@pytest.mark.slow
def test_norm_limit_in_flight():
    craft, gains = make_craft([2.0, 3.0, 4.0], 0.005), mpc.examples()[1]
    loop = ClosedLoop(craft, catalogue()["mpc"], gains, PUBLISHED, 0.1, limit="norm")
    record, end = fly(loop, 2500)
    size = np.linalg.norm(record[COMMAND], axis=0)
    assert size.max() <= 0.005 + 1e-9
    assert np.mean(size > 0.005 * (1.0 - 1e-9)) > 0.02
    assert mpc.counters(end.memory)[mpc.EXHAUSTED] == 0
    assert np.linalg.norm(record[ERROR, -1]) < 1e-3


def test_moving_target_and_no_orbit():
    period, steps = 0.1, 1500
    times = period * np.arange(steps + 1)
    angle = 0.3 * np.sin(0.02 * times)
    still = 0.0 * times
    attitudes = np.stack([np.cos(angle / 2), np.sin(angle / 2), still, still], axis=1)
    table = tabulate(times[::10], attitudes[::10], times)
    start = State(normalise((1.0, 0.2, -0.1, 0.1)), ZERO, ZERO, ZERO, ZERO)
    loop = ClosedLoop(CRAFTS["principal"], catalogue()["mpc"], mpc.examples()[0], start, period, parts=(aimed(table),))
    record, _ = fly(loop, steps)
    assert np.abs(record[COMMAND]).max() <= 0.01 + 1e-9
    assert np.linalg.norm(record[ERROR], axis=0)[-100:].max() < 5e-3
