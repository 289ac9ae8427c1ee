"""Requirements as numbers: bounds on metrics, with their margins."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from numbers import Real
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from starhold.analysis.mode_notes import PEAKS
from starhold.analysis.rigid_body import EXTRAS, Cone
from starhold.errors import InputError, input_at
from starhold.parts.orbit import period_of
from starhold.scenario.checking import nearest, show
from starhold.scenario.requirement import BEGINS, CONE, RequirementTable, column_of, is_of_a_part
from starhold.scenario.units import shown, to_number

if TYPE_CHECKING:
    from starhold.scenario.reading import Scenario

ORBITS = re.compile(r"([0-9]+(?:\.[0-9]+)?) ?orbits?")
"""Matches a time in orbits of the flight."""
LOST = "lost"
"""The name, beside metrics and the exclusion-cone, of the requirement that the motion does not diverge."""


@dataclass(frozen=True)
class Requirement:
    """A bound on a metric, in its unit (SI), that a `share` of the flights must meet, shown with a `confidence`. column: the
    name of the measured metric; at_most: whether the bound is the largest value allowed, not the least."""

    name: str
    metric: str
    column: str
    unit: str
    bound: float
    at_most: bool
    share: float
    confidence: float

    def margins(self, metrics: Mapping[str, NDArray[np.float64]]) -> NDArray[np.float64]:
        """Return the margin (n,) of each run, in the metric's unit: 0 or more where it meets the bound, minus infinity where
        it has no such value. For the requirement "not lost" it is 1 or minus infinity."""
        if self.metric == LOST:
            return np.where(np.isnan(metrics["diverged_at"]), 1.0, -np.inf)
        values = metrics[self.column]
        margins = self.bound - values if self.at_most else values - self.bound
        return np.where(np.isnan(margins), -np.inf, margins)

    def __str__(self) -> str:
        if self.metric == LOST:
            return "not lost"
        return f"{self.metric} {'at most' if self.at_most else 'at least'} {self.bound:.6g} {shown(self.unit)}"


def cones_of(tables: Iterable[RequirementTable]) -> dict[str, Cone]:
    """Return the exclusion cones of requirements, by the names of their metrics; axes and directions have unit length."""
    cones = [table for table in tables if table.metric == CONE]
    return {column_of(table): Cone(_unit(table.axis), _unit(table.direction)) for table in cones}


def extras_of(tables: Iterable[RequirementTable], more: Sequence[str]) -> tuple[str, ...]:
    """Return the additional metrics, or kinds of metrics, to measure: those requested and those required."""
    wanted = {
        *more,
        *(extra for table in tables for extra in EXTRAS if extra in str(table.metric) and not is_of_a_part(table)),
    }
    return tuple(extra for extra in (*EXTRAS, *sorted(wanted - {*EXTRAS})) if extra in wanted)


def tables_of(scenario: Scenario, method: str | None) -> dict[str, RequirementTable]:
    """Return the [[requirement]] tables of a scenario with this method, by their names in errors."""
    numbered = enumerate(scenario.table.requirement, 1)
    return {f"requirement[{number}]": table for number, table in numbered if table.method == method}


def read_requirements(
    tables: Mapping[str, RequirementTable], units: Mapping[str, str], where: str, orbit: float | None = None
) -> tuple[Requirement, ...]:
    """Return the requirements of tables, given by their names in errors; units: those of the metrics that the method
    measures; orbit: the orbital period (s), of which times may be multiples. InputError where a metric is not measured or a
    bound is missing."""
    beside = [LOST, CONE, BEGINS] if {table.method for table in tables.values()} <= {"campaign", "flight"} else []
    requirements: list[Requirement] = []
    for key, table in tables.items():
        metric = str(table.metric)
        column = column_of(table)
        if is_of_a_part(table) and column not in units:
            if metric not in PEAKS:
                raise InputError(
                    where, f"{key}.metric", show(metric), f"{' or '.join(PEAKS)}, of runs in a mode or a window"
                )
            raise InputError(where, f"{key}.in_mode", show(table.in_mode), "a mode of every law that is flown")
        if metric not in (*units, *beside) and column not in units:
            raise InputError(where, f"{key}.metric", show(metric), nearest(metric, [*units, *beside]))
        if metric == BEGINS and table.method == "campaign" and column not in units:
            raise InputError(where, f"{key}.in_mode", show(table.in_mode), "a mode of every law that is flown")
        unit = "s" if metric == BEGINS else units.get(column, "1")
        bound, at_most = _bound(table, unit, where, key, orbit), table.at_least is None
        requirements.append(Requirement(table.called, metric, column, unit, bound, at_most, table.share, table.confidence))
    return tuple(requirements)


def at_most(scenario: Scenario, tables: Mapping[str, RequirementTable], units: Mapping[str, str]) -> tuple[Requirement, ...]:
    """Return the requirements of a method that bounds metrics only from above, as `read_requirements` does."""
    for key, table in tables.items():
        if table.at_least is not None:
            raise InputError(scenario.where, f"{key}.at_least", show(table.at_least), f"at_most, with a {table.method}")
    return read_requirements(tables, units, scenario.where)


class Times(NamedTuple):
    """The times (s) between which a requirement applies, since the start of the flight or of the mode."""

    begin: float = 0.0
    end: float = math.inf

    def __str__(self) -> str:
        if self == Times():
            return ""
        return f" from {self.begin:g} s on" if math.isinf(self.end) else f" from {self.begin:g} s to {self.end:g} s"


def times_of(scenario: Scenario, key: str, table: RequirementTable, duration: float = math.inf) -> Times:
    """Return the times of a requirement. InputError where they are invalid or outside a flight of this duration (s)."""

    def seconds(name: str, value: Any) -> float:
        try:
            time = to_number(value, "s") if isinstance(value, str) else float(value)
        except (ValueError, TypeError) as error:
            raise InputError(scenario.where, f"{key}.{name}", show(value), str(error)) from None
        if not 0.0 <= time <= duration:
            raise InputError(scenario.where, f"{key}.{name}", show(value), f"between 0 s and the flight's {duration:g} s")
        return time

    if table.after is not None:
        return Times(seconds("after", table.after))
    if table.window is None:
        return Times()
    if not isinstance(table.window, list | tuple) or len(table.window) != 2:
        raise InputError(scenario.where, f"{key}.window", show(table.window), "two times")
    times = Times(*(seconds("window", value) for value in table.window))
    if times.begin >= times.end:
        raise InputError(scenario.where, f"{key}.window", show(table.window), "two times, the later one last")
    return times


def orbit_of(scenario: Scenario) -> float | None:
    """Return the orbital period (s) of a scenario; None without a closed orbit."""
    orbit = scenario.orbit
    if orbit is None:
        return None
    position, velocity = orbit.start
    time = period_of(position, velocity, orbit.gravitational_parameter)
    return time if math.isfinite(time) else None


def _bound(table: RequirementTable, unit: str, where: str, key: str, orbit: float | None) -> float:
    side = "at_least" if table.at_most is None else "at_most"
    value = getattr(table, side)
    if table.metric == LOST:
        if value is not None:
            raise InputError(where, f"{key}.{side}", show(value), "no bound, because a motion is lost or not")
        return math.nan
    if table.metric == CONE and (side == "at_most" or value is None):
        raise InputError(where, f"{key}.at_least", show(table.at_least), "the least angle between axis and direction")
    if value is None:
        raise InputError(where, key, "no bound", "at_most or at_least")
    if not isinstance(value, str | Real):
        allowed = f"one number, in {shown(unit)} or with its unit"
        raise InputError(where, f"{key}.{side}", show(value), allowed)
    with input_at(where, f"{key}.{side}", show(value)):
        orbits = ORBITS.fullmatch(value.strip()) if unit == "s" and orbit is not None and isinstance(value, str) else None
        if orbits is not None:
            return float(orbits[1]) * float(orbit or 0.0)
        return to_number(value, unit) if isinstance(value, str) else float(value)


def _unit(vector: Any) -> Any:
    length = math.hypot(*vector)
    return tuple(component / length for component in vector)
