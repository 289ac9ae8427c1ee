"""Tables of certificates, as `certify`, `check` and `compare` print them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich.markup import escape
from rich.table import Table

from starhold.certification.assumptions import texts
from starhold.certification.certificate import Certificate, Claim
from starhold.certification.obligations import OBLIGATIONS
from starhold.certification.wording import HEADINGS, eigenvalues, evidence, methods, sentence, unclaimed
from starhold.cli.console import console
from starhold.cli.show import print_rows, printable
from starhold.report.commands import Column
from starhold.report.commands import Table as Rows
from starhold.report.text import left_text

if TYPE_CHECKING:
    from starhold.checker import Finding
    from starhold.studies.certificates import Tried
    from starhold.studies.flight import Flight

LONGEST = 1_000
"""Characters of a file that are printed at a time."""
COLOURS = {
    "proved": "green",
    "refuted": "red",
    "undecided": "yellow",
    "holds": "green",
    "fails": "red",
    "not checked": "yellow",
    "not claimed": "dim",
}


def print_certificate(tried: Tried) -> None:
    """Claims with their outcomes, why those that are not proved are not, the assumptions, and the flights."""
    certificate, trial, inside = tried
    console.print(f"[bold]{_safe(certificate.name)}[/bold]: {_coloured(certificate.outcome)}")
    if not certificate.claims:
        console.print(f"  no claim: {_safe(unclaimed(certificate.subject))}")
    table = Table(show_edge=False, pad_edge=False, box=None, show_header=False)
    for _ in range(3):
        table.add_column(overflow="fold")
    for claim in certificate.claims:
        statement = _safe(sentence(claim, certificate.subject))
        table.add_row(f"  {_coloured(claim.outcome)}", HEADINGS[claim.kind], f"{statement} [dim]({methods(claim)})[/dim]")
        if "eigenvalues" in claim.numbers:
            table.add_row("", "", f"[dim]eigenvalues {eigenvalues(claim)}[/dim]")
        for line in reasons(claim):
            table.add_row("", "", _safe(line))
    if certificate.claims:
        console.print(table)
        console.print(f"  [dim]assuming: {assumptions(certificate)}[/dim]")
    outside = [HEADINGS[kind] for kind, is_inside in inside.items() if not is_inside]
    if outside:
        console.print(f"  this scenario starts outside the sets of: {', '.join(outside)}")
    if trial is not None:
        console.print(f"  [dim]flown: {trial.flights} states of the certified set, none against the claim[/dim]")
    console.print()


def print_proved(flights: Sequence[Flight]) -> None:
    """One line for each claim of several laws, and how their flights leave what is proved."""
    console.print("\nCertified on this spacecraft (starhold certify tells how):")
    table = Table(show_edge=False, pad_edge=False, box=None, show_header=False)
    for _ in range(3):
        table.add_column(overflow="fold")
    for flight in flights:
        for place, certificate in enumerate(flight.certificates):
            name, texts = _safe(certificate.name), dict[str, list[str]]()
            for claim in certificate.claims:
                table.add_row(f"  {name}", _coloured(claim.outcome), _safe(sentence(claim, certificate.subject)))
                name = ""
                texts.setdefault(left_text(flight, place, claim.kind), []).append(HEADINGS[claim.kind])
            if not certificate.claims:
                table.add_row(f"  {name}", _coloured("undecided"), "no claim")
            for text, kinds in texts.items():
                if text:
                    table.add_row("", "[yellow]left[/yellow]", f"by this flight, {', '.join(kinds)}: {text}")
    console.print(table)


def reasons(claim: Claim) -> list[str]:
    """Why a claim is not proved, one line an obligation."""
    return [
        f"needed, but {o.outcome}: {OBLIGATIONS[o.name]}; {evidence(o)}" for o in claim.obligations if o.outcome != "proved"
    ]


def assumptions(certificate: Certificate) -> str:
    """Every assumption once, with the claims that need it where not all do."""
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


def print_compared(others: Sequence[str], scenario: str | None) -> None:
    """Print whether the proofs are about the loops of a scenario; None: they were not compared with any."""
    if scenario is None:
        console.print("The programs of its proofs were not compared with those of a scenario.")
    elif not others:
        console.print(f"The programs of its proofs are those of {_safe(scenario)}.")
    for text in others:
        console.print(f"[red]another loop[/red]  {_safe(text)}")


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
        rows.append([_safe(name), _safe(claim), _safe(obligations), _coloured(worst)])
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
    """Text from a file as one that can be printed: no markup, nothing that steers a terminal, no half of a character."""
    plain = printable(text)
    return escape(plain if len(plain) <= LONGEST else f"{plain[:LONGEST]} …")


def _coloured(outcome: str) -> str:
    return f"[{COLOURS[outcome]}]{outcome}[/{COLOURS[outcome]}]"
