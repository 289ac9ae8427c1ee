"""The predictive law at single instants."""

from typing import Any

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from starhold.algebra.quaternion import normalise
from starhold.algebra.vector import ZERO
from starhold.laws import mpc
from starhold.laws.interface import Measurement, tracking_torque
from starhold.parts.craft import make_craft, tensor
from tests.mpc.setting import CRAFTS, POSITION, WEIGHTS, fresh, seen_at


def test_equal_problems_are_solved_once():
    gains = mpc.Gains((0.2, 0.4, 0.1), (0.3, 0.2, 0.5), (50.0, 80.0, 20.0))
    crafts = [make_craft(moments, torque_limit=limit) for moments in ([2, 3, 4], [2, 3, 4.5]) for limit in (0.1, 0.2)]
    mpc.terminal_weight.cache_clear()
    first, again, *_ = (mpc.remember(gains, craft, 0.5).numbers for craft in crafts)
    assert mpc.terminal_weight.cache_info().misses == 2
    # Each memory is a trajectory's own.
    assert first is not again
    assert first.cells == again.cells


@pytest.mark.parametrize("horizon", [1, 5, 20])
@pytest.mark.parametrize("craft", CRAFTS.values(), ids=CRAFTS)
def test_riccati_terminal_gives_the_endless_horizon(craft: Any, horizon: int):
    # Near rest, far from any mass and from the limits.
    period, x = 0.5, np.array([1e-6, -2e-6, 3e-6, 0.0, 0.0, 0.0])
    gains = mpc.Gains((0.2, 0.4, 0.1), (0.3, 0.2, 0.5), (50.0, 80.0, 20.0), horizon=horizon)
    inverse = np.linalg.inv(tensor(craft.inertia))
    a = np.block([[np.eye(3), 0.5 * period * np.eye(3)], [np.zeros((3, 3)), np.eye(3)]])
    b = np.vstack([0.25 * period**2 * inverse, period * inverse])
    q, r = np.diag([*gains.q_attitude, *gains.q_rate]), np.diag(gains.r)
    p = solve_discrete_are(a, b, q, r)
    best = -np.linalg.solve(r + b.T @ p @ b, b.T @ p @ a) @ x
    measurement = seen_at((np.sqrt(1.0 - x @ x), *x[:3].tolist()), ZERO, period=period)
    command, memory = mpc.torque(measurement, gains, craft, mpc.remember(gains, craft, period))
    assert command == pytest.approx(best, rel=1e-6)
    assert mpc.counters(memory) == (1, 1, 1, 0, 0)


@pytest.mark.parametrize("limit", ["axis", "norm"])
def test_budget_is_reported_and_the_limit_kept(limit: str):
    # A long period: the limits bind early and late moves, not all of them.
    craft, period = CRAFTS["principal"], 2.0
    gains = mpc.Gains(*WEIGHTS[:2], (0.5, 0.5, 0.5), horizon=20, limit=mpc.LIMITS.index(limit), budget=1)
    measurement = seen_at((0.9, 0.3, -0.2, 0.1), (0.05, -0.04, 0.06), period=period)
    command, memory = mpc.torque(measurement, gains, craft, fresh(gains, craft, period))
    counters = mpc.counters(memory)
    assert (counters[mpc.CALLS], counters[mpc.SWEEPS], counters[mpc.EXHAUSTED]) == (1, 1, 1)
    assert spread(command, limit) <= craft.torque_limit + 1e-9
    enough = gains._replace(budget=50)
    command, memory = mpc.torque(measurement, enough, craft, fresh(enough, craft, period))
    assert mpc.counters(memory)[mpc.EXHAUSTED] == 0
    assert 1 < mpc.counters(memory)[mpc.WORST] < 50
    assert spread(command, limit) == pytest.approx(craft.torque_limit, rel=1e-6)


def spread(command: Any, limit: str) -> float:
    """What the limit acts on."""
    return float(np.linalg.norm(command) if limit == "norm" else np.abs(command).max())


@pytest.mark.parametrize("limit", ["axis", "norm", "none"])
def test_an_endless_limit_is_none(limit: str):
    measurement = seen_at((0.3, 0.8, -0.4, 0.2), (0.5, -0.4, 0.6))
    craft = make_craft([2.0, 3.0, 4.0])
    gains = mpc.Gains(*WEIGHTS, limit=mpc.LIMITS.index(limit))
    command, _ = mpc.torque(measurement, gains, craft, fresh(gains, craft))
    free = gains._replace(limit=mpc.LIMITS.index("none"))
    assert command == mpc.torque(measurement, free, CRAFTS["principal"], fresh(free))[0]
    assert np.isfinite(command).all()


@pytest.mark.parametrize("limit", ["axis", "norm"])
def test_tracking_torque_counts_towards_the_limit(limit: str):
    craft = CRAFTS["full"]
    gains = mpc.Gains(*WEIGHTS, limit=mpc.LIMITS.index(limit))
    target_rate, acceleration, rate = (0.03, -0.02, 0.04), (1e-3, 2e-3, -1e-3), (1e-4, 2e-4, -1e-4)
    body = tuple(np.add(target_rate, rate).tolist())
    q = normalise((1.0, 1e-4, -2e-4, 1e-4))
    measurement = Measurement(q, rate, body, target_rate, acceleration, ZERO, ZERO, 0.1)
    free = gains._replace(limit=mpc.LIMITS.index("none"))
    ahead = np.array(tracking_torque(measurement, craft))
    resting = seen_at(q, rate)
    at_rest = mpc.torque(resting, free, craft, fresh(free, craft))[0]
    assert mpc.torque(measurement, free, craft, fresh(free, craft))[0] == pytest.approx(ahead + at_rest, rel=1e-9)
    # A limit that the tracking torque alone exceeds.
    weak = make_craft(tensor(craft.inertia), 0.3 * float(np.abs(ahead).min()))
    command, memory = mpc.torque(measurement, gains, weak, fresh(gains, weak))
    assert spread(command, limit) == pytest.approx(weak.torque_limit, rel=1e-9)
    assert mpc.counters(memory)[mpc.EXHAUSTED] == 0


def test_weights_without_a_solution_are_refused():
    with pytest.raises(ValueError, match="no terminal weight"):
        mpc.remember(mpc.Gains((1e-300,) * 3, (0.0,) * 3, (1e300,) * 3), CRAFTS["principal"], 0.1)


@pytest.mark.parametrize("limit", ["axis", "norm"])
def test_a_measurement_that_is_no_number_is_forgotten(limit: str):
    craft, gains = CRAFTS["principal"], mpc.Gains(*WEIGHTS, limit=mpc.LIMITS.index(limit))
    measurement = seen_at((0.3, 0.8, -0.4, 0.2), (0.05, -0.04, 0.06), POSITION)
    memory = fresh(gains)
    for rate in (measurement.rate, (0.0, np.nan, 0.0)):
        _, memory = mpc.torque(measurement._replace(rate=rate), gains, craft, memory)
    assert mpc.counters(memory)[mpc.SHAPED] == 0
    command, _ = mpc.torque(measurement, gains, craft, memory)
    assert command == mpc.torque(measurement, gains, craft, fresh(gains))[0]
