"""The predictive law: its program against library solvers, its model against the true motion, and its flights."""

from __future__ import annotations

from functools import cache
from typing import Any

import clarabel
import daqp
import numpy as np
import piqp
import pytest
import scipy.sparse as sp
from scipy.linalg import expm, solve_discrete_are
from scipy.optimize import minimize

from starhold.algebra.quaternion import conjugate, derivative, multiply, normalise
from starhold.laws import mpc
from starhold.laws.catalogue import catalogue
from starhold.laws.interface import Seen, tracking_torque
from starhold.laws.predictive.problem import hold, linearise
from starhold.laws.predictive.solver import solve
from starhold.loop.closed_loop import ClosedLoop
from starhold.models.craft import make_craft, tensor
from starhold.models.environment import two_body_gravity_gradient
from starhold.models.rigid_body import State, angular_acceleration
from starhold.models.target import tabulate
from starhold.simulation import lane

ZERO = (0.0, 0.0, 0.0)
POSITION = (4.1e6, -3.3e6, 5.2e6)
CRAFTS = {
    "principal": make_craft([2.0, 3.0, 4.0], 0.01),
    "full": make_craft([[12.0, 1.0, -0.5], [1.0, 15.0, 0.7], [-0.5, 0.7, 9.0]], 0.05),
}
WEIGHTS = ((0.2, 0.2, 0.2), (0.2, 0.2, 0.2), (50.0, 50.0, 50.0))


def seen_at(attitude: Any, rate: Any, position: Any = ZERO, period: float = 0.1) -> Seen:
    """What the law sees of a target at rest."""
    return Seen(normalise(attitude), rate, rate, ZERO, ZERO, ZERO, position, period)


# --- The solver -------------------------------------------------------------------------------------------------------


class Program:
    """A random program, with the same in the moves alone: v'Hv/2 + f'v + c."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.horizon = n = 1 + seed % 20
        a = rng.normal(size=(6, 6))
        self.a = a * rng.uniform(0.3, 1.1) / np.abs(np.linalg.eigvals(a)).max()
        self.b = rng.normal(size=(6, 3)) * 10.0 ** rng.uniform(-2.0, 1.0)
        root = rng.normal(size=(6, 6)) * 10.0 ** rng.uniform(-1.0, 1.0, size=6)
        self.q = root @ root.T + 1e-3 * np.eye(6)
        root = rng.normal(size=(3, 3))
        self.r = (root @ root.T + 0.1 * np.eye(3)) * 10.0 ** rng.uniform(-2.0, 1.0)
        self.p = self.q * rng.uniform(0.0, 20.0)
        self.x = rng.normal(size=6) * 10.0 ** rng.uniform(0.0, 2.0)
        self.bound = 10.0 ** rng.uniform(-1.0, 1.0)
        self.centre = rng.normal(size=3) * self.bound
        powers = [np.linalg.matrix_power(self.a, k) for k in range(n + 1)]
        free = np.vstack(powers[1:])
        forced = np.block([[powers[i - j] @ self.b if j <= i else np.zeros((6, 3)) for j in range(n)] for i in range(n)])
        weight = np.kron(np.eye(n), self.q)
        weight[-6:, -6:] = self.p
        hessian = 2.0 * (forced.T @ weight @ forced + np.kron(np.eye(n), self.r))
        self.hessian = 0.5 * (hessian + hessian.T)
        self.linear = 2.0 * forced.T @ weight @ free @ self.x
        self.constant = float(self.x @ self.q @ self.x + free @ self.x @ weight @ free @ self.x)

    def cost(self, moves: Any) -> float:
        v = np.ravel(moves)
        return float(0.5 * v @ self.hessian @ v + self.linear @ v + self.constant)

    def solve(self, *, ball: bool, budget: int = 100) -> Any:
        arguments = (self.a, self.b, self.q, self.r, self.p, self.x, self.horizon, self.bound)
        return solve(*arguments, tuple(self.centre.tolist()), ball, budget)

    @property
    def low(self) -> Any:
        return np.tile(self.centre - self.bound, self.horizon)

    @property
    def high(self) -> Any:
        return np.tile(self.centre + self.bound, self.horizon)


SEEDS = range(120)


def by_piqp(program: Program) -> Any:
    solver = piqp.DenseSolver()
    solver.settings.eps_abs, solver.settings.eps_rel = 1e-9, 1e-11
    solver.setup(program.hessian, program.linear, x_l=program.low, x_u=program.high)
    assert solver.solve() == piqp.PIQP_SOLVED
    return solver.result.x


def by_daqp(program: Program) -> Any:
    # Scaled: its tolerances are absolute.
    size = program.bound
    hessian = program.hessian / np.abs(program.hessian).max()
    linear = program.linear / np.abs(program.hessian).max() / size
    none = np.zeros((0, 3 * program.horizon))
    high, low = program.high / size, program.low / size
    settings = {"primal_tol": 1e-10, "dual_tol": 1e-14}
    moves, _, flag, _ = daqp.solve(hessian, linear, none, high, low, np.zeros(high.size, dtype=np.int32), **settings)
    assert flag == 1
    return moves * size


def by_clarabel(program: Program) -> Any:
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-10
    n = program.horizon
    rows, right = np.zeros((4 * n, 3 * n)), np.zeros(4 * n)
    for k in range(n):
        right[4 * k], right[4 * k + 1 : 4 * k + 4] = program.bound, -program.centre
        rows[4 * k + 1 : 4 * k + 4, 3 * k : 3 * k + 3] = -np.eye(3)
    cones = [clarabel.SecondOrderConeT(4)] * n
    hessian = sp.csc_matrix(np.triu(program.hessian))
    return np.array(clarabel.DefaultSolver(hessian, program.linear, sp.csc_matrix(rows), right, cones, settings).solve().x)


def by_slsqp(program: Program) -> Any:
    size = abs(program.cost(np.zeros(3 * program.horizon)))
    room = {
        "type": "ineq",
        "fun": lambda v: 1.0 - (((v.reshape(-1, 3) - program.centre) / program.bound) ** 2).sum(axis=1),
        "jac": lambda v: np.vstack(
            [
                np.kron(unit, -2.0 * (move - program.centre) / program.bound**2)
                for unit, move in zip(np.eye(program.horizon), v.reshape(-1, 3), strict=True)
            ]
        ),
    }
    start = np.tile(program.centre, program.horizon)
    return minimize(
        lambda v: program.cost(v) / size,
        start,
        jac=lambda v: (program.hessian @ v + program.linear) / size,
        constraints=[room],
        method="SLSQP",
        options={"ftol": 1e-14, "maxiter": 1000},
    ).x


def test_box_against_two_solvers():
    pressing = []
    for seed in SEEDS:
        program = Program(seed)
        plan, cost, _, solved = program.solve(ball=False)
        away = np.abs(plan - program.centre)
        assert solved
        assert away.max() <= program.bound + 1e-9
        assert cost == pytest.approx(program.cost(plan), rel=1e-9)
        pressing.append(float(np.mean(away > program.bound * (1.0 - 1e-9))))
        for reference in (by_piqp(program), by_daqp(program)):
            assert abs(program.cost(plan) - program.cost(reference)) <= 1e-6 * abs(cost), f"seed {seed}"
    assert np.mean(pressing) > 0.4
    assert np.mean(np.array(pressing) > 0.0) > 0.8


def test_ball_against_two_solvers():
    pressing, compared = [], 0
    for seed in SEEDS:
        program = Program(seed)
        plan, cost, _, solved = program.solve(ball=True)
        away = np.linalg.norm(plan - program.centre, axis=1)
        assert solved
        assert away.max() <= program.bound + 1e-9
        pressing.append(float(np.mean(away > program.bound * (1.0 - 1e-9))))
        assert abs(program.cost(plan) - program.cost(by_clarabel(program))) <= 1e-6 * abs(cost), f"seed {seed}"
        if program.horizon <= 6:
            # SLSQP is a local method of moderate accuracy: it may fall short, but must never find anything better.
            other = program.cost(by_slsqp(program))
            assert program.cost(plan) <= other + 1e-6 * abs(cost), f"seed {seed}"
            compared += other <= program.cost(plan) + 1e-6 * abs(cost)
    assert compared > 0.7 * sum(1 + seed % 20 <= 6 for seed in SEEDS)
    assert np.mean(pressing) > 0.4
    assert np.mean(np.array(pressing) > 0.0) > 0.8


@pytest.mark.parametrize("ball", [False, True])
def test_optimality_conditions(ball: bool):
    # The answer put back into the theorem, without any other solver: the gradient vanishes but where it pushes outwards.
    for seed in SEEDS:
        program = Program(seed)
        plan = program.solve(ball=ball).plan
        gradient = (program.hessian @ plan.ravel() + program.linear).reshape(-1, 3)
        out = plan - program.centre
        if ball:
            size = np.linalg.norm(out, axis=1, keepdims=True)
            push = -(gradient * out).sum(axis=1, keepdims=True) / size
            held = (size >= program.bound * (1.0 - 1e-11)) & (push > 0.0)
            loose = np.where(held, gradient + push * out / size, gradient)
        else:
            held = (np.abs(out) >= program.bound * (1.0 - 1e-11)) & (gradient * out < 0.0)
            loose = np.where(held, 0.0, gradient)
        gap = 0.5 * np.sum(loose * np.linalg.solve(2.0 * program.r, loose.T).T)
        assert gap <= 1e-9 * program.cost(plan), f"seed {seed}"


def test_hard_program_uses_the_interior_method():
    # The projected Newton method gives up after a dozen sweeps; without the rescue these need hundreds.
    sweeps = [Program(seed).solve(ball=ball).sweeps for seed in SEEDS for ball in (False, True)]
    assert max(sweeps) > 12
    assert max(sweeps) <= 60
    assert np.median(sweeps) <= 6


def test_without_limits_it_is_one_sweep():
    program = Program(7)
    program.bound = np.inf
    for ball in (False, True):
        plan, _, sweeps, solved = program.solve(ball=ball)
        assert solved
        assert sweeps == 1
        assert plan.ravel() == pytest.approx(np.linalg.solve(program.hessian, -program.linear), rel=1e-7)


# --- The model --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("craft", CRAFTS.values(), ids=CRAFTS)
@pytest.mark.parametrize(("rate", "period"), [((0.04, 0.03, 0.02), 0.1), ((1.0, -2.0, 1.5), 0.7), ((3.0, 5.0, -4.0), 2.0)])
def test_sampling_is_exact(craft: Any, rate: Any, period: float):
    a, b = np.zeros(36), np.zeros(18)
    linearise(seen_at((0.3, 0.5, -0.2, 0.7), rate, POSITION), craft, a, b)
    joint = np.zeros((9, 9))
    joint[:6] = np.hstack([a.reshape(6, 6), b.reshape(6, 3)])
    exact = expm(joint * period)
    hold(a, b, period, np.zeros(108))
    assert np.abs(a.reshape(6, 6) - exact[:6, :6]).max() <= 1e-13 * np.abs(exact[:6, :6]).max()
    assert np.abs(b.reshape(6, 3) - exact[:6, 6:]).max() <= 1e-13 * np.abs(exact[:6, 6:]).max()


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

    a, b = np.zeros(36), np.zeros(18)
    here = multiply(multiply(conjugate(q), (0.0, *place)), q)[1:]
    linearise(seen_at(q, w, here), craft, a, b)
    step = 1e-4
    steps = [step * unit for unit in np.eye(9)]
    slopes = [(error_rate(d[:6], d[6:]) - error_rate(-d[:6], -d[6:])) / (2.0 * step) for d in steps]
    true = np.array(slopes).T
    assert a.reshape(6, 6) == pytest.approx(true[:, :6], rel=1e-6, abs=1e-7)
    assert b.reshape(6, 3) == pytest.approx(true[:, 6:], rel=1e-6, abs=1e-9)
    # The gravity block is not negligible here, so its factor 6 is tested.
    assert np.abs(true[3:, :3]).max() > 1e-3


@pytest.mark.parametrize("craft", CRAFTS.values(), ids=CRAFTS)
def test_no_orbit_no_gravity(craft: Any):
    a, b = np.zeros(36), np.zeros(18)
    linearise(seen_at((1.0, 0.2, 0.1, 0.0), (0.1, 0.0, 0.2)), craft, a, b)
    assert np.isfinite(a).all()
    assert not a.reshape(6, 6)[3:, :3].any()


# --- The law ----------------------------------------------------------------------------------------------------------


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
    seen = seen_at((np.sqrt(1.0 - x @ x), *x[:3].tolist()), ZERO, period=period)
    command, memory = mpc.torque(seen, gains, craft, mpc.remember(gains, craft, period))
    assert command == pytest.approx(best, rel=1e-6)
    assert memory.counters.tolist() == [1, 1, 1, 0, 0]


def test_nothing_to_do_at_rest_on_target():
    for gains in mpc.examples():
        command, _ = mpc.torque(seen_at((1.0, 0.0, 0.0, 0.0), ZERO), gains, CRAFTS["principal"], fresh(gains))
        assert command == ZERO


def fresh(gains: Any, craft: Any = CRAFTS["principal"], period: float = 0.1) -> Any:
    return mpc.remember(gains, craft, period)


@pytest.mark.parametrize("limit", ["axis", "norm"])
def test_budget_is_reported_and_the_limit_kept(limit: str):
    # A long period: the limits bind early and late moves, not all of them.
    craft, period = CRAFTS["principal"], 2.0
    gains = mpc.Gains(*WEIGHTS[:2], (0.5, 0.5, 0.5), horizon=20, limit=mpc.LIMITS.index(limit), budget=1)
    seen = seen_at((0.9, 0.3, -0.2, 0.1), (0.05, -0.04, 0.06), period=period)
    command, memory = mpc.torque(seen, gains, craft, fresh(gains, craft, period))
    counters = memory.counters
    assert (counters[mpc.CALLS], counters[mpc.SWEEPS], counters[mpc.EXHAUSTED]) == (1, 1, 1)
    assert spread(command, limit) <= craft.torque_limit + 1e-9
    enough = gains._replace(budget=50)
    command, memory = mpc.torque(seen, enough, craft, fresh(enough, craft, period))
    assert memory.counters[mpc.EXHAUSTED] == 0
    assert 1 < memory.counters[mpc.WORST] < 50
    assert spread(command, limit) == pytest.approx(craft.torque_limit, rel=1e-6)


def spread(command: Any, limit: str) -> float:
    """What the limit acts on."""
    return float(np.linalg.norm(command) if limit == "norm" else np.abs(command).max())


@pytest.mark.parametrize("limit", ["axis", "norm", "none"])
def test_an_endless_limit_is_none(limit: str):
    seen = seen_at((0.3, 0.8, -0.4, 0.2), (0.5, -0.4, 0.6))
    craft = make_craft([2.0, 3.0, 4.0])
    gains = mpc.Gains(*WEIGHTS, limit=mpc.LIMITS.index(limit))
    command, _ = mpc.torque(seen, gains, craft, fresh(gains, craft))
    free = gains._replace(limit=mpc.LIMITS.index("none"))
    assert command == mpc.torque(seen, free, CRAFTS["principal"], fresh(free))[0]
    assert np.isfinite(command).all()


@pytest.mark.parametrize("limit", ["axis", "norm"])
def test_tracking_torque_counts_towards_the_limit(limit: str):
    craft = CRAFTS["full"]
    gains = mpc.Gains(*WEIGHTS, limit=mpc.LIMITS.index(limit))
    target_rate, acceleration, rate = (0.03, -0.02, 0.04), (1e-3, 2e-3, -1e-3), (1e-4, 2e-4, -1e-4)
    body = tuple(np.add(target_rate, rate).tolist())
    q = normalise((1.0, 1e-4, -2e-4, 1e-4))
    seen = Seen(q, rate, body, target_rate, acceleration, ZERO, ZERO, 0.1)
    free = gains._replace(limit=mpc.LIMITS.index("none"))
    ahead = np.array(tracking_torque(seen, craft))
    resting = seen_at(q, rate)
    at_rest = mpc.torque(resting, free, craft, fresh(free, craft))[0]
    assert mpc.torque(seen, free, craft, fresh(free, craft))[0] == pytest.approx(ahead + at_rest, rel=1e-9)
    # A limit that the tracking torque alone exceeds.
    weak = make_craft(tensor(craft.inertia), 0.3 * float(np.abs(ahead).min()))
    command, memory = mpc.torque(seen, gains, weak, fresh(gains, weak))
    assert spread(command, limit) == pytest.approx(weak.torque_limit, rel=1e-9)
    assert memory.counters[mpc.EXHAUSTED] == 0


@pytest.mark.parametrize("factors", [(1e3, 1.0, 1.0), (1.0, 1e3, 1.0), (1.0, 1.0, 60.0)])
def test_units_do_not_matter(factors: tuple[float, float, float]):
    kg, m, s = factors
    torque_unit = kg * m**2 / s**2
    # The limit is active in the one and must be in the other.
    gains = mpc.Gains(*WEIGHTS, horizon=8)
    changed = gains._replace(q_rate=tuple(x * s**2 for x in gains.q_rate), r=tuple(x / torque_unit**2 for x in gains.r))
    craft = make_craft([2.0, 3.0, 4.0], 0.004)
    other = make_craft([x * kg * m**2 for x in (2.0, 3.0, 4.0)], 0.004 * torque_unit, craft.gravity * m**3 / s**2)
    q, w = (0.3, 0.8, -0.4, 0.2), (0.05, -0.04, 0.06)
    seen = seen_at(q, w, POSITION)
    seen_other = seen_at(q, tuple(x / s for x in w), tuple(x * m for x in POSITION), 0.1 * s)
    one = np.array(mpc.torque(seen, gains, craft, fresh(gains, craft))[0])
    two = np.array(mpc.torque(seen_other, changed, other, fresh(changed, other, 0.1 * s))[0])
    assert two / torque_unit == pytest.approx(one, rel=1e-6)


def test_gains_are_checked_as_declared():
    for field in catalogue()["mpc"].fields():
        if field.gain.choices:
            assert field.gain.check(field.gain.choices[0]) == 0
            with pytest.raises(ValueError, match="must be one of"):
                field.gain.check("other")
    with pytest.raises(ValueError, match="no terminal weight"):
        mpc.remember(mpc.Gains((1e-300,) * 3, (0.0,) * 3, (1e300,) * 3), CRAFTS["principal"], 0.1)


# --- Flights ----------------------------------------------------------------------------------------------------------

PUBLISHED = State((0.0, *(3.0**-0.5,) * 3), (0.04, 0.03, 0.02), (7e6, 0.0, 0.0), (0.0, 7550.0, 0.0), ZERO)
COMMAND, ERROR = slice(16, 19), slice(20, 23)


def fly(loop: ClosedLoop, steps: int) -> tuple[Any, Any]:
    """The record of every step, and what is carried at the end."""
    record, end = lane.fly(loop, steps)
    assert end.lost_at < 0.0
    assert np.isfinite(record).all()
    return record, end


@cache
def published(horizon: int, terminal: str) -> tuple[Any, Any]:
    gains = mpc.Gains(*WEIGHTS, horizon=horizon, terminal=mpc.TERMINALS.index(terminal))
    craft = CRAFTS["principal"]
    loop = ClosedLoop(craft, catalogue()["mpc"], gains, PUBLISHED, 0.1, orbit=True, gravity_gradient=True)
    return fly(loop, 2500)


@pytest.mark.parametrize("horizon", [5, 10, 20])
def test_published_experiment(horizon: int):
    record, end = published(horizon, "riccati")
    error = np.linalg.norm(record[ERROR], axis=0)
    settled = int(np.nonzero(error > 1e-3)[0][-1]) + 1
    assert 1100 < settled < 1400
    assert np.abs(record[COMMAND]).max() <= 0.01 + 1e-9
    counters = end.memory.counters
    assert counters[mpc.CALLS] >= 2500
    assert counters[mpc.EXHAUSTED] == 0


@pytest.mark.parametrize("horizon", [10, 40])
def test_without_terminal_weight_it_barely_moves(horizon: int):
    record, _ = published(horizon, "none")
    error = np.linalg.norm(record[ERROR], axis=0)
    assert error[:1400].min() > 0.3
    assert np.abs(record[COMMAND]).max() <= 0.01 + 1e-9


def test_norm_limit_in_flight():
    craft, gains = make_craft([2.0, 3.0, 4.0], 0.005), mpc.examples()[1]
    loop = ClosedLoop(craft, catalogue()["mpc"], gains, PUBLISHED, 0.1, limit="norm")
    record, end = fly(loop, 2500)
    size = np.linalg.norm(record[COMMAND], axis=0)
    assert size.max() <= 0.005 + 1e-9
    assert np.mean(size > 0.005 * (1.0 - 1e-9)) > 0.02
    assert end.memory.counters[mpc.EXHAUSTED] == 0
    assert np.linalg.norm(record[ERROR, -1]) < 1e-3


def test_moving_target_and_no_orbit():
    period, steps = 0.1, 1500
    times = period * np.arange(steps + 1)
    angle = 0.3 * np.sin(0.02 * times)
    still = 0.0 * times
    attitudes = np.stack([np.cos(angle / 2), np.sin(angle / 2), still, still], axis=1)
    table = tabulate(times[::10], attitudes[::10], times)
    start = State(normalise((1.0, 0.2, -0.1, 0.1)), ZERO, ZERO, ZERO, ZERO)
    loop = ClosedLoop(CRAFTS["principal"], catalogue()["mpc"], mpc.examples()[0], start, period, target=table)
    record, _ = fly(loop, steps)
    assert np.abs(record[COMMAND]).max() <= 0.01 + 1e-9
    assert np.linalg.norm(record[ERROR], axis=0)[-100:].max() < 5e-3


def test_runs_do_not_share_memory():
    gains = mpc.examples()[1]
    loop = ClosedLoop(CRAFTS["principal"], catalogue()["mpc"], gains, PUBLISHED, 0.1, limit="norm")
    first, second = loop.carry(), loop.carry()
    assert not any(np.shares_memory(a, b) for a, b in zip(first.memory, second.memory, strict=True))
    one, _ = fly(loop, 300)
    other, _ = fly(loop, 300)
    assert np.array_equal(one, other)
