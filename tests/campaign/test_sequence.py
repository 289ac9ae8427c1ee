"""The sequence of bounds against its definition, the martingale property, and what stopping early does to others."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import integrate, special, stats

from starhold.campaign.sequence import (
    bounds,
    decided,
    failures_to_meet,
    log_evidence_above,
    log_evidence_below,
    runs_to_meet,
)
from starhold.campaign.verdicts import failure_bounds
from tests.refusals import refused

counts = st.integers(0, 3000).flatmap(lambda runs: st.tuples(st.integers(0, runs), st.just(runs)))
rates = st.floats(1e-4, 1.0 - 1e-4)
confidences = st.floats(0.5, 0.999)


@pytest.mark.parametrize(("failures", "runs", "rate"), [(0, 100, 0.03), (2, 40, 0.3), (9, 40, 0.2), (40, 40, 0.7)])
def test_evidence_is_the_mean_likelihood_ratio(failures, runs, rate):
    """By quadrature over the angle, in which the arcsine law is uniform."""
    middle = math.asin(math.sqrt(rate))

    def ratio(angle):
        q = math.sin(angle) ** 2
        return (q / rate) ** failures * ((1.0 - q) / (1.0 - rate)) ** (runs - failures)

    below, _ = integrate.quad(ratio, 0.0, middle, epsrel=1e-10)
    above, _ = integrate.quad(ratio, middle, 0.5 * math.pi, epsrel=1e-10)
    assert float(log_evidence_below(failures, runs, rate)) == pytest.approx(math.log(below / middle), rel=1e-8)
    assert float(log_evidence_above(failures, runs, rate)) == pytest.approx(
        math.log(above / (0.5 * math.pi - middle)), rel=1e-8
    )


@given(counts, rates)
def test_evidence_is_a_martingale(pair, rate):
    """What is expected after the next run is what there is now; without runs it is one."""
    failures, runs = pair
    for evidence, weight in ((log_evidence_below, special.betainc), (log_evidence_above, special.betaincc)):
        now = float(evidence(failures, runs, rate))
        # Next to the least float a weight has few digits.
        if min(weight(failures + k + 0.5, runs - failures + 1.5 - k, rate) for k in (0, 1)) > 1e-290:
            next_run = rate * math.exp(evidence(failures + 1, runs + 1, rate) - now)
            next_run += (1.0 - rate) * math.exp(evidence(failures, runs + 1, rate) - now)
            assert next_run == pytest.approx(1.0, abs=1e-9)
        assert float(evidence(0, 0, rate)) == pytest.approx(0.0, abs=1e-12)


@given(counts, confidences)
def test_bounds_hold_the_observed_share_and_are_wider_than_those_of_a_fixed_number(pair, confidence):
    failures, runs = pair
    lower, upper = bounds(failures, runs, confidence)
    fixed = failure_bounds(failures, runs, confidence, sides=1)
    assert 0.0 <= lower <= fixed.lower <= (failures / runs if runs else 0.5) <= fixed.upper <= upper <= 1.0


@given(counts, confidences)
def test_bounds_rise_with_failures_and_fall_with_passed_runs(pair, confidence):
    failures, runs = pair
    now, passed, failed = (bounds(failures + k, runs + n, confidence) for k, n in ((0, 0), (0, 1), (1, 1)))
    assert passed.upper <= now.upper <= failed.upper
    assert passed.lower <= now.lower <= failed.lower


@given(counts, confidences, rates)
def test_a_decision_is_a_bound_on_the_other_side(pair, confidence, rate):
    lower, upper = bounds(*pair, confidence)
    word = decided(*pair, 1.0 - rate, confidence)
    if abs(upper - rate) > 1e-9 and abs(lower - rate) > 1e-9:
        assert word == ("met" if upper < rate else "missed" if lower > rate else None)


def test_known_numbers_of_runs():
    needed = [runs_to_meet(0.9973, 0.9, failures) for failures in (0, 1, 2, 5, 10)]
    assert needed == [1104, 2128, 2916, 4907, 7793]
    for failures, runs in zip((0, 1, 2, 5, 10), needed, strict=True):
        assert decided(failures, runs, 0.9973, 0.9) == "met"
        assert decided(failures, runs - 1, 0.9973, 0.9) is None
        assert failures_to_meet(0.9973, 0.9, runs) == failures
    assert failures_to_meet(0.9973, 0.9, 1103) is None


def first_words(failed, table):
    """Whether a table (failures, runs) of what is said is true anywhere along each sequence (sequences, runs) of
    failures."""
    runs = np.arange(1, failed.shape[1] + 1)
    return table[failed.cumsum(1), runs].any(1)


def test_stopping_at_will_keeps_the_risk_and_peeking_breaks_it():
    """At the boundary, with a look after each run: the sequence is wrong once in ten, bounds for a fixed number far more
    often."""
    rate, risk, length, campaigns = 0.1, 0.1, 1500, 3000
    failed = np.random.default_rng(5).uniform(size=(campaigns, length)) < rate
    k, n = np.meshgrid(np.arange(failed.sum(1).max() + 1), np.arange(length + 1), indexing="ij")
    k = np.minimum(k, n)
    enough = math.log(1.0 / risk)
    met = first_words(failed, log_evidence_below(k, n, rate) >= enough).mean()
    missed = first_words(failed, log_evidence_above(k, n, rate) >= enough).mean()
    allowance = 3.0 * math.sqrt(risk * (1.0 - risk) / campaigns)
    assert 0.02 < met <= risk + allowance
    assert 0.02 < missed <= risk + allowance
    # A look at 50 runs and after each one from there on.
    peeked = first_words(failed, (stats.binom.cdf(k, n, rate) <= risk) & (n >= 50)).mean()
    assert peeked > 0.3


def test_bad_input_is_one_line():
    for call in (
        lambda: bounds(3, 2, 0.9),
        lambda: bounds(-1, 2, 0.9),
        lambda: bounds(1, 2, 1.0),
        lambda: decided(0, 10, 1.0, 0.9),
        lambda: decided(0, 10, 0.9, math.nan),
    ):
        with refused():
            call()
