"""Scenarios of a craft that keeps its station near a libration point, recognized by their [libration] table."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from starhold.algebra.scalar import is_finite
from starhold.algebra.vector import ZERO, add, dot, norm
from starhold.analysis.libration_point import CircleGoal, goal_of
from starhold.errors import InputError
from starhold.laws.l2_circle import peak_demand
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.bodies.libration_point import Libration, PointMeasurement, PointState, Units
from starhold.parts.catalogue import fit
from starhold.scenario.bodies.interface import Body
from starhold.scenario.bodies.libration_point.tables import LibrationPointTable, LibrationTable, PointLawTable
from starhold.scenario.checking import show, validate

if TYPE_CHECKING:
    from starhold.scenario.reading import LawEntry, Scenario

EXAMPLE = """\
name = "written"
[libration]
[control]
limit = 4.0
[initial]
position = [0.0, 0.5, 0.1]
[simulation]
duration = 0.1
"""
NEAR = 0.4
"""The default divergence bound, as a share of the distance to the nearer body."""


class Made(NamedTuple):
    """The scaled numbers of a libration point and their units."""

    craft: Libration


class Options(NamedTuple):
    """The control available to a law: its limit, infinite if there is none, and its lag (scaled)."""

    limit: float
    lag: float


class LibrationPoint(Body):
    """A craft near a libration point."""

    name = "libration-point"
    marker = "libration"
    tables = LibrationPointTable
    law_table = PointLawTable
    example = EXAMPLE

    def context(self, tables: Mapping[str, Any], where: str) -> Units:
        return validate(LibrationTable, tables[self.marker], where, self.marker).units

    def make(self, table: LibrationPointTable, where: str) -> Made:
        return Made(table.libration.plant)

    def options(self, scenario: Scenario, law_table: PointLawTable, gains: Any, key: str) -> Options:
        lag = scenario.table.control.lag if law_table.lag is None else law_table.lag
        return Options(_limit(scenario, law_table, gains, key), lag or 0.0)

    def given(self, scenario: Scenario, entry: LawEntry) -> dict[str, Any]:
        table, plant, options = scenario.table, scenario.craft, entry.options
        field = "linear-gravity" if table.libration.model == "linear" else "three-body-gravity"
        surfaces = (fit("actuator", "lag", options.lag),) if options.lag > 0.0 else ()
        return {
            "start": _start(scenario, entry),
            "parts": (fit("environment", field), *surfaces, *scenario.parts),
            "limit": "none" if math.isinf(options.limit) else table.control.limit_kind,
            "command_limit": options.limit,
            "divergence_bound": table.simulation.lost_beyond or NEAR * min(abs(plant.from_smaller), abs(plant.from_larger)),
        }

    def examine(self, scenario: Scenario, entry: LawEntry, loop: ClosedLoop) -> None:
        away = norm(loop.start.position)
        if away >= loop.divergence_bound:
            allowed = f"less than lost_beyond, {loop.divergence_bound:.6g}"
            raise InputError(scenario.where, "initial.position", f"a start {away:.6g} away", allowed)
        # A law that uses all the control available cannot do without a limit.
        measurement = PointMeasurement(loop.start.position, loop.start.velocity, loop.period, entry.options.limit)
        command, _ = loop.law.command(measurement, entry.gains, loop.known, loop.carry().memory)
        if not is_finite(dot(command, command)):
            allowed = "a limit, margin or deficit: this law uses all the control available"
            raise InputError(scenario.where, f"law {entry.name}", "no limit of the control", allowed)


def _limit(scenario: Scenario, law_table: PointLawTable, gains: Any, key: str) -> float:
    """Return the largest control acceleration (scaled) of a law, from its own table or else from [control]."""
    where, table = scenario.where, scenario.table
    said, key = (law_table.limits, key) if law_table.limits else (table.control.limits, "control")
    if not said:
        return math.inf
    if table.control.limit_kind == "none":
        raise InputError(where, f"{key}.{next(iter(said))}", show(next(iter(said.values()))), 'limit_kind "norm" or "axis"')
    if "limit" in said:
        return said["limit"]
    ((word, share),) = said.items()
    goal = goal_of(gains)
    if not isinstance(goal, CircleGoal):
        raise InputError(where, f"{key}.{word}", show(share), "limit, because a law without a circle has no peak demand")
    return peak_demand(scenario.craft, goal.rate) * goal.radius * (1.0 + share if word == "margin" else 1.0 - share)


def _start(scenario: Scenario, entry: LawEntry) -> PointState:
    """Return the initial state; control surfaces with a lag start at zero control."""
    start = scenario.table.initial
    if start.relative_to == "point":
        return PointState(start.position, start.velocity, ZERO)
    position, velocity = goal_of(entry.gains).at(start.phase)
    return PointState(add(position, start.position), add(velocity, start.velocity), ZERO)


BODY = LibrationPoint()
