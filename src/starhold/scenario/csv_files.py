"""Reads tables of numbers from CSV files: torque tables, target histories, telemetry."""

import csv
from pathlib import Path

from starhold.files import read_text


def csv_lines(path: Path) -> list[tuple[int, list[str]]]:
    """The lines of a CSV file that are neither empty nor comments: their numbers, and their cells without spaces around.
    Raises OSError, or ValueError where it is no CSV file."""
    try:
        rows = [(k, [cell.strip() for cell in row]) for k, row in enumerate(csv.reader(read_text(path).splitlines()), 1)]
    except csv.Error as error:
        raise ValueError(str(error)) from None
    return [(number, cells) for number, cells in rows if any(cells) and not cells[0].startswith("#")]


def number_in(text: str) -> float | None:
    """Return the number in a cell of a CSV file; None for words."""
    try:
        return float(text)
    except ValueError:
        return None
