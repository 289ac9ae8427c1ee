"""Opens scenarios of every kind."""

from __future__ import annotations

from pathlib import Path
from typing import Any, TypeAlias

from starhold.scenario.checking import read_toml
from starhold.scenario.reading import MARK, Scenario, read_attitude, read_text
from starhold.scenario.schema import attitude_schema
from starhold.scenario.station.reading import StationScenario, read_station
from starhold.scenario.station.schema import station_schema

AnyScenario: TypeAlias = Scenario | StationScenario


def open_scenario(source: str | Path, allow_unstable: bool = False) -> AnyScenario:
    """The scenario in a file, or the built-in one of that name, of whichever kind. InputError says what is wrong with it."""
    return open_text(*read_text(source), allow_unstable)


def open_text(text: str, where: str, folder: Path = Path(), allow_unstable: bool = False) -> AnyScenario:
    """The scenario of a TOML text, of whichever kind; `where` names it in errors."""
    return open_tables(read_toml(text, where), text, where, folder, allow_unstable)


def open_tables(data: dict[str, Any], text: str, where: str, folder: Path, allow_unstable: bool) -> AnyScenario:
    """The same of the tables that a text holds."""
    if MARK in data:
        return read_station(data, text, where, folder, allow_unstable)
    return read_attitude(data, text, where, folder, allow_unstable)


def json_schema() -> dict[str, Any]:
    """A JSON Schema of scenario files of both kinds, for completion and checks in editors."""
    kinds = [attitude_schema(), station_schema()]
    shared: dict[str, Any] = {}
    for kind in kinds:
        shared |= kind.pop("$defs", {})
    title = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "starhold scenario", "type": "object"}
    return {**title, "anyOf": kinds, "$defs": shared}
