"""Metrics of a body known only by its recording, in the units of the recording."""

from collections.abc import Mapping
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from starhold.algebra.quantity import Quantity
from starhold.algebra.scalar import less, maximum, sqrt, where
from starhold.algebra.structure import flatten, leaves, places
from starhold.algebra.vector import most
from starhold.analysis.meter import Meter, Metric, Window, tail_start
from starhold.analysis.ranking import COSTS, Measure, MetricSet
from starhold.simulation.lane import Recording

COMMAND = "command"
"""The recorded quantity of a law's command."""


class Noted(NamedTuple):
    """Notes on a lane: the peak of the command's components and the sum of its norm; per window the largest squared norm of
    each recorded quantity."""

    peak: float
    total: float
    windows: tuple[float, ...]


def make_meter(recorded: Mapping[str, Quantity], steps: int, period: float, clock: str) -> Meter:
    """Return the meter of these recorded quantities, for flights of `steps` control periods, or for as many samples at such
    intervals; clock: the unit of time."""
    recorded = _with_size(recorded)
    first = Noted(0.0, 0.0, (0.0,) * len(recorded))
    rows = places(first)
    windows, table = dict[str, Window](), dict[str, Metric]()
    for row, (name, quantity) in zip(rows.windows, recorded.items(), strict=True):
        windows[name] = Window(row, np.sqrt, quantity.text, quantity.unit)
        table[f"final_{name}"] = Metric(quantity.unit, "root", (row,), since="tail", final=True)
        if name == COMMAND:
            table["peak_command"] = Metric(quantity.unit, "number", (rows.peak,))
            table["effort"] = Metric(f"{quantity.unit} {clock}", "number", (rows.total,), (period,))
    note = _note(tuple(recorded))
    return Meter(first, float(steps), (note, note), table, windows, steps, period, (tail_start(steps),))


def measure(run: Recording) -> dict[str, Any]:
    """Return the metrics of a run: for each recorded quantity its largest norm in the last quarter, and for the command the
    peak of its components and the integral of its norm. Final values are None for a motion that diverged, at
    `diverged_at`."""
    # No metric here depends on a limit.
    return _meter_of(run).of_recording(run, np.inf)


def _meter_of(run: Recording) -> Meter:
    period = run.attrs["control_period"] * run.attrs["record_every"]
    return make_meter(_measured(run), len(run["time"]) - 1, period, run.time_unit)


def metric_set(run: Recording) -> MetricSet:
    """Return the metrics of `measure` for such runs; laws are ranked by their effort."""
    measures: dict[str, Measure] = {}
    for name, (unit, meaning, _) in _measured(run).items():
        said = f"largest norm in the last quarter; {meaning}"
        measures[f"final_{name}"] = Measure(f"final {name.replace('_', ' ')}", _shown(unit), said)
        if name == COMMAND:
            measures["peak_command"] = Measure("peak command", _shown(unit), "largest component of the command")
            measures["effort"] = Measure("effort", f"{unit} {run.time_unit}", "integral of the command's norm over the run")
    units = {"diverged_at": run.time_unit, **_meter_of(run).units, **COSTS}
    return MetricSet(measures, ("effort",) if "effort" in measures else (), run.time_unit, units=units)


def _measured(run: Recording) -> dict[str, Quantity]:
    return _with_size({name: quantity for name, quantity in run.columns.items() if name in run.arrays})


def _with_size(recorded: Mapping[str, Quantity]) -> dict[str, Quantity]:
    # The norm of a quaternion carries no information.
    return {name: quantity for name, quantity in recorded.items() if quantity.dimension != "quaternion"}


def _shown(unit: str) -> str:
    return "" if unit == "1" else unit


@cache
def _note(names: tuple[str, ...]) -> Any:
    """Return the equation of the notes, the same function for all loops that one kernel serves."""

    def note(seen: Noted, quantities: Mapping[str, Any], now: Any, limit: Any, last: Any) -> Noted:
        squares = {name: _square(quantities[name]) for name in names}
        peak, total = seen.peak, seen.total
        if COMMAND in squares:
            peak = maximum(peak, most(tuple(leaves((quantities[COMMAND],)))))
            total = total + where(less(now, last), sqrt(squares[COMMAND]), 0.0)
        windows = tuple(maximum(then, squares[name]) for then, name in zip(seen.windows, names, strict=True))
        return Noted(peak, total, windows)

    return note


def _square(value: Any) -> Any:
    numbers: list[Any] = flatten((value,))
    total = numbers[0] * numbers[0]
    for number in numbers[1:]:
        total = total + number * number
    return total
