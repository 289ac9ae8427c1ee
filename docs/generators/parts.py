"""The page of all parts but laws."""

from __future__ import annotations

from generators.tables import keys
from starhold.algebra.quantity import quantities
from starhold.parts.catalogue import PACKAGES, parts
from starhold.parts.part import Part


def described_part(part: Part) -> list[str]:
    """A part's card, parameters, and what is recorded of it."""
    card = part.card
    lines = [f"### {part.name}: {card.title}", "", card.summary.replace("*", "\\*"), ""]
    if part.role != "body":
        lines.append(f"* body: {part.body or 'any'}")
    lines += [
        f"* {head}: {'; '.join(told)}" for head, told in (("needs", part.needs), ("assumes", card.assumptions)) if told
    ]
    lines += [f"* sources: {'; '.join(card.sources)}", ""]
    if part.table:
        lines += [f"Given by the `[{part.table}]` table.", ""]
    elif part.role != "body" and part.fields():
        lines += [*keys(part.fields()), ""]
    kind = next((getattr(part.module, n) for n in ("Sample", "Reading", "Estimate") if hasattr(part.module, n)), None)
    if kind is not None and getattr(part.module, "RECORDED", True):
        rows = [f"| `{name}` | {q.unit} | {q.text} |" for name, q in quantities(kind).items()]
        lines += ["| recorded | unit | meaning |", "|---|---|---|", *rows, ""]
    return lines


def page_of_parts() -> str:
    """The page of all other parts."""
    lines = [
        "# Parts",
        "",
        "Written from the parts' own files by `make docs`. A part that names no table here is given by a `[[part]]`",
        "table with its `type` and its keys, see [scenario files](scenarios.md#further-parts). Laws have",
        "[a page of their own](laws.md), and so have [parts of your own](part-authors.md).",
        "",
    ]
    for role, package in PACKAGES.items():
        lines += [f"## {package.rpartition('.')[2].capitalize()}", ""]
        for part in parts(role).values():
            lines += described_part(part)
    return "\n".join(lines)
