"""A predictive program is solved by itself, outside any flight."""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.scalar import Scalar, Truth, where
from starhold.algebra.structured import Buffer, Index
from starhold.algebra.vector import Vector
from starhold.laws.predictive.horizon import rollout
from starhold.laws.predictive.problem import Problem, carve, put_limits, size
from starhold.laws.predictive.solver import improve
from starhold.trace.machine import load
from starhold.trace.program import Program
from starhold.trace.recording import Recorder


class Solution(NamedTuple):
    """A solution is the plan (N, 3), its cost, the number of Riccati sweeps, and whether the optimum was reached."""

    plan: NDArray[np.float64]
    cost: float
    sweeps: int
    solved: bool


def solve(
    a: Any, b: Any, q: Any, r: Any, p: Any, x: Any, horizon: int, bound: float, centre: Vector, ball: bool, budget: int
) -> Solution:
    """Solve one program from scratch: A (6, 6), B (6, 3), Q (6, 6), R (3, 3) and P (6, 6) symmetric, Q and P positive
    semidefinite, R positive definite; x (6); limits |v - centre| <= bound per axis or, with ball, in norm (inf: none).

    The first call for a kind of limits compiles the solver."""
    problem = pose(a, b, q, r, p, x, horizon, bound, centre, ball)
    numbers, report = np.array(problem.numbers.cells), np.empty(3)
    _kernel(ball)(numbers.ctypes.data, report.ctypes.data, horizon, budget)
    plan = np.array(carve(problem._replace(numbers=Buffer(numbers.tolist()))).plan.row(0, 3 * horizon))
    return Solution(plan.reshape(horizon, 3), float(report[0]), int(report[1]), bool(report[2]))


def pose(a: Any, b: Any, q: Any, r: Any, p: Any, x: Any, horizon: int, bound: float, centre: Vector, ball: bool) -> Problem:
    """Return the program of these numbers, see `solve`, with limits and weights and its first state set."""
    problem = Problem(Buffer([0.0] * size(horizon, dense=True)), horizon, ball, dense=True)
    store = carve(problem)
    store.weights.put(0, _numbers(q, r, np.linalg.inv(r), p))
    store.motion.put(0, _numbers(a, b))
    store.states.put(0, _numbers(x))
    put_limits(problem, centre, bound)
    return problem


def _numbers(*arrays: Any) -> list[float]:
    return [float(x) for array in arrays for x in np.ravel(array)]


def work_out(problem: Problem, budget: Index) -> tuple[Scalar, Scalar, Truth]:
    """Solve a program from scratch; gives its cost, the number of sweeps and whether the optimum was reached."""
    end = improve(problem, budget, False)
    return 2.0 * rollout(problem), end.sweeps, end.solved


def record_solver(*, ball: bool) -> Program:
    """Return the solver as a program: memories `numbers`, of `pose`, and `report` (3), the results of `work_out`; then
    the horizon and the budget."""
    recorder = Recorder()
    numbers = recorder.memory("numbers", lanes=True, writable=True)
    report = recorder.memory("report", lanes=True, writable=True)
    horizon, budget = recorder.input("horizon", "index"), recorder.input("budget", "index")
    problem = Problem(Buffer(numbers, 0, size(horizon, dense=True)), horizon, ball, dense=True)
    with recorder.recording():
        cost, sweeps, solved = work_out(problem, budget)
    for place, number in enumerate((cost, sweeps, where(solved, 1.0, 0.0))):
        report[place] = number
    return recorder.program("solve")


@cache
def _kernel(ball: bool) -> Any:
    return load(record_solver(ball=ball), 1)
