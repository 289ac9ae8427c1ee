"""The degree of stability against the roots, its optimum against searches that know only the roots and the budget."""

import math
from itertools import permutations
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from starhold.synthesis.stability_degree import brute_force, degree, design_gains, optimum, scale
from tests.tiers import fewer

PUBLISHED = [((1.0, 1.5, 2.0), (1.0136, 3.2881, 0.8220)), ((1.0, 0.75, 0.5), (1.2312, 2.5625, 1.2813))]


def by_roots(K_a: float, K_w: float, ratios: Any) -> float:
    """Degree of stability from the roots that NumPy finds."""
    return -max(float(np.roots([i, K_w, 2.0 * K_a]).real.max()) for i in ratios)


def cases(count: int, seed: int) -> list[tuple[np.ndarray, float, float, float]]:
    """Random ratios in any order, some equal, with alpha, omega and L over several decades."""
    random = np.random.default_rng(seed)
    found: list[tuple[np.ndarray, float, float, float]] = []
    for number in range(count):
        ratios = np.exp(random.uniform(-1.5, 1.5, 3))
        if number % 7 == 0:
            ratios[random.integers(3)] = ratios[random.integers(3)]
        if number % 29 == 0:
            ratios[:] = ratios[0]
        alpha, omega, budget = np.exp(random.uniform(-4.0, 4.0, 3))
        found.append((ratios, float(alpha), float(omega), float(budget)))
    return found


@pytest.mark.parametrize(("ratios", "expected"), PUBLISHED)
def test_checked_values(ratios: tuple[float, ...], expected: tuple[float, ...]) -> None:
    for order in permutations(ratios):
        assert optimum(order, 0.5, 0.3, 2.0) == pytest.approx(expected, abs=5e-5)


def test_degree_is_that_of_the_roots() -> None:
    random = np.random.default_rng(1)
    for _ in range(fewer(500)):
        ratios = np.exp(random.normal(size=3))
        K_a, K_w = np.exp(random.normal(size=2)) * random.choice([-1.0, 1.0], 2, p=[0.1, 0.9])
        assert float(degree(K_a, K_w, ratios)) == pytest.approx(by_roots(K_a, K_w, ratios), rel=1e-9, abs=1e-12)
    for K_a, K_w in ((0.0, 0.0), (0.0, 1.0), (0.0, -1.0), (1.0, 0.0), (-1.0, 0.0)):
        assert float(degree(K_a, K_w, (1.0, 2.0, 3.0))) == pytest.approx(by_roots(K_a, K_w, (1.0, 2.0, 3.0)), abs=1e-12)


def test_degree_of_strong_damping_keeps_its_digits() -> None:
    assert float(degree(1.0, 1e9, (1.0, 2.0, 3.0))) == pytest.approx(2e-9, rel=1e-12)


def test_optimum_is_the_best_on_the_budget_line() -> None:
    for ratios, alpha, omega, budget in cases(fewer(300), 2):
        best = optimum(ratios, alpha, omega, budget)
        assert 2.0 * best.K_a * alpha + best.K_w * omega == pytest.approx(budget, rel=1e-12)
        # Half of a double root's digits are lost in the roots.
        assert by_roots(best.K_a, best.K_w, ratios) == pytest.approx(best.eta, rel=1e-7)
        most = budget / omega

        def loss(share: float, most: float = most, ratios: Any = ratios, given: Any = (alpha, omega, budget)) -> float:
            left = (given[2] - share * most * given[1]) / (2.0 * given[0])
            return -float(degree(left, share * most, ratios))

        found = minimize_scalar(loss, bounds=(0.0, 1.0), method="bounded", options={"xatol": 1e-13, "maxiter": 500})
        assert -found.fun == pytest.approx(best.eta, rel=1e-6)
        assert -found.fun <= best.eta * (1.0 + 1e-9)


@pytest.mark.parametrize("zero", ["", "alpha", "omega"])
def test_brute_force_finds_the_same(zero: str) -> None:
    for ratios, alpha, omega, budget in cases(fewer(100), 5):
        demand = (0.0 if zero == "alpha" else alpha, 0.0 if zero == "omega" else omega)
        best, found = optimum(ratios, *demand, budget), brute_force(ratios, *demand, budget, points=21)
        assert found.eta == pytest.approx(best.eta, rel=1e-6)
        assert found.K_w == pytest.approx(best.K_w, rel=1e-6)
        # Without an initial error, stiffness costs nothing: what is found may be stiffer.
        assert found.K_a == pytest.approx(best.K_a, rel=1e-6) if zero != "alpha" else found.K_a >= best.K_a * (1.0 - 1e-6)


def test_scale_there_and_back() -> None:
    units = scale((40.0, 60.0, 80.0), 0.2, 20.0)
    assert units[:3] == pytest.approx((40.0, 100.0, 50.0))
    assert units.ratios == pytest.approx((1.0, 1.5, 2.0))
    assert units.scaled(*units.gains(1.7, 2.3)) == pytest.approx((1.7, 2.3), rel=1e-14)
    assert units.gains(1.0, 1.0) == pytest.approx((0.004, 0.4))


def test_design_spends_the_torque_and_has_its_degree() -> None:
    moments, torque, angle, rate = np.array([40.0, 30.0, 50.0]), 0.2, 0.4, 0.01
    made = design_gains(moments, torque, 20.0, angle, rate)
    assert {type(value) for value in made[:2] + made[3:]} == {float}
    assert 2.0 * made.k_attitude * angle + made.k_rate * rate == pytest.approx(torque, rel=1e-12)
    slowest = max(float(np.roots([j, made.k_rate, 2.0 * made.k_attitude]).real.max()) for j in moments)
    assert made.eta_per_second == pytest.approx(-slowest, rel=1e-7)
    assert made[3:6] == optimum(made.ratios, angle, rate * made.t0, made.L)


def test_design_knows_no_favoured_axis_nor_momentum() -> None:
    made = design_gains((40.0, 30.0, 50.0), 0.2, 20.0, 0.4, 0.01)
    for moments, momentum in (((50.0, 40.0, 30.0), 20.0), ((30.0, 50.0, 40.0), 3.0)):
        other = design_gains(moments, 0.2, momentum, 0.4, 0.01)
        assert other[6:] == pytest.approx(made[6:], rel=1e-13)


RATIOS, BODY = (1.0, 1.5, 2.0), (40.0, 60.0, 80.0)
PROBLEMS = [
    (((1.0, 2.0), 0.5, 0.3, 2.0), "three positive numbers"),
    (((1.0, 2.0, 0.0), 0.5, 0.3, 2.0), "three positive numbers"),
    (((1.0, 2.0, math.nan), 0.5, 0.3, 2.0), "three positive numbers"),
    ((RATIOS, -0.5, 0.3, 2.0), "alpha must be at least 0"),
    ((RATIOS, 0.5, math.inf, 2.0), "omega must be at least 0 and finite"),
    ((RATIOS, 0.5, 0.3, 0.0), "budget must be positive"),
    ((RATIOS, 0.0, 0.0, 2.0), "bounds no gain"),
    ((RATIOS, 0.0, 1e-200, 1e200), "range"),
    (((0.1, 0.1, 0.1), 0.0, 5e-324, 1.0), "range"),
]
DESIGNS = [
    (((40.0, 60.0), 0.2, 20.0, 0.5, 0.01), "three numbers"),
    (((40.0, -60.0, 80.0), 0.2, 20.0, 0.5, 0.01), "positive definite"),
    (((10.0, 10.0, 80.0), 0.2, 20.0, 0.5, 0.01), "no body"),
    ((BODY, 0.0, 20.0, 0.5, 0.01), "torque must be positive"),
    ((BODY, 0.2, math.inf, 0.5, 0.01), "momentum must be positive"),
    ((BODY, 1e-300, 1e300, 0.5, 0.01), "range"),
    ((BODY, 0.2, 20.0, -0.5, 0.01), "angle must be at least 0"),
    ((BODY, 0.2, 20.0, 3.5, 0.01), "angle must be at most pi"),
    ((BODY, 0.2, 20.0, 0.5, -0.01), "rate must be at least 0"),
    ((BODY, 0.2, 20.0, 0.0, 0.0), "angle and rate are both 0"),
]
REFUSED = [(solve, *case) for solve in (optimum, brute_force) for case in PROBLEMS]
REFUSED += [(design_gains, *case) for case in DESIGNS]
REFUSED += [(degree, (1.0, 1.0, ratios), "ratios must be positive") for ratios in ((1.0, -1.0, 1.0), 1.0, ())]
REFUSED += [(brute_force, (RATIOS, 0.5, 0.3, 2.0, 2), "points must be")]


@pytest.mark.parametrize(("function", "arguments", "words"), REFUSED)
def test_bad_problems_are_refused_in_one_line(function: Any, arguments: tuple[Any, ...], words: str) -> None:
    with pytest.raises(ValueError, match=words) as caught:
        function(*arguments)
    assert "\n" not in str(caught.value)
