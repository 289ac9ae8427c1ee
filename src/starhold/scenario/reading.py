"""Reads a scenario file and reports every error in one line."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from importlib import resources
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from starhold.errors import InputError, expect, shortly
from starhold.laws.catalogue import Law
from starhold.loop.slews import Slew
from starhold.parts.part import Fitted
from starhold.scenario.bodies import body_of
from starhold.scenario.bodies.interface import Body, Made
from starhold.scenario.checking import LONGEST_TEXT, cut, free_name, numbered, read_toml, validate
from starhold.scenario.checking import nearest as nearest
from starhold.scenario.element_sets import say_distance, with_orbit
from starhold.scenario.making import changed, plain
from starhold.scenario.modes import has_modes, read_gains, read_modes
from starhold.scenario.parts import read_parts
from starhold.scenario.requirement_files import with_files
from starhold.scenario.schema import APART
from starhold.scenario.writing import toml_text

if TYPE_CHECKING:
    from starhold.scenario.orbit import Orbit

LONGEST_PATH = 200
"""The most characters of a path in errors."""
WHERE = "scenario"
"""The name, in errors, of a scenario that is not from a file."""


@dataclass(frozen=True, repr=False)
class LawEntry:
    """A law of a scenario, with its gains and its name in the file."""

    name: str
    law: Law
    gains: Any
    options: Any
    """The values of the keys that a body adds to law tables besides gains, a NamedTuple."""
    form: str | None = None
    spec: Any = None
    """The design form of the gains, and its inputs; None where the file gives the gains themselves."""
    targets: tuple[Fitted, ...] = ()
    """The target of each mode, for a law whose modes have their own targets."""
    slews: tuple[Slew | None, ...] = ()
    """The slew by which each target is reached when its mode begins."""

    def __repr__(self) -> str:
        return f"<law {self.name}: {self.law.name}, {self.gains}>"


@dataclass(frozen=True, repr=False)
class Scenario:
    """A scenario file, read and checked: its body, its tables, its laws with their gains, its text, its name in errors, and
    the folder to which its file names are relative."""

    hooks: Body
    table: Any
    laws: tuple[LawEntry, ...]
    text: str
    where: str = ""
    folder: Path = Path()
    allow_unstable: bool = False
    """Whether gains are accepted although the law's own check finds them unstable."""
    parts: tuple[Fitted, ...] = ()
    """The parts of the [[part]] tables."""
    supposed: Scenario | None = None
    """The nominal scenario that laws assume and are designed for, without laws; None without a [nominal] table."""

    @property
    def name(self) -> str:
        """The scenario's name."""
        return self.table.name

    @property
    def body(self) -> str:
        """The name of the controlled body."""
        return self.hooks.name

    @cached_property
    def raw(self) -> Mapping[str, Any]:
        """The raw tables of its text."""
        return read_toml(self.text, self.where)

    @cached_property
    def made(self) -> Made:
        """The numbers that the tables define. InputError where they are physically impossible."""
        return self.hooks.make(self.table, self.where)

    @property
    def craft(self) -> Any:
        """The true craft, the numbers of the body that flies."""
        return self.made.craft

    @property
    def orbit(self) -> Orbit | None:
        """The [orbit] table; None without one."""
        return getattr(self.table, "orbit", None)

    @property
    def known(self) -> Scenario:
        """The scenario that laws assume and are designed for: the nominal one, or this one."""
        return self.supposed or self

    @property
    def nominal_craft(self) -> Any:
        """The craft of the nominal model; None without a [nominal] table."""
        return None if self.supposed is None else self.supposed.craft

    def __repr__(self) -> str:
        names = ", ".join(entry.name for entry in self.laws)
        return f"<{type(self).__name__} {self.name}: {names}; {self.table.simulation.steps} control steps>"

    @shortly
    def with_(self, changes: Mapping[str, Any]) -> Scenario:
        """Return the scenario with other values of some keys: {"spacecraft.inertia": [2, 3, 4], "law.pd.k_rate": "0.1 N m
        s"}. The table of a law or part is found by its name, or by its number as "law[1]"; None removes a key. InputError
        as for a file."""
        other = changed(self, changes)
        flown, before = ((s.orbit, s.parts, s.table.simulation.duration) for s in (other, self))
        if flown != before:
            say_distance(other)
        return other

    def _of(self, tables: Mapping[str, Any]) -> Scenario:
        """Return the scenario of other raw tables, read with this one's settings."""
        return read_tables(tables, toml_text(tables), self.where, self.folder, self.allow_unstable)

    @shortly
    def pick(self, name: str | None) -> LawEntry:
        """Return the law of this name, by default the first. InputError, which suggests the nearest name, if none has it."""
        names = [entry.name for entry in self.laws]
        if name is not None and name not in names:
            raise InputError(self.where, "law", name, nearest(name, names))
        return self.laws[0 if name is None else names.index(name)]

    def about(self, body: str) -> Scenario:
        """Return the scenario itself. InputError unless its body has this name."""
        if self.body != body:
            raise InputError(self.where, self.hooks.marker, f"a scenario of a {self.body}", f"here one of a {body}")
        return self


def builtin_names() -> list[str]:
    """Return the names of the built-in scenarios."""
    folder = resources.files("starhold.scenario") / "builtin"
    return sorted(item.name.removesuffix(".toml") for item in folder.iterdir() if item.name.endswith(".toml"))


def builtin_text(name: str) -> str:
    """Return the text of a built-in scenario."""
    return (resources.files("starhold.scenario") / "builtin" / f"{name}.toml").read_text(encoding="utf-8")


def open_scenario(source: Scenario | str | Path) -> Scenario:
    """Return a scenario as it is, or the one that `load` reads from a file or a built-in name."""
    return source if isinstance(source, Scenario) else load(source)


def load(source: str | Path, allow_unstable: bool = False) -> Scenario:
    """Return the scenario in a file, or the built-in one of that name. InputError states the first error in it; gains that
    the law's own check finds unstable are errors unless allowed."""
    return parse(*_read_text(source), allow_unstable)


def _read_text(source: str | Path) -> tuple[str, str, Path]:
    """Return the text of a file or of a built-in scenario, its name in errors, and its folder."""
    allowed = "a scenario, or the name of a file or of a built-in scenario; sh.scenario takes tables"
    expect(source, (str, PathLike), WHERE, allowed)
    path, where = Path(source), cut(str(source), LONGEST_PATH)
    try:
        if not path.is_file() and str(source) in builtin_names():
            return builtin_text(str(source)), str(source), Path()
        with path.open(encoding="utf-8") as file:
            # No more than the limit, because a device file may be endless.
            return file.read(LONGEST_TEXT + 1), where, path.parent
    except FileNotFoundError:
        known = nearest(where, builtin_names())
        raise InputError(where, "", "no such file", f"a scenario file, or a built-in scenario: {known}") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "it is no text in UTF-8"
        raise InputError(where, "", "", f"cannot be read: {reason}") from None


def parse(text: str, where: str, folder: Path = Path(), allow_unstable: bool = False) -> Scenario:
    """Return the scenario of a TOML text; `where` names it in errors."""
    scenario = read_tables(read_toml(text, where), text, where, folder, allow_unstable)
    say_distance(scenario)
    return scenario


@shortly
def make_scenario(tables: Mapping[str, Any], folder: str | Path = ".", allow_unstable: bool = False) -> Scenario:
    """Return the scenario of tables as in a file, {"name": "mine", "spacecraft": {"inertia": [2, 3, 4]}, ..., "law":
    [{"type": "pd", ...}]}. Values are strings, numbers, booleans, dates, lists and tables; tuples and NumPy arrays count as
    lists, a SciPy Rotation as the quaternion of an attitude, and None as absent. File names are relative to `folder`.
    InputError as for a file. The scenario's `with_` makes variants, and its `text` is the text of the file."""
    expect(tables, Mapping, WHERE, 'tables, {"spacecraft": {...}, ...}; sh.load reads a file or a name')
    written = plain(tables, WHERE, "")
    scenario = read_tables(written, toml_text(written), WHERE, Path(folder), allow_unstable)
    say_distance(scenario)
    return scenario


def read_tables(data: Mapping[str, Any], text: str, where: str, folder: Path, allow_unstable: bool) -> Scenario:
    """Return the scenario of the raw tables of a text."""
    body = body_of(data, where, folder)
    data = with_orbit(with_files(data, folder, where), folder, where)
    # First, because it gives the units of scaled numbers in the other tables.
    context = body.context(data, where)
    table = _tables(body, data, where, context)
    parts = read_parts(data.get("part"), body.name, folder, where, table.shared, context)
    scenario = Scenario(body, table, (), text, where, folder, allow_unstable, parts)
    _ = scenario.made
    if table.nominal:
        scenario = replace(scenario, supposed=_supposed(scenario, data, context))
    entries: list[LawEntry] = []
    for key, item in numbered(data.get("law"), where):
        entries.append(_read_law(item, scenario.known, context, key, {entry.name for entry in entries}))
    return replace(scenario, laws=tuple(entries))


def _tables(body: Body, data: Mapping[str, Any], where: str, context: Any) -> Any:
    """Validate all raw tables except those of laws and parts."""
    rest = {key: value for key, value in data.items() if key not in APART}
    return validate(body.tables, rest, where, "", extra=APART, context=context)


def _supposed(scenario: Scenario, data: Mapping[str, Any], context: Any) -> Scenario:
    """Return the nominal scenario, which laws assume: the tables of [nominal] replace the scenario's own."""
    given, known = scenario.table.nominal, [*scenario.hooks.modelled, *scenario.hooks.designed]
    for name in given:
        if name not in known:
            allowed = nearest(name, known) if known else "none, because laws of this body know their craft"
            raise InputError(scenario.where, f"nominal.{name}", "a table that laws are not designed for", allowed)
    other = {name: table for name, table in data.items() if name != "nominal"} | given
    try:
        supposed = replace(scenario, table=_tables(scenario.hooks, other, scenario.where, context))
        _ = supposed.made
    except InputError as error:
        raise InputError(error.where, f"nominal.{error.key}", error.given, error.allowed) from None
    return supposed


def _read_law(data: Any, scenario: Scenario, context: Any, key: str, taken: set[str]) -> LawEntry:
    """Return the law of a raw table, for a scenario without laws as yet; `taken`: names of other laws."""
    body, where = scenario.hooks, scenario.where
    reads = read_modes if has_modes(data, body) else read_gains
    law, form, table, spec, gains, targets, slews = reads(data, scenario, context, key)
    options = body.options(scenario, table, gains, key)
    name = free_name(table.name, law.name, taken, where, key)
    return LawEntry(name, law, gains, options, form, spec, targets, slews)
