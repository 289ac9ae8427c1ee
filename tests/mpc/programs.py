"""Random quadratic programs with limits, and their optimum by library solvers."""

from typing import Any

import clarabel
import numpy as np
import piqp
import scipy.sparse as sp

from starhold.laws.predictive.problem import Problem
from tests.mpc.single import Solution, pose, solve
from tests.tiers import fewer


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

    def _numbers(self) -> tuple[Any, ...]:
        return self.a, self.b, self.q, self.r, self.p, self.x, self.horizon, self.bound, tuple(self.centre.tolist())

    def solve(self, *, ball: bool, budget: int = 100) -> Solution:
        return solve(*self._numbers(), ball, budget)

    def pose(self, *, ball: bool) -> Problem:
        return pose(*self._numbers(), ball)

    @property
    def low(self) -> Any:
        return np.tile(self.centre - self.bound, self.horizon)

    @property
    def high(self) -> Any:
        return np.tile(self.centre + self.bound, self.horizon)


SEEDS = range(fewer(120, 8))


def by_piqp(program: Program) -> Any:
    solver = piqp.DenseSolver()
    solver.settings.eps_abs, solver.settings.eps_rel = 1e-9, 1e-11
    solver.setup(program.hessian, program.linear, x_l=program.low, x_u=program.high)
    assert solver.solve() == piqp.PIQP_SOLVED
    return solver.result.x


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
