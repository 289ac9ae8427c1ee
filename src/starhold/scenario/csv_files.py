"""Reads tables of numbers from CSV files: torque tables, target histories, telemetry."""

import csv
from pathlib import Path

from starhold.files import read_text


def csv_lines(path: Path) -> list[tuple[int, list[str]]]:
    """Return the lines of a CSV file that are neither empty nor comments: each line's number and its stripped cells. Raises
    OSError, or ValueError where the file is not CSV."""
    try:
        rows = [(k, [cell.strip() for cell in row]) for k, row in enumerate(csv.reader(read_text(path).splitlines()), 1)]
    except csv.Error as error:
        raise ValueError(str(error)) from None
    return [(number, cells) for number, cells in rows if any(cells) and not cells[0].startswith("#")]


def number_in(text: str) -> float | None:
    """Return the number in a cell of a CSV file, or None if it is not a number."""
    try:
        return float(text)
    except ValueError:
        return None
