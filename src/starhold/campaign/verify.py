"""Decides whether a law meets the requirements of its scenario. Each method runs at most once, and only if a requirement
needs it; a review uses the same flights."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, NamedTuple, TypeVar

from starhold.campaign.campaign import Options, begin, fly_campaign, with_campaign
from starhold.campaign.job import Job, Source
from starhold.errors import InputError
from starhold.scenario.building import build
from starhold.studies import budget as budgets
from starhold.studies.body import SILENT, Notice, study_of
from starhold.studies.compare import fly_law
from starhold.studies.deciding import (
    Verdicts,
    by_budget,
    by_margins,
    by_proof,
    check_margins,
    check_proofs,
    refuse_other_bodies,
)
from starhold.studies.linear import linear_of
from starhold.studies.requirements import LOST, tables_of
from starhold.studies.verification import (
    RequirementVerdict,
    by_flight,
    by_inspection,
    check_flight,
    in_order,
    limits,
    verdict_on,
)

if TYPE_CHECKING:
    from starhold.analysis.linear import Linear
    from starhold.campaign.results import CampaignResult
    from starhold.loop.closed_loop import ClosedLoop
    from starhold.scenario.reading import LawEntry, Scenario
    from starhold.studies.body import Issued
    from starhold.studies.budget import Budget
    from starhold.studies.flight import Flight

Known = TypeVar("Known")
OTHER_BODY = "it is available for rigid bodies only"


@dataclass(frozen=True)
class Evidence:
    """All evidence about a law of a scenario, computed at first use. Missing evidence is replaced by a text with the
    reason."""

    scenario: Scenario
    entry: LawEntry

    @cached_property
    def loop(self) -> ClosedLoop:
        """Its loop."""
        return build(self.scenario, self.entry)

    @cached_property
    def flight(self) -> Flight:
        """The flight of the scenario with its nominal values."""
        return fly_law(self.scenario, self.entry, self.loop)

    @cached_property
    def linear(self) -> Linear | str:
        """The linear loop, or why there is none."""
        return self._by(linear_of)

    @cached_property
    def budget(self) -> Budget | str:
        """The pointing budget, or why there is none."""
        return self._by(budgets.study)

    def _by(self, study: Callable[[Scenario, LawEntry], Known]) -> Known | str:
        """Return the result of a study of rigid bodies, or the reason why there is none."""
        if self.scenario.body != "rigid-body":
            return OTHER_BODY
        try:
            return study(self.scenario, self.entry)
        except InputError as error:
            return error.given

    @cached_property
    def issued(self) -> Sequence[Issued] | str:
        """The certificates, each with its loop, or why there are none."""
        if self.scenario.supposed is not None:
            return "the law's nominal model is not the craft that flies"
        return study_of(self.scenario.body).certify(self.scenario, self.entry, self.loop, pointing=True)

    @cached_property
    def campaign(self) -> CampaignResult:
        """The campaign of the scenario's [campaign] table, whose folder is removed. InputError where there is none."""
        with TemporaryDirectory(prefix="starhold-verify-") as folder:
            return fly_campaign(self.scenario, Path(folder) / "campaign", self.entry.name, Options(search=False))

    def verdicts(self, notice: Notice, more: Collection[str] = ()) -> tuple[RequirementVerdict, ...]:
        """Return the verdicts on all requirements by their methods; also run the methods `more`, whose evidence is
        needed."""
        scenario, entry = self.scenario, self.entry
        methods: dict[str, Callable[[], Verdicts]] = {
            "inspection": lambda: by_inspection(scenario),
            "margin": lambda: by_margins(scenario, self.linear),
            "flight": lambda: by_flight(scenario, entry, self.flight.recording),
            "proof": lambda: by_proof(scenario, entry, self.loop, self.issued),
            "budget": lambda: by_budget(scenario, self.budget),
            "campaign": lambda: by_campaign(scenario, self.campaign),
        }
        wanted = [method for method in methods if method in more or tables_of(scenario, method)]
        decided: Verdicts = {}
        for done, method in enumerate(wanted):
            notice(done, len(wanted), method)
            decided |= methods[method]()
        notice(len(wanted), len(wanted), "")
        return in_order(scenario, decided)


class Review(NamedTuple):
    """The verdicts on the requirements of a law, and the evidence for them and for a review."""

    verdicts: tuple[RequirementVerdict, ...]
    evidence: Evidence

    @property
    def has_budget(self) -> bool:
        """Whether a [budget] table or a requirement asks for a pointing budget."""
        return _asks_budget(self.evidence.scenario)

    @property
    def has_campaign(self) -> bool:
        """Whether there is a [campaign] table."""
        return self.evidence.scenario.table.campaign is not None


def study(scenario: Scenario, entry: LawEntry, notice: Notice = SILENT) -> tuple[RequirementVerdict, ...]:
    """Return the verdicts on the requirements of a scenario for one of its laws, by their methods; one flight, campaign,
    certificate, budget and linear loop serve all of them. `notice` is called with the number of methods done, the total and
    the next method. InputError for any mistake in a requirement, before anything is flown or proved."""
    if not scenario.table.requirement:
        raise InputError(scenario.where, "requirement", "none", "at least one [[requirement]] table")
    check(scenario, entry)
    return Evidence(scenario, entry).verdicts(notice)


def examine(scenario: Scenario, entry: LawEntry, notice: Notice = SILENT) -> Review:
    """Return the contents of a law's review: the verdicts, if anything is required, a flight, the linear loop, certificates,
    and the budget and the campaign that the scenario defines, each computed once. InputError as in `study`, and for any
    mistake in the [campaign] table."""
    check(scenario, entry)
    more = ["margin", "flight", "proof", *(["budget"] if _asks_budget(scenario) else [])]
    if scenario.table.campaign is not None:
        begin(scenario, [entry.name])
        more.append("campaign")
    evidence = Evidence(scenario, entry)
    return Review(evidence.verdicts(notice, more), evidence)


def _asks_budget(scenario: Scenario) -> bool:
    return "budget" in scenario.table.model_fields_set or bool(tables_of(scenario, "budget"))


def check(scenario: Scenario, entry: LawEntry) -> None:
    """Raise InputError for any mistake in a requirement: a metric that its method does not measure, a limit in a wrong unit,
    an unknown mode, or a missing [campaign] table."""
    refuse_other_bodies(scenario)
    if scenario.body == "rigid-body":
        check_proofs(scenario, entry)
        budgets.check_budget(scenario)
    check_margins(scenario)
    check_flight(scenario, entry)
    if tables_of(scenario, "campaign"):
        Job(Source.of(scenario), with_campaign(scenario, {}).table.campaign).requirements(entry.name)


def by_campaign(scenario: Scenario, result: CampaignResult) -> Verdicts:
    """Return the verdicts of a scenario's campaign on its only law."""
    tables = tables_of(scenario, "campaign")
    verdicts: Verdicts = {}
    judged = zip(tables.items(), result.requirements, result.laws[0].verdicts, strict=True)
    for (key, table), required, verdict in judged:
        if required.metric == LOST:
            known = {"number": verdict.observed, "limit": verdict.share, "unit": "1", "at_most": False}
        else:
            side, kept = (1.0 if required.at_most else -1.0), verdict.margin_bound
            number = None if kept is None or not math.isfinite(kept) else required.bound - side * kept
            known = limits(table, required) | {"number": number}
        said = verdict.sentence().removeprefix(f"{verdict.name}: ")
        verdicts[key] = verdict_on(table, verdict.outcome, f"{said} Digest of the runs: {result.digest}", **known)
    return verdicts
