"""Verdicts against SciPy's binomial law, Hanson and Beard's table, and simulated campaigns."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from starhold.campaign import sequence
from starhold.campaign.verdicts import (
    acceptance,
    allowed_failures,
    failure_bounds,
    judge,
    percent,
    quantile_bound,
    runs_needed,
)
from tests.refusals import refused

counts = st.integers(1, 2000).flatmap(lambda runs: st.tuples(st.integers(0, runs), st.just(runs)))
probabilities = st.floats(0.01, 0.999)


def margins(failures, runs):
    """Margins of which so many, at random places, are below zero."""
    values = np.random.default_rng(failures + runs).permutation(np.arange(runs) - failures + 0.5)
    return values / runs


@pytest.mark.parametrize(("failures", "runs"), [(0, 852), (1, 1440), (2, 1970), (5, 3433), (10, 5704)])
def test_hanson_and_beard(failures, runs):
    """NASA/TP-2010-216447: 99.73 % with a consumer's risk of 10 %."""
    assert runs_needed(0.9973, 0.1, failures) == runs
    assert allowed_failures(0.9973, 0.1, runs) == failures
    assert allowed_failures(0.9973, 0.1, runs - 1) == (failures - 1 if failures else None)
    assert acceptance(0.9973, runs, failures) <= 0.1 < acceptance(0.9973, runs - 1, failures)


@given(counts, probabilities)
def test_bounds_are_those_of_scipy(pair, confidence):
    failures, runs = pair
    theirs = stats.binomtest(failures, runs).proportion_ci(confidence, method="exact")
    assert failure_bounds(failures, runs, confidence) == pytest.approx((theirs.low, theirs.high), rel=1e-7, abs=1e-12)
    low = stats.binomtest(failures, runs, alternative="greater").proportion_ci(confidence, method="exact").low
    high = stats.binomtest(failures, runs, alternative="less").proportion_ci(confidence, method="exact").high
    assert failure_bounds(failures, runs, confidence, sides=1) == pytest.approx((low, high), rel=1e-7, abs=1e-12)


@given(counts, probabilities)
def test_risks_are_those_of_scipy(pair, share):
    failures, runs = pair
    assert acceptance(share, runs, failures) == pytest.approx(stats.binom.cdf(failures, runs, 1.0 - share), abs=1e-10)
    assert 1.0 - acceptance(share, runs, failures) == pytest.approx(stats.binom.sf(failures, runs, 1.0 - share), abs=1e-10)


@given(st.integers(0, 60), st.floats(0.3, 0.999), st.floats(0.01, 0.5))
def test_runs_and_allowed_failures_are_inverse(failures, share, risk):
    runs = runs_needed(share, risk, failures)
    assert stats.binom.cdf(failures, runs, 1.0 - share) <= risk * (1.0 + 1e-9)
    assert stats.binom.cdf(failures, runs - 1, 1.0 - share) > risk * (1.0 - 1e-9)
    assert allowed_failures(share, risk, runs) == failures


@pytest.mark.parametrize(("failures", "outcome"), [(19, "met"), (20, "not decided"), (34, "not decided"), (36, "missed")])
def test_outcomes(failures, outcome):
    verdict = judge("pointing", margins(failures, 10_000), 0.9973, 0.9)
    below = stats.binom.cdf(failures, 10_000, 0.0027) <= 0.1
    above = stats.binom.sf(failures - 1, 10_000, 0.0027) < 0.1
    assert verdict.outcome == outcome == ("met" if below else "missed" if above else "not decided")
    assert verdict.failures == failures
    assert verdict.observed == pytest.approx(1.0 - failures / 10_000)
    assert verdict.allowed == 19
    assert verdict.more == {"met": 0, "missed": None}.get(outcome, runs_needed(0.9973, 0.1, failures) - 10_000)
    assert verdict.sentence().startswith(f"pointing: {outcome}. {failures} of 10000 runs miss it")
    assert "independent draws from the stated dispersions" in verdict.sentence()


@given(st.integers(0, 40), st.integers(60, 2000), st.floats(0.5, 0.99), st.floats(0.5, 0.99))
def test_a_requirement_is_met_where_its_quantile_bound_is_kept(failures, runs, share, confidence):
    verdict = judge("torque", margins(failures, runs), share, confidence)
    assert (verdict.outcome == "met") == (verdict.margin_bound is not None and verdict.margin_bound >= 0.0)
    assert verdict.margin_bound == quantile_bound(margins(failures, runs), share, confidence)


def test_quantile_bound_covers():
    """Of exponential values, whose quantile is known, as often as the confidence says, and hardly more often."""
    share, confidence, campaigns = 0.9, 0.8, 2000
    values = np.random.default_rng(3).exponential(size=(campaigns, 150))
    good = np.mean([quantile_bound(row, share, confidence) <= -math.log(share) for row in values])
    exact = 1.0 - stats.binom.cdf(allowed_failures(share, 1.0 - confidence, 150), 150, 1.0 - share)
    assert exact >= confidence
    assert good == pytest.approx(exact, abs=3.5 * math.sqrt(0.2 * 0.8 / campaigns))
    assert quantile_bound(values[0, :20], share, confidence) == values[0, :20].min()
    assert quantile_bound(values[0, :15], share, confidence) is None


def test_a_run_without_a_value_is_missed_and_worst():
    values = np.array([0.5, np.nan, -0.2, 0.0, -np.inf] + [1.0] * 20)
    verdict = judge("settling", values, 0.5, 0.9, run=np.arange(100, 125))
    assert (verdict.failures, verdict.worst_margin, verdict.worst_run) == (3, -np.inf, 101)
    assert quantile_bound([np.nan] * 5 + [1.0] * 95, 0.99, 0.5) == -np.inf
    assert judge("settling", [0.3, 0.1, 0.2], 0.5, 0.9).worst_run == 1


def test_known_conditions_are_not_averaged_over():
    """Runs together keep the share easily; the quarter in which all failures are does not."""
    load = np.arange(40_000) / 40_000
    other = np.random.default_rng(0).permutation(40_000) % 5000
    values = np.where(load > 0.9987, -1.0, 1.0)
    assert judge("pointing", values, 0.9973, 0.9).outcome == "met"
    assert judge("pointing", values, 0.9973, 0.9, {"other": other}).outcome == "met"
    verdict = judge("pointing", values, 0.9973, 0.9, {"other": other, "load": load})
    assert verdict.outcome == "missed"
    assert verdict.lower < 1.0 - 0.9973
    assert verdict.worst_part is not None
    assert verdict.worst_part.name.startswith("load from 0.7")
    assert verdict.worst_part.failures == verdict.failures == (values < 0).sum()
    assert len(verdict.parts) == 8
    assert [part.runs for part in verdict.parts] == [10_000] * 8
    assert "Worst is load from 0.7" in verdict.sentence()


def test_words_and_few_numbers_are_parts_by_value():
    mode = np.array(["axis"] * 9000 + ["norm"] * 1000)
    stage = np.tile([1.0, 2.0], 5000)
    verdict = judge("pointing", np.ones(10_000), 0.9973, 0.9, {"mode": mode, "stage": stage, "constant": np.ones(10_000)})
    assert [(part.name, part.runs) for part in verdict.parts] == [
        ("mode = axis", 9000),
        ("mode = norm", 1000),
        ("stage = 1", 5000),
        ("stage = 2", 5000),
    ]
    assert verdict.outcome == "met"
    # 800 runs of one condition cannot show the share, however many there are of others.
    few = judge("pointing", np.ones(8000), 0.9973, 0.9, {"mode": mode[1800:9800]})
    assert (few.outcome, few.worst_part.name, few.worst_part.runs) == ("not decided", "mode = norm", 800)
    assert few.more == math.ceil(52 * 8000 / 800)


def test_runs_without_a_known_value_are_a_part():
    known = np.concatenate([np.full(100, np.nan), np.arange(900.0)])
    verdict = judge("pointing", np.ones(1000), 0.9, 0.9, {"time": known})
    assert sum(part.runs for part in verdict.parts) == 1000
    assert verdict.parts[0].name == "time without a value"


def test_wrong_verdicts_are_as_rare_as_said():
    """At the boundary in all parts, and in one part only."""
    rng = np.random.default_rng(11)
    words = []
    for _ in range(400):
        known = {"a": rng.uniform(size=1000), "b": rng.choice(["u", "v"], 1000)}
        words.append(judge("x", rng.uniform(size=1000) - 0.1, 0.9, 0.9, known).outcome)
    assert words.count("met") <= 0.1 * 400 + 3 * 6
    assert words.count("missed") <= 0.2 * 400 + 3 * 8
    wrong = 0
    for _ in range(400):
        load = rng.uniform(size=1000)
        values = rng.uniform(size=1000) - np.where(load > 0.75, 0.1, 0.0)
        wrong += judge("x", values, 0.9, 0.9, {"load": load}).outcome == "met"
    assert 10 <= wrong <= 0.1 * 400 + 3 * 6


def test_draws_that_depend_give_no_confidence():
    verdict = judge("pointing", margins(3, 10_000), 0.9973, 0.9, {"a": np.arange(10_000.0)}, independent=False)
    assert verdict.outcome == "not decided"
    bounds = (verdict.lower, verdict.upper, verdict.allowed, verdict.more, verdict.margin_bound)
    assert bounds == (None,) * 5
    assert verdict.observed == pytest.approx(0.9997)
    assert "99.97 % meet it" in verdict.sentence()
    assert "no confidence" in verdict.sentence()
    assert all(part.lower is None and part.outcome == "not decided" for part in verdict.parts)


def test_a_campaign_that_stops_when_it_knows_is_judged_by_the_sequence():
    for failures, runs, outcome in (
        (0, 1104, "met"),
        (0, 1103, "not decided"),
        (1, 1440, "not decided"),
        (60, 8000, "missed"),
    ):
        verdict = judge("pointing", margins(failures, runs), 0.9973, 0.9, until_decided=True)
        assert verdict.outcome == outcome
        assert (verdict.lower, verdict.upper) == sequence.bounds(failures, runs, 0.9)
        assert verdict.margin_bound is None
        assert "whenever the campaign was stopped" in verdict.sentence()
    assert judge("pointing", np.ones(1000), 0.9973, 0.9, until_decided=True).more == 104


def test_bad_input_is_one_line():
    for call in (
        lambda: failure_bounds(3, 2, 0.9),
        lambda: runs_needed(1.0, 0.1, 0),
        lambda: runs_needed(0.9, 0.0, 0),
        lambda: allowed_failures(0.9, 2.0, 5),
        lambda: judge("pointing", [], 0.9, 0.9),
        lambda: judge("pointing", [1.0], 99.73, 0.9),
    ):
        with refused():
            call()


@pytest.mark.parametrize(
    ("share", "shown"),
    [(0.0, "0 %"), (1.0, "100 %"), (0.123456, "12.346 %"), (1.23456e-6, "0.00012 %"), (1.0 - 1e-6, "99.9999 %")],
)
def test_a_share_has_the_digits_that_tell_it_from_none_and_all(share, shown):
    assert percent(share) == shown
