"""Scenarios of a craft that keeps its station near a libration point, known by their [libration] table."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from starhold.analysis.libration_point import CircleGoal, goal_of
from starhold.errors import InputError
from starhold.laws.catalogue import Law, catalogue
from starhold.laws.l2_circle import peak_demand
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.bodies.libration_point import Libration, Units
from starhold.scenario.bodies.interface import Body
from starhold.scenario.bodies.libration_point.building import build, check_start
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


class Made(NamedTuple):
    """The numbers of a libration point."""

    craft: Libration


class Options(NamedTuple):
    """The control that a law has: its limit, infinite for none, and its lag (scaled)."""

    limit: float
    lag: float


class LibrationPoint(Body):
    """A craft near a libration point."""

    name = "libration-point"
    marker = "libration"
    tables = LibrationPointTable
    law_table = PointLawTable
    example = EXAMPLE

    def laws(self) -> Mapping[str, Law]:
        return catalogue("libration-point")

    def context(self, tables: Mapping[str, Any], where: str) -> Units:
        return validate(LibrationTable, tables[self.marker], where, self.marker).units

    def make(self, table: LibrationPointTable, where: str) -> Made:
        return Made(table.libration.plant)

    def options(self, scenario: Scenario, own: PointLawTable, gains: Any, key: str) -> Options:
        lag = scenario.table.control.lag if own.lag is None else own.lag
        return Options(_limit(scenario, own, gains, key), lag or 0.0)

    def build(self, scenario: Scenario, entry: LawEntry) -> ClosedLoop:
        return build(scenario, entry)

    def examine(self, scenario: Scenario, entry: LawEntry, loop: ClosedLoop) -> None:
        check_start(scenario, entry, loop)


def _limit(scenario: Scenario, own: PointLawTable, gains: Any, key: str) -> float:
    """The largest control (scaled) a law has, by what its own table says or else [control]."""
    where, table = scenario.where, scenario.table
    said, key = (own.told, key) if own.told else (table.control.told, "control")
    if not said:
        return math.inf
    if table.control.limit_kind == "none":
        raise InputError(where, f"{key}.{next(iter(said))}", show(next(iter(said.values()))), 'limit_kind "norm" or "axis"')
    if "limit" in said:
        return said["limit"]
    ((word, share),) = said.items()
    goal = goal_of(gains)
    if not isinstance(goal, CircleGoal):
        raise InputError(where, f"{key}.{word}", show(share), "limit, for a law without a circle has no peak demand")
    return peak_demand(scenario.craft, goal.rate) * goal.radius * (1.0 + share if word == "margin" else 1.0 - share)


BODY = LibrationPoint()
