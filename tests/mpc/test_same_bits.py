"""The predictive law and its solver give the same bits in plain Python, on one lane, on eight lanes, in C and JavaScript."""

from typing import Any

import numpy as np
import pytest

from starhold.algebra.structured import Buffer, repeat
from starhold.algebra.vector import ZERO
from starhold.laws import mpc
from starhold.laws.interface import Measurement
from starhold.laws.predictive.problem import Problem
from starhold.laws.predictive.single import record_solver, work_out
from starhold.laws.predictive.solver import PATIENCE
from starhold.trace.program import Memory
from tests.mpc.programs import Program
from tests.mpc.setting import CRAFTS, WEIGHTS, fresh
from tests.trace.machines import Job, Subject, column, on_c, on_lanes, on_node, same

LANES, BUDGET = 8, 100
SMALL, LARGE, STUBBORN = 0, 3, 13
"""Seeds of programs with 1, 4 and 14 moves; of the last, some need the interior-point method."""


@pytest.mark.parametrize("ball", [False, True])
def test_solver(ball: bool):
    solver, sweeps = record_solver(ball=ball), []
    for first in (SMALL, LARGE, STUBBORN):
        # Seeds 20 apart have the same horizon.
        posed = [Program(first + 20 * k).pose(ball=ball) for k in range(LANES)]
        memories = {"numbers": np.array([p.numbers.cells for p in posed]).T, "report": np.zeros((3, LANES))}
        inputs = {"horizon": posed[0].horizon, "budget": BUDGET}
        many = on_lanes(Job(solver, memories, inputs), LANES)
        for lane, problem in enumerate(posed):
            own = column(solver, memories, lane)
            expected = plainly_solved(problem)
            same(expected, on_lanes(Job(solver, own, inputs)), "one lane")
            same(expected, column(solver, many, lane), f"lane {lane}")
            sweeps.append(expected["report"][1])
    assert min(sweeps) == 1
    assert max(sweeps) > PATIENCE


def plainly_solved(problem: Problem) -> Any:
    """What plain Python leaves in the memories of the solver."""
    cost, sweeps, solved = work_out(problem, BUDGET)
    return {"numbers": np.array(problem.numbers.cells), "report": np.array([cost, sweeps, float(solved)])}


# --- The law ----------------------------------------------------------------------------------------------------------

STEPS, PERIOD = 5, 2.0
LIKE = 23
"""Numbers of what the law sees, but for the wheels' momentum."""


def seen_in(numbers: Any) -> Measurement:
    """What the law sees, from its numbers in order."""
    n = tuple(numbers)
    return Measurement(n[0:4], n[4:7], n[7:10], n[10:13], n[13:16], n[16:19], n[19:22], n[22])


def law_over_rows(gains: mpc.Gains, craft: Any) -> Subject:
    """The law, called with one row after the other: commands and all that it remembers."""

    def run(rows: Buffer, numbers: Buffer, commands: Buffer, _lane: Any) -> None:
        def step(k: int) -> None:
            command, _ = mpc.torque(seen_in(rows.row(k, LIKE)), gains, craft, mpc.Memory(numbers))
            commands.put(k, command)

        repeat(STEPS, step)

    count = len(fresh(gains, craft).numbers.cells)
    sizes = (("rows", False, LIKE * STEPS), ("numbers", True, count), ("commands", True, 3 * STEPS))
    return Subject(run, tuple(Memory(name, True, writable, size) for name, writable, size in sizes), {})


def jumping_rows(seed: int) -> Any:
    """Rows in which the craft tumbles round a moving target, so far off that limits shape most plans."""
    random = np.random.default_rng(seed)
    rows = np.zeros((STEPS, LIKE))
    attitude, rate = random.normal(size=4), random.normal(size=3) * 0.06
    for row in rows:
        attitude, rate = attitude + 0.05 * random.normal(size=4), rate + 0.006 * random.normal(size=3)
        target, acceleration = random.normal(size=(2, 3)) * ((0.01,), (0.001,))
        turn = attitude / np.linalg.norm(attitude)
        position = random.normal(size=3) * 5e6
        row[:] = (*turn, *rate, *(rate + target), *target, *acceleration, *ZERO, *position, PERIOD)
    return rows


@pytest.mark.parametrize("language", ["gcc", "node"])
def test_law_in_other_languages(language: str):
    craft = CRAFTS["principal"]
    gains = mpc.Gains(*WEIGHTS[:2], (1e-3, 1e-3, 1e-3), horizon=9, limit=mpc.LIMITS.index("norm"))
    subject = law_over_rows(gains, craft)
    program = subject.program()
    start = np.array(fresh(gains, craft, PERIOD).numbers.cells)
    memories = {"rows": jumping_rows(1).ravel(), "numbers": start, "commands": np.zeros(3 * STEPS)}
    jobs = [Job(program, memories, {})]
    (found,) = on_node(jobs) if language == "node" else on_c(jobs, language, "-O1")
    expected = subject.plain(memories, {})
    same(expected, found, language)
    assert expected["numbers"][mpc.WORST] > PATIENCE
