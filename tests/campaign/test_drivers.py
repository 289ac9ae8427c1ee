"""Drivers against SciPy's statistics, planted causes, and chance."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import optimize, special, stats

from starhold.campaign.drivers import Column, _misfit, find_drivers, independent_causes
from tests.tiers import leading

N = 2000


def draws(rng, runs=N, count=6):
    inputs = {f"x{number}": rng.uniform(size=runs) for number in range(count)}
    return inputs | {"mode": rng.choice(["axis", "norm", "off"], runs, p=[0.5, 0.3, 0.2])}


def told(drivers):
    return [driver.input for driver in drivers.inputs if driver.significant]


def told_pairs(drivers):
    return [set(pair.inputs) for pair in drivers.pairs if pair.significant]


@pytest.fixture
def rng():
    return np.random.default_rng(8)


@pytest.mark.parametrize("round_to", [None, 1])
def test_statistics_of_failure_are_those_of_scipy(rng, round_to):
    """With and without equal values."""
    x = rng.normal(size=300) if round_to is None else rng.normal(size=300).round(round_to)
    failed = rng.uniform(size=300) < special.expit(x - 1.0)
    driver = find_drivers({"x": x}, failed, {}).inputs[0]
    assert driver.distance == pytest.approx(stats.ks_2samp(x[failed], x[~failed]).statistic)
    theirs = stats.mannwhitneyu(x[failed], x[~failed], use_continuity=False, method="asymptotic")
    assert driver.above == pytest.approx(theirs.statistic / (failed.sum() * (~failed).sum()))
    distance_chance = special.kolmogorov(driver.distance * math.sqrt(failed.sum() * (~failed).sum() / 300))
    assert driver.p == pytest.approx(min(1.0, 2.0 * min(theirs.pvalue, distance_chance)), abs=0.0)
    assert distance_chance == pytest.approx(stats.ks_2samp(x[failed], x[~failed], method="asymp").pvalue, rel=0.5)


def test_correlations_are_those_of_scipy(rng):
    x, y = rng.normal(size=(2, 400)).round(1)
    words = rng.choice(["a", "b", "c"], 400)
    metric = x + rng.normal(size=400) + (words == "b")
    metric[rng.choice(400, 90, replace=False)] = np.nan
    there = ~np.isnan(metric)
    drivers = find_drivers({"x": x, "y": y, "words": words}, np.zeros(400, bool), {"m": metric, "all": y**2})
    found = {(driver.input, driver.metric): driver for driver in drivers.metrics}
    for (name, metric_name), column, values in ((("x", "m"), x, metric), (("y", "m"), y, metric), (("x", "all"), x, y**2)):
        rows = ~np.isnan(values)
        theirs = stats.spearmanr(column[rows], values[rows])
        driver = found[name, metric_name]
        assert (driver.correlation, driver.p) == pytest.approx((theirs.statistic, theirs.pvalue))
        assert driver.runs == rows.sum()
    kruskal = stats.kruskal(*(metric[there & (words == word)] for word in "abc"))
    driver = found["words", "m"]
    assert driver.correlation**2 * (there.sum() - 1) == pytest.approx(kruskal.statistic)
    assert driver.p == pytest.approx(kruskal.pvalue)
    # Words that are all the same where there is a metric tell nothing of it.
    assert find_drivers({"words": words}, np.zeros(400, bool), {"m": np.where(words == "a", metric, np.nan)}).metrics == ()


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000))
def test_independent_causes_are_fitted_to_the_most_likely(seed):
    rng = np.random.default_rng(seed)
    runs = rng.integers(0, 200, (3, 4))
    truth = 1.0 - np.outer(1.0 - rng.uniform(0.0, 0.6, 3), 1.0 - rng.uniform(0.0, 0.3, 4))
    failures = rng.binomial(runs, truth if seed % 2 else 0.2)

    def loss(chances):
        fail = np.clip(1.0 - np.outer(1.0 - chances[:3], 1.0 - chances[3:]), 1e-12, 1.0 - 1e-12)
        return -(special.xlogy(failures, fail) + special.xlog1py(runs - failures, -fail)).sum()

    fitted = independent_causes(failures[None].astype(float), runs[None].astype(float))[0]
    found = -(special.xlogy(failures, fitted) + special.xlog1py(runs - failures, -fitted)).sum()
    best = min(optimize.minimize(loss, np.full(7, start), bounds=[(0.0, 1.0)] * 7).fun for start in (0.1, 0.3))
    assert found - best < 0.02


def test_a_misfit_is_the_lesser_of_two_statistics_of_scipy(rng):
    expected = rng.uniform(0.5, 20.0, (50, 6))
    counts = rng.poisson(expected).astype(float)
    expected *= counts.sum(1, keepdims=True) / expected.sum(1, keepdims=True)
    kinds = [stats.power_divergence(counts, expected, axis=1, lambda_=name)[0] for name in ("log-likelihood", "pearson")]
    assert _misfit(counts, expected, (1,)) == pytest.approx(np.minimum(*kinds))
    assert 5 < (kinds[0] < kinds[1]).sum() < 45


PLANTED = {
    "one end of an input": (lambda x, u: x["x2"] > 0.93, {"x2"}, []),
    "both ends of an input": (lambda x, u: np.abs(x["x2"] - 0.5) > 0.45, {"x2"}, []),
    "either of two inputs": (lambda x, u: (x["x1"] > 0.9) | (x["x2"] > 0.9), {"x1", "x2"}, []),
    "two together": (lambda x, u: (x["x1"] > 2 / 3) & (x["x2"] > 2 / 3), {"x1", "x2"}, [{"x1", "x2"}]),
    "two together, rarely": (lambda x, u: (x["x1"] > 2 / 3) & (x["x2"] > 2 / 3) & (u < 0.1), {"x1", "x2"}, [{"x1", "x2"}]),
    "just one of two": (lambda x, u: (x["x1"] > 0.5) ^ (x["x4"] > 0.5), set(), [{"x1", "x4"}]),
    "just one of two, or chance": (lambda x, u: (x["x1"] > 0.5) ^ (x["x4"] > 0.5) ^ (u < 0.3), set(), [{"x1", "x4"}]),
    "a word and a number": (lambda x, u: (x["mode"] == "norm") & (x["x0"] < 0.3), {"mode", "x0"}, [{"mode", "x0"}]),
    "an uneven choice and a flag": (lambda x, u: (x["wheel"] > 1.0) & x["flag"], {"wheel", "flag"}, [{"wheel", "flag"}]),
}
"""What makes a run fail, of its inputs and a number between 0 and 1; the inputs and pairs of them that are to be told."""


@pytest.mark.parametrize("cause", PLANTED)
def test_planted_causes_and_no_others_are_found(rng, cause):
    fails, inputs, pairs = PLANTED[cause]
    drawn = draws(rng) | {"wheel": rng.choice([1.0, 2.0, 3.0], N, p=[0.9, 0.07, 0.03]), "flag": rng.uniform(size=N) < 0.5}
    drivers = find_drivers(drawn, fails(drawn, rng.uniform(size=N)), {})
    assert set(told(drivers)) == inputs
    assert told_pairs(drivers) == pairs


def test_a_driver_is_told_with_where_its_failures_are(rng):
    inputs = draws(rng)
    driver = find_drivers(inputs, inputs["x2"] > 0.93, {}).inputs[0]
    assert (driver.above, driver.distance) == (1.0, 1.0)
    assert driver.range[0] > 0.93


def test_a_pair_is_told_with_where_its_failures_are(rng):
    inputs = draws(rng)
    failed = (inputs["x1"] > 2 / 3) & (inputs["x2"] > 2 / 3)
    pair = find_drivers(inputs, failed, {}).pairs[0]
    assert pair.where.startswith("x1 is at least 0.")
    assert "x2 is at least 0." in pair.where
    assert not pair.drawn_together
    assert pair.failed > 0.5 * failed.mean() / 0.25
    drivers = find_drivers(inputs, (inputs["mode"] == "norm") & (inputs["x0"] < 0.3), {})
    assert "mode is norm" in drivers.pairs[0].where
    assert "x0 is at most 0." in drivers.pairs[0].where
    assert next(driver for driver in drivers.inputs if driver.input == "mode").range == "mode is norm"


def test_lost_runs_have_no_say_about_a_metric_they_lack(rng):
    inputs = draws(rng)
    lost = inputs["x0"] > 0.9
    metrics = {
        "settling": np.where(lost, np.nan, 100.0 - 20.0 * inputs["x1"] + rng.normal(size=N)),
        "none": np.full(N, np.nan),
    }
    drivers = find_drivers(inputs, lost, metrics | {"constant": np.ones(N)})
    assert [(driver.input, driver.metric) for driver in drivers.metrics if driver.significant] == [("x1", "settling")]
    assert drivers.metrics[0].runs == (~lost).sum()
    assert drivers.metrics[0].correlation < -0.9
    assert {driver.metric for driver in drivers.metrics} == {"settling"}
    assert told(drivers) == ["x0"]


def test_inputs_drawn_together_are_marked(rng):
    inputs = draws(rng)
    inputs["y"] = inputs["x1"] + 0.2 * rng.normal(size=N)
    drivers = find_drivers(inputs, inputs["x1"] > 0.9, {})
    marked = {frozenset(pair.inputs) for pair in drivers.pairs if pair.drawn_together}
    assert marked == {frozenset({"x1", "y"})}


def test_rare_words_are_numbered_together_once_they_are_common_enough():
    for rare, labels in ((1, ["x is a", "x is another"]), (6, ["x is a", "x is b", "x is another"])):
        words = np.repeat([*"abcdefgh"][: 2 + rare], [60, 40, *[2] * rare])
        assert Column("x", words).words_grid(0.1)[1] == labels


def test_constant_inputs_are_skipped(rng):
    inputs = draws(rng) | {
        "same": np.ones(N),
        "word": np.full(N, "axis"),
        "hole": np.where(rng.uniform(size=N) < 0.1, np.nan, 1.0),
    }
    drivers = find_drivers(inputs, inputs["x0"] > 0.9, {})
    assert drivers.skipped == ("same", "word", "hole")
    assert told(drivers) == ["x0"]


@pytest.mark.parametrize(
    ("failures", "remark"), [(0, "too few failures"), (4, "too few failures"), (N - 2, "too few passed runs")]
)
def test_too_few_runs_to_say(rng, failures, remark):
    failed = np.arange(N) < failures
    drivers = find_drivers(draws(rng), failed, {})
    assert (drivers.inputs, drivers.pairs) == ((), ())
    assert remark in drivers.remark


def test_too_few_failures_for_pairs(rng):
    inputs = draws(rng)
    failed = inputs["x0"] > np.sort(inputs["x0"])[-13]
    drivers = find_drivers(inputs, failed, {})
    assert told(drivers) == ["x0"]
    assert drivers.pairs == ()
    assert drivers.remark == "too few failures to test pairs of inputs: 12; at least 20 are needed"


# Too few for pairs, and enough; between and beyond is slow.
@pytest.mark.parametrize("failures", leading([6, 50, 24, 300]))
def test_chance_is_called_a_driver_as_rarely_as_said(failures):
    """Of all that was tested, anything is called significant in one campaign of twenty at most."""
    campaigns, wrong = 150, 0
    for seed in range(campaigns):
        rng = np.random.default_rng(1000 * failures + seed)
        inputs = draws(rng, runs=800, count=5) | {"number": rng.choice([1.0, 2.0, 5.0], 800, p=[0.7, 0.2, 0.1])}
        failed = np.zeros(800, bool)
        failed[rng.choice(800, failures, replace=False)] = True
        metrics = {"a": np.where(failed, np.nan, rng.normal(size=800)), "b": rng.normal(size=800)}
        drivers = find_drivers(inputs, failed, metrics)
        wrong += any(driver.significant for driver in (*drivers.inputs, *drivers.pairs, *drivers.metrics))
    assert wrong <= stats.binom.ppf(0.999, campaigns, 0.05)


def test_chance_alone_makes_a_p_value_small_as_rarely_as_it_says(rng):
    """A number is tested twice, and the better test is shown."""
    # Too few for pairs.
    failed = np.arange(400) < 19
    found = find_drivers({f"x{number}": rng.uniform(size=400) for number in range(800)}, failed, {}).inputs
    for level in (0.01, 0.05, 0.1):
        assert sum(driver.p <= level for driver in found) <= 800 * level


def test_corrected_chances_are_those_of_holm(rng):
    inputs = draws(rng, count=3)
    drivers = find_drivers(inputs, inputs["x0"] + 0.3 * rng.normal(size=N) > 0.9, {"m": inputs["x1"] + rng.normal(size=N)})
    # Three numbers and the words; six pairs; four correlations.
    looked = 4 + 6 + 4
    every = [*drivers.inputs, *drivers.pairs, *drivers.metrics]
    least = min(every, key=lambda driver: driver.p)
    assert least.corrected == pytest.approx(min(1.0, looked * least.p))
    assert all(driver.p <= driver.corrected <= 1.0 for driver in every)
    ordered = sorted(every, key=lambda driver: driver.p)
    assert [driver.corrected for driver in ordered] == sorted(driver.corrected for driver in ordered)
