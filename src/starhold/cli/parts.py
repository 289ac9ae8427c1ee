"""The commands `parts` and `check-part`."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from starhold.cli.arguments import FAILED_CHECK
from starhold.errors import InputError
from starhold.report.commands import Column, Table

if TYPE_CHECKING:
    from starhold.parts.part import Part


def parts(
    name: Annotated[
        str | None, typer.Argument(metavar="ROLE|NAME|FILE", help="a role, the name of a part, or a Python file with one")
    ] = None,
) -> None:
    """List the parts that a loop can be made of, those of one role, or describe one."""
    from starhold.cli.show import print_law
    from starhold.conformance.parts import find_part
    from starhold.laws.catalogue import Law, catalogue
    from starhold.parts import catalogue as installed
    from starhold.parts.roles import ROLES
    from starhold.scenario.checking import nearest

    def of_role(role: str) -> dict[str, Any]:
        if role != "law":
            return dict(installed.parts(role))
        return {law: found for body in installed.parts("body") for law, found in catalogue(body).items()}

    if name is None or name in ROLES:
        _print_roles({role: of_role(role).values() for role in ROLES if name in (None, role)})
        return
    known = {part: found for role in ROLES for part, found in of_role(role).items()}
    if not Path(name).is_file() and not name.endswith(".py") and name not in known:
        raise InputError("parts", "", name, nearest(name, [*ROLES, *known]))
    found = known[name] if name in known else _find(name, find_part)
    (print_law if isinstance(found, Law) else print_part)(found)


def check_part(
    part: Annotated[
        str, typer.Argument(metavar="FILE", help="a Python file that holds a part or a law, or the name of one")
    ],
) -> None:
    """Run the conformance suite over a part or a law of your own."""
    from rich.markup import escape

    from starhold.cli.console import console
    from starhold.conformance.parts import examine_part, find_part
    from starhold.conformance.suite import examine
    from starhold.laws.catalogue import Law

    found, failed = _find(part, find_part), 0
    for verdict in examine(found) if isinstance(found, Law) else examine_part(found):
        failed += verdict.outcome == "failed"
        colour = {"passed": "green", "failed": "red", "does not apply": "dim"}[verdict.outcome]
        console.print(f"[{colour}]{verdict.outcome:>14}[/{colour}]  {escape(verdict.name)}", highlight=False)
        if verdict.reason:
            console.print(f"{'':16}{verdict.reason}", highlight=False, markup=False)
    if failed:
        raise typer.Exit(FAILED_CHECK)


def _find(given: str, find_part: Any) -> Any:
    """The part or the law of this name or in this file."""
    from starhold.conformance.suite import find_law
    from starhold.laws.catalogue import catalogue
    from starhold.parts import catalogue as installed

    if Path(given).is_file():
        try:
            law = installed.role_of(installed.read_module(Path(given))) == "law"
        except (OSError, ValueError):
            # Told by whoever reads it for good.
            law = True
    else:
        law = any(given in catalogue(body) for body in installed.parts("body"))
    return find_law(given) if law else find_part(given)


def _print_roles(groups: dict[str, Iterable[Part]]) -> None:
    from rich.markup import escape

    from starhold.cli.console import console
    from starhold.cli.show import print_rows

    for role, known in groups.items():
        rows: list[list[str]] = []
        for part in known:
            given = {"law": "[[law]]", "body": "its table"}.get(role, f"[{part.table}]" if part.table else "[[part]]")
            of = part.name if role == "body" else part.body or "any"
            rows.append([*map(escape, (part.name, of, given, part.card.summary))])
        print_rows(Table([*map(Column, (role, "body", "given by", "summary"))], rows))
        console.print()


def print_part(part: Part) -> None:
    """The card of a part, its parameters and what it records."""
    from rich.markup import escape

    from starhold.algebra.quantity import quantities
    from starhold.cli.console import console
    from starhold.cli.show import print_fields, print_rows

    card = part.card
    console.print(f"[bold]{part.name}[/bold], {part.role}: {card.title}", highlight=False)
    console.print(card.summary, highlight=False, markup=False)
    if card.assumptions:
        console.print(f"Assumes: {'; '.join(card.assumptions)}", highlight=False, markup=False)
    for source in card.sources:
        console.print(f"Source: {source}", highlight=False, markup=False)
    if part.needs:
        console.print(f"Needs: {', '.join(part.needs)}", highlight=False, markup=False)
    if part.table:
        console.print(f"Given by the table [{part.table}] of a scenario", highlight=False, markup=False)
    elif part.role != "body":
        print_fields("Parameters", part.fields())
    kinds = [getattr(part.module, kind) for kind in ("Reading", "Estimate", "Sample") if hasattr(part.module, kind)]
    if kinds and getattr(part.module, "RECORDED", True):
        recorded = [(name, told.unit, told.text) for kind in kinds for name, told in quantities(kind).items()]
        rows = [[*map(escape, row)] for row in recorded]
        print_rows(Table([*map(Column, ("recorded", "unit", "meaning"))], rows), apart=True)
