"""Ranks laws by their metrics."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

COSTS = {
    **dict.fromkeys(("cost_median", "cost_worst"), "s"),
    **dict.fromkeys(("solver_calls", "solver_iterations_mean", "solver_iterations_worst", "solver_budget_hits"), "1"),
}
"""Metrics of a law's calls, with their units."""
LATE = " †"
"""The mark after the dash of a time for which a run is too short."""


@dataclass(frozen=True)
class Measure:
    """The presentation of a metric: heading, unit, meaning, the factor from SI to that unit, and whether it is shown if it
    is 0 for all laws; less is better."""

    heading: str
    unit: str
    meaning: str
    scale: float = 1.0
    at_zero: bool = True


class Metrics(dict[str, Any]):
    """The results of a law, a dictionary by name; `units` has the unit of each number, "1" for none."""

    def __init__(self, values: Mapping[str, Any], units: Mapping[str, str]) -> None:
        super().__init__(values)
        self.units = dict(units)


@dataclass(frozen=True)
class MetricSet:
    """The presentation of the results of laws on a body: the metrics shown, for which less is always better; those by which
    laws are ranked in turn; and the unit of time, with its length in seconds."""

    measures: Mapping[str, Measure]
    order: tuple[str, ...]
    clock: str = "s"
    tick: float = 1.0
    units: Mapping[str, str] = field(default_factory=dict[str, str])
    """The units of metrics as computed, including those not shown."""

    def measured(self, row: Mapping[str, Any]) -> Metrics:
        """Return the results of a law with their units."""
        return Metrics(row, {name: self.units[name] for name in row if name in self.units})

    def columns(self, results: Mapping[str, Mapping[str, Any]]) -> list[str]:
        """Return the metrics that some of the laws have, in order."""
        shown = {name: one.at_zero for name, one in self.measures.items()}
        return [name for name, zero in shown.items() if any(name in row and (zero or row[name]) for row in results.values())]

    def ranked(self, results: Mapping[str, Mapping[str, Any]]) -> list[str]:
        """Return the names of the laws from best to worst."""

        def key(name: str) -> tuple[float, ...]:
            values = [results[name].get(metric) for metric in self.order]
            lost = results[name].get("diverged_at") is not None
            return (float(lost), *(float("inf") if value is None else float(value) for value in values))

        return sorted(results, key=key)

    def winners(self, results: Mapping[str, Mapping[str, Any]]) -> dict[str, list[str]]:
        """Return for each metric the names of the laws with the least value; none if all are equal or none has a value."""
        won: dict[str, list[str]] = {}
        for metric in self.measures:
            values = {name: row[metric] for name, row in results.items() if row.get(metric) is not None}
            values = {name: value for name, value in values.items() if results[name].get("diverged_at") is None}
            least = min(values.values(), default=None)
            best = [name for name, value in values.items() if value == least]
            won[metric] = best if len(values) > 1 and len(best) < len(values) else []
        return won

    def shown(self, metric: str, value: Any) -> str:
        """Return a metric's value as text in the unit of its heading; a dash for none."""
        if value is None:
            return "—"
        scaled = float(value) * self.measures[metric].scale
        if metric.startswith("iterations"):
            return f"{int(value)}"
        return f"{scaled:.3g}" if abs(scaled) < 1e3 else f"{scaled:.0f}"

    def moment(self, time: float, digits: int = 6) -> str:
        """Return a time (s) as text with its unit."""
        return f"{time / self.tick:.{digits}g} {self.clock}"

    def cell(self, metric: str, row: Mapping[str, Any]) -> str:
        """Return a result of a law as `shown` does, with a mark if a time is too late to count."""
        return self.shown(metric, row.get(metric)) + (LATE if metric in row.get("cut_off", ()) else "")

    def late(self, results: Mapping[str, Mapping[str, Any]]) -> str:
        """Return the explanation of the mark; empty if no law has one."""
        marked = any(set(row.get("cut_off", ())) & set(self.measures) for row in results.values())
        return (
            f"{LATE.strip()} within its bounds only at the very end of the run, which does not count: fly longer."
            if marked
            else ""
        )

    def headings(self, results: Mapping[str, Mapping[str, Any]]) -> list[str]:
        """Return the headings by which laws with these results are ranked; the first always counts."""
        there = self.columns(results)
        return [self.measures[metric].heading for metric in self.order if metric in there]
