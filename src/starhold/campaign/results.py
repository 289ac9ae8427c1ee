"""The results of a campaign, law by law: distributions, envelopes, verdicts, drivers, and the runs worth flying again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from starhold.errors import shortly

if TYPE_CHECKING:
    from pandas import DataFrame

    from starhold.campaign.again import FlownAgain
    from starhold.campaign.drivers import Drivers
    from starhold.campaign.envelopes import Envelope
    from starhold.campaign.sensitivity import Morris, Refused, Sobol
    from starhold.campaign.verdicts import Verdict
    from starhold.studies.requirements import Requirement

Array: TypeAlias = NDArray[np.float64]

QUANTILES = (0.0, 0.05, 0.25, 0.5, 0.75, 0.95, 1.0)
"""Quantiles of a metric's distribution: least, 5 %, quarter, median, three quarters, 95 %, largest."""

ROUNDING = 1e-12
"""The share of a bound by which rounding may take a flight beyond it."""


CHANCE = 1e-6
"""The probability with which as many flights as contradict a claim with a share would be beyond it by chance."""


@dataclass(frozen=True)
class Spread:
    """The distribution of a metric over the runs that have it. quantiles: those of QUANTILES, by linear interpolation, as
    `numpy.quantile` gives them; edges (bins + 1,) and counts (bins,) of a histogram, its edges the same for all laws; runs:
    all of them; missing: those without the metric."""

    metric: str
    unit: str
    runs: int
    missing: int
    mean: float
    quantiles: tuple[float, ...]
    edges: Array = field(repr=False)
    counts: NDArray[np.int64] = field(repr=False)


@dataclass(frozen=True)
class Again:
    """A run that is worth flying again: its number, why, and the command."""

    run: int
    why: str
    command: str


@dataclass(frozen=True)
class Bracket:
    """The worst value of a metric: *flown <= true <= proved*, or the reverse where `at_most` is false and less is worse.
    flown: the worst of the runs and of a search over the dispersions' box, with the scenario file of that run (NaN: a run
    without the metric, which is worse than any number); proved: a bound of the same quantity for the same flights, with its
    basis; None where nothing is proved of the metric."""

    metric: str
    unit: str
    flown: float
    file: str
    evaluations: int
    proved: float | None
    assumption: str
    at_most: bool = True

    @property
    def contradicted(self) -> bool:
        """Whether a flight exceeds the proved bound by more than rounding: a fault of starhold."""
        if self.proved is None:
            return False
        room = ROUNDING * abs(self.proved)
        return self.flown > self.proved + room if self.at_most else self.flown < self.proved - room


@dataclass(frozen=True)
class Within:
    """A metric of the flights that keep the premises of a claim, from when they do, lies between the worst flown and the
    bound proved. covered: how many these flights are; beyond: those beyond the bound by more than the integration's error,
    or without a value."""

    metric: str
    unit: str
    flown: float
    proved: float
    covered: int
    beyond: int


@dataclass(frozen=True)
class ByClaim:
    """A claim about a law's loop as it flies, compared with its flights. about: the name of its certificate, that of the
    law or one that also tells its mode; text: the claim, or why nothing is claimed of them; runs: flights that were
    compared with it; left: how many do not meet its premises, by the reason; share: of flights of which the claim holds,
    None for all; misled: in how many of the others the law was told more wrongly than the claim assumes for this share,
    None where what it is told is not recorded; within: the metrics that it bounds."""

    about: str
    text: str
    runs: int = 0
    left: Mapping[str, int] = field(default_factory=dict[str, int])
    share: float | None = None
    misled: int | None = None
    within: tuple[Within, ...] = ()

    @property
    def covered(self) -> int:
        """The number of flights that have the premises of the claim."""
        return self.runs - sum(self.left.values())

    def is_rare(self, failures: int, runs: int) -> bool:
        """Whether `failures` of the runs may be outside the share: the probability of as many is more than `CHANCE`. Each
        run has its own noise, however the dispersions are drawn."""
        if self.share is None or not failures:
            return not failures
        from starhold.campaign.verdicts import failure_bounds

        return failure_bounds(failures, runs, 1.0 - CHANCE, sides=1).lower <= 1.0 - self.share

    @property
    def contradicted(self) -> bool:
        """Whether flights contradict the claim, or the share of them in which its assumption on noise holds."""
        counts = [(self.misled or 0, self.covered), *((one.beyond, one.covered) for one in self.within)]
        return not all(self.is_rare(*pair) for pair in counts)


@dataclass(frozen=True)
class LawResult:
    """The results of one law in a campaign."""

    law: str
    runs: int
    lost: int
    failed: int
    spreads: tuple[Spread, ...]
    envelopes: tuple[Envelope, ...]
    verdicts: tuple[Verdict, ...]
    drivers: Drivers | None
    indices: Mapping[str, Morris | Sobol | Refused] = field(default_factory=dict[str, Any])
    """Sensitivity of metrics, by their names, if the sampling was designed for it."""
    again: tuple[Again, ...] = ()
    brackets: tuple[Bracket, ...] = ()
    claims: tuple[ByClaim, ...] = ()
    """The brackets by claims, one for each mode of a law of modes; none unless a proof was requested."""

    def __repr__(self) -> str:
        judged = "".join(f"; {verdict.name} {verdict.outcome}" for verdict in self.verdicts)
        return f"<law {self.law}: {self.failed} of {self.runs} failed, {self.lost} lost{judged}>"


@dataclass(frozen=True)
class CampaignResult:
    """A whole campaign, in its folder: the number of runs of each law, how they were sampled, the digest of its results
    (SHA-256), the seconds that flying took this time, and the number of runs flown in them."""

    name: str
    folder: Path
    runs: int
    sampling: str
    over: Mapping[str, str]
    """Each dispersed key, with a description of its distribution."""
    laws: tuple[LawResult, ...]
    digest: str
    seconds: float
    flown: int
    requirements: tuple[Requirement, ...] = ()

    @property
    def met(self) -> bool | None:
        """Whether every requirement is met by every law; None where some are not decided and none is missed."""
        outcomes = {verdict.outcome for law in self.laws for verdict in law.verdicts}
        return False if "missed" in outcomes else None if "not decided" in outcomes else True

    @property
    def contradicted(self) -> bool:
        """Whether a flight contradicts a proof, which is a fault of starhold."""
        every = (one for law in self.laws for one in (*law.brackets, *law.claims))
        return any(one.contradicted for one in every)

    def frame(self) -> DataFrame:
        """A row for each run of each law: `law`, `run`, drawn and flown values, metrics, margins."""
        return self.query("SELECT * FROM runs ORDER BY law, run")

    @shortly
    def query(self, sql: str) -> DataFrame:
        """Answer a SELECT about `runs`. InputError where that is impossible."""
        from starhold.campaign.query import query

        return query(self.folder, sql)

    @shortly
    def again(self, run: int, law: str | None = None) -> FlownAgain:
        """Fly one run again and record it. InputError where there is no such run."""
        from starhold.campaign.again import fly_again

        return fly_again(self.folder, run, law)

    def __repr__(self) -> str:
        failures = ", ".join(f"{law.law}: {law.failed} of {law.runs} failed" for law in self.laws)
        return f"<campaign {self.name}: {failures}>"
