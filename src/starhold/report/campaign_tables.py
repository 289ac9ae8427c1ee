"""The tables that sum up a campaign, as the terminal prints them and the page shows them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from starhold.campaign.verdicts import percent
from starhold.report.campaign_units import (
    CONTRADICTED,
    DASH,
    Wording,
    bounds_text,
    count_text,
    counted,
    figure,
    headings_of,
    order,
    with_unit,
    worst_text,
)
from starhold.report.commands import Cell, Column, Table

if TYPE_CHECKING:
    from starhold.campaign.results import CampaignResult
    from starhold.campaign.verdicts import Verdict


class Section(NamedTuple):
    """A table under its heading, and a note on it."""

    heading: str
    table: Table
    note: str = ""


def numbers(*names: str) -> list[Column]:
    """Columns of numbers, aligned right: each its heading, and after a stroke the line below it."""
    return [Column(name, below, ">") for name, _, below in (one.partition("|") for one in names)]


def law_cell(result: CampaignResult, number: int) -> Cell:
    """A law's name, which has its colour."""
    return Cell(result.laws[number].law, "law", number)


def verdicts(result: CampaignResult, words: Wording) -> Section | None:
    """One row for each requirement and law; None where nothing is required."""
    rows: list[list[Any]] = []
    ends: set[int] = set()
    for name in dict.fromkeys(verdict.name for law in result.laws for verdict in law.verdicts):
        heading: Any = words.called(name)
        for number, law in enumerate(result.laws):
            for verdict in law.verdicts:
                if verdict.name == name:
                    rows.append([heading, law_cell(result, number), *_verdict(verdict, words)])
                    heading = ""
        ends.add(len(rows) - 1)
    if not rows:
        return None
    stopped = any(verdict.until_decided for law in result.laws for verdict in law.verdicts)
    columns = [
        *map(Column, ("requirement", "law", "verdict")),
        *numbers("keep it|and must", "miss it|and may"),
        *numbers(f"failure probability|{'whenever stopped' if stopped else 'Clopper–Pearson'}"),
        *numbers("worst margin|and its run", "margin kept|by the share asked"),
    ]
    return Section("Verdicts", Table(columns, rows, ends=ends), " ".join(_conditions(result)))


def _verdict(verdict: Verdict, words: Wording) -> list[Any]:
    allowed = "none" if verdict.allowed is None else count_text(verdict.allowed)
    return [
        Cell(verdict.outcome, verdict.outcome),
        f"{percent(verdict.observed)} / {percent(verdict.share)}",
        f"{count_text(verdict.failures)} / {allowed if verdict.independent else DASH}",
        bounds_text(verdict),
        f"{words.margin(verdict.name, verdict.worst_margin)}, {verdict.worst_run}",
        words.margin(verdict.name, verdict.margin_bound),
    ]


def _conditions(result: CampaignResult) -> list[str]:
    """The conditions known before flight in which requirements are not met."""
    sentences: list[str] = []
    for law in result.laws:
        for verdict in law.verdicts:
            part = verdict.worst_part
            if part is not None and part.outcome != "met" and verdict.independent:
                missed = f"{count_text(part.failures)} of {counted(part.runs, 'run')} miss it"
                where = f"with {part.name}, known before flight"
                sentences.append(f"{law.law}: {where}, {verdict.name} is {part.outcome}: {missed}.")
    return sentences


def runs(result: CampaignResult) -> Section:
    """How many runs of each law were lost, and how many failed."""

    def of_runs(number: int, among: int) -> str:
        return f"{count_text(number)} ({percent(number / max(among, 1))})" if number else "0"

    rows = [
        [law_cell(result, number), count_text(law.runs), of_runs(law.lost, law.runs), of_runs(law.failed, law.runs)]
        for number, law in enumerate(result.laws)
    ]
    note = "Lost: the motion left all bounds and has no final values. Failed: lost, or a requirement is missed."
    return Section("Runs", Table([Column("law"), *numbers("runs", "lost", "failed")], rows), note)


def metrics(result: CampaignResult, words: Wording, most: int | None = None) -> Section | None:
    """The distribution of each metric under each law, the required ones first; `most`: no more metrics than these."""
    headings, required = headings_of(result, words), {item.column for item in words.requirements.values()}
    rows: list[list[Any]] = []
    ends: set[int] = set()
    for metric in sorted(headings, key=lambda metric: (metric not in required, headings.index(metric)))[:most]:
        measure = words.measure(metric)
        cells: list[Any] = [Cell(measure.heading, detail=measure.meaning), measure.unit]
        for number, law in enumerate(result.laws):
            for spread in law.spreads:
                if spread.metric == metric:
                    least, low, _, median, _, high, largest = spread.quantiles
                    values = (figure(measure.scale * x) for x in (least, low, median, high, largest, spread.mean))
                    missing = count_text(spread.missing) if spread.missing else DASH
                    rows.append([*cells, law_cell(result, number), *values, missing])
                    cells = ["", ""]
        ends.add(len(rows) - 1)
    if not rows:
        return None
    heads = numbers("least", "5 %", "median", "95 %", "largest", "mean", "without|value")
    note = "Over the runs that have the metric; a run that is lost, or never settles, is without one."
    return Section("Metrics", Table([*map(Column, ("metric", "unit", "law")), *heads], rows, ends=ends), note)


def again(result: CampaignResult, most: int) -> Section | None:
    """The runs that are worth flying again, at most so many of a law, with what to type."""
    rows = [
        [law_cell(result, number), str(item.run), item.why, Cell(item.command, "typed")]
        for number, law in enumerate(result.laws)
        for item in law.again[:most]
    ]
    if not rows:
        return None
    left = sum(len(law.again[most:]) for law in result.laws)
    more = f" {counted(left, 'further run')} are not listed." if left else ""
    note = f"The command flies the run again, bit for bit, and writes its full series, pictures and page.{more}"
    columns = [Column("law"), *numbers("run"), Column("why"), Column("command")]
    return Section("Runs worth flying again", Table(columns, rows), note)


def brackets(result: CampaignResult, words: Wording) -> Section | None:
    """How bad metrics get: what was flown and what is proved."""
    rows: list[list[Any]] = []
    faults: list[str] = []
    for number, law in enumerate(result.laws):
        for item in law.brackets:
            measure = words.measure(item.metric, item.unit)
            text, why = worst_text(item, measure), "nothing is proved of it"
            if item.proved is not None:
                text, why = f"{text} {order(item)} {with_unit(item.proved, measure)}", item.assumption
            tries = f"{counted(item.evaluations, 'flight')} of the search" if item.evaluations else DASH
            rows.append([measure.heading, law_cell(result, number), text, why, tries, Cell(item.file, "typed")])
            faults += [f"{law.law}, {measure.heading}: {CONTRADICTED}"] if item.contradicted else []
    if not rows:
        return None
    note = (
        "The worst flown is that of all runs and of a search over the box of the dispersions: no smaller bound can be true. "
        "What is proved holds for every flight over what is drawn. The scenario file flies the worst run that was found."
    )
    columns = [*map(Column, ("metric", "law")), *numbers("flown ≤ true ≤ proved")]
    columns += [*map(Column, ("proved by", "looked for by", "flown by"))]
    return Section("Worst cases: flown ≤ true ≤ proved", Table(columns, rows), " ".join([*faults, note]))


def dispersions(result: CampaignResult) -> Section | None:
    """The dispersed keys with their distributions."""
    rows = [[key, how] for key, how in result.over.items()]
    return Section("Dispersions flown", Table([Column("key"), Column("distribution")], rows)) if rows else None
