"""Who is best at what."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from starhold.analysis.metrics import MEASURES

ORDER = ("settling_time", "final_attitude_error", "effort")
"""Laws are ranked by these in turn: settled before unsettled, then sooner, then more accurate, then more sparing."""


def columns(results: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """The metrics that some of the laws have, in order."""
    return [metric for metric in MEASURES if any(metric in row for row in results.values())]


def ranked(results: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Names from best to worst."""

    def key(name: str) -> tuple[float, ...]:
        values = [results[name].get(metric) for metric in ORDER]
        lost = results[name].get("diverged_at") is not None
        return (float(lost), *(float("inf") if value is None else float(value) for value in values))

    return sorted(results, key=key)


def winners(results: Mapping[str, Mapping[str, Any]]) -> dict[str, list[str]]:
    """For each metric the names with the least value; nobody wins where all are equal or none has a value."""
    won: dict[str, list[str]] = {}
    for metric in MEASURES:
        values = {name: row[metric] for name, row in results.items() if row.get(metric) is not None}
        values = {name: value for name, value in values.items() if results[name].get("diverged_at") is None}
        least = min(values.values(), default=None)
        best = [name for name, value in values.items() if value == least]
        won[metric] = best if len(values) > 1 and len(best) < len(values) else []
    return won


def shown(metric: str, value: Any) -> str:
    """A metric's value in the unit of its heading; a dash where there is none."""
    if value is None:
        return "—"
    scaled = float(value) * MEASURES[metric].scale
    if metric.startswith("iterations"):
        return f"{int(value)}"
    return f"{scaled:.3g}" if abs(scaled) < 1e3 else f"{scaled:.0f}"
