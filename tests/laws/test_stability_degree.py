"""The degree of stability against the roots, its optimum against searches that know only the roots and the budget."""

import math
from itertools import permutations
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from starhold.synthesis.stability_degree import (
    Designed,
    Optimum,
    boundary,
    brute_force,
    degree,
    design_gains,
    optimum,
    scale,
)

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


def test_formula_for_rising_moments() -> None:
    for s in np.linspace(0.0, 3.0, 13):
        c = (1.0 + 2.0 * s) / (8.0 * (1.0 + s) ** 2)
        ratios = (1.0, 1.0 + 0.4 * s, 1.0 + s)
        assert boundary(ratios) == pytest.approx(c, rel=1e-14)
        best = optimum(ratios, 0.7, 0.2, 3.0)
        assert best.K_w == pytest.approx((-0.2 + math.sqrt(0.04 + 8.0 * c * 0.7 * 3.0)) / (4.0 * c * 0.7), rel=1e-13)
        assert best.K_a == pytest.approx(c * best.K_w**2, rel=1e-14)


def test_degree_is_that_of_the_roots() -> None:
    random = np.random.default_rng(1)
    for _ in range(500):
        ratios = np.exp(random.normal(size=3))
        K_a, K_w = np.exp(random.normal(size=2)) * random.choice([-1.0, 1.0], 2, p=[0.1, 0.9])
        assert float(degree(K_a, K_w, ratios)) == pytest.approx(by_roots(K_a, K_w, ratios), rel=1e-9, abs=1e-12)
    for K_a, K_w in ((0.0, 0.0), (0.0, 1.0), (0.0, -1.0), (1.0, 0.0), (-1.0, 0.0)):
        assert float(degree(K_a, K_w, (1.0, 2.0, 3.0))) == pytest.approx(by_roots(K_a, K_w, (1.0, 2.0, 3.0)), abs=1e-12)


def test_degree_of_strong_damping_keeps_its_digits() -> None:
    assert float(degree(1.0, 1e9, (1.0, 2.0, 3.0))) == pytest.approx(2e-9, rel=1e-12)


def test_degree_broadcasts() -> None:
    K_a, K_w = np.linspace(0.1, 2.0, 5), np.linspace(0.1, 3.0, 4)
    eta = degree(K_a, K_w[:, None], (1.0, 1.5, 2.0))
    assert eta.shape == (4, 5)
    assert eta[2, 3] == degree(K_a[3], K_w[2], (1.0, 1.5, 2.0))
    many = degree(1.0, 2.0, np.array([[1.0, 1.5, 2.0], [1.0, 1.0, 1.0]]))
    assert many.tolist() == [float(degree(1.0, 2.0, (1.0, 1.5, 2.0))), float(degree(1.0, 2.0, (1.0, 1.0, 1.0)))]


def test_optimum_is_the_best_on_the_budget_line() -> None:
    for ratios, alpha, omega, budget in cases(300, 2):
        best = optimum(ratios, alpha, omega, budget)
        assert 2.0 * best.K_a * alpha + best.K_w * omega == pytest.approx(budget, rel=1e-12)
        # Half of a double root's digits are lost in the roots.
        assert by_roots(best.K_a, best.K_w, ratios) == pytest.approx(best.eta, rel=1e-7)
        most = budget / omega

        def loss(
            share: float, most: float = most, ratios: Any = ratios, given: tuple[float, ...] = (alpha, omega, budget)
        ) -> float:
            left = (given[2] - share * most * given[1]) / (2.0 * given[0])
            return -float(degree(left, share * most, ratios))

        found = minimize_scalar(loss, bounds=(0.0, 1.0), method="bounded", options={"xatol": 1e-13, "maxiter": 500})
        assert -found.fun == pytest.approx(best.eta, rel=1e-6)
        assert -found.fun <= best.eta * (1.0 + 1e-9)


def test_nothing_inside_the_budget_is_better() -> None:
    random = np.random.default_rng(3)
    for ratios, alpha, omega, budget in cases(300, 4):
        best = optimum(ratios, alpha, omega, budget)
        share, split = random.uniform(0.0, 0.999, (2, 2000))
        K_a, K_w = share * split * budget / (2.0 * alpha), share * (1.0 - split) * budget / omega
        near = np.exp(random.normal(size=(2, 2000)) * 0.05) * [[best.K_a], [best.K_w]]
        near *= 0.999 * np.minimum(1.0, budget / (2.0 * alpha * near[0] + omega * near[1]))
        assert degree(K_a, K_w, ratios).max() < best.eta
        assert degree(near[0], near[1], ratios).max() < best.eta


@pytest.mark.parametrize("zero", ["", "alpha", "omega"])
def test_brute_force_finds_the_same(zero: str) -> None:
    for ratios, alpha, omega, budget in cases(100, 5):
        demand = (0.0 if zero == "alpha" else alpha, 0.0 if zero == "omega" else omega)
        best, found = optimum(ratios, *demand, budget), brute_force(ratios, *demand, budget, points=21)
        assert found.eta == pytest.approx(best.eta, rel=1e-6)
        assert found.K_w == pytest.approx(best.K_w, rel=1e-6)
        # Without an initial error, stiffness costs nothing: what is found may be stiffer.
        assert found.K_a == pytest.approx(best.K_a, rel=1e-6) if zero != "alpha" else found.K_a >= best.K_a * (1.0 - 1e-6)


def test_limits_are_continuous() -> None:
    ratios = (1.0, 1.5, 2.0)
    assert optimum(ratios, 0.0, 0.3, 2.0) == pytest.approx(optimum(ratios, 1e-12, 0.3, 2.0), rel=1e-9)
    assert optimum(ratios, 0.5, 0.0, 2.0) == pytest.approx(optimum(ratios, 0.5, 1e-12, 2.0), rel=1e-9)
    assert optimum(ratios, 0.0, 0.3, 2.0).K_w == pytest.approx(2.0 / 0.3, rel=1e-15)
    assert optimum(ratios, 0.5, 0.0, 2.0).K_a == pytest.approx(2.0, rel=1e-15)


def test_equal_moments_are_critically_damped() -> None:
    best = optimum((1.0, 1.0, 1.0), 0.5, 0.0, 2.0)
    assert best == pytest.approx((2.0, 4.0, 2.0), rel=1e-15)
    assert best.K_w**2 == pytest.approx(8.0 * best.K_a)


def test_scale_there_and_back() -> None:
    units = scale((40.0, 60.0, 80.0), 0.2, 20.0)
    assert units[:3] == pytest.approx((40.0, 100.0, 50.0))
    assert units.ratios == pytest.approx((1.0, 1.5, 2.0))
    assert units.scaled(*units.gains(1.7, 2.3)) == pytest.approx((1.7, 2.3), rel=1e-14)
    assert units.gains(1.0, 1.0) == pytest.approx((0.004, 0.4))


def test_design_spends_the_torque_and_has_its_degree() -> None:
    moments, torque, angle, rate = np.array([40.0, 30.0, 50.0]), 0.2, 0.4, 0.01
    made = design_gains(moments, torque, 20.0, angle, rate)
    assert isinstance(made, Designed)
    assert 2.0 * made.k_attitude * angle + made.k_rate * rate == pytest.approx(torque, rel=1e-12)
    slowest = max(float(np.roots([j, made.k_rate, 2.0 * made.k_attitude]).real.max()) for j in moments)
    assert made.eta_per_second == pytest.approx(-slowest, rel=1e-7)
    assert made[3:6] == optimum(made.ratios, angle, rate * made.t0, made.L)


def test_design_knows_no_favoured_axis_nor_momentum() -> None:
    made = design_gains((40.0, 30.0, 50.0), 0.2, 20.0, 0.4, 0.01)
    for moments, momentum in (((50.0, 40.0, 30.0), 20.0), ((30.0, 50.0, 40.0), 3.0)):
        other = design_gains(moments, 0.2, momentum, 0.4, 0.01)
        assert other[6:] == pytest.approx(made[6:], rel=1e-13)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (((1.0, 2.0), 0.5, 0.3, 2.0), "three positive numbers"),
        (((1.0, 2.0, 0.0), 0.5, 0.3, 2.0), "three positive numbers"),
        (((1.0, 2.0, math.nan), 0.5, 0.3, 2.0), "three positive numbers"),
        (((1.0, 1.5, 2.0), -0.5, 0.3, 2.0), "alpha must be at least 0"),
        (((1.0, 1.5, 2.0), 0.5, math.inf, 2.0), "omega must be at least 0 and finite"),
        (((1.0, 1.5, 2.0), 0.5, 0.3, 0.0), "budget must be positive"),
        (((1.0, 1.5, 2.0), 0.0, 0.0, 2.0), "bounds no gain"),
        (((1.0, 1.5, 2.0), 0.0, 1e-200, 1e200), "range"),
        (((0.1, 0.1, 0.1), 0.0, 5e-324, 1.0), "range"),
    ],
)
def test_bad_problems_are_refused_in_one_line(arguments: tuple[Any, ...], words: str) -> None:
    for solve in (optimum, brute_force):
        with pytest.raises(ValueError, match=words) as caught:
            solve(*arguments)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (((40.0, 60.0), 0.2, 20.0, 0.5, 0.01), "three numbers"),
        (((40.0, -60.0, 80.0), 0.2, 20.0, 0.5, 0.01), "positive definite"),
        (((10.0, 10.0, 80.0), 0.2, 20.0, 0.5, 0.01), "no body"),
        (((40.0, 60.0, 80.0), 0.0, 20.0, 0.5, 0.01), "torque must be positive"),
        (((40.0, 60.0, 80.0), 0.2, math.inf, 0.5, 0.01), "momentum must be positive"),
        (((40.0, 60.0, 80.0), 1e-300, 1e300, 0.5, 0.01), "range"),
        (((40.0, 60.0, 80.0), 0.2, 20.0, -0.5, 0.01), "angle must be at least 0"),
        (((40.0, 60.0, 80.0), 0.2, 20.0, 3.5, 0.01), "angle must be at most pi"),
        (((40.0, 60.0, 80.0), 0.2, 20.0, 0.5, -0.01), "rate must be at least 0"),
        (((40.0, 60.0, 80.0), 0.2, 20.0, 0.0, 0.0), "angle and rate are both 0"),
    ],
)
def test_bad_designs_are_refused_in_one_line(arguments: tuple[Any, ...], words: str) -> None:
    with pytest.raises(ValueError, match=words) as caught:
        design_gains(*arguments)
    assert "\n" not in str(caught.value)


def test_bad_ratios_and_grids_are_refused() -> None:
    for ratios in ((1.0, -1.0, 1.0), 1.0, ()):
        with pytest.raises(ValueError, match="ratios must be positive"):
            degree(1.0, 1.0, ratios)
    with pytest.raises(ValueError, match="points must be"):
        brute_force((1.0, 1.5, 2.0), 0.5, 0.3, 2.0, points=2)


def test_numbers_are_plain_floats() -> None:
    given = (np.array([1.0, 1.5, 2.0]), np.float64(0.5), np.float64(0.3), np.float64(2.0))
    for best in (optimum(*given), brute_force(*given, points=11)):
        assert isinstance(best, Optimum)
        assert [type(value) for value in best] == [float] * 3
    made = design_gains(np.array([40.0, 60.0, 80.0]), np.float64(0.2), np.float64(20.0), np.float64(0.5), np.float64(0.01))
    assert {type(value) for value in made[:2] + made[3:]} == {float}
