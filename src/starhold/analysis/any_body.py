"""Metrics of a body of which nothing is known but what is recorded of it, in the units of the recording."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from starhold.analysis.metrics import LAST
from starhold.analysis.ranking import Measure, MetricSet

if TYPE_CHECKING:
    from starhold.simulation.lane import Recording

COMMAND = "command"
"""The recorded quantity that a law asks for."""


def measure(run: Recording) -> dict[str, Any]:
    """Metrics of a run: for each recorded quantity its largest norm in the last quarter, and of the command the peak of its
    components and the integral of its norm. What is final is None for a motion that was lost, at `diverged_at`."""
    lost = run.attrs.get("diverged_at")
    found: dict[str, Any] = {"diverged_at": lost, "cut_off": []}
    for name in _recorded(run):
        size = np.linalg.norm(np.reshape(run[name], (len(run[name]), -1)), axis=1)
        found[f"final_{name}"] = None if lost is not None else float(size[int(len(size) * (1.0 - LAST)) :].max())
        if name == COMMAND:
            found["peak_command"] = float(np.abs(run[name]).max())
            found["effort"] = float(np.sum(size[:-1] * np.diff(run["time"])))
    return found


def metric_set(run: Recording) -> MetricSet:
    """The metrics that `measure` gives of such runs; laws are ranked by their effort."""
    measures: dict[str, Measure] = {}
    for name in _recorded(run):
        unit, meaning, _ = run.columns[name]
        said = f"largest norm in the last quarter; {meaning}"
        measures[f"final_{name}"] = Measure(f"final {name.replace('_', ' ')}", _shown(unit), said)
        if name == COMMAND:
            measures["peak_command"] = Measure("peak command", _shown(unit), "largest component of the command")
            measures["effort"] = Measure("effort", f"{unit} {run.time_unit}", "integral of the command's norm over the run")
    return MetricSet(measures, ("effort",) if "effort" in measures else (), run.time_unit)


def _recorded(run: Recording) -> list[str]:
    # Of quaternions the norm says nothing.
    return [name for name, told in run.columns.items() if name in run.arrays and told.dimension != "quaternion"]


def _shown(unit: str) -> str:
    return "" if unit == "1" else unit
