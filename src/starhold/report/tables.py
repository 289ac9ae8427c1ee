"""Results of studies as CSV files, SI units and radians."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from starhold.files import atomic_write
from starhold.report.commands import Column, Table

if TYPE_CHECKING:
    from starhold.synthesis.circle import Station


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


def write_sail(station: Station, path: Path) -> None:
    """Write the sail that a circle takes, one row a rate and reflectivity."""
    from starhold.studies import sail

    columns = sail.reflectivities(station)
    head = ["rate", "period", "peak_scaled", "peak", "pressure", "radius", "specular", "diffuse", "area_per_mass"]
    rows: list[Sequence[Any]] = [
        [*row[:4], station.pressure, station.radius, mirror, min(station.diffuse, 1.0 - mirror), area]
        for row in sail.rows(station, columns)
        for mirror, area in zip(columns, row.areas, strict=True)
    ]
    write_table(Table([Column(name) for name in head], rows), path)
