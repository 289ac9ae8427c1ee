"""Decides whether a campaign shows that the required share of flights meets a requirement.

A number of runs fixed beforehand is judged by the binomial distribution: exact bounds on the failure probability (C. J.
Clopper, E. S. Pearson, Biometrika 26, 1934) and, equivalently, the greatest number of failures with which the requirement is
accepted at a consumer's risk of at most 1 - confidence (J. M. Hanson, B. B. Beard, "Applying Monte Carlo Simulation to
Launch Vehicle Design and Requirements Verification", NASA/TP-2010-216447). A campaign that stops early is judged by
`sequence` instead. A run meets a requirement if its margin is 0 or more. A margin of NaN or minus infinity, as of a lost
run, is a miss and worse than any other.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special

from starhold.campaign import sequence
from starhold.campaign.sequence import Bounds, Outcome, require_counts, require_share
from starhold.errors import InputError

SEVERITY: tuple[Outcome, ...] = ("met", "not decided", "missed")
PARTS = 4
"""Known inputs with more values than this are divided into this many parts with about equal numbers of runs."""


def failure_bounds(failures: int, runs: int, confidence: float, sides: int = 2) -> Bounds:
    """Return the exact Clopper-Pearson bounds on a failure probability from a fixed number of independent runs.

    With two `sides` both bounds hold together with the confidence; with one, each bound holds with it separately."""
    require_share("confidence", confidence)
    require_counts(failures, runs)
    tail = (1.0 - confidence) / sides
    lower = float(special.betaincinv(failures, runs - failures + 1, tail)) if failures else 0.0
    upper = float(special.betainccinv(failures + 1, runs - failures, tail)) if failures < runs else 1.0
    return Bounds(lower, upper)


def acceptance(share: float, runs: int, failures: int) -> float:
    """Return the probability that at most `failures` of the runs fail if flights meet the requirement with probability
    `share`."""
    require_share("share", share)
    require_counts(failures, runs)
    return 1.0 if failures == runs else float(special.betainc(runs - failures, failures + 1, share))


def runs_needed(share: float, risk: float, failures: int) -> int:
    """Return the least number of runs with which at most `failures` are accepted at a consumer's risk of at most `risk`.

    A share of 99.73 % and a risk of 10 % need 852, 1440, 1970, 3433 and 5704 runs for 0, 1, 2, 5 and 10 failures (Hanson
    and Beard)."""
    require_share("share", share)
    require_share("risk", risk)
    return sequence.least(lambda runs: acceptance(share, runs, failures) <= risk, failures)


def allowed_failures(share: float, risk: float, runs: int) -> int | None:
    """Return the greatest number of failures accepted at a consumer's risk of at most `risk`; None where there are too few
    runs to accept any."""
    require_share("share", share)
    require_share("risk", risk)
    return sequence.greatest(lambda failures: acceptance(share, runs, failures) <= risk, runs)


def quantile_bound(values: ArrayLike, share: float, confidence: float) -> float | None:
    """Return a value that at least `share` of all flights reach or exceed, with the confidence; None for too few runs.

    It is an order statistic of the values (n,), valid for any distribution: the least value after leaving out the
    `allowed_failures` worst. Less is worse; NaN counts as minus infinity. Pass the negative of a metric if more is worse. A
    fixed number of runs meets a requirement exactly if this bound on its margin is 0 or more."""
    values = _worst_first(values)
    allowed = allowed_failures(share, 1.0 - confidence, len(values))
    return None if allowed is None else float(np.partition(values, allowed)[allowed])


@dataclass(frozen=True)
class Part:
    """The verdict on a part of the runs, those under one condition known before flight. `lower` and `upper` bound the
    failure probability, each with the confidence: Clopper-Pearson's bounds, or those of `sequence` for a sequential
    campaign; None where the draws are not independent. `more` further runs without a failure would make the outcome "met"
    (None: impossible or unknown)."""

    name: str
    runs: int
    failures: int
    lower: float | None
    upper: float | None
    outcome: Outcome
    more: int | None

    @property
    def observed(self) -> float:
        """The share of the runs that met the requirement."""
        return 1.0 - self.failures / self.runs


@dataclass(frozen=True)
class Verdict(Part):
    """A campaign's verdict whether at least `share` of all flights meet a requirement, with `confidence`.

    `allowed` failures are accepted with this number of runs (None: too few runs to accept any). With parts, `more` is
    approximate, because one cannot choose the runs that fall in a part. The run `worst_run` has the margin `worst_margin`;
    `margin_bound` is a margin that at least `share` of all flights have, with the confidence, by order statistics (None: too
    few runs, or their number was not fixed). `parts` are the conditions known before flight, `worst_part` the one with the
    strongest evidence against the requirement."""

    share: float
    confidence: float
    allowed: int | None
    worst_margin: float
    worst_run: int
    margin_bound: float | None
    parts: tuple[Part, ...]
    worst_part: Part | None
    independent: bool
    until_decided: bool
    knowledge: str = ""
    """A sentence on which drawn values laws know."""

    def sentence(self) -> str:
        """Return the verdict and its basis in words."""
        flown = f"{self.failures} of {self.runs} runs miss it ({percent(self.observed)} meet it, {percent(self.share)} must)"
        if self.lower is None or self.upper is None:
            text = f"{self.name}: {flown}. The draws are not independent of each other, so no confidence can be given"
            return f"{text}; random sampling gives one. {self.knowledge}".rstrip()
        least, most = f"at least {percent(self.lower)}", f"at most {percent(self.upper)}"
        both = self.lower <= 1.0 - self.share < self.upper
        bound = f"{least} and {most}" if both else least if self.lower > 1.0 - self.share else most
        text = f"{self.name}: {self.outcome}. {flown}; {bound} of all flights do, with {percent(self.confidence)} confidence"
        text += " each" if both else ""
        if self.worst_part is not None:
            part = self.worst_part
            text += (
                f". Worst is {part.name}, known before flight: {part.outcome}, {part.failures} of {part.runs} runs miss it"
            )
        if self.outcome == "not decided" and self.more:
            about = "about " if self.parts else ""
            text += f". It would be met after {about}{self.more} more runs without a failure"
        stopped = ", whenever the campaign was stopped" if self.until_decided else ""
        return f"{text}. This holds for independent draws from the stated dispersions{stopped}. {self.knowledge}".rstrip()


def judge(
    name: str,
    margins: ArrayLike,
    share: float,
    confidence: float,
    known: Mapping[str, NDArray] | None = None,
    *,
    independent: bool = True,
    until_decided: bool = False,
    run: NDArray[np.int64] | None = None,
    knowledge: str = "",
) -> Verdict:
    """Return the verdict on a requirement by its margins (n,), n > 0, in the runs numbered `run` (n,), by default 0 to n -
    1.

    Conditions known before flight must not be averaged over: a launch on a bad day has a bad day's failure probability. So
    each column (n,) of `known` is divided into quarters, or into its values if they are words or at most four numbers, and
    each part is judged separately with the same share and confidence. The outcome is "met" only if it is so for all runs
    together and for each part. No correction for the number of parts is needed: a wrong "met" requires that the test of a
    condition that misses its share errs (the risk of an intersection-union test is that of its tests; R. L. Berger,
    Technometrics 24, 1982). For "missed" one is needed: the parts share one risk 1 - `confidence` evenly (Bonferroni),
    beside that of the runs together. Conditions are judged one at a time, not in combination.

    independent: whether runs are drawn independently; for Sobol points or a Latin hypercube the binomial distribution does
    not apply, and only the observed share is returned. until_decided: whether the number of runs was not fixed beforehand;
    then the verdict uses `sequence` and may be taken any number of times."""
    require_share("share", share)
    require_share("confidence", confidence)
    margins = _worst_first(margins)
    if not len(margins):
        raise InputError("verdict", name, "no runs", "one or more")
    missed = margins < 0.0
    pieces = list(_parts(known or {}))

    def judged(name: str, rows: Any, missed_confidence: float) -> Part:
        return _judge(name, missed[rows], share, confidence, independent, until_decided, missed_confidence)

    parts = tuple(judged(*piece, 1.0 - (1.0 - confidence) / len(pieces)) for piece in pieces)
    whole = judged(name, slice(None), confidence)
    outcome = SEVERITY[max(SEVERITY.index(part.outcome) for part in (whole, *parts))]
    more = [math.ceil(part.more * len(margins) / part.runs) for part in (whole, *parts) if part.more is not None]
    if until_decided:
        allowed = sequence.failures_to_meet(share, confidence, len(margins))
    else:
        allowed = allowed_failures(share, 1.0 - confidence, len(margins))
    row = int(np.argmin(margins))
    return Verdict(
        **vars(whole) | {"outcome": outcome, "more": None if outcome == "missed" else max(more, default=None)},
        share=share,
        confidence=confidence,
        allowed=allowed if independent else None,
        worst_margin=float(margins[row]),
        worst_run=row if run is None else int(run[row]),
        margin_bound=quantile_bound(margins, share, confidence) if independent and not until_decided else None,
        parts=parts,
        worst_part=max(parts, key=lambda x: (SEVERITY.index(x.outcome), x.failures / x.runs, x.upper or 0.0), default=None),
        independent=independent,
        until_decided=until_decided,
        knowledge=knowledge,
    )


def _judge(
    name: str,
    missed: NDArray[np.bool_],
    share: float,
    confidence: float,
    independent: bool,
    until_decided: bool,
    missed_confidence: float,
) -> Part:
    """Return the verdict on the runs of one condition; "missed" has its own confidence."""
    runs, failures = len(missed), int(missed.sum())
    if not independent:
        return Part(name, runs, failures, None, None, "not decided", None)
    if until_decided:
        lower, upper = sequence.bounds(failures, runs, confidence)
        met = sequence.decided(failures, runs, share, confidence) == "met"
        short = sequence.decided(failures, runs, share, missed_confidence) == "missed"
        needed = sequence.runs_to_meet(share, confidence, failures)
    else:
        lower, upper = failure_bounds(failures, runs, confidence, sides=1)
        met = acceptance(share, runs, failures) <= 1.0 - confidence
        short = failure_bounds(failures, runs, missed_confidence, sides=1).lower > 1.0 - share
        needed = runs_needed(share, 1.0 - confidence, failures)
    outcome: Outcome = "met" if met else "missed" if short else "not decided"
    return Part(name, runs, failures, lower, upper, outcome, None if short else max(0, needed - runs))


def _parts(known: Mapping[str, NDArray]) -> Iterator[tuple[str, NDArray[np.bool_]]]:
    """Yield the names of the conditions known before flight, each with a mask (n,) of its runs; constants are left out."""
    for name, column in known.items():
        column = np.asarray(column)
        values = np.unique(column)
        if len(values) == 1:
            continue
        if column.dtype.kind not in "fiu" or len(values) <= PARTS:
            for value in values:
                # NaN equals nothing, not even itself.
                yield f"{name} = {_shown(value)}", np.isnan(column) if value != value else column == value
            continue
        there = ~np.isnan(column)
        if not there.all():
            yield f"{name} without a value", ~there
        quarter = np.searchsorted(np.quantile(column[there], np.arange(1, PARTS) / PARTS), column)
        for number in range(PARTS):
            rows = there & (quarter == number)
            if rows.any():
                yield f"{name} from {_shown(column[rows].min())} to {_shown(column[rows].max())}", rows


def _worst_first(values: ArrayLike) -> NDArray[np.float64]:
    """Return values (n,) with NaN replaced by minus infinity, the worst value."""
    values = np.asarray(values, dtype=np.float64)
    return np.where(np.isnan(values), -np.inf, values)


def _shown(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, (int, float, np.number)) else str(value)


def percent(share: float) -> str:
    """Return a share in percent, with enough digits to distinguish it from 0 and 100 %."""
    digits = 3 if not 0.0 < share < 1.0 else max(3, 1 - math.floor(math.log10(min(share, 1.0 - share) * 100.0)))
    return f"{100.0 * share:.{digits}f}".rstrip("0").rstrip(".") + " %"
