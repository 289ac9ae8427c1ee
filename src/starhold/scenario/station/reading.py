"""Reads a scenario of station keeping."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from starhold.analysis.station import Circle, Equilibrium, goal_of
from starhold.errors import InputError
from starhold.laws.catalogue import Law, catalogue
from starhold.laws.l2_circle import peak_demand
from starhold.parts.bodies.libration_point import Libration, Units
from starhold.scenario.checking import (
    LawBook,
    Named,
    free_name,
    make_gains,
    numbered,
    pick_law,
    read_toml,
    refuse_unstable,
    show,
    validate,
)
from starhold.scenario.reading import MARK
from starhold.scenario.schema import law_model
from starhold.scenario.station.schema import LibrationTable, Resources, StationLawTable, StationTable


@dataclass(frozen=True, repr=False)
class StationEntry(Named):
    """A law with its gains and the control it has: the limit and the lag (scaled)."""

    name: str
    law: Law
    gains: Any
    limit: float
    lag: float
    form: str | None = None
    spec: Any = None


@dataclass(frozen=True, repr=False)
class StationScenario(LawBook[StationEntry]):
    """A scenario of station keeping, read and checked."""

    body: ClassVar[str] = "libration-point"
    table: StationTable
    laws: tuple[StationEntry, ...]
    text: str
    where: str = ""
    folder: Path = Path()
    allow_unstable: bool = False

    @property
    def units(self) -> Units:
        """What scaled numbers are worth."""
        return self.table.libration.units

    @property
    def craft(self) -> Libration:
        """The numbers of the libration point, which laws act on."""
        return self.table.libration.plant

    def goal(self, name: str) -> Circle | Equilibrium:
        """What the law of this name makes for."""
        return goal_of(self.pick(name).gains)


def parse_station(text: str, where: str, folder: Path = Path(), allow_unstable: bool = False) -> StationScenario:
    """The scenario of a TOML text; `where` names it in errors."""
    return read_station(read_toml(text, where), text, where, folder, allow_unstable)


def read_station(data: dict[str, Any], text: str, where: str, folder: Path, allow_unstable: bool = False) -> StationScenario:
    """The same of the tables that a text holds."""
    laws = data.get("law")
    # First of all, for it says what the numbers of the other tables are worth.
    point = validate(LibrationTable, data.get(MARK), where, MARK)
    rest = {key: value for key, value in data.items() if key != "law"}
    table = validate(StationTable, rest, where, "", extra=["law"], context=point.units)
    entries: list[StationEntry] = []
    for key, item in numbered(laws, where):
        taken = {entry.name for entry in entries}
        entries.append(_read_law(item, table, where, folder, key, taken, allow_unstable))
    return StationScenario(table, tuple(entries), text, where, folder, allow_unstable)


def _read_law(
    data: Any, table: StationTable, where: str, folder: Path, key: str, taken: set[str], allow_unstable: bool
) -> StationEntry:
    found, law, form = pick_law(data, catalogue("libration-point"), folder, where, key)
    units, plant = table.libration.units, table.libration.plant
    extra = ["file", *(["form"] if law.forms else [])]
    read = validate(law_model(law, form, StationLawTable), found, where, key, extra, units)
    values = [getattr(read, item.name) for item in law.fields(form)]
    spec = None if form is None else law.forms[form](*values)
    gains = make_gains(law, values, spec, plant, where, key)
    if not allow_unstable:
        refuse_unstable(lambda: law.check(gains, plant), where, key)
    limit = _limit(table, read, gains, plant, where, key)
    lag = table.control.lag if read.lag is None else read.lag
    return StationEntry(free_name(read.name, law.name, taken, where, key), law, gains, limit, lag or 0.0, form, spec)


def _limit(table: StationTable, own: Resources, gains: Any, plant: Libration, where: str, key: str) -> float:
    """The largest control (scaled) a law has, by what its own table says or else [control]."""
    said, key = (own.told, key) if own.told else (table.control.told, "control")
    if not said:
        return math.inf
    if table.control.limit_kind == "none":
        raise InputError(where, f"{key}.{next(iter(said))}", show(next(iter(said.values()))), 'limit_kind "norm" or "axis"')
    if "limit" in said:
        return said["limit"]
    ((word, share),) = said.items()
    goal = goal_of(gains)
    if not isinstance(goal, Circle):
        raise InputError(where, f"{key}.{word}", show(share), "limit, for a law without a circle has no peak demand")
    return peak_demand(plant, goal.rate) * goal.radius * (1.0 + share if word == "margin" else 1.0 - share)
