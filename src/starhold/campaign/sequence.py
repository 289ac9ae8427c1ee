"""Bounds on a failure probability that hold simultaneously at every number of runs, so that a campaign may stop as soon as
it is decided.

Let k of n independent runs fail, each with probability p. For a rate q below p the likelihood ratio

    (q / p)^k ((1 - q) / (1 - p))^(n - k)

is a nonnegative martingale in n with mean one, and a supermartingale where the true probability is above p. So is its mean
over any weight of q on (0, p), fixed before the first run. The weight is the arcsine law, Beta(1/2, 1/2), cut at p, for
which the mean has a closed form in the incomplete beta function. By Ville's inequality it reaches 1/risk at *any* number of
runs with a probability of at most `risk`: once it does, "the failure probability is below p" is right with confidence
1 - risk, for any number of interim analyses and any stopping rule. The mirrored mean over (p, 1) is evidence for "above p".
Each is thus a one-sided test of power one (H. Robbins, "Statistical methods related to the law of the iterated
logarithm", Ann. Math. Statist. 41, 1970; J. Ville, "Étude critique de la notion de collectif", 1939).

The mean increases with p from p = k/n on: with p = sin²θ its derivative vanishes only where the second derivative is
positive, because (n p - k) 2θ / sin 2θ increases. So the rates not ruled out form an interval that contains k/n. The mean
also decreases with k, so the bound is never inside the Clopper-Pearson bound of the same risk: the price of interim
analyses.

A share of 99.73 % with 90 % confidence is decided by 1104 runs without a failure, compared with 852 if the number of runs is
fixed beforehand; with 1, 2, 5 and 10 failures by 2128, 2916, 4907 and 7793 runs, compared with 1440, 1970, 3433 and 5704."""

import math
from collections.abc import Callable
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special

from starhold.errors import InputError

Outcome: TypeAlias = Literal["met", "missed", "not decided"]


class Bounds(NamedTuple):
    """The lower and the upper bound of a probability."""

    lower: float
    upper: float


def require_share(name: str, value: float) -> None:
    """Refuse a share, risk or confidence that is not strictly between 0 and 1: no finite campaign can show 0 or 1."""
    if not 0.0 < value < 1.0:
        raise InputError("verdict", name, f"{value:g}", "above 0 and below 1")


def require_counts(failures: int, runs: int) -> None:
    """Refuse a number of failures that is negative or larger than the number of runs."""
    if not 0 <= failures <= runs:
        raise InputError("verdict", "failures", f"{failures} of {runs} runs", "from 0 to the number of runs")


def log_evidence_below(failures: ArrayLike, runs: ArrayLike, rate: float) -> NDArray[np.float64]:
    """Return the logarithm of the evidence (see the module) for a failure probability below `rate`; counts may be arrays."""
    return _log_evidence(failures, runs, rate, special.betainc, math.asin)


def log_evidence_above(failures: ArrayLike, runs: ArrayLike, rate: float) -> NDArray[np.float64]:
    """Return the logarithm of the evidence for a failure probability above `rate`, with passed runs counted as failures."""
    return _log_evidence(failures, runs, rate, special.betaincc, math.acos)


def _log_evidence(failures: ArrayLike, runs: ArrayLike, rate: float, tail: Any, angle: Any) -> NDArray[np.float64]:
    k, n = np.asarray(failures, float), np.asarray(runs, float)
    a, b = k + 0.5, n - k + 0.5
    with np.errstate(divide="ignore"):
        # If the weight of all rates on this side underflows, there is no evidence.
        weighed = special.betaln(a, b) + np.log(tail(a, b, rate))
    return weighed - math.log(2.0 * angle(math.sqrt(rate))) - special.xlogy(k, rate) - special.xlog1py(n - k, -rate)


def bounds(failures: int, runs: int, confidence: float) -> Bounds:
    """Return bounds on the failure probability that hold simultaneously at all numbers of runs, each with the confidence.

    Both together hold with confidence 2 `confidence` - 1. They enclose failures/runs; without runs they are 0 and 1."""
    require_share("confidence", confidence)
    require_counts(failures, runs)
    enough = -math.log1p(-confidence)
    share = failures / runs if runs else 0.0
    lower, upper = 0.0, 1.0
    if failures < runs:
        upper = _edge(lambda rate: float(log_evidence_below(failures, runs, rate)) >= enough, share, 1.0)
    if failures > 0:
        lower = _edge(lambda rate: float(log_evidence_above(failures, runs, rate)) >= enough, share, 0.0)
    return Bounds(lower, upper)


def decided(failures: int, runs: int, share: float, confidence: float) -> Literal["met", "missed"] | None:
    """Return "met" if `failures` among `runs` decide that at least `share` of all flights meet a requirement, "missed" if
    they decide that fewer do, else None. Even if this is called after every run until the first answer, each answer is wrong
    with a probability of at most 1 - `confidence`."""
    require_share("share", share)
    require_share("confidence", confidence)
    require_counts(failures, runs)
    enough = -math.log1p(-confidence)
    if log_evidence_below(failures, runs, 1.0 - share) >= enough:
        return "met"
    if log_evidence_above(failures, runs, 1.0 - share) >= enough:
        return "missed"
    return None


def runs_to_meet(share: float, confidence: float, failures: int) -> int:
    """Return the least number of runs at which `decided` returns "met" with at most `failures` failures."""
    return least(lambda runs: decided(failures, runs, share, confidence) == "met", failures)


def failures_to_meet(share: float, confidence: float, runs: int) -> int | None:
    """Return the greatest number of failures among `runs` at which `decided` returns "met"; None where there is none."""
    return greatest(lambda failures: decided(failures, runs, share, confidence) == "met", runs)


def least(holds: Callable[[int], bool], start: int) -> int:
    """Return the least whole number >= `start` for which a monotone condition `holds`, as it does for all larger numbers."""
    low, step = start - 1, 1
    while not holds(low + step):
        low, step = low + step, 2 * step
    high = low + step
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if holds(middle) else (middle, high)
    return high


def greatest(holds: Callable[[int], bool], end: int) -> int | None:
    """Return the greatest whole number from 0 to `end` for which a monotone condition `holds`, as it does for all smaller
    ones; None where it does not hold for 0."""
    last = least(lambda number: number > end or not holds(number), 0) - 1
    return None if last < 0 else last


def _edge(ruled_out: Callable[[float], bool], inside: float, outside: float) -> float:
    """Return, by bisection to the last digits, the rate nearest to `inside` that is ruled out, on the safe side."""
    while abs(outside - inside) > 1e-14 * max(outside, inside):
        middle = 0.5 * (inside + outside)
        inside, outside = (inside, middle) if ruled_out(middle) else (middle, outside)
    return outside
