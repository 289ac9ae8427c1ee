"""Whether a law keeps the requirements of its scenario: each method is used once, and only those that are wanted for."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from starhold.campaign.campaign import Options, fly_campaign, with_campaign
from starhold.campaign.job import Job, Source
from starhold.errors import InputError
from starhold.scenario.building import build
from starhold.studies.budget import check_budget
from starhold.studies.compare import record
from starhold.studies.deciding import (
    Verdicts,
    by_budget,
    by_margins,
    by_proof,
    check_margins,
    check_proofs,
    refuse_other_bodies,
)
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
    from starhold.scenario.reading import LawEntry, Scenario

Notice = Callable[[int, int, str], None]


def study(
    scenario: Scenario, entry: LawEntry, notice: Notice = lambda done, total, what: None
) -> tuple[RequirementVerdict, ...]:
    """Decide the requirements of a scenario for one of its laws, by the methods that they ask for: one flight, one campaign,
    one certificate, one budget and one linear loop do for all of them. `notice` hears the number of methods done, that of
    all and the next one. InputError for any mistake in a requirement, before anything is flown or proved."""
    check(scenario, entry)
    methods: dict[str, Callable[[], Verdicts]] = {
        "inspection": lambda: by_inspection(scenario),
        "margin": lambda: by_margins(scenario, entry),
        "flight": lambda: by_flight(scenario, entry, record(scenario, build(scenario, entry))),
        "proof": lambda: by_proof(scenario, entry),
        "budget": lambda: by_budget(scenario, entry, lambda done, total, name: None),
        "campaign": lambda: by_campaign(scenario, entry),
    }
    wanted = [method for method in methods if tables_of(scenario, method)]
    decided: Verdicts = {}
    for done, method in enumerate(wanted):
        notice(done, len(wanted), method)
        decided |= methods[method]()
    notice(len(wanted), len(wanted), "")
    return in_order(scenario, decided)


def check(scenario: Scenario, entry: LawEntry) -> None:
    """InputError for whatever is wrong with a requirement: a metric that its method does not measure, a limit in another
    unit, a mode that the law does not have, a campaign that the scenario lacks."""
    if not scenario.table.requirement:
        raise InputError(scenario.where, "requirement", "none", "at least one [[requirement]] table")
    refuse_other_bodies(scenario)
    if scenario.body == "rigid-body":
        check_proofs(scenario, entry)
        check_budget(scenario)
    check_margins(scenario)
    check_flight(scenario, entry)
    if tables_of(scenario, "campaign"):
        Job(Source.of(scenario), with_campaign(scenario, {}).table.campaign).requirements(entry.name)


def by_campaign(scenario: Scenario, entry: LawEntry) -> Verdicts:
    """The verdicts of a scenario's campaign on one of its laws."""
    tables = tables_of(scenario, "campaign")
    with TemporaryDirectory(prefix="starhold-verify-") as folder:
        result = fly_campaign(scenario, Path(folder) / "campaign", entry.name, Options(search=False))
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
