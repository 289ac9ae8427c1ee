"""Plans draw the same numbers however they are cut, and place them as they say."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats
from scipy.stats import qmc

from starhold.campaign.sampling import LEVELS, SAMPLINGS, Plan
from starhold.errors import InputError
from starhold.scenario.reading import load
from tests.campaign.flown import dispersed
from tests.refusals import refused

SCENARIO = load("three-laws-noise")
TABLES = {
    "initial.attitude": {"distribution": "rotations"},
    "initial.rate": {"distribution": "shell", "high": "0.07 rad/s"},
    "spacecraft.inertia": {"distribution": "normal", "sigma": 0.02, "relative": True},
    "spacecraft.limit": {"distribution": "choice", "values": ["axis", "norm"]},
}
OVER = dispersed(SCENARIO, TABLES)
DIMS = 10
RUNS = {"random": 300, "sobol": 300, "latin-hypercube": 300, "morris": (DIMS + 1) * 20, "saltelli": (2 * DIMS + 2) * 16}
PLANS = {name: Plan(OVER, name, 7, runs) for name, runs in RUNS.items()}
WHOLE = {name: plan.unit(0, plan.runs) for name, plan in PLANS.items()}


@pytest.mark.parametrize("name", SAMPLINGS)
def test_uniforms_are_strictly_between_0_and_1(name):
    assert WHOLE[name].shape == (DIMS, RUNS[name])
    assert 0.0 < WHOLE[name].min() < WHOLE[name].max() < 1.0


@pytest.mark.parametrize("name", SAMPLINGS)
@given(st.data())
@settings(max_examples=25)
def test_cutting_changes_no_bit(name, data):
    plan = PLANS[name]
    first = data.draw(st.integers(0, plan.runs))
    count = data.draw(st.integers(0, plan.runs - first))
    assert (plan.unit(first, count) == WHOLE[name][:, first : first + count]).all()
    whole, cut = plan.values(WHOLE[name]), plan.columns(first, count)
    assert list(cut) == list(whole)
    assert all((cut[key] == whole[key][first : first + count]).all() for key in cut)


@pytest.mark.parametrize("name", SAMPLINGS)
def test_the_seed_decides(name):
    assert (Plan(OVER, name, 7, RUNS[name]).unit(0, 50) == WHOLE[name][:, :50]).all()
    assert (Plan(OVER, name, 8, RUNS[name]).unit(0, 50) != WHOLE[name][:, :50]).any()


def test_random_uniforms_are_independent_and_uniform():
    found = Plan(OVER, "random", 3, 20_000).unit(0, 20_000)
    for row in found:
        assert stats.kstest(row, stats.uniform.cdf).pvalue > 1e-3
    assert np.abs(np.corrcoef(found) - np.eye(DIMS)).max() < 0.03
    # From one run to the next as well.
    assert np.abs(np.corrcoef(found[:, :-1], found[:, 1:])[:DIMS, DIMS:]).max() < 0.03


def test_what_a_key_draws_depends_on_no_other_key():
    plan = PLANS["random"]
    whole = plan.columns(0, 40)
    fewer = Plan(OVER[2:], "random", 7, 300).columns(0, 40)
    assert set(fewer) < set(whole)
    assert all((fewer[name] == whole[name]).all() for name in fewer)
    turned = Plan(OVER[::-1], "random", 7, 5000).columns(0, 40)
    assert all((turned[name] == whole[name]).all() for name in whole)


def test_these_numbers_are_drawn_for_ever():
    """Kept from the first version: stored campaigns are resumed with them."""
    kept = [
        [0.32709417174661926, 0.5676467889120341],
        [0.7628088973225219, 0.9850327623419036],
        [0.38994250226274907, 0.9710706590305934],
    ]
    assert PLANS["random"].unit(10, 2)[:3].tolist() == kept


def test_a_latin_hypercube_has_one_run_in_each_stratum():
    strata = np.sort(np.floor(WHOLE["latin-hypercube"] * 300), axis=1)
    assert (strata == np.arange(300)).all()


def test_a_sobol_sequence_is_more_even_than_chance():
    sobol, random = (Plan(OVER, name, 1, 256).unit(0, 256).T for name in ("sobol", "random"))
    assert qmc.discrepancy(sobol) < 0.5 * qmc.discrepancy(random)
    # A net: of 256 points each of 256 equal intervals of every axis has one.
    assert (np.sort(np.floor(sobol * 256), axis=0) == np.arange(256)[:, None]).all()


def test_trajectories_of_morris_change_one_uniform_at_a_time():
    levels = WHOLE["morris"].T.reshape(20, DIMS + 1, DIMS)
    assert np.unique(levels) == pytest.approx((np.arange(LEVELS) + 0.5) / LEVELS)
    steps = np.diff(levels, axis=1)
    assert (np.count_nonzero(steps, axis=2) == 1).all()
    assert (np.count_nonzero(steps, axis=1) == 1).all()
    assert PLANS["morris"].points() == pytest.approx((levels.reshape(-1, DIMS) * LEVELS - 0.5) / (LEVELS - 1))


def test_the_design_of_saltelli_finds_known_indices():
    """Of u1 + 2 u2 u3, whose indices of first order and in all can be computed by hand."""
    from SALib.analyze import sobol

    plan = Plan(OVER, "saltelli", 2, (2 * DIMS + 2) * 1024)
    u = plan.unit(0, plan.runs)
    problem = {"num_vars": DIMS, "names": list(plan.factors), "bounds": [[0.0, 1.0]] * DIMS}
    found = sobol.analyze(problem, u[0] + 2.0 * u[1] * u[2], calc_second_order=True, seed=1)
    variance = 1.0 / 12.0 + 4.0 * (1.0 / 9.0 - 1.0 / 16.0)
    pair = 4.0 / 144.0 / variance
    assert found["S1"][0] == pytest.approx(1.0 / 12.0 / variance, abs=0.02)
    assert found["S2"][1, 2] == pytest.approx(pair, abs=0.03)
    assert found["ST"][3:] == pytest.approx(np.zeros(DIMS - 3), abs=1e-3)


def test_uniforms_have_names():
    names = PLANS["random"].factors
    assert len(names) == DIMS
    assert names[:3] == tuple(f"initial.attitude ({n} of 3)" for n in (1, 2, 3))
    assert names[6:] == (*(f"spacecraft.inertia[{n}]" for n in (1, 2, 3)), "spacecraft.limit")


def test_a_plan_of_nothing_draws_nothing():
    plan = Plan((), "random", 1, 10)
    assert plan.unit(2, 5).shape == (0, 5)
    assert plan.columns(0, 10) == plan.change({}) == {}


BAD = {
    "zero runs": ("random", 0, "campaign.runs: found 0; allowed: at least 1"),
    "unknown sampling": ("sobel", 9, 'campaign.sampling: found "sobel"; did you mean sobol?'),
    "morris": ("morris", 100, "found 100; allowed: 99 or 110"),
    "too few of morris": ("morris", 11, "found 11; allowed: 22 or 33"),
    "saltelli": ("saltelli", 100, "found 100; allowed: 88 or 176"),
    "no power of 2": ("saltelli", 66, "found 66; allowed: 44 or 88"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_plan_that_cannot_be_is_told_in_one_line(name):
    sampling, runs, said = BAD[name]
    with refused(said, start="my.toml: campaign."):
        Plan(OVER, sampling, 1, runs, "my.toml")


def test_a_design_of_nothing_is_refused():
    with pytest.raises(InputError, match="nothing is dispersed"):
        Plan((), "morris", 1, 10)


def test_runs_that_are_not_there_are_no_users_fault():
    with pytest.raises(ValueError, match="runs 299 to 300 of 300"):
        PLANS["random"].unit(299, 2)
