"""The command `invariant`, a table and a picture of the proved invariant sets of a small system."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from starhold.report.commands import Block, Column, Command, Heading, Result, Table, coloured, later

if TYPE_CHECKING:
    from starhold.certification.certificate import Certificate
    from starhold.certification.invariant import InvariantProblem
    from starhold.certification.invariant.problem import SetCertificate
    from starhold.studies.phase_portraits import Portrait


def listed() -> list[Block]:
    """Return the names of the built-in systems."""
    from starhold.certification import invariant as sets

    return [Heading(name, f"  {sets.load(name).description}") for name in sets.builtin_names()]


def read(problem: InvariantProblem | str | Path) -> tuple[InvariantProblem]:
    """Return the problem itself, the one in a file, or the built-in one of this name."""
    from starhold.certification import invariant as sets

    return (problem if isinstance(problem, sets.InvariantProblem) else sets.load(problem),)


def present(problem: InvariantProblem, certificate: SetCertificate) -> Result:
    """Return the result: each claim with its outcome, its method or what is missing, and the phase portrait with the
    sets."""
    from starhold.certification import invariant as sets
    from starhold.certification.assumptions import texts
    from starhold.studies.phase_portraits import portraits

    shown = portraits(problem, certificate)
    drawn = [item for item in shown if item.V is not None]
    assumptions = texts(a for claim in certificate.claims for a in claim.assumptions)
    blocks = ["", Heading(certificate.name), _table(certificate, shown), f"  assuming: {'; '.join(assumptions)}", ""]
    figure = partial(later("report.invariant_picture.draw"), drawn, problem.name) if drawn else None
    outcome = {"proved": "met", "refuted": "missed"}.get(certificate.outcome, "undecided")
    written: Any = partial(sets.write, certificate)
    return Result(problem.name, blocks, figure=figure, certificate=written, outcome=outcome)  # type: ignore[arg-type]


def _table(certificate: Certificate, portraits: list[Portrait]) -> Table:
    from rich.markup import escape

    from starhold.certification.invariant.wording import HEADINGS, OBLIGATIONS, evidence, limit, sentence, size

    rows: list[list[str]] = []
    for claim, portrait in zip(certificate.claims, portraits, strict=True):
        heading, name = HEADINGS[claim.numbers["theorem"]], escape(claim.witness["name"])
        title = f"{name}\n[dim]{heading}[/dim]" if name else heading
        rows.append([title, coloured(claim.outcome), escape(sentence(claim))])
        lines = [f"[dim]{line}[/dim]" for line in (size(claim.numbers, portrait.orbit_area), limit(claim.numbers)) if line]
        lines += [
            f"needed, but {o.outcome}: {OBLIGATIONS[o.name]}; {escape(evidence(o))}"
            for o in claim.obligations
            if o.outcome != "proved"
        ]
        if claim.outcome == "proved":
            lines.append(f"[dim]by {', '.join(dict.fromkeys(o.how for o in claim.obligations))}[/dim]")
        rows += [["", "", line] for line in lines]
    return Table([*map(Column, ("claim", "outcome", "what it says"))], rows)


COMMAND = Command(
    """Prove claims about invariant sets of any small system by functions V: a table, certificate.json and a picture.

    Exit code 0: every claim is proved; 3: one is refuted, with the state that refutes it; 4: one is undecided.
    """,
    "invariant",
    later("certification.invariant.certify"),
    present,
    doing=None,
    file="a file with a system, or the name of a built-in one; none: list these",
    listed=listed,
    read=read,
    proofs=True,
)
