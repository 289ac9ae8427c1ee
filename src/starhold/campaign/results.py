"""The results of a campaign by law: distributions, envelopes, verdicts, drivers, and runs worth flying again."""

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
"""Quantiles of a metric's distribution: minimum, 5 %, 25 %, median, 75 %, 95 %, maximum."""

ROUNDING = 1e-12
"""The share of a bound by which rounding may make a flight exceed it."""


CHANCE = 1e-6
"""The probability below which the number of flights outside a claim's share is not attributed to chance."""


@dataclass(frozen=True)
class Spread:
    """The distribution of a metric over the runs that have it. quantiles: those of QUANTILES, by linear interpolation as in
    `numpy.quantile`; edges (bins + 1,) and counts (bins,): a histogram, with the same edges for all laws; runs: number of
    all runs; missing: number of runs without the metric."""

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
    """A run worth flying again: its number, the reason, and the command."""

    run: int
    why: str
    command: str


@dataclass(frozen=True)
class Bracket:
    """Bounds on the worst value of a metric: *flown <= true <= proved*, or reversed if `at_most` is false and less is worse.
    flown: the worst value in the runs and in a search over the box of the dispersions, with the scenario file of that run
    (NaN: a run without the metric, which is worse than any number); proved: a bound on the same quantity for the same
    flights, with its basis; None where no bound is proved."""

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
        """Whether a flight exceeds the proved bound by more than rounding, which is an error in starhold."""
        if self.proved is None:
            return False
        room = ROUNDING * abs(self.proved)
        return self.flown > self.proved + room if self.at_most else self.flown < self.proved - room


@dataclass(frozen=True)
class Within:
    """The worst value flown and the bound proved for a metric of flights that meet a claim's premises, from the time when
    they do. covered: the number of these flights; beyond: the number of those that exceed the bound by more than the
    integration error, or have no value."""

    metric: str
    unit: str
    flown: float
    proved: float
    covered: int
    beyond: int


@dataclass(frozen=True)
class ByClaim:
    """A claim about a law's loop as it flies, compared with its flights. about: the name of its certificate, which names the
    law and, for a law of modes, the mode; text: the claim, or the reason why there is none; runs: the number of flights
    compared; left: the numbers of flights that do not meet its premises, by reason; share: the share of flights for which
    the claim holds, None for all; misled: the number of flights outside it in which the measurement error exceeded what the
    claim assumes for this share, None where measurements are not recorded; within: the metrics that the claim bounds."""

    about: str
    text: str
    runs: int = 0
    left: Mapping[str, int] = field(default_factory=dict[str, int])
    share: float | None = None
    misled: int | None = None
    within: tuple[Within, ...] = ()

    @property
    def covered(self) -> int:
        """The number of flights that meet the premises of the claim."""
        return self.runs - sum(self.left.values())

    def is_rare(self, failures: int, runs: int) -> bool:
        """Return whether `failures` of the runs may be outside the share by chance: the probability of so many is more than
        `CHANCE`. Each run has its own noise, regardless of how the dispersions are drawn."""
        if self.share is None or not failures:
            return not failures
        from starhold.campaign.verdicts import failure_bounds

        return failure_bounds(failures, runs, 1.0 - CHANCE, sides=1).lower <= 1.0 - self.share

    @property
    def contradicted(self) -> bool:
        """Whether flights contradict the claim, or the share of flights that it assumes to meet its bound on noise."""
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
    """Sensitivity indices by metric, if the sampling was designed for them."""
    again: tuple[Again, ...] = ()
    brackets: tuple[Bracket, ...] = ()
    claims: tuple[ByClaim, ...] = ()
    """The comparisons with claims, one for each mode of a law of modes; empty unless a proof was requested."""

    def __repr__(self) -> str:
        judged = "".join(f"; {verdict.name} {verdict.outcome}" for verdict in self.verdicts)
        return f"<law {self.law}: {self.failed} of {self.runs} failed, {self.lost} lost{judged}>"


@dataclass(frozen=True)
class CampaignResult:
    """The results of a whole campaign: its folder, the number of runs of each law, the sampling, the digest (SHA-256) of the
    results, the seconds that flying took this time, and the number of runs flown in them."""

    name: str
    folder: Path
    runs: int
    sampling: str
    over: Mapping[str, str]
    """The dispersed keys with descriptions of their distributions."""
    laws: tuple[LawResult, ...]
    digest: str
    seconds: float
    flown: int
    requirements: tuple[Requirement, ...] = ()

    @property
    def met(self) -> bool | None:
        """Whether every law meets every requirement; None where some are not decided and none is missed."""
        outcomes = {verdict.outcome for law in self.laws for verdict in law.verdicts}
        return False if "missed" in outcomes else None if "not decided" in outcomes else True

    @property
    def contradicted(self) -> bool:
        """Whether a flight contradicts a proof, which is an error in starhold."""
        every = (one for law in self.laws for one in (*law.brackets, *law.claims))
        return any(one.contradicted for one in every)

    def frame(self) -> DataFrame:
        """Return a row for each run of each law: `law`, `run`, drawn and flown values, metrics, margins."""
        return self.query("SELECT * FROM runs ORDER BY law, run")

    @shortly
    def query(self, sql: str) -> DataFrame:
        """Return the result of a SELECT from `runs`. InputError where the query is refused."""
        from starhold.campaign.query import query

        return query(self.folder, sql)

    @shortly
    def again(self, run: int, law: str | None = None) -> FlownAgain:
        """Fly one run again and return it with a recording. InputError where there is no such run."""
        from starhold.campaign.again import fly_again

        return fly_again(self.folder, run, law)

    def __repr__(self) -> str:
        failures = ", ".join(f"{law.law}: {law.failed} of {law.runs} failed" for law in self.laws)
        return f"<campaign {self.name}: {failures}>"
