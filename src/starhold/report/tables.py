"""Tables of results as HTML, and as CSV files in SI units and radians."""

import csv
import math
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from starhold.files import atomic_write
from starhold.report.commands import OUTCOMES, Cell, Column, Table
from starhold.report.plots import colour

PILLS = {"green": "proved", "red": "refuted", "yellow": "undecided"}
"""The style classes for the colours of outcomes."""


class Markup(str):
    """HTML that a cell shows unchanged, with text from files already escaped."""


def table_html(table: Table, kind: str = "", fit: bool = False, rows: Mapping[int, str] | None = None) -> str:
    """Return a table as HTML, which scrolls if it is too wide; with `fit` it is no wider than its contents. Without column
    names it has no head. rows: attributes of rows by index."""
    headed = any(column.name for column in table.columns)
    sides = [f' class="{"number" if column.format else "words"}"' if headed else "" for column in table.columns]
    # On a narrow screen each cell of such a table has its own line.
    named = [
        f'{side} data-head="{escape(column.name)}"' if "rows" in kind else side
        for side, column in zip(sides, table.columns, strict=True)
    ]
    body = "".join(
        f"<tr{f' {rows[i]}' if rows and i in rows else ''}>{''.join(map(_cell, row, named))}</tr>\n"
        for i, row in enumerate(table.rows)
    )
    head = f"<thead><tr>{''.join(map(_head, table.columns, sides))}</tr></thead>\n" if headed else ""
    return (
        f'<div class="wide{" fit" if fit else ""}"><table class="{kind or "told"}">{head}<tbody>{body}</tbody></table></div>'
    )


def titled(title: str, table: Table) -> str:
    """Return a section with a table below a heading, as HTML."""
    return f"<section><h3>{escape(title)}</h3>\n{table_html(table, 'text')}</section>"


def listed(rows: Sequence[Sequence[Any]]) -> Table:
    """Return a table of these rows without a head."""
    return Table([Column("")] * max(map(len, rows), default=0), rows)


def _head(column: Column, side: str) -> str:
    below = f"<small>{escape(column.unit)}</small>" if column.unit else ""
    meaning = f' title="{escape(column.meaning)}"' if column.meaning else ""
    return f'<th scope="col"{side}{meaning}>{escape(column.name)}{below}</th>'


def _cell(value: Any, side: str) -> str:
    text = value if isinstance(value, Markup) else escape("" if value is None else f"{value}")
    if not isinstance(value, Cell):
        return f"<td{side}>{text}</td>"
    if value.kind == "shade":
        return f'<td style="background:rgba({value.detail},{0.05 + 0.65 * min(abs(value.number), 1.0):.2f})">{text}</td>'
    if value.kind == "share":
        width = 100.0 * min(max(value.number, 0.0), 1.0) if math.isfinite(value.number) else 0.0
        return f'<td class="words bar">{text}<i style="width:{width:.1f}%"></i></td>'
    if value.kind == "name":
        below = f"<small>{escape(value.detail)}</small>" if value.detail else ""
        return f'<th scope="row">{swatch(int(value.number))}{text}{below}</th>'
    if value.kind == "law":
        return f'<td class="words whose">{swatch(int(value.number))}{text}</td>'
    if value.kind == "best":
        return f'<td class="number best">{text}</td>'
    title = f' title="{escape(value.detail)}"' if value.detail else ""
    return f"<td{side}{title}>{code(value.text) if value.kind == 'typed' else pill(value.kind) or text}</td>"


def pill(outcome: str, text: str = "") -> str:
    """Return an outcome, or a text in its place, in the outcome's colour; "" where there is none."""
    style = PILLS.get(OUTCOMES.get(outcome, ""))
    return f'<span class="outcome {style}">{escape(text or outcome)}</span>' if style else ""


def swatch(number: int) -> str:
    """Return a small square in a law's colour."""
    return f'<span class="swatch" style="background:{colour(number)}"></span>'


def code(text: str) -> str:
    """Return a text to be typed, escaped; a click selects all of it."""
    return f'<code class="copy">{escape(text)}</code>' if text else ""


def note(text: str) -> str:
    """Return a text as a note, escaped; "" where it is empty."""
    return f'<p class="note">{escape(text)}</p>' if text else ""


def write_table(table: Table, path: Path) -> None:
    """Write a table as CSV with all digits and units in the header; missing values are empty cells, and spaces separate
    components."""
    with atomic_write(path) as hidden, hidden.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([table.heads(), *(map(cell, row) for row in table.rows)])


def cell(value: Any) -> str:
    """Return a value as text with all digits."""
    if value is None or isinstance(value, str):
        return value or ""
    return " ".join(repr(number) for number in np.asarray(value).ravel().tolist())
