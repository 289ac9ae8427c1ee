"""The solver of the predictive law against library solvers and the conditions of an optimum."""

import numpy as np
import pytest

from tests.mpc.programs import SEEDS, Program, by_clarabel, by_piqp
from tests.tiers import leading


@pytest.mark.parametrize("ball", leading([False, True]))
def test_against_library_solvers(ball: bool):
    pressing, by_library = [], by_clarabel if ball else by_piqp
    for seed in SEEDS:
        program = Program(seed)
        plan, cost, _, solved = program.solve(ball=ball)
        out = plan - program.centre
        away = np.linalg.norm(out, axis=1) if ball else np.abs(out)
        assert solved
        assert away.max() <= program.bound + 1e-9
        assert cost == pytest.approx(program.cost(plan), rel=1e-9)
        pressing.append(float(np.mean(away > program.bound * (1.0 - 1e-9))))
        assert abs(program.cost(plan) - program.cost(by_library(program))) <= 1e-6 * abs(cost), f"seed {seed}"
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
