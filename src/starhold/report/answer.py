"""The first screen of a page: whether and with what margin each law meets its requirements, and what is proved about it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

from starhold.certification.wording import coverage, statement, strongest, unclaimed
from starhold.report.commands import Cell, Column, Table
from starhold.report.commands.verify import amount
from starhold.report.tables import Markup, note, pill, swatch, table_html
from starhold.report.text import covered_text, lost_text, plain_measure, unflown_text, unknown_text
from starhold.studies.requirements import LOST
from starhold.studies.verification import verdicts_of_flight

if TYPE_CHECKING:
    from starhold.analysis.ranking import MetricSet
    from starhold.certification.certificate import Certificate
    from starhold.scenario.reading import Scenario
    from starhold.studies.flight import Flight
    from starhold.studies.verification import RequirementVerdict

SPANS = ((63_115_200.0, 31_557_600.0, "years"), (172_800.0, 86_400.0, "days"), (7_200.0, 3_600.0, "h"), (600.0, 60.0, "min"))
"""The least time (s) shown in each unit, the unit in seconds, and its name."""


def span_text(seconds: float) -> str:
    """Return a time (s) as text, in the largest suitable unit."""
    sizes = ((seconds / size, unit) for least, size, unit in SPANS if seconds >= least)
    return "{:g} {}".format(*next((one for one in sizes if abs(one[0] - round(one[0], 2)) < 1e-9), (seconds, "s")))


def facts(scenario: Scenario, flights: Sequence[Flight]) -> str:
    """Return a text with the duration of the flights and the control rate."""
    run = flights[0].recording.attrs
    period, end = (x * run.get("time_unit_s", 1.0) for x in (run["control_period"], scenario.table.simulation.duration))
    whose = f", commands from {run['law_process']}" if "law_process" in run else ""
    return f"{span_text(end)}, {f'{1.0 / period:.4g} Hz' if period <= 1.0 else f'a step every {span_text(period)}'}{whose}"


def lost_alarm(flights: Sequence[Flight]) -> str:
    """Return HTML that lists the motions that diverged and the metrics that are not finite; "" if there are none."""
    lost = [f"{flight.name} (at {lost_text(flight)})" for flight in flights if flight.lost is not None]
    sentences = [f"Diverged, and so without final values: {', '.join(lost)}"] if lost else []
    sentences += [said for flight in flights if (said := unknown_text(flight))]
    return "".join(f'<p class="alarm">{escape(said)}.</p>' for said in sentences)


def verdicts(scenario: Scenario, flights: Sequence[Flight]) -> tuple[str, str]:
    """Return the table of requirements with the verdict on each law, and the counts of verdicts; both "" without
    requirements."""
    names = {entry.name for entry in scenario.laws} if scenario.table.requirement else set[str]()
    judged = {number: verdicts_of_flight(scenario, one) for number, one in enumerate(flights) if one.name in names}
    if not judged:
        return "", ""
    whose = {number: f"{swatch(number)}{escape(flights[number].name)} " if len(flights) > 1 else "" for number in judged}
    counts = "".join(f"<span>{whose[number]}{_counted(of)}</span>" for number, of in judged.items())
    by_law = list(judged.values())
    if all(one.verdict == "not decided" for of in by_law for one in of):
        subject = ", ".join(one.id for one in by_law[0])
        return note(f"Required, but not decided by a flight: {subject}; run starhold verify."), ""
    rows: list[list[Any]] = []
    for same in zip(*by_law, strict=True):
        first = same[0]
        measure = flights[0].metric_set.measures.get(first.metric) or plain_measure(first.metric, first.unit)
        limit = next((text for one in same if (text := amount(one, one.limit))), "")
        limit = f"{'≤' if first.at_most else '≥'} {limit}" if limit else ""
        subject = "the motion does not diverge" if first.metric == LOST else measure.heading
        cells = [Markup(f"{pill(one.verdict)} {escape(amount(one, one.number) or '')}") for one in same]
        how = dict.fromkeys(_evidence(one, flights[number].name) for number, one in zip(judged, same, strict=True))
        name = Markup(f'<small class="id">{escape(first.id)}</small> {escape(first.text or subject)}')
        rows.append([name, *cells, limit, "; ".join(how)])
    laws = [Column(flights[number].name if len(flights) > 1 else "verdict") for number in judged]
    table = Table([Column("requirement"), *laws, Column("limit"), Column("how it is known")], rows)
    return table_html(table, "told tight verdicts"), counts


def _evidence(verdict: RequirementVerdict, law: str) -> str:
    """Return the evidence for a verdict, without the law's name, so that equal texts for several laws appear once."""
    known = verdict.evidence.replace(f" of {law}", "")
    return f"{known}; leaving out {', '.join(verdict.left_out)}" if verdict.left_out else known


def _counted(given: Sequence[RequirementVerdict]) -> str:
    counts = Counter(one.verdict for one in given)
    pills = [pill("met", f"{counts['met']} of {len(given)} met")] if counts["met"] else []
    pills += [pill(word, f"{counts[word]} {word}") for word in ("missed", "not decided") if counts[word]]
    return " ".join(pills)


def key_metrics(metric_set: MetricSet, results: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Return the names of the metrics in the table, beginning with those by which laws are ranked."""
    there = metric_set.columns(results)
    return [*(name for name in metric_set.order if name in there), *(name for name in there if name not in metric_set.order)]


def fate(flight: Flight) -> str:
    """Return the outcome of a flight in a word; "" where no metric states whether it settles."""
    if flight.lost is not None:
        return "diverged"
    if "settling_time" not in flight.metrics:
        return ""
    return "not settled" if flight.metrics["settling_time"] is None else "settled"


def ranking(flights: Sequence[Flight]) -> str:
    """Return the ranked table as HTML: a row of key numbers for each law, and below it the best law by each metric."""
    metric_set = flights[0].metric_set
    results = {flight.name: flight.metrics for flight in flights}
    best, metrics = metric_set.winners(results), key_metrics(metric_set, results)
    numbers = {flight.name: number for number, flight in enumerate(flights)}
    measures = [metric_set.measures[metric] for metric in metrics]
    columns = [Column("law"), Column("flown")]
    # A name is not broken at its hyphen.
    columns += [
        Column(one.heading.replace("-", "\N{NON-BREAKING HYPHEN}"), one.unit or "\N{NO-BREAK SPACE}", ">", one.meaning)
        for one in measures
    ]
    rows: list[list[Any]] = []
    for name in metric_set.ranked(results):
        flight = flights[numbers[name]]
        below = f"at {lost_text(flight)}" if flight.lost is not None else flight.law if flight.law != name else ""
        cells = [Cell(metric_set.cell(one, flight.metrics), "best" if name in best[one] else "") for one in metrics]
        rows.append([Cell(name, "name", numbers[name], below), Cell("", fate(flight)), *cells])
    lost = {i: 'class="lost"' for i, row in enumerate(rows) if row[1].kind == "diverged"}
    won = "".join(
        f"<span>{escape(metric_set.measures[one].heading)}: {_winners(best[one], numbers)}</span>"
        for one in metric_set.order
        if best.get(one)
    )
    said = f'<p class="best-at"{"" if won else " hidden"}><strong>Best</strong> {won}</p>' if len(flights) > 1 else ""
    return f"{said}{table_html(Table(columns, rows), 'ranking', rows=lost)}\n{note(metric_set.late(results))}"


def _winners(names: Iterable[str], numbers: Mapping[str, int]) -> str:
    return ", ".join(f"{swatch(numbers[name])}{escape(name)}" for name in names)


def columns_list(flights: Sequence[Flight]) -> str:
    """Return HTML that explains the columns of the ranking and its order."""
    metric_set, results = flights[0].metric_set, {flight.name: flight.metrics for flight in flights}
    items = "".join(
        f"<dt>{escape(one.heading)}{f', {escape(one.unit)}' if one.unit else ''}</dt><dd>{escape(one.meaning)}</dd>"
        for one in (metric_set.measures[metric] for metric in key_metrics(metric_set, results))
    )
    order = escape(", then ".join(metric_set.headings(results)))
    return (
        f'<h3>How to read the key numbers</h3>\n<p class="note">Laws are ordered by {order}; less is better in every '
        f"column, and the best value is marked. A dash: never reached, or not measured.</p>\n<dl>{items}</dl>"
    )


def proofs(flights: Sequence[Flight]) -> str:
    """Return HTML with the strongest claim proved about each law, preceded by the reason if there is none about the loop as
    it flies; "" where no proof was attempted."""
    certified = [(number, flight) for number, flight in enumerate(flights) if flight.certificates]
    names = [f"<strong>{swatch(n)}{escape(one.name)}</strong> " if len(flights) > 1 else "" for n, one in certified]
    lines = [f"{_unflown(one, name)}{_strongest(one, name)}" for (_, one), name in zip(certified, names, strict=True)]
    if not lines:
        return ""
    more = '<button class="link" type="button" data-open="proofs">All claims</button>'
    return f'<section class="card proved"><h2>Proved</h2>{"".join(lines)}{more}</section>'


def _about(certificate: Certificate, flight: Flight) -> str:
    return certificate.name.removeprefix(flight.name).strip(": ")


def _unflown(flight: Flight, whose: str) -> str:
    subjects: dict[tuple[str, str], list[str]] = {}
    for certificate in flight.certificates:
        subjects.setdefault(unflown_text(certificate), []).append(_about(certificate, flight))
    reasons = {said: f"{', '.join(names)}: " if len(subjects) > 1 else "" for said, names in subjects.items() if all(said)}
    return "".join(f"<p>{pill(word)} {whose}{escape(about + text)}.</p>" for (word, text), about in reasons.items())


def _strongest(flight: Flight, whose: str) -> str:
    claims = [(claim, place) for place, one in enumerate(flight.certificates) for claim in one.claims]
    if not claims:
        return f"<p>{pill('undecided')} {whose}nothing is claimed: {escape(unclaimed(flight.certificates[0].subject))}.</p>"
    claim = strongest([claim for claim, _ in claims])[0]
    place = next(place for other, place in claims if other is claim)
    certificate = flight.certificates[place]
    about = _about(certificate, flight)
    left = flight.left(place, claim.kind)
    when = covered_text(flight, place) if claim.kind == "pointing" else ""
    if left and claim.outcome == "proved" and not when:
        start = left[0].time
        when = f"this flight leaves it {'from the start' if start == 0.0 else f'at {flight.metric_set.moment(start, 4)}'}"
    more = "; ".join(filter(None, (coverage(claim, certificate.subject), when)))
    text = f"{f'{about}: ' if about else ''}{statement(claim, certificate.subject)}{f' ({more})' if more else ''}."
    return f"<p>{pill(claim.outcome)} {whose}{escape(text)}</p>"
