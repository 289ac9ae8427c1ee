"""Tables of results as HTML, and as CSV files in SI units and radians."""

import csv
import math
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from starhold.files import atomic_write
from starhold.report.commands import Cell, Table
from starhold.report.proved import swatch

PILLS = {"met": "proved", "missed": "refuted", "not decided": "undecided"}
"""The style of each outcome."""


def table_html(table: Table, kind: str = "", fit: bool = False) -> str:
    """Make a table that scrolls where it is too wide; with `fit` it is no wider than its contents."""
    sides = [' class="number"' if column.format else ' class="words"' for column in table.columns]
    heads = "".join(
        f'<th scope="col"{side}>{escape(column.name)}{f"<small>{escape(column.unit)}</small>" if column.unit else ""}</th>'
        for column, side in zip(table.columns, sides, strict=True)
    )
    rows = "".join(f"<tr>{''.join(map(_cell, row, sides))}</tr>\n" for row in table.rows)
    opened = f'<div class="wide{" fit" if fit else ""}"><table class="{kind or "told"}">'
    return f"{opened}<thead><tr>{heads}</tr></thead>\n<tbody>{rows}</tbody></table></div>"


def titled(title: str, table: Table) -> str:
    """Make a section of a table of laws."""
    return f"<h2>{title}</h2>\n{table_html(table, 'text')}"


def _cell(value: Any, side: str) -> str:
    text = escape(f"{value}")
    if not isinstance(value, Cell):
        return f"<td{side}>{text}</td>"
    if value.kind == "shade":
        return f'<td style="background:rgba({value.detail},{0.05 + 0.65 * min(abs(value.number), 1.0):.2f})">{text}</td>'
    if value.kind == "share":
        width = 100.0 * min(max(value.number, 0.0), 1.0) if math.isfinite(value.number) else 0.0
        return f'<td class="words bar">{text}<i style="width:{width:.1f}%"></i></td>'
    if value.kind == "name":
        return f'<th scope="row">{swatch(int(value.number))}{text}</th>'
    if value.kind == "law":
        return f'<td class="words whose">{swatch(int(value.number))}{text}</td>'
    title = f' title="{escape(value.detail)}"' if value.detail else ""
    return f"<td{side}{title}>{code(value.text) if value.kind == 'typed' else pill(value.kind) or text}</td>"


def pill(outcome: str) -> str:
    """Show an outcome in its colour; nothing where there is none."""
    return f'<span class="outcome {PILLS[outcome]}">{outcome}</span>' if outcome in PILLS else ""


def code(text: str) -> str:
    """Show a text to be typed, escaped; a click selects all of it."""
    return f'<code class="copy">{escape(text)}</code>' if text else ""


def note(text: str) -> str:
    """Show a text as a note, escaped; nothing where it is empty."""
    return f'<p class="note">{escape(text)}</p>' if text else ""


def write_table(table: Table, path: Path) -> None:
    """Write a table with all digits, units in the header; what does not exist is an empty cell, vectors are separated by
    blanks."""
    with atomic_write(path) as hidden, hidden.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([table.heads(), *(map(cell, row) for row in table.rows)])


def cell(value: Any) -> str:
    """A value with all digits."""
    if value is None or isinstance(value, str):
        return value or ""
    return " ".join(repr(number) for number in np.asarray(value).ravel().tolist())
