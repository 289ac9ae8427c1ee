"""The solver of the predictive law gives the same bits in plain Python, on one lane and on eight; the law itself flies in
C and JavaScript in `simulation/test_every_machine.py`."""

from typing import Any

import numpy as np
import pytest

from starhold.laws.predictive.problem import Problem
from starhold.laws.predictive.solver import PATIENCE
from tests.mpc.programs import Program
from tests.mpc.single import record_solver, work_out
from tests.tiers import leading
from tests.trace.machines import Job, column, on_lanes, same

LANES, BUDGET = 8, 100
SMALL, LARGE, STUBBORN = 0, 3, 13
"""Seeds of programs with 1, 4 and 14 moves; of the last, some need the interior-point method."""


@pytest.mark.parametrize("ball", leading([False, True]))
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
