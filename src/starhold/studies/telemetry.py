"""Telemetry: readings, estimates and commands recorded by a satellite, under the names that they have in runs of a
scenario."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from starhold.algebra.quantity import Quantity
from starhold.algebra.structure import flatten
from starhold.errors import InputError
from starhold.export.aem import from_date
from starhold.loop.closed_loop import ClosedLoop, is_recorded
from starhold.parts.epoch import OF_J2000, iso_text
from starhold.scenario.bodies.rigid_body.start import date_of_axes
from starhold.scenario.building import build
from starhold.scenario.checking import nearest
from starhold.scenario.reading import LawEntry, Scenario
from starhold.simulation.lane import recorded
from starhold.simulation.stepper import sensed_of
from starhold.studies.telemetry_files import (
    Array,
    ColumnsTable,
    MappingTable,
    heads_of,
    read_mapping,
    seconds_of,
    table_of,
    values_of,
)

Known: TypeAlias = dict[str, tuple[Quantity, int]]
"""Quantities by name, each with its number of components."""
MISSED = 1.5
"""The number of intervals above which a time step counts as a gap with missing rows."""


class Gaps(NamedTuple):
    """The numbers of rows in a file: present, missing according to the interval, without a time, with a repeated time, and
    out of order; and the interval (s)."""

    rows: int
    missing: int
    timeless: int
    doubled: int
    disordered: int
    interval: float

    @property
    def sentence(self) -> str:
        """A sentence on the rows that are present and missing."""
        words = ("missing", "without a time", "at the time of another", "out of order")
        faults = [f"{count} {word}" for count, word in zip(self[1:5], words, strict=True) if count]
        return f"{self.rows} rows, one every {self.interval:g} s; {', '.join(faults) if faults else 'none missing'}"


@dataclass(frozen=True, repr=False)
class Telemetry:
    """Recorded quantities over time.

    times: (n,) s, increasing. Absolute times count from the scenario's epoch or, if it states none, from the first sample;
    others are those of a run. columns: arrays (n, k), SI, by their names in runs, NaN where nothing is recorded; known: unit
    and meaning of each; gaps: those of each file; absolute: whether times count from an epoch."""

    name: str
    times: Array
    columns: Mapping[str, Array]
    known: Mapping[str, Quantity]
    gaps: Mapping[str, Gaps]
    absolute: bool

    def __repr__(self) -> str:
        return f"<Telemetry {self.name}: {len(self.times)} samples of {', '.join(self.columns)}>"

    @property
    def sentence(self) -> str:
        """Sentences on what was read and what is missing."""
        files = [f"{name} has {gaps.sentence}" for name, gaps in self.gaps.items()]
        counts = {name: int(np.isnan(values).any(axis=1).sum()) for name, values in self.columns.items()}
        empty = [f"{name} in {count}" for name, count in counts.items() if count]
        return ". ".join([*files, *([f"Of {len(self.times)} samples are empty: {', '.join(empty)}"] if empty else [])]) + "."


def quantities_of(loop: ClosedLoop) -> Known:
    """Return the quantities that telemetry of a loop may contain, with their numbers of components: those that runs record,
    and the readings of sensors that they do not."""
    known = {name: (meant, size) for name, meant, size in recorded(loop)}
    for fitted, reading in zip(loop.used("sensor"), sensed_of(loop)[1], strict=True):
        for name, value in {} if is_recorded(fitted.part) else reading._asdict().items():
            meant = known[name][0]._replace(text=f"{name} as {fitted.called} measures it")
            known[f"{fitted.prefix}{name}"] = meant, len(flatten((value,)))
    return known


def check(scenario: Scenario, entry: LawEntry, source: Any, mapping: str | Path | None = None, *_: Any) -> None:
    """Raise InputError where telemetry cannot be read for a law of a scenario."""
    read(scenario, build(scenario, entry), source, mapping)


def read(scenario: Scenario, loop: ClosedLoop, source: Any, mapping: str | Path | None = None) -> Telemetry:
    """Return the telemetry in a file, the folder of a run, or a Dataset of `simulate`, for a loop of a scenario. mapping: a
    file, or the name of a built-in one, with the meaning of the columns; recordings of starhold need none. InputError for an
    unsuitable file, column or unit."""
    import pandas as pd

    known = quantities_of(loop)
    table, where = MappingTable() if mapping is None else read_mapping(mapping), str(mapping)
    for name in table.columns:
        if name not in known:
            raise InputError(where, f"telemetry.columns.{name}", "no quantity of this scenario", nearest(name, [*known]))
    main = Path("the run") if hasattr(source, "data_vars") else Path(source)
    frame, table = table_of(source, main, table)
    columns = _columns(known, table, frame, main)
    absolute = table.time.base not in ("run", "first")
    start = _epoch(scenario) if absolute else 0.0 if table.time.base == "run" else None
    zero, parts, gaps = start, [], dict[str, Gaps]()
    for file in dict.fromkeys(column.file for column in columns.values()):
        place = main.parent / file if file else main
        here = table_of(place, place, table)[0] if file else frame
        seconds = seconds_of(here, table.time, place, where)
        if not np.isfinite(seconds).any():
            raise InputError(str(place), table.time.column, "no time", "a row at least")
        zero = float(np.nanmin(seconds)) if zero is None else zero
        numbers = {n: values_of(here, n, c, known[n], place, where) for n, c in columns.items() if c.file == file}
        each = {(n, k): values[:, k] for n, values in numbers.items() for k in range(values.shape[1])}
        # Floats resolve times since 1970 to better than a microsecond.
        part = pd.DataFrame(each, index=np.round(seconds - zero, 6) if absolute else seconds - zero)
        gaps[place.name], part = _in_order(part, table.interval)
        parts.append(part)
    whole = pd.concat(parts, axis=1).sort_index()
    arrays = {n: whole[n].to_numpy(dtype=float) for n in columns}
    of_date = date_of_axes(scenario) if scenario.body == "rigid-body" else None
    for n, column in columns.items():
        if column.frame == OF_J2000 and of_date is not None:
            arrays[n] = from_date(arrays[n], of_date, back=True)
    meant = {n: known[n][0] for n in columns}
    return Telemetry(main.name, whole.index.to_numpy(dtype=float), arrays, meant, gaps, absolute and start is not None)


def _columns(
    known: Mapping[str, tuple[Quantity, int]], table: MappingTable, frame: Any, path: Path
) -> dict[str, ColumnsTable]:
    """Return the columns of each quantity: those that a mapping names, by default those with starhold's names."""
    named = {name: heads_of(name, *meant) for name, meant in known.items()}
    if table.columns:
        return {n: c if c.columns else c.model_copy(update={"columns": named[n]}) for n, c in table.columns.items()}
    columns = {name: ColumnsTable(columns=heads) for name, heads in named.items() if set(heads) <= {*frame.columns}}
    if not columns:
        allowed = f"a mapping of its columns, or columns such as time, {', '.join(next(iter(named.values())))}"
        raise InputError(str(path), "", f"columns {', '.join(map(str, frame.columns[:8]))}", allowed)
    return columns


def _epoch(scenario: Scenario) -> float | None:
    """Return the start of a scenario's flight, UTC in s since 1970; None where it states no epoch."""
    epoch = scenario.orbit and scenario.orbit.epoch
    return None if epoch is None else float(np.datetime64(iso_text(epoch), "us").astype(float)) * 1e-6


def _in_order(part: Any, interval: float | None) -> tuple[Gaps, Any]:
    """Return the gaps and the table sorted by time, with rows of equal times merged; interval: by default the median time
    step."""
    timed = part[part.index.notna()]
    times = timed.index.to_numpy()
    disordered = int((times < np.maximum.accumulate(times)).sum())
    # Of rows with equal times the first number of each column is taken.
    ordered = timed.groupby(level=0).first()
    steps = np.diff(ordered.index.to_numpy())
    usual = float(interval or (np.median(steps) if len(steps) else 0.0))
    missing = int((np.round(steps[steps > MISSED * usual] / usual) - 1.0).sum()) if usual else 0
    return Gaps(len(part), missing, len(part) - len(timed), len(timed) - len(ordered), disordered, usual), ordered
