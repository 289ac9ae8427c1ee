"""Results of studies as CSV files, SI units and radians."""

import csv
from pathlib import Path
from typing import Any

import numpy as np

from starhold.files import atomic_write
from starhold.report.commands import Table


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
