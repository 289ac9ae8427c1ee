"""The predictive law against OSQP, PIQP and DAQP on the programs met in one flight.

    python benchmarks/mpc.py

The published experiment is flown with the law; each of its control instants gives one quadratic program, and every
solver gets the same sequence in the same order. Ours is timed as the law runs: linearisation, exact sampling and
solution, inside compiled code, called once for each program; what entering compiled code costs, measured by calls that do
nothing, is left out. The libraries get finished matrices, so forming them costs them nothing, and are timed around
`update` and `solve` from Python; `own` is the time that the library itself reports, where it reports all of it. Forms,
each the best for its solver that we found: OSQP sparse, states and moves as variables, matrices updated in place,
started from its last solution; PIQP dense in the moves alone (an interior-point method starts anew); DAQP dense in the
moves alone, its working set kept. Moves are counted in units of the limit. A second pair of sequences has a fifth of the
torque, so that limits are active in every program.

Accuracy: the largest gap of the objective relative to the best of all solvers is printed. OSQP's tolerances, 1e-5
with polishing, favour it: its gap is the largest, up to 1e-4; the others are as exact as ours or nearly so.

The last table is of the law on several flights at once, from starts that differ, beside one flight at a time.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import daqp
import numpy as np
import osqp
import piqp
import scipy.sparse as sp

sys.path.insert(0, str(Path(__file__).parent))

from common import INERTIA, ORBIT, PERIOD, PUBLISHED, header, show
from starhold.algebra.structure import leaves
from starhold.algebra.structured import Buffer, repeat
from starhold.algebra.vector import ZERO
from starhold.laws import mpc
from starhold.laws.catalogue import catalogue
from starhold.laws.interface import Measurement
from starhold.laws.predictive.motion import linearise, sample
from starhold.laws.predictive.problem import carve, motion, weights
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.craft import Craft, make_craft
from starhold.simulation import lane
from starhold.trace.calling import bind
from starhold.trace.machine import aligned, load
from starhold.trace.recording import Recorder

WIDTHS = (1, 4, 8)
WEIGHTS = ((0.2, 0.2, 0.2), (0.2, 0.2, 0.2), (50.0, 50.0, 50.0))
ROW = 10
"""Numbers of a row: attitude (4), rate (3), position in body axes (3)."""


class Program(NamedTuple):
    """One program: sampled motion A (6, 6), B (6, 3), state x (6), and in the moves alone, in units of the limit,
    v'Hv/2 + f'v + constant."""

    a: Any
    b: Any
    x: Any
    hessian: Any
    linear: Any
    constant: float

    def cost(self, moves: Any) -> float:
        return float(0.5 * moves @ self.hessian @ moves + self.linear @ moves + self.constant)


def fly(gains: Any, craft: Craft, steps: int, start: Any = PUBLISHED) -> Any:
    """Rows of what the law sees, see ROW."""
    loop = ClosedLoop(craft, catalogue()["mpc"], gains, start, PERIOD, parts=ORBIT)
    record, _ = lane.fly(loop, steps - 1)
    q, inertial = record[:4], record[7:10]
    # Body axes from inertial ones: r - 2 q0 (q x r) + 2 q x (q x r).
    once = np.cross(q[1:], inertial, axis=0)
    body = inertial - 2.0 * q[0] * once + 2.0 * np.cross(q[1:], once, axis=0)
    return np.ascontiguousarray(np.vstack([record[19:23], record[23:26], body]).T)


def seen_in(row: Any) -> Measurement:
    """What the law sees in a row."""
    q, rate, position = tuple(row[:4]), tuple(row[4:7]), tuple(row[7:])
    return Measurement(q, rate, rate, ZERO, ZERO, ZERO, position, PERIOD)


class OverRows:
    """The compiled law over rows of so many flights at once, (flights, rows, ROW)."""

    def __init__(self, gains: Any, craft: Craft, flights: Any) -> None:
        self.width, self.count = flights.shape[:2]
        self.memory = mpc.remember(gains, craft, PERIOD)
        start = np.array(self.memory.numbers.cells)
        recorder = Recorder()
        rows, known = recorder.memory("rows", lanes=True), recorder.memory("known")
        numbers = recorder.memory("numbers", lanes=True, writable=True)
        first, count = recorder.input("first", "index"), recorder.input("count", "index")

        def step(k: Any) -> None:
            row = Buffer(rows, 0, ROW * self.count).row(first + k, ROW)
            mpc.torque(seen_in(row), gains, bind(craft, known), mpc.Memory(Buffer(numbers, 0, len(start))))

        with recorder.recording():
            repeat(count, step)
        program = recorder.program("law_over_rows")
        begun = time.perf_counter()
        self.kernel = load(program, self.width)
        self.compiling = time.perf_counter() - begun
        self.rows, self.numbers = aligned(self.count * ROW, self.width), aligned(len(start), self.width)
        self.rows[:] = flights.reshape(self.width, -1).T
        self.numbers[:] = start[:, None]
        self.known = np.array(list(leaves(craft)))
        self.places = [array.ctypes.data for array in (self.rows, self.known, self.numbers)]

    def __call__(self, first: int, count: int) -> float:
        """Microseconds that so many rows take."""
        begun = time.perf_counter_ns()
        self.kernel(*self.places, first, count)
        return 1e-3 * (time.perf_counter_ns() - begun)

    def anew(self) -> None:
        """Forget what was remembered."""
        self.numbers[:] = np.array(self.memory.numbers.cells)[:, None]


def ours(rows: Any, gains: Any, craft: Craft) -> tuple[Any, Any, Any]:
    """Plans, microseconds a call, and the counters, from one run of the sequence after an untimed one."""
    law = OverRows(gains, craft, rows[None])
    plan = carve(mpc.program(gains, law.memory)).plan
    moves, spent = np.zeros((len(rows), plan.size)), np.zeros(len(rows))
    for _ in range(2):
        law.anew()
        entering = float(np.median([law(0, 0) for _ in range(1000)]))
        for k in range(len(rows)):
            spent[k] = law(k, 1) - entering
            moves[k] = law.numbers[plan.base : plan.base + plan.size, 0]
    return moves / craft.torque_limit, spent, mpc.counters(mpc.Memory(Buffer(law.numbers[:, 0].tolist())))


def state_programs(rows: Any, gains: Any, craft: Craft) -> tuple[list[Program], Any]:
    """The programs of the rows, and P."""
    problem, n = mpc.program(gains, mpc.remember(gains, craft, PERIOD)), gains.horizon
    weight = weights(problem)
    q, r, p = np.diag(weight.q), np.diag(weight.r), np.array(weight.p)
    cost = np.kron(np.eye(n), q)
    cost[-6:, -6:] = p
    programs = []
    for row in rows:
        sample(problem, linearise(seen_in(row.tolist()), craft), PERIOD)
        a, b = map(np.array, motion(problem))
        b = b * craft.torque_limit
        x = row[1:7].copy()
        free, forced = np.zeros((6 * n, 6)), np.zeros((6 * n, 3 * n))
        power = np.eye(6)
        for k in range(n):
            for j in range(n - k):
                forced[6 * (j + k) : 6 * (j + k) + 6, 3 * j : 3 * j + 3] = power @ b
            power = a @ power
            free[6 * k : 6 * k + 6] = power
        hessian = 2.0 * (forced.T @ cost @ forced + np.kron(np.eye(n), r * craft.torque_limit**2))
        drift = free @ x
        linear, constant = 2.0 * forced.T @ cost @ drift, float(drift @ cost @ drift + x @ q @ x)
        programs.append(Program(a, b, x, np.asfortranarray(0.5 * (hessian + hessian.T)), linear, constant))
    return programs, p


Timed = tuple[Any, Any, Any]


def sequence(programs: list[Program], solve: Callable[[Program], tuple[Any, float]]) -> Timed:
    """Plans, wall microseconds, and the library's own microseconds, over the programs in order."""
    plans, wall, own = [], [], []
    for program in programs:
        begun = time.perf_counter()
        plan, spent = solve(program)
        wall.append(1e6 * (time.perf_counter() - begun))
        own.append(1e6 * spent)
        plans.append(np.array(plan))
    return np.array(plans), np.array(wall), np.array(own)


def by_piqp(programs: list[Program]) -> Timed:
    size = len(programs[0].linear)
    low, high = -np.ones(size), np.ones(size)
    solver = piqp.DenseSolver()
    solver.settings.eps_abs, solver.settings.eps_rel = 1e-9, 1e-9
    solver.settings.compute_timings = True
    solver.setup(programs[0].hessian, programs[0].linear, x_l=low, x_u=high)

    def solve(program: Program) -> tuple[Any, float]:
        solver.update(P=program.hessian, c=program.linear)
        solver.solve()
        return solver.result.x, solver.result.info.update_time + solver.result.info.solve_time

    return sequence(programs, solve)


def by_daqp(programs: list[Program]) -> Timed:
    size = len(programs[0].linear)
    none, one = np.zeros((0, size)), np.ones(size)
    model = daqp.Model()
    model.settings = {"primal_tol": 1e-9, "dual_tol": 1e-12}
    model.setup(programs[0].hessian, programs[0].linear, none, one, -one, np.zeros(size, dtype=np.int32))

    def solve(program: Program) -> tuple[Any, float]:
        model.update(H=program.hessian, f=program.linear)
        plan, _, flag, _ = model.solve()
        if flag < 1:
            raise RuntimeError(f"DAQP: exit flag {flag}")
        # It does not report the time of an update, which is most of the work.
        return plan, np.nan

    return sequence(programs, solve)


def by_osqp(programs: list[Program], gains: Any, craft: Craft, terminal: Any) -> Timed:
    n = gains.horizon
    q = np.diag([*gains.q_attitude, *gains.q_rate])
    r = np.diag(gains.r) * craft.torque_limit**2
    hessian = sp.block_diag([*[sp.csc_matrix(2.0 * q)] * (n - 1), 2.0 * terminal, *[2.0 * r] * n], format="csc")

    def rows(a: Any, b: Any) -> Any:
        # Every entry of A and B is kept, zeros too, so that the pattern never changes.
        motion = sp.block_array(
            [[sp.eye(6) if j == i else sp.coo_matrix(full(-a)) if j == i - 1 else None for j in range(n)] for i in range(n)]
        )
        push = sp.block_array([[sp.coo_matrix(full(-b)) if j == i else None for j in range(n)] for i in range(n)])
        box = sp.hstack([sp.csc_matrix((3 * n, 6 * n)), sp.eye(3 * n)])
        return sp.csc_matrix(sp.vstack([sp.hstack([motion, push]), box]))

    def full(block: Any) -> Any:
        # A sparse matrix drops exact zeros; this one is far below what counts.
        return np.where(block == 0.0, 1e-300, block)

    data = [rows(program.a, program.b).data for program in programs]
    bounds = [np.concatenate([program.a @ program.x, np.zeros(6 * (n - 1))]) for program in programs]
    one = np.ones(3 * n)
    lows, highs = [np.concatenate([e, -one]) for e in bounds], [np.concatenate([e, one]) for e in bounds]
    solver = osqp.OSQP()
    settings = {"eps_abs": 1e-5, "eps_rel": 1e-5, "max_iter": 100_000, "polishing": True, "verbose": False}
    first = rows(programs[0].a, programs[0].b)
    solver.setup(sp.triu(hessian, format="csc"), np.zeros(9 * n), first, lows[0], highs[0], **settings)
    turn = iter(zip(data, lows, highs, strict=True))

    def solve(program: Program) -> tuple[Any, float]:
        entries, low, high = next(turn)
        solver.update(Ax=entries, l=low, u=high)
        result = solver.solve()
        return result.x[6 * n :], result.info.update_time + result.info.solve_time + result.info.polish_time

    plans, wall, own = sequence(programs, solve)
    # Its moves may pass the limits by its tolerance.
    return np.clip(plans, -1.0, 1.0), wall, own


def compare(horizon: int, torque_limit: float, steps: int) -> None:
    """Fly, solve with every solver, and print a table."""
    gains, craft = mpc.Gains(*WEIGHTS, horizon=horizon), make_craft(INERTIA, torque_limit)
    rows = fly(gains, craft, steps)
    programs, terminal = state_programs(rows, gains, craft)
    plans, spent, counters = ours(rows, gains, craft)
    results = {
        "starhold": (plans, spent, spent),
        "PIQP": by_piqp(programs),
        "DAQP": by_daqp(programs),
        "OSQP": by_osqp(programs, gains, craft, terminal),
    }
    costs = {
        name: np.array([p.cost(v) for p, v in zip(programs, plan, strict=True)]) for name, (plan, _, _) in results.items()
    }
    least = np.min(list(costs.values()), axis=0)
    active = float(np.mean(np.abs(plans).max(axis=1) > 1.0 - 1e-9))
    print(f"N = {horizon}, limit {torque_limit:g} N m, {steps} programs, limits active in {active:.0%} of them")
    print(f"ours: {counters[mpc.SWEEPS] / counters[mpc.CALLS]:.2f} sweeps a call, at most {counters[mpc.WORST]}")
    table = []
    for name, (_, wall, own) in results.items():
        gap = float(np.max((costs[name] - least) / least))
        ratio = float(np.median(wall) / np.median(spent))
        share = float(np.median(own) / np.median(spent))
        figures = [np.median(wall), np.percentile(wall, 99.0), wall.max(), np.median(own)]
        cells = ["-" if np.isnan(x) else f"{x:.1f}" for x in (*figures, ratio, share)]
        table.append([name, *cells, f"{gap:.0e}"])
    show(["solver", "median us", "99 % us", "worst us", "own us", "median/ours", "own/ours", "gap"], table)


def compare_lanes(horizon: int, torque_limit: float, steps: int) -> None:
    """Time the law on several flights at once, and print a table."""
    gains, craft = mpc.Gains(*WEIGHTS, horizon=horizon), make_craft(INERTIA, torque_limit)
    rates = np.random.default_rng(1).normal(scale=0.04, size=(max(WIDTHS), 3)).tolist()
    flights = np.array([fly(gains, craft, steps, PUBLISHED._replace(rate=tuple(rate))) for rate in rates])
    laws = [OverRows(gains, craft, flights[:width]) for width in WIDTHS]
    least = np.full(len(WIDTHS), np.inf)
    # In turn, so that what the machine does meanwhile falls on all alike.
    for _ in range(15):
        for place, law in enumerate(laws):
            law.anew()
            least[place] = min(least[place], law(0, steps) / (steps * law.width))
    print(f"N = {horizon}, limit {torque_limit:g} N m, flights at once")
    table = [[str(law.width), f"{time:.2f}", f"{law.compiling:.2f}"] for law, time in zip(laws, least, strict=True)]
    show(["flights", "us a call", "s to compile"], table)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=1400)
    steps = parser.parse_args().steps
    print(header("osqp", "piqp", "daqp"))
    for horizon, torque_limit in ((10, 0.01), (20, 0.01), (10, 0.002), (20, 0.002)):
        compare(horizon, torque_limit, steps)
    for horizon in (10, 20):
        compare_lanes(horizon, 0.01, steps)


if __name__ == "__main__":
    main()
