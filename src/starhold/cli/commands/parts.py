"""The commands that list installed laws, parts and wheels (`laws`, `parts`, `wheels`), and `check-part`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from starhold.cli.arguments import FAILED_CHECK
from starhold.errors import InputError
from starhold.report.commands import Block, Column, Heading, Table, coloured

if TYPE_CHECKING:
    from starhold.laws.catalogue import Law
    from starhold.parts.contract import Field
    from starhold.parts.part import Part

Checked = Annotated[str, typer.Argument(metavar="FILE", help="a Python file that holds a part or a law, or the name of one")]
NEW_MODES = "starhold new my.toml --from cubesat-mission shows one."


def laws(name: Annotated[str | None, typer.Argument(help="show the card and gains of this law or file")] = None) -> None:
    """List the control laws, or describe one."""
    from starhold.cli.show import print_blocks
    from starhold.conformance.suite import find_law
    from starhold.laws.modes import NAME as MODES
    from starhold.scenario.checking import nearest

    groups = _laws()
    known = {law: law_named for group in groups.values() for law, law_named in group.items()}
    if name is None:
        for body, group in groups.items():
            rows = [(law.name, law.card.claims, law.card.summary) for law in group.values()]
            print_blocks([_table((body, "claims", "summary"), rows)])
    elif name.endswith(".py"):
        print_blocks(_law_blocks(find_law(name)))
    elif name == MODES:
        text = "modes: a law made of laws, each in a [[law.mode]] table with the condition that begins the next one."
        print_blocks([f"{text} {NEW_MODES}"])
    elif name not in known:
        raise InputError("laws", "", name, nearest(name, [*known, MODES]))
    else:
        print_blocks(_law_blocks(known[name]))


def parts(
    name: Annotated[
        str | None, typer.Argument(metavar="ROLE|NAME|FILE", help="a role, a part's name, or a Python file that holds one")
    ] = None,
) -> None:
    """List all parts for loops, those of one role, or describe one."""
    from starhold.cli.show import print_blocks
    from starhold.laws.catalogue import Law
    from starhold.parts import catalogue as installed
    from starhold.parts.roles import ROLES
    from starhold.scenario.checking import nearest

    of_laws = {law: part_named for group in _laws().values() for law, part_named in group.items()}
    known = {role: dict[str, Any](of_laws if role == "law" else installed.parts(role)) for role in ROLES}
    if name is None or name in ROLES:
        for role in ROLES if name is None else (name,):
            rows = [_row(part) for part in known[role].values()]
            print_blocks([_table((role, "body", "given by", "summary"), rows), ""])
        return
    every = {part: part_named for group in known.values() for part, part_named in group.items()}
    if not Path(name).is_file() and not name.endswith(".py") and name not in every:
        raise InputError("parts", "", name, nearest(name, [*ROLES, *every]))
    part_named = every[name] if name in every else _find(name)
    print_blocks(_law_blocks(part_named) if isinstance(part_named, Law) else _part_blocks(part_named))


def wheels() -> None:
    """List the reaction wheels of the catalogue, for `unit` in a scenario."""
    from starhold.cli.show import print_blocks
    from starhold.parts.effectors.wheel_units import WHEEL_UNITS

    numbers = [Column(name, "", ".4g") for name in ("torque, N m", "momentum, N m s", "rotor inertia, kg m²", "mass, kg")]
    rows = [[u.name, u.maker, u.torque_limit, u.momentum_limit, u.inertia, u.mass, u.source] for u in WHEEL_UNITS.values()]
    print_blocks([Table([Column("unit"), Column("maker"), *numbers, Column("source")], rows)])


def check_part(part: Checked) -> None:
    """Run the conformance suite over a part or a law of your own."""
    from rich.markup import escape

    from starhold.cli.console import console
    from starhold.conformance.parts import examine_part
    from starhold.conformance.suite import examine
    from starhold.laws.catalogue import Law

    examined, failed = _find(part), 0
    for verdict in examine(examined) if isinstance(examined, Law) else examine_part(examined):
        failed += verdict.outcome == "failed"
        console.print(f"{coloured(verdict.outcome, f'{verdict.outcome:>14}')}  {escape(verdict.name)}")
        if verdict.reason:
            console.print(f"{'':16}{verdict.reason}", markup=False)
    if failed:
        raise typer.Exit(FAILED_CHECK)


def _laws() -> dict[str, dict[str, Law]]:
    """Return the laws by the bodies that they control."""
    from starhold.laws.catalogue import catalogue
    from starhold.parts.catalogue import parts as installed

    return {body: dict(catalogue(body)) for body in installed("body")}


def _find(given: str) -> Part:
    """Return the part or the law of this name or in this file."""
    from starhold.conformance.parts import find_part
    from starhold.conformance.suite import find_law
    from starhold.parts import catalogue as installed

    if Path(given).is_file():
        try:
            law = installed.role_of(installed.read_module(Path(given))) == "law"
        except (OSError, ValueError):
            # The error is raised by the reader that follows.
            law = True
    else:
        law = any(given in group for group in _laws().values())
    return find_law(given) if law else find_part(given)


def _table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> Table:
    """Return a table of unformatted text."""
    from rich.markup import escape

    return Table([*map(Column, heads)], [[*map(escape, row)] for row in rows])


def _row(part: Part) -> tuple[str, str, str, str]:
    given = {"law": "[[law]]", "body": "its table"}.get(part.role, f"[{part.table}]" if part.table else "[[part]]")
    return part.name, part.name if part.role == "body" else part.body or "any", given, part.card.summary


def _law_blocks(law: Law) -> list[Block]:
    """Return a law's card, gains and design forms."""
    card = law.card
    claim = "no stability; assumes" if card.claims == "none" else f"{card.claims} asymptotic stability, if"
    claims = f"Claims: {claim}: {'; '.join(card.assumptions)}"
    blocks = [Heading(law.name, f": {card.title}"), card.summary, claims, *(f"Source: {source}" for source in card.sources)]
    blocks += _field_blocks("Gains", law.fields())
    return blocks + [block for form in law.forms for block in _field_blocks(f'form = "{form}"', law.fields(form))]


def _part_blocks(part: Part) -> list[Block]:
    """Return a part's card, parameters and recorded quantities."""
    from starhold.algebra.quantity import quantities

    card = part.card
    blocks: list[Block] = [Heading(part.name, f", {part.role}: {card.title}"), card.summary]
    blocks += [f"Assumes: {'; '.join(card.assumptions)}"] if card.assumptions else []
    blocks += [f"Source: {source}" for source in card.sources]
    blocks += [f"Needs: {', '.join(part.needs)}"] if part.needs else []
    if part.table:
        blocks.append(f"Given by the table [{part.table}] of a scenario")
    elif part.role != "body":
        blocks += _field_blocks("Parameters", part.fields())
    kinds = [getattr(part.module, kind) for kind in ("Reading", "Estimate", "Sample") if hasattr(part.module, kind)]
    if kinds and getattr(part.module, "RECORDED", True):
        rows = [(name, quantity.unit, quantity.text) for kind in kinds for name, quantity in quantities(kind).items()]
        blocks += ["", _table(("recorded", "unit", "meaning"), rows)]
    return blocks


def _field_blocks(title: str, fields: Iterable[Field]) -> list[Block]:
    """Return parameters with their units, bounds and defaults under a title."""
    rows: list[tuple[str, ...]] = []
    for item in fields:
        gain = item.gain
        allowed = ", ".join(gain.choices) or _bounds(gain)
        default = "required" if item.required else str(item.written(item.default))
        rows.append((item.name, gain.units, allowed, default, gain.text))
    return ["", Heading(title), _table(("key", "unit", "allowed", "default", "meaning"), rows)]


def _bounds(gain: Any) -> str:
    parts = [(gain.above, "> "), (gain.at_least, ">= "), (gain.at_most, "<= ")]
    bounds = ", ".join(f"{sign}{bound:g}" for bound, sign in parts if bound is not None)
    return gain.describe() + (f", {bounds}" if bounds else "")


def check_law(part: Checked) -> None:
    """The old name of check-part."""
    check_part(part)


COMMANDS = {"parts": parts, "check-part": check_part, "check-law": check_law, "laws": laws, "wheels": wheels}
