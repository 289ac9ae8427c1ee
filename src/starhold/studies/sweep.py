"""Flies a scenario with many values of some of its keys and measures each run."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from starhold.errors import InputError, shortly
from starhold.scenario.checking import show
from starhold.scenario.making import variants
from starhold.scenario.reading import Scenario, open_scenario
from starhold.simulation.batched import Flying, fly_batched
from starhold.studies.compare import build, metrics_of, name_samples
from starhold.studies.frames import frame_of

if TYPE_CHECKING:
    from pandas import DataFrame


@shortly
def sweep(
    scenario: Scenario | str | Path,
    changes: Mapping[str, Iterable[Any]] | Iterable[Mapping[str, Any]],
    law: str | None = None,
    threads: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> DataFrame:
    """Fly a scenario with other values and return a row per run, with the changed keys, `law` and the `metrics`.

    changes: the values of some keys, {"law.pd.k_rate": [0.1, 0.2], "spacecraft.inertia": [...]}, of which every combination
    is flown; or a list of changes as for a scenario's `with_`. law: the law that flies; by default those that the keys name,
    else all. The metrics are those that `compare` measures in the changed scenario, without the cost of calls; nothing is
    certified. Runs that differ only in numbers fly side by side on the lanes of a vector. InputError before the first flight
    where one of the scenarios is invalid."""
    opened = open_scenario(scenario)
    points = _points(opened, changes)
    names = [law] if law is not None else _named(opened, points)
    rows: list[dict[str, Any]] = []
    flown: list[Scenario] = []
    flights: list[Flying] = []
    # All are read before the first flight, so that an error in the last is reported at once.
    for point, other in zip(points, variants(opened, points), strict=True):
        simulation = other.table.simulation
        for name in names:
            loop = build(other, other.pick(name))
            rows.append({**point, "law": name})
            flown.append(other)
            flights.append(Flying(loop, simulation.steps, simulation.record_every))

    def measured(number: int, samples: Any, carry: Any) -> dict[str, Any]:
        return metrics_of(name_samples(flown[number], flights[number].loop, samples, carry))

    results = fly_batched(flights, measured, threads, progress)
    return frame_of([row | metrics for row, metrics in zip(rows, results, strict=True)])


def _points(scenario: Scenario, changes: Any) -> list[dict[str, Any]]:
    """Return the list of changes: the given list, or every combination of the values of the keys."""
    if isinstance(changes, Mapping):
        columns = {key: _values(scenario, key, values) for key, values in changes.items()}
        points = [dict(zip(columns, chosen, strict=True)) for chosen in product(*columns.values())]
    else:
        points = [dict(point) for point in changes]
    if not points or not all(points):
        allowed = 'values of some keys, {"law.pd.k_rate": [0.1, 0.2]}, or a list of changes as `with_` takes them'
        raise InputError(scenario.where, "sweep", "nothing to change", allowed)
    return points


def _values(scenario: Scenario, key: str, values: Any) -> list[Any]:
    if isinstance(values, str | bytes | Mapping) or not isinstance(values, Iterable):
        raise InputError(scenario.where, key, show(values), "a list of values to fly")
    return values.tolist() if isinstance(values, np.ndarray) else list(values)


def _named(scenario: Scenario, points: list[dict[str, Any]]) -> list[str]:
    """Return the names of the laws in the changes; those of all laws where they name none, or name laws by index."""
    keys = {key for point in points for key in point if key.startswith("law")}
    names = [entry.name for entry in scenario.laws]
    about = [name for name in names if any(f"{key}.".startswith(f"law.{name}.") for key in keys)]
    by_place = any(key.startswith("law[") or key == "law" for key in keys)
    return names if by_place or not about else about
