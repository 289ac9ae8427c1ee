"""Indices of Ishigami's function against published ones, and what holes in a design do."""

import numpy as np
import pytest
from SALib.sample import morris as morris_design
from SALib.sample import sobol as saltelli_design

from starhold.campaign.sensitivity import Morris, Refused, Sobol, morris, problem, sobol

NAMES = ("x1", "x2", "x3")


def ishigami(unit):
    """T. Ishigami, T. Homma, ISUMA '90, with a = 7, b = 0.1."""
    x = np.pi * (2.0 * unit - 1.0)
    return np.sin(x[:, 0]) + 7.0 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])


@pytest.mark.parametrize("second_order", [False, True])
def test_sobol_indices_of_ishigami(second_order):
    """Published to four digits in A. Saltelli et al., "Global sensitivity analysis: the primer", 2008."""
    unit = saltelli_design.sample(problem(NAMES), 4096, calc_second_order=second_order, seed=2)
    found = sobol(NAMES, unit, ishigami(unit))
    assert isinstance(found, Sobol)
    assert found.first == pytest.approx([0.3139, 0.4424, 0.0], abs=0.01)
    assert found.total == pytest.approx([0.5576, 0.4424, 0.2437], abs=0.01)
    assert (np.abs(found.total - [0.5576, 0.4424, 0.2437]) < found.total_width).all()
    assert found.sentence().startswith("x1 moves it most: 0.31")


def test_sobol_intervals_can_be_made_again():
    unit = saltelli_design.sample(problem(NAMES), 64, calc_second_order=False, seed=2)
    one, again, other = (sobol(NAMES, unit, ishigami(unit), seed=seed).first_width for seed in (0, 0, 1))
    assert np.array_equal(one, again)
    assert not np.array_equal(one, other)


def test_sobol_refuses_with_a_reason():
    unit = saltelli_design.sample(problem(NAMES), 64, calc_second_order=False, seed=2)
    values = ishigami(unit)
    values[[3, 70]] = np.nan
    refused = sobol(NAMES, unit, values)
    assert refused == Refused("2 runs have no value, and Sobol's estimators need all 320; Morris designs and drivers do not")
    values[70] = 1.0
    assert "1 run has no value" in sobol(NAMES, unit, values).reason
    assert sobol(NAMES, unit, np.ones(320)) == Refused("all runs have the same value")
    shuffled = np.random.default_rng(0).permutation(unit)
    for design in (shuffled, unit[:319], unit[:0]):
        assert "no Saltelli design" in sobol(NAMES, design, ishigami(design)).reason
    assert "no Saltelli design" in sobol((), unit[:, :0], values).reason


@pytest.mark.parametrize("levels", [2, 4, 6, 10])
def test_morris_effects_of_a_plane_are_its_slopes(levels):
    unit = morris_design.sample(problem(NAMES), 12, num_levels=levels, seed=1)
    found = morris(NAMES, unit, unit @ [3.0, -2.0, 0.0] + 5.0)
    assert isinstance(found, Morris)
    assert found.mu == pytest.approx([3.0, -2.0, 0.0], abs=1e-12)
    assert found.mu_star == pytest.approx([3.0, 2.0, 0.0], abs=1e-12)
    assert found.sigma == pytest.approx(np.zeros(3), abs=1e-12)
    assert (found.trajectories, found.dropped) == (12, 0)


def test_morris_effects_of_ishigami_are_those_of_the_four_levels():
    """Exactly: x2 moves between levels 2/3 apart, of which each step makes 7 sin² x2 differ by 5.25."""
    unit = morris_design.sample(problem(NAMES), 400, num_levels=4, seed=1)
    found = morris(NAMES, unit, ishigami(unit))
    assert found.mu_star[1] == pytest.approx(5.25 * 1.5)
    assert abs(found.mu[1]) < 1.0
    assert found.mu_star[0] > found.mu_star[2] > 3.0
    # The third input acts only together with the first, with either sign.
    assert abs(found.mu[2]) < 1.0 < found.sigma[2]


def test_morris_drops_the_trajectories_with_failed_runs():
    unit = morris_design.sample(problem(NAMES), 20, num_levels=4, seed=1)
    values = ishigami(unit)
    holes = values.copy()
    holes[[5, 7, 41]] = np.nan, np.nan, -np.inf
    left = np.delete(np.arange(80), [*range(4, 8), *range(40, 44)])
    found, expected = morris(NAMES, unit, holes), morris(NAMES, unit[left], values[left])
    assert (found.trajectories, found.dropped, expected.dropped) == (20, 2, 0)
    for field in ("mu", "mu_star", "mu_star_width", "sigma"):
        assert np.array_equal(getattr(found, field), getattr(expected, field))
    assert "2 of 20 trajectories were dropped" in found.sentence()
    holes[4:] = np.nan
    assert morris(NAMES, unit, holes) == Refused("1 of 20 trajectories have all their values, two are the least")


def test_morris_refuses_other_designs():
    unit = morris_design.sample(problem(NAMES), 20, num_levels=4, seed=1)
    assert "whole number of trajectories" in morris(NAMES, unit[:-1], ishigami(unit[:-1])).reason
    for design in (
        np.random.default_rng(0).permutation(unit),
        np.zeros((8, 3)),
        np.random.default_rng(0).uniform(size=(8, 3)),
    ):
        assert "no Morris design" in morris(NAMES, design, ishigami(design)).reason
    # Ends of the unit interval may be drawn in a little, as where a distribution has no ends.
    assert isinstance(morris(NAMES, 0.001 + 0.998 * unit, ishigami(unit)), Morris)
