"""The document of a review: the requirements, the evidence for each, and the open points."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from rich.markup import escape

from starhold.campaign.again import hashes
from starhold.certification.assumptions import WITHOUT, texts
from starhold.certification.wording import (
    HEADINGS,
    coverage,
    enumerated,
    grouped,
    listed,
    methods,
    reasons,
    sentence,
    statement,
    strongest,
    unclaimed,
)
from starhold.report import campaign_tables as tables
from starhold.report.answer import facts
from starhold.report.body import report_of
from starhold.report.campaign_units import Wording, flown_text, headline
from starhold.report.commands import Cell, Column, Table
from starhold.report.commands import budget as command
from starhold.report.commands.verify import NUMBERS, numbers
from starhold.report.credibility import factors_of
from starhold.report.document import Figure, Listing, Piece, Section
from starhold.report.linear_loop import NOTE, Known, margins_table
from starhold.report.text import lost_text, value_text
from starhold.studies.body import study_of

if TYPE_CHECKING:
    from starhold.campaign.verify import Review
    from starhold.certification.certificate import Certificate

MISSION, ASSUMPTIONS, REQUIREMENTS = "Mission and configuration", "Assumptions", "Requirements"
POINTING, MARGINS, CAMPAIGN = "Pointing and momentum", "Margins", "Campaign"
CERTIFICATES, CREDIBILITY, OPEN = "Certificates", "Credibility", "Open points"
PLACES = {
    "flight": POINTING,
    "budget": POINTING,
    "margin": MARGINS,
    "campaign": CAMPAIGN,
    "proof": CERTIFICATES,
    "inspection": MISSION,
    "": REQUIREMENTS,
}
"""The section that holds the evidence of each method."""
ATTITUDE = "rigid-body"
DRIVERS = 8
"""The largest number of drivers of each kind shown."""
PICTURES = ("angle", "wheel-momentum")
"""The figures of a flight to show, if it has them; else the first."""


class Open(str):
    """A sentence about an open point."""


class Listed(Open):
    """An open point that appears only in the list, because its section states it in other words."""


Points: TypeAlias = list[tuple[str, str]]
"""The open points, each with the section that states it."""


def sections_of(review: Review) -> tuple[list[Section], Points]:
    """Return the sections of the document and the points that it leaves open."""
    makers: dict[str, Callable[[Review], Iterator[Piece]]] = {
        MISSION: _mission,
        ASSUMPTIONS: _assumptions,
        REQUIREMENTS: _requirements,
        POINTING: _pointing,
        MARGINS: _margins,
        CAMPAIGN: _campaign,
        CERTIFICATES: _certificates,
    }
    fresh = (MISSION, REQUIREMENTS)
    sections = [Section(name, [*make(review)], name in fresh) for name, make in makers.items()]
    sections.append(Section(CREDIBILITY, [*_credibility(review)]))
    points = [(one.name, str(piece)) for one in sections for piece in one.pieces if isinstance(piece, Open)]
    rows = [[str(number), Cell(name, "section", detail=name), escape(text)] for number, (name, text) in enumerate(points, 1)]
    columns = [Column("no."), Column("from"), Column("what is open")]
    sections.append(Section(OPEN, [Table(columns, rows) if rows else "No point is open."]))
    scenario = review.evidence.scenario
    sections.append(Section("Scenario", ["The text from which all of this is computed.", Listing(scenario.text)], True))
    shown = [one._replace(pieces=[piece for piece in one.pieces if not isinstance(piece, Listed)]) for one in sections]
    return [Section("Outcome", [*_outcome(review, len(points))]), *shown], points


def _safe_rows(rows: Iterable[Sequence[Any]]) -> list[list[Any]]:
    return [[escape(value) if type(value) is str else value for value in row] for row in rows]


def _table(names: str, rows: Iterable[Sequence[Any]], title: str = "") -> Table:
    """Return a table of text; names: its headings, separated by "|"."""
    return Table([*map(Column, names.split("|"))], _safe_rows(rows), title)


def _outcome(review: Review, points: int) -> Iterator[Piece]:
    scenario, judged = review.evidence.scenario, review.verdicts
    counts = {word: sum(one.verdict == word for one in judged) for word in ("met", "missed", "not decided")}
    said = ", ".join(f"{count} {word}" for word, count in counts.items() if count)
    if scenario.table.description:
        yield f"{scenario.table.description}."
    yield f"Required of the law {review.evidence.entry.name}: {said} of {len(judged)}." if judged else "Nothing is required."
    limited = [one.id for one in judged if one.verdict == "met" and one.left_out]
    if limited:
        yield f"Met only if some parts of the flight are left out: {listed(limited)}."
    yield f"{OPEN}: {points}; see the section of that name." if points else "No point is open."


# --- sections ---------------------------------------------------------------------------------------------------------


def _mission(review: Review) -> Iterator[Piece]:
    evidence = review.evidence
    scenario, entry, flight = evidence.scenario, evidence.entry, evidence.flight
    rows = [
        ["scenario", f"{scenario.name} ({Path(scenario.where).name})"],
        ["law", f"{entry.name}: {entry.law.card.title}"],
        *([f"gain {name}", value_text(value, unit)] for name, (value, unit) in flight.gains.items()),
        ["body", evidence.loop.body.card.title],
        ["flight", facts(scenario, [flight])],
    ]
    yield _table("item|value", rows, "Configuration")
    digests = {"text of the scenario": hashlib.sha256(scenario.text.encode()).hexdigest()}
    digests |= hashes(scenario.text, scenario.where, scenario.folder)
    digests |= {f"program of the law, {one.name}": one.law for one in _issued(review) if one.law}
    digests |= {"runs of the campaign": evidence.campaign.digest} if review.has_campaign else {}
    yield _table("what|SHA-256", digests.items(), "Digests")


def _issued(review: Review) -> list[Certificate]:
    issued = review.evidence.issued
    return [] if isinstance(issued, str) else [one.certificate for one in issued]


def _assumptions(review: Review) -> Iterator[Piece]:
    evidence = review.evidence
    needed: dict[str, list[str]] = {}
    for one in _issued(review):
        for claim in one.claims:
            # What a claim leaves out is stated with it.
            for text in texts(name for name in claim.assumptions if not name.startswith(WITHOUT)):
                needed.setdefault(text, []).append(f"{one.name}: {HEADINGS[claim.kind]}")
    if needed:
        yield _table("claims assume|needed by", [[a, "; ".join(dict.fromkeys(of))] for a, of in needed.items()], "Of claims")
    parts = [("law", evidence.entry.name, evidence.entry.law), ("body", evidence.loop.body.name, evidence.loop.body)]
    parts += [(fitted.part.role, fitted.called, fitted.part) for fitted in evidence.loop.parts]
    rows = [[role, name, part.card.summary, "; ".join(part.card.assumptions)] for role, name, part in parts]
    yield _table("role|part|model|valid for", rows, "Of models")
    silent = [f"{role} {name}" for role, name, part in parts if not part.card.assumptions]
    if silent:
        yield Open(f"Limits of validity are not stated for {enumerated(silent)}.")


def _requirements(review: Review) -> Iterator[Piece]:
    if not review.verdicts:
        yield Open("Nothing is required: the scenario has no [[requirement]] table.")
        return
    matrix: list[list[Any]] = []
    rests: list[list[Any]] = []
    derived = any(one.parent for one in review.verdicts)
    for one in review.verdicts:
        text = ": ".join(filter(None, (one.text, one.rationale)))
        place = PLACES[one.method]
        link = Cell(one.method or "what is derived", "section", detail=place)
        matrix.append([one.id, *[one.parent] * derived, text, *numbers(one), link, Cell(one.verdict, one.verdict)])
        rests.append([one.id, f"{one.evidence}.", "; ".join(one.left_out) or "nothing"])
    columns = [Column("requirement"), *[Column("parent")] * derived, Column("text"), *NUMBERS]
    yield Table([*columns, Column("known by"), Column("verdict")], _safe_rows(matrix))
    yield _table("requirement|rests on|leaves out of the loop", rests, "Evidence")
    for one in review.verdicts:
        if one.verdict != "met":
            yield Listed(f"{one.id} is {one.verdict}: {one.evidence.removeprefix(f'{one.verdict}. ')}.")
        elif one.left_out:
            yield Listed(f"{one.id} is {one.sentence}.")


def _pointing(review: Review) -> Iterator[Piece]:
    evidence = review.evidence
    scenario, flight = evidence.scenario, evidence.flight
    known, row = flight.metric_set, flight.metrics
    if flight.lost is not None:
        yield Open(f"The motion is lost at {lost_text(flight)}.")
    measures = [(metric, known.measures[metric]) for metric in known.columns({flight.name: row})]
    rows = [[measure.heading, known.cell(metric, row), measure.unit, measure.meaning] for metric, measure in measures]
    columns = [Column("metric"), Column("value", "", ">"), Column("unit"), Column("meaning")]
    yield Table(columns, _safe_rows(rows), "One flight of the scenario")
    pictures = report_of(scenario.body).picture([flight], scenario)
    for name in [name for name in PICTURES if name in pictures] or list(pictures)[:1]:
        yield Figure(f"One flight of {flight.name}: {name.replace('-', ' ')}", pictures[name])
    if scenario.body == ATTITUDE:
        yield from _budget(review)
        yield from _momentum(review)


def _budget(review: Review) -> Iterator[Piece]:
    evidence = review.evidence
    if not review.has_budget:
        yield Open("There is no pointing budget: the scenario has no [budget] table.")
        return
    budget = evidence.budget
    if isinstance(budget, str):
        yield Open(f"There is no pointing budget: {budget}.")
        return
    first, *rest = command.present(evidence.scenario, evidence.entry, budget).blocks[1:]
    yield first._replace(title="Pointing budget") if isinstance(first, Table) else first
    yield from rest
    yield Figure("Pointing error by source", lambda: command.draw(budget, "Pointing error by source"))


def _momentum(review: Review) -> Iterator[Piece]:
    evidence = review.evidence
    wheels, run = evidence.loop.wheels, evidence.flight.recording
    if wheels is None or "wheel_momentum" not in run.arrays:
        yield "There is no momentum budget, because there are no wheels."
        return
    peaks, rotors = np.nanmax(np.abs(run["wheel_momentum"]), axis=0), evidence.loop.rotors
    rows: list[list[Any]] = []
    for number, (begun, peak, limit) in enumerate(zip(rotors, peaks, wheels.momentum_limit, strict=True), 1):
        margin = [limit, 100.0 * peak / limit, limit - peak] if math.isfinite(limit) else [None] * 3
        rows.append([str(number), begun, peak, *margin])
    heads = [Column(name, "N m s", ".4g") for name in ("at the start", "largest flown", "limit")]
    yield Table(
        [Column("wheel"), *heads, Column("share", "%", ".1f"), Column("left", "N m s", ".4g")],
        rows,
        "Momentum budget of the samples recorded",
    )
    spreads = evidence.campaign.laws[0].spreads if review.has_campaign else ()
    worst = [one.quantiles[-1] for one in spreads if one.metric == "peak_wheel_momentum"]
    yield from (f"Over all runs of the campaign no wheel stores more than {most:.4g} N m s." for most in worst)
    for one in _issued(review):
        claim = one.claim("wheels")
        if claim is not None and claim.outcome == "proved" and "momentum" in claim.numbers:
            yield f"Proved of {one.name}: {sentence(claim, one.subject)}."


def _margins(review: Review) -> Iterator[Piece]:
    evidence = review.evidence
    if evidence.scenario.body != ATTITUDE:
        yield "Margins exist only for laws that rotate a body."
        return
    linear = evidence.linear
    if isinstance(linear, str):
        yield Open(f"There are no margins: {linear}.")
        return

    table = margins_table([Known.of(0, evidence.entry.name, linear)])
    yield table._replace(columns=table.columns[1:], rows=[row[1:] for row in table.rows])
    yield NOTE
    if linear.left_out:
        yield f"Left out: {', '.join(linear.left_out)}."
    if not linear.is_stable:
        yield Open("The linear loop is not stable.")


def _campaign(review: Review) -> Iterator[Piece]:
    if not review.has_campaign:
        yield Open("No campaign is flown, so nothing is known for other parameters: the scenario has no [campaign] table.")
        return
    result = review.evidence.campaign
    law, words = result.laws[0], Wording.of(review.evidence.scenario.body, result)
    yield f"{flown_text(result)[:1].upper()}{flown_text(result)[1:]}"
    yield f"{law.law} {headline(law, result.sampling, words)}"
    shown: list[Table | None] = [tables.verdicts(result, words), tables.runs(result), tables.metrics(result, words)]
    shown += [tables.dispersions(result), *tables.indices(result, words)]
    if law.drivers is not None:
        shown.append(tables.drivers(law.drivers, words, DRIVERS)._replace(title="What drives failures and metrics"))
    for one in shown:
        if one is not None and one.rows:
            yield one._replace(rows=_safe_rows(one.rows))
        if one is not None and one.note:
            yield one.note
    if law.drivers is None:
        yield Open("Drivers of failures were not sought: nothing is drawn, or the sampling repeats its values.")


def _certificates(review: Review) -> Iterator[Piece]:
    issued = review.evidence.issued
    if isinstance(issued, str):
        yield Open(f"Nothing is certified: {issued}.")
        return

    rows: list[list[Any]] = []
    points: list[Open] = []
    covered: list[str] = []
    for given in issued:
        one = given.certificate
        subject, name = one.subject, one.name
        for claims in grouped(one).values():
            for claim in claims:
                absent = enumerated(claim.left_out) if claim.left_out else "nothing"
                outcome = Cell(claim.outcome, claim.outcome)
                rows.append(
                    [name, HEADINGS[claim.kind], outcome, f"{statement(claim, subject)}. By {methods(claim)}.", absent]
                )
        points += [
            Open(f"{name}, {HEADINGS[claim.kind]} is {claim.outcome}: {'; '.join(reasons(claim))}.")
            for claim in one.claims
            if claim.outcome != "proved"
        ]
        if one.unflown:
            points.append(Open(f"{name}, {HEADINGS['pointing']} is not proved: {one.unflown}."))
        if not one.claims:
            points.append(Open(f"{name}: nothing is claimed, so nothing is proved: {unclaimed(subject)}."))
            continue
        first = strongest(one.claims)[0]
        covered += [f"{name}: {coverage(first, subject)} ({HEADINGS[first.kind]})."] if coverage(first, subject) else []
        if first.outcome == "proved" and first.left_out:
            points.append(Open(f"{name}: no proof about the motion includes {enumerated(first.left_out)}."))
        # Certificates of later phases begin at states that this flight does not reach.
        inside = study_of(review.evidence.scenario.body).start_inside(given) if given.step == 0 else {}
        outside = [HEADINGS[kind] for kind, is_inside in inside.items() if not is_inside]
        if outside:
            points.append(Open(f"{name}: the flight begins outside the sets of {listed(outside)}."))
    if rows:
        yield _table("certificate|claim|outcome|what is claimed|leaves out", rows)
        yield from covered
    yield from points


# --- credibility ------------------------------------------------------------------------------------------------------


def _credibility(review: Review) -> Iterator[Piece]:
    """Yield the evidence for each factor of NASA-STD-7009; people assign the levels."""
    yield "The factors are those of NASA-STD-7009; this review assigns no levels."
    factors = factors_of(review, _issued(review))
    rows = [[name, " ".join(known) or "nothing", " ".join(blank)] for name, (known, blank) in factors.items()]
    yield _table("factor|known|not stated", rows)
    for name, (_, blanks) in factors.items():
        yield from (Listed(f"{name}: not stated: {blank[:1].lower()}{blank[1:]}") for blank in blanks)
