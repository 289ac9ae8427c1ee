"""Reads a scenario file; whatever is wrong with it becomes one line."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from importlib import resources
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from starhold.errors import InputError
from starhold.laws.catalogue import Law, catalogue
from starhold.parts.craft import Craft, compact, make_craft
from starhold.parts.effectors.envelope import authority
from starhold.parts.effectors.wheels import Wheels, body_inertia
from starhold.scenario.checking import (
    LONGEST_TEXT,
    LawBook,
    Named,
    cut,
    free_name,
    make_gains,
    numbered,
    pick_law,
    read_toml,
    refuse_unstable,
    refusing,
    validate,
)
from starhold.scenario.checking import nearest as nearest
from starhold.scenario.rotors import make_rotors
from starhold.scenario.schema import FaultTable, ScenarioTable, law_model
from starhold.scenario.start import told_to_design

MARK = "libration"
"""The table by which a scenario of station keeping is known."""
LONGEST_PATH = 200
"""Characters of a path that errors show whole."""


@dataclass(frozen=True, repr=False)
class LawEntry(Named):
    """A law with its gains, under the name the file gives it."""

    name: str
    law: Law
    gains: Any
    quaternion_sign: Any = "as_published"
    hysteresis_width: float = 0.5
    form: str | None = None
    spec: Any = None
    """The design form that gave the gains, and its inputs; None where the file gives the gains themselves."""
    fault_action: str | None = None
    """What is done about any fault where this law flies; None: what the fault says."""

    def action_on(self, fault: FaultTable) -> str:
        """What is done about a fault where this law flies."""
        return self.fault_action or fault.action


@dataclass(frozen=True, repr=False)
class Scenario(LawBook[LawEntry]):
    """A scenario file read and checked: its tables, its laws with their gains, its text, what errors call it, and the
    folder that file names in it are relative to."""

    body: ClassVar[str] = "rigid-body"
    table: ScenarioTable
    laws: tuple[LawEntry, ...]
    text: str
    where: str = ""
    folder: Path = Path()
    allow_unstable: bool = False
    """Whether gains that a law tells to be unstable are taken."""

    @cached_property
    def craft(self) -> Craft:
        """The spacecraft; with wheels, its inertia is without the rotors' moments about their own axes."""
        return self.craft_of(self.table.spacecraft.inertia)

    def craft_of(self, inertia: Any) -> Craft:
        """The same spacecraft with another inertia (3, 3; kg m2), its wheels included; ValueError where it cannot be."""
        gravity = {} if self.table.orbit is None else {"gravity": self.table.orbit.gravitational_parameter}
        craft = make_craft(inertia, self.torque_limit(self.wheels), **gravity)
        if self.wheels is None:
            return craft
        rest = body_inertia(inertia, self.wheels)
        return craft._replace(inertia=compact(rest), inverse_inertia=compact(np.linalg.inv(rest)), with_rotors=craft.inertia)

    def torque_limit(self, wheels: Wheels | None) -> float:
        """The torque that a law may reckon with (N m): the limit of [spacecraft], or what these wheels surely give in its
        way (in norm, else about each axis at once) where that is less."""
        own, table = self.table.spacecraft, self.table.wheels
        if wheels is None:
            return own.torque_limit
        peak = table is not None and table.allocation == "least-peak"
        least = authority(wheels, "norm" if own.limit == "norm" else "axis", peak=peak)
        return least if own.limit == "none" else min(own.torque_limit, least)

    @cached_property
    def wheels(self) -> Wheels | None:
        """The reaction wheels, None for a craft without."""
        return make_rotors(self.table.wheels, self.table.wheel)

    @property
    def fault_times(self) -> tuple[float, ...]:
        """When faults happen and are acted on (s)."""
        faults = self.table.fault
        acted = [f.time + f.delay for f in faults if any(law.action_on(f) != "none" for law in self.laws)]
        return tuple(sorted({*(fault.time for fault in faults), *acted}))


def not_turning(where: str) -> InputError:
    """What is said where a scenario of station keeping is not taken."""
    return InputError(where, MARK, "a scenario of station keeping", "here a [spacecraft] that turns")


def builtin_names() -> list[str]:
    """The scenarios that come with starhold."""
    folder = resources.files("starhold.scenario") / "builtin"
    return sorted(item.name.removesuffix(".toml") for item in folder.iterdir() if item.name.endswith(".toml"))


def builtin_text(name: str) -> str:
    """The text of a built-in scenario."""
    return (resources.files("starhold.scenario") / "builtin" / f"{name}.toml").read_text(encoding="utf-8")


def load(source: str | Path, allow_unstable: bool = False) -> Scenario:
    """The scenario in a file, or the built-in one of that name. InputError says what is wrong with it; gains that a law
    tells to be unstable are, unless allowed."""
    return parse(*read_text(source), allow_unstable)


def read_text(source: str | Path) -> tuple[str, str, Path]:
    """The text of a file or of a built-in scenario, what errors call it, and its folder."""
    path, where = Path(source), cut(str(source), LONGEST_PATH)
    try:
        if not path.is_file() and str(source) in builtin_names():
            return builtin_text(str(source)), str(source), Path()
        with path.open(encoding="utf-8") as file:
            # No more than is taken, for a device has no end.
            return file.read(LONGEST_TEXT + 1), where, path.parent
    except FileNotFoundError:
        known = nearest(where, builtin_names())
        raise InputError(where, "", "no such file", f"a scenario file, or a built-in scenario: {known}") from None
    except (OSError, ValueError) as error:
        found = getattr(error, "strerror", None) or type(error).__name__
        raise InputError(where, "", found, "a readable text file") from None


def parse(text: str, where: str, folder: Path = Path(), allow_unstable: bool = False) -> Scenario:
    """The scenario of a TOML text; `where` names it in errors."""
    return read_attitude(read_toml(text, where), text, where, folder, allow_unstable)


def read_attitude(data: dict[str, Any], text: str, where: str, folder: Path, allow_unstable: bool) -> Scenario:
    """The same of the tables that a text holds."""
    if MARK in data:
        raise not_turning(where)
    laws = data.get("law")
    rest = {key: value for key, value in data.items() if key != "law"}
    table = validate(ScenarioTable, rest, where, "", extra=["law"])
    scenario = Scenario(table, (), text, where, folder)
    try:
        _ = scenario.craft
    except ValueError as error:
        raise InputError(where, "wheel" if table.wheels or table.wheel else "spacecraft", "", str(error)) from None
    entries: list[LawEntry] = []
    for key, item in numbered(laws, where):
        entries.append(_read_law(item, scenario, key, {entry.name for entry in entries}, allow_unstable))
    return Scenario(table, tuple(entries), text, where, folder, allow_unstable)


def _read_law(data: Any, scenario: Scenario, key: str, taken: set[str], allow_unstable: bool) -> LawEntry:
    where = scenario.where
    table, law, form = pick_law(data, catalogue(), scenario.folder, where, key)
    read = validate(law_model(law, form), table, where, key, extra=["file", *(["form"] if law.forms else [])])
    values = [getattr(read, item.name) for item in law.fields(form)]
    with refusing(law, where, key):
        spec = (
            None
            if form is None
            else law.complete(law.forms[form](*values), lambda: told_to_design(scenario, read.quaternion_sign))
        )
    gains = make_gains(law, values, spec, scenario.craft, where, key)
    if not allow_unstable:
        refuse_unstable(lambda: law.check(gains, scenario.craft), where, key)
    name = free_name(read.name, law.name, taken, where, key)
    return LawEntry(name, law, gains, read.quaternion_sign, read.hysteresis_width, form, spec, read.fault_action)
