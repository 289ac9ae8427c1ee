"""Prints certificates for `certify`, `check` and `compare`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from rich.markup import escape
from rich.table import Table

from starhold.certification.assumptions import HAS, texts
from starhold.certification.certificate import Certificate
from starhold.certification.wording import (
    HEADINGS,
    coverage,
    eigenvalues,
    grouped,
    listed,
    methods,
    ranked,
    reasons,
    statement,
    strongest,
    unclaimed,
)
from starhold.cli.console import console
from starhold.cli.show import print_rows, printable
from starhold.report.commands import Column, coloured
from starhold.report.commands import Table as Rows
from starhold.report.text import covered_text, unflown_text
from starhold.studies.chain import sentence, summary

if TYPE_CHECKING:
    from starhold.analysis.departure import Departure
    from starhold.checker import Finding
    from starhold.studies.certificates import Tried
    from starhold.studies.chain import Link
    from starhold.studies.flight import Flight

LONGEST = 1_000
"""The largest number of characters printed of a text from a file."""


def print_certificate(tried: Tried, why: bool = False) -> None:
    """Print claims with their outcomes, beginning with those that leave out the fewest parts of the loop, each list of such
    parts once, and the reason why a claim is not proved. why: whether to print methods and all assumptions too."""
    certificate, trial, inside = tried
    subject = certificate.subject
    console.print(f"[bold]{_safe(certificate.name)}[/bold]: {coloured(certificate.outcome)}")
    if not certificate.claims:
        console.print(f"  no claim: {_safe(unclaimed(subject))}")
    word, said = unflown_text(certificate)
    if said:
        console.print(f"  {coloured(word)}: {_safe(said)}")
    for heading, claims in grouped(certificate).items():
        console.print(f"  [dim]{_safe(heading)}:[/dim]")
        table = _grid()
        for claim in claims:
            how = f" [dim]({methods(claim)})[/dim]" if why else ""
            text = _safe(statement(claim, subject))
            table.add_row(f"  {coloured(claim.outcome)}", HEADINGS[claim.kind], text + how)
            if why and "eigenvalues" in claim.numbers:
                table.add_row("", "", f"[dim]eigenvalues {eigenvalues(claim)}[/dim]")
            for line in reasons(claim):
                table.add_row("", "", _safe(line))
        console.print(table)
    if why and certificate.claims:
        console.print(f"  [dim]assuming: {assumptions(certificate)}[/dim]")
    if why and certificate.no_larger_start:
        console.print(f"  [dim]not proved of a larger start: {_safe(certificate.no_larger_start)}[/dim]")
    outside = [HEADINGS[kind] for kind, is_inside in inside.items() if not is_inside]
    if outside:
        console.print(f"  this scenario starts outside the regions of these claims: {', '.join(outside)}")
    if trial is not None:
        console.print(f"  [dim]flown: {trial.flights} states of the certified set, none against the claim[/dim]")
    console.print()


def print_chain(name: str, links: Sequence[Link]) -> None:
    """Print for each switch between the modes of a law whether the claim about the next mode as it flies covers it."""
    console.print(f"[bold]{_safe(name)}[/bold]: {summary(links)}:")
    table = _grid()
    for link in links:
        word = "undecided" if link.lacks else "proved"
        table.add_row(f"  {coloured(word)}", _safe(f"{link.before} to {link.after}"), _safe(link.text))
    console.print(table)
    if whole := sentence(links):
        console.print(f"  together: {_safe(whole)}")
    console.print()


def print_proved(flights: Sequence[Flight]) -> None:
    """Print for each law whether there is a claim about the loop as it flies, the claim that leaves out the least, the names
    of the others, and how long they cover a flight."""
    console.print("\nCertified on this spacecraft (for details: starhold certify --why):")
    table = _grid()
    for flight in flights:
        for place, certificate in enumerate(flight.certificates):
            for left, outcome, text in _summary(flight, place, certificate):
                table.add_row(f"  {_safe(left)}", outcome, _safe(text))
    console.print(table)


def _grid() -> Table:
    """Return a table of three columns without lines."""
    table = Table(show_edge=False, pad_edge=False, box=None, show_header=False)
    for _ in range(3):
        table.add_column(overflow="fold")
    return table


def _summary(flight: Flight, place: int, certificate: Certificate) -> Iterator[tuple[str, str, str]]:
    """Yield at most four rows about a certificate: the reason if no claim is about the loop as it flies, its first claim,
    the names of the others, and the time for which they cover the flight."""
    claims, name, (word, said) = ranked(certificate), certificate.name, unflown_text(certificate)
    if said:
        yield name, coloured(word), said
        name = ""
    if not claims:
        yield name, coloured("undecided"), "no claim"
        return
    first, *others = strongest(claims)
    covered = coverage(first, certificate.subject)
    yield name, coloured(first.outcome), statement(first, certificate.subject) + (f" ({covered})" if covered else "")
    named: dict[str, list[str]] = {}
    for claim in others:
        named.setdefault(claim.outcome, []).append(HEADINGS[claim.kind])
    if others:
        yield "", "[dim]and[/dim]", "; ".join(f"{outcome}: {', '.join(kinds)}" for outcome, kinds in named.items())
    # If a flight leaves several claims at once, the reasons are those of the claim shown first.
    proved = [claim.kind for claim in strongest(claims) if claim.outcome == "proved"]
    departures = flight.departures[place] if flight.departures else {}
    begins = {kind: departures[kind] for kind in proved if kind in departures}
    if said := covered_text(flight, place):
        yield "", "[dim]covers[/dim]", said
    elif begins and all(begins.values()):
        last = max(begins, key=lambda kind: begins[kind][0].time)
        yield "", "[yellow]left[/yellow]", _uncovered(flight, begins[last])


def _uncovered(flight: Flight, left: Sequence[Departure]) -> str:
    """Return a sentence on when and why claims cease to cover a flight; parts that claims leave out are not named again."""
    time = left[0].time
    happens = [one.how for one in left if one.time == time]
    events = [how for how in happens if not how.startswith(HAS)]
    if len(events) < len(happens):
        events.insert(0, "its loop has parts in no claim")
    begin = "from the start" if time == 0.0 else f"from {flight.metric_set.moment(time, 4)} on"
    return f"{begin} no proved claim covers this flight: {listed(events)}"


def assumptions(certificate: Certificate) -> str:
    """Return every assumption once, with the claims that need it unless all do."""
    kinds = {claim.kind: texts(claim.assumptions) for claim in certificate.claims}
    parts: list[str] = []
    for assumption in dict.fromkeys(a for assumed in kinds.values() for a in assumed):
        holders = [HEADINGS[kind] for kind, assumed in kinds.items() if assumption in assumed]
        others = [HEADINGS[kind] for kind, assumed in kinds.items() if assumption not in assumed]
        if not others:
            parts.append(assumption)
        elif len(others) < len(holders):
            parts.append(f"{assumption} (not for: {', '.join(others)})")
        else:
            parts.append(f"{assumption} (for: {', '.join(holders)})")
    return "; ".join(parts)


def print_compared(others: Sequence[str], beside: Sequence[str], scenario: str | None) -> None:
    """Print whether the proofs are about the loops of a scenario, and what they leave open about these; None: they were not
    compared."""
    if scenario is None:
        console.print("The programs of its proofs were not compared with those of a scenario.")
    elif not others:
        console.print(f"The programs of its proofs are those of {_safe(scenario)}.")
    for text in others:
        console.print(f"[red]another loop[/red]  {_safe(text)}")
    for text in beside:
        console.print(f"[yellow]left open[/yellow]  {_safe(text)}", soft_wrap=True)


def print_findings(findings: Sequence[Finding]) -> None:
    """Print the findings of an independent check, claim by claim, and every obligation that fails."""
    groups: dict[tuple[str, str], list[Finding]] = {}
    for finding in findings:
        groups.setdefault((finding.certificate, finding.claim), []).append(finding)
    rows: list[list[str]] = []
    for (name, claim), group in groups.items():
        verdicts = {finding.verdict for finding in group}
        worst = next(v for v in ("fails", "not checked", "not claimed", "holds") if v in verdicts)
        obligations = ", ".join(f.obligation for f in group if f.obligation)
        rows.append([_safe(name), _safe(claim), _safe(obligations), coloured(worst)])
    print_rows(Rows([*map(Column, ("certificate", "claim", "obligations", "verdict"))], rows))
    failed = [finding for finding in findings if finding.verdict == "fails"]
    for f in failed:
        console.print(f"[red]fails[/red]  {_where(f)}")
    left = [finding for finding in findings if finding.verdict == "not checked"]
    for f in left:
        console.print(f"[yellow]not checked[/yellow]  {_where(f)}")
    claimed = sum(finding.verdict == "holds" for finding in findings)
    console.print(f"{claimed} obligations hold, {len(failed)} fail{f', {len(left)} are not checked' if left else ''}.")


def _where(finding: Finding) -> str:
    place = " / ".join(part for part in (finding.certificate, finding.claim, finding.obligation) if part)
    return _safe(": ".join(part for part in (place, finding.reason) if part))


def _safe(text: str) -> str:
    """Return text from a file in printable form: no markup, no terminal control characters, no broken character."""
    plain = printable(text)
    return escape(plain if len(plain) <= LONGEST else f"{plain[:LONGEST]} …")
