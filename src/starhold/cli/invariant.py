"""The command `invariant`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from starhold.cli.arguments import REFUTED, UNDECIDED, Force, InvariantOutput

if TYPE_CHECKING:
    from starhold.certification.certificate import Certificate
    from starhold.studies.phase_portraits import Portrait

SystemFile = Annotated[
    str | None, typer.Argument(metavar="FILE", help="a file with a system, or the name of a built-in one; none: list these")
]


def invariant(file: SystemFile = None, output: InvariantOutput = None, force: Force = False) -> None:
    """Prove what functions V say of an invariant set of any small system: a table, certificate.json and a picture.

    Exit code 0: all that is claimed is proved; 3: something is refuted, with the state that does; 4: not decided.
    """
    from starhold.certification import invariant as sets
    from starhold.certification.certificate import FILE
    from starhold.cli.console import console
    from starhold.files import atomic_write
    from starhold.report.invariant_picture import PICTURE, draw
    from starhold.report.results import open_folder
    from starhold.studies.phase_portraits import portraits

    if file is None:
        for name in sets.builtin_names():
            console.print(f"[bold]{name}[/bold]  {sets.load(name).description}", soft_wrap=True)
        return
    problem = sets.load(file)
    folder = open_folder(output or Path("results") / f"{problem.name}-invariant", force)
    certificate = sets.certify(problem)
    drawn = portraits(problem, certificate)
    _print(certificate, drawn)
    with atomic_write(folder / FILE) as hidden:
        sets.write(certificate, hidden)
    said = f"Certificate: {folder / FILE}."
    if draw(drawn, folder / PICTURE, problem.name) is not None:
        said += f" Picture: {folder / PICTURE}"
    console.print(said, soft_wrap=True)
    if certificate.outcome != "proved":
        raise typer.Exit(REFUTED if certificate.outcome == "refuted" else UNDECIDED)


def _print(certificate: Certificate, portraits: list[Portrait]) -> None:
    """Each claim with its outcome, how it was shown and what it lacks."""
    from rich.markup import escape
    from rich.table import Table

    from starhold.certification.invariant.wording import HEADINGS, OBLIGATIONS, evidence, limit, sentence, size
    from starhold.cli.console import console
    from starhold.cli.show_certificates import COLOURS

    console.print(f"\n[bold]{certificate.name}[/bold]", highlight=False)
    table = Table(show_edge=False, pad_edge=False)
    for head in ("claim", "outcome", "what it says"):
        table.add_column(head, overflow="fold")
    for claim, portrait in zip(certificate.claims, portraits, strict=True):
        heading = HEADINGS[claim.numbers["theorem"]]
        name = escape(claim.witness["name"])
        table.add_row(
            f"{name}\n[dim]{heading}[/dim]" if name else heading,
            f"[{COLOURS[claim.outcome]}]{claim.outcome}[/{COLOURS[claim.outcome]}]",
            escape(sentence(claim)),
        )
        for line in filter(None, (size(claim.numbers, portrait.orbit_area), limit(claim.numbers))):
            table.add_row("", "", f"[dim]{line}[/dim]")
        for o in claim.obligations:
            if o.outcome != "proved":
                table.add_row("", "", f"needed, but {o.outcome}: {OBLIGATIONS[o.name]}; {escape(evidence(o))}")
        if claim.outcome == "proved":
            table.add_row("", "", f"[dim]by {', '.join(dict.fromkeys(o.how for o in claim.obligations))}[/dim]")
    console.print(table, highlight=False)
    told = dict.fromkeys(a for claim in certificate.claims for a in claim.assumptions)
    console.print(f"  [dim]assuming: {'; '.join(told)}[/dim]\n", highlight=False)
