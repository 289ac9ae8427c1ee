"""Reads the attitudes that a target follows from a CSV file or a CCSDS attitude ephemeris message."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from starhold.export.aem import OFF_UNIT, read_aem
from starhold.files import read_text

COLUMNS = ("time", "q0", "q1", "q2", "q3")


def read_history(path: Path) -> tuple[NDArray[np.float64], NDArray[np.float64], str]:
    """Times (n,) in s, quaternions (n, 4), scalar first, and the name of the reference frame, "" for none. Columns that are
    named may stand in any order; without names they are those of COLUMNS. A file that ends in .aem is an attitude ephemeris
    message, whose first epoch is time 0.

    Raises OSError, or ValueError that names the line and what is wrong with it.
    """
    if path.suffix.lower() == ".aem":
        message = read_aem(path)
        return message.times, message.attitudes, message.frame
    rows: list[list[float]] = []
    order = list(range(len(COLUMNS)))
    for number, cells in enumerate(csv.reader(read_text(path).splitlines()), 1):
        cells = [cell.strip() for cell in cells]
        if not any(cells):
            continue
        if not rows and _number(cells[0]) is None:
            order = _order(cells, number)
            continue
        rows.append(_numbers(cells, order, number))
    if len(rows) < 2:
        raise ValueError(f"{len(rows)} rows of numbers")
    table = np.array(rows)
    backwards = np.flatnonzero(np.diff(table[:, 0]) <= 0.0)
    if len(backwards):
        later, earlier = table[backwards[0] + 1, 0], table[backwards[0], 0]
        raise ValueError(f"a time of {later:g} s after one of {earlier:g} s")
    return table[:, 0], table[:, 1:], ""


def _order(names: list[str], line: int) -> list[int]:
    """Where each of COLUMNS stands among the named columns."""
    given = [name.lower() for name in names]
    if sorted(given) != sorted(COLUMNS):
        raise ValueError(f"line {line}: columns {', '.join(names)}")
    return [given.index(name) for name in COLUMNS]


def _numbers(cells: list[str], order: list[int], line: int) -> list[float]:
    if len(cells) != len(COLUMNS):
        raise ValueError(f"line {line}: {len(cells)} columns")
    row: list[float] = []
    for place in order:
        number = _number(cells[place])
        if number is None or not math.isfinite(number):
            raise ValueError(f"line {line}: {cells[place]!r}, which is no finite number")
        row.append(number)
    length = math.hypot(*row[1:])
    if abs(length - 1.0) > OFF_UNIT:
        raise ValueError(f"line {line}: a quaternion of length {length:.6g}")
    return row


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None
