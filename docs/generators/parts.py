"""The page of all parts but laws, and a page for each."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from generators.tables import keys, table
from starhold.algebra.quantity import quantities
from starhold.parts.catalogue import PACKAGES, parts
from starhold.parts.part import Part

if TYPE_CHECKING:
    from collections.abc import Callable


def _described(part: Part) -> str:
    """A part's card, parameters, and what is recorded of it."""
    card = part.card
    lines = [f"# {part.name}: {card.title}", "", card.summary.replace("*", "\\*"), "", f"* role: {part.role}"]
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
    return "\n".join([*lines, "All others: [Parts](../parts.md).", ""])


def pages() -> dict[str, Callable[[], str]]:
    """A page for each part, by its path."""
    return {f"parts/{name}.md": partial(_described, part) for role in PACKAGES for name, part in parts(role).items()}


def page() -> str:
    """The page of all parts."""
    lines = [
        "# Parts",
        "",
        "Written from the parts' own files by `make docs`, with a page for each. A part that names no table there",
        "is given by a `[[part]]` table with its `type` and its keys, see [scenario files](scenarios.md#further-parts).",
        "Laws have [pages of their own](laws.md), and so have [parts of your own](part-authors.md).",
        "",
    ]
    for role, package in PACKAGES.items():
        rows = [[f"[`{name}`](parts/{name}.md)", part.card.title, part.card.summary] for name, part in parts(role).items()]
        lines += [f"## {package.rpartition('.')[2].capitalize()}", "", table([role, "", "summary"], rows), ""]
    return "\n".join(lines)
