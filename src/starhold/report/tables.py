"""Results of studies as CSV files, SI units and radians."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from starhold.files import atomic_write

if TYPE_CHECKING:
    from starhold.scenario.reading import LawEntry
    from starhold.studies.budget import Budget
    from starhold.studies.failures import Failure
    from starhold.studies.modal_roots import Study
    from starhold.synthesis.circle import Station


def write_failures(found: Sequence[Failure], entry: LawEntry, path: Path) -> None:
    """Write all numbers of a study of failures, units in the header; what does not exist is an empty cell, vectors are
    separated by blanks."""
    gains = {f"{item.name} ({item.gain.unit})": item.name for item in entry.law.fields()}
    rows = [
        [*_cells(failure).values(), *(_numbers((failure.gains or {}).get(name)) for name in gains.values())]
        for failure in found
    ]
    _write(path, [[*_cells(found[0]), *gains], *rows])


def write_budget(budget: Budget, path: Path) -> None:
    """Write a pointing budget, one row a source, index and axis."""
    units = {"level": "level (rad)", "mean": "mean (rad)", "deviation": "standard deviation (rad)"}
    rows = budget.records()
    _write(path, [[units.get(name, name) for name in rows[0]], *(map(_numbers, row.values()) for row in rows)])


def write_modal_roots(what: Study, path: Path) -> None:
    """Write a search for roots, one row an angle; with the fits at that angle."""
    head = ["angle", "root", "time", "peak_rate", *(f"peak_acceleration_{axis}" for axis in "xyz")]
    eased = ["eased_root", "eased_time"] if what.eased else []
    fits = {f"{name}_root": pieces.at(what.angles) for name, pieces in what.fits().items()}
    rows: list[list[Any]] = [[*head, *eased, *fits]]
    for place, item in enumerate(what.found):
        row: list[Any] = [item.angle]
        if item.hard is not None:
            flown = item.hard.transient
            row += [item.hard.root, item.hard.time, flown.peak_rate, *flown.peak_acceleration]
        if what.eased and item.eased is not None:
            row += [item.eased.root, item.eased.time]
        rows.append([*row, *(float(values[place]) for values in fits.values())])
    _write(path, rows)


def write_sail(station: Station, path: Path) -> None:
    """Write the sail that a circle takes, one row a rate and reflectivity."""
    from starhold.studies import sail

    columns = sail.reflectivities(station)
    head = ["rate", "period", "peak_scaled", "peak", "pressure", "radius", "specular", "diffuse", "area_per_mass"]
    rows = [
        [*row[:4], station.pressure, station.radius, mirror, min(station.diffuse, 1.0 - mirror), area]
        for row in sail.rows(station, columns)
        for mirror, area in zip(columns, row.areas, strict=True)
    ]
    _write(path, [head, *rows])


def _write(path: Path, rows: Iterable[Iterable[Any]]) -> None:
    with atomic_write(path) as hidden, hidden.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)


def _cells(failure: Failure) -> dict[str, str]:
    known = failure.saturation
    certified = failure.certified or (None, None)
    return {
        "lost wheels": _numbers(failure.lost),
        "controllable axes": str(3 - len(failure.lacking)),
        "directions without authority": "; ".join(map(_numbers, failure.lacking)),
        "condition number": _numbers(failure.condition),
        "torque authority (N m)": _numbers(failure.authority),
        "share of intact authority": _numbers(failure.share),
        "degree of stability intact (1/s)": _numbers(failure.eta_intact),
        "degree of stability after (1/s)": _numbers(failure.eta),
        "settling time (s)": _numbers(failure.settling),
        "diverged at (s)": _numbers(failure.diverged_at),
        "certified turn (rad)": _numbers(certified[0]),
        "certified rate (rad/s)": _numbers(certified[1]),
        "saturation time (s)": _numbers(known and known.time),
        "saturating wheel": _numbers(known and known.wheel),
        "saturation known from": known.known if known else "",
        "window of momentum growth (s)": _numbers(known and known.window),
        "largest share of momentum limit": _numbers(failure.momentum_share),
        "time flown (s)": _numbers(failure.flown),
        "not flown because": failure.refused,
    }


def _numbers(value: Any) -> str:
    if value is None or isinstance(value, str):
        return value or ""
    return " ".join(repr(number) for number in np.asarray(value).ravel().tolist())
