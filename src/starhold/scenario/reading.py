"""Reads a scenario file; whatever is wrong with it becomes one line."""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from importlib import resources
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np
from pydantic import BaseModel, ValidationError

from starhold.errors import InputError
from starhold.laws.catalogue import Law, catalogue
from starhold.models.craft import Craft, compact, make_craft
from starhold.models.wheels import Wheels, body_inertia
from starhold.scenario.rotors import make_rotors
from starhold.scenario.schema import LawTable, ScenarioTable, law_model
from starhold.scenario.start import angle_at_start

_Model = TypeVar("_Model", bound=BaseModel)


@dataclass(frozen=True)
class LawEntry:
    """A law with its gains, under the name the file gives it."""

    name: str
    law: Law
    gains: Any
    double_cover: Any = "as_published"
    hysteresis_width: float = 0.5
    form: str | None = None
    spec: Any = None
    """The design form that gave the gains, and its inputs; None where the file gives the gains themselves."""


@dataclass(frozen=True)
class Scenario:
    """A scenario file read and checked: its tables, its laws with their gains, its text, what errors call it, and the
    folder that file names in it are relative to."""

    table: ScenarioTable
    laws: tuple[LawEntry, ...]
    text: str = field(repr=False)
    where: str = ""
    folder: Path = Path()

    @property
    def name(self) -> str:
        """The scenario's name."""
        return self.table.name

    @cached_property
    def craft(self) -> Craft:
        """The spacecraft; with wheels, its inertia is without the rotors' moments about their own axes."""
        return self.craft_of(self.table.spacecraft.inertia)

    def craft_of(self, inertia: Any) -> Craft:
        """The same spacecraft with another inertia (3, 3; kg m2), its wheels included; ValueError where it cannot be."""
        gravity = {} if self.table.orbit is None else {"gravity": self.table.orbit.gravitational_parameter}
        craft = make_craft(inertia, self.table.spacecraft.torque_limit, **gravity)
        if self.wheels is None:
            return craft
        rest = body_inertia(inertia, self.wheels)
        return craft._replace(inertia=compact(rest), inverse_inertia=compact(np.linalg.inv(rest)), with_rotors=craft.inertia)

    @cached_property
    def wheels(self) -> Wheels | None:
        """The reaction wheels, None for a craft without."""
        return make_rotors(self.table.wheels, self.table.wheel)

    @property
    def fault_times(self) -> tuple[float, ...]:
        """When faults happen and are acted on (s)."""
        acted = [fault.time + fault.delay for fault in self.table.fault if fault.action != "none"]
        return tuple(sorted({*(fault.time for fault in self.table.fault), *acted}))

    def pick(self, name: str) -> LawEntry:
        """The law of this name; InputError names the nearest when there is none."""
        for entry in self.laws:
            if entry.name == name:
                return entry
        raise InputError(self.where, "law", name, nearest(name, [entry.name for entry in self.laws]))


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
    path = Path(source)
    if not path.exists() and str(source) in builtin_names():
        return parse(builtin_text(str(source)), str(source), allow_unstable=allow_unstable)
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        known = nearest(str(source), builtin_names())
        raise InputError(str(source), "", "no such file", f"a scenario file, or a built-in scenario: {known}") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(str(source), "", _reason(error), "a readable text file") from None
    return parse(text, str(source), path.parent, allow_unstable)


def parse(text: str, where: str, folder: Path = Path(), allow_unstable: bool = False) -> Scenario:
    """The scenario of a TOML text; `where` names it in errors."""
    try:
        data: dict[str, Any] = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(where, "", f"not TOML: {error}", "a TOML file") from None
    laws: Any = data.pop("law", None)
    table = _validate(ScenarioTable, data, where, "", extra=["law"])
    if not isinstance(laws, list) or not laws:
        found = "no law" if laws is None else _show(laws)
        raise InputError(where, "law", found, "at least one [[law]] table")
    scenario = Scenario(table, (), text, where, folder)
    try:
        _ = scenario.craft
    except ValueError as error:
        raise InputError(where, "wheel" if table.wheels or table.wheel else "spacecraft", "", str(error)) from None
    entries: list[LawEntry] = []
    for number, item in enumerate(cast(list[Any], laws), 1):
        entries.append(_read_law(item, scenario, f"law[{number}]", {entry.name for entry in entries}, allow_unstable))
    return Scenario(table, tuple(entries), text, where, folder)


def _read_law(data: Any, scenario: Scenario, key: str, taken: set[str], allow_unstable: bool) -> LawEntry:
    where = scenario.where
    if not isinstance(data, dict):
        raise InputError(where, key, _show(data), "a [[law]] table")
    table = cast(dict[str, Any], data)
    kind = table.get("type")
    if not isinstance(kind, str) or kind not in catalogue():
        raise InputError(where, f"{key}.type", _show(kind), nearest(str(kind), list(catalogue())))
    law = catalogue()[kind]
    form = table.get("form")
    if form is not None and (not isinstance(form, str) or form not in law.forms):
        allowed = nearest(str(form), list(law.forms)) if law.forms else f"no form; {law.name} takes its gains"
        raise InputError(where, f"{key}.form", _show(form), allowed)
    read = _validate(law_model(law, form), table, where, key, extra=["form"] if law.forms else [])
    values = [getattr(read, item.name) for item in law.fields(form)]
    spec = None if form is None else law.complete(law.forms[form](*values), lambda: angle_at_start(scenario))
    try:
        gains = law.gains(*values) if form is None else law.design(scenario.craft, spec)
    except ValueError as error:
        raise InputError(where, key, "", str(error)) from None
    try:
        if not allow_unstable:
            law.check(gains)
    except ValueError as error:
        raise InputError(where, key, "", f"{error}; --allow-unstable takes it all the same") from None
    name = _free_name(read, law.name, taken, where, key)
    return LawEntry(name, law, gains, read.double_cover, read.hysteresis_width, form, spec)


def _free_name(read: LawTable, kind: str, taken: set[str], where: str, key: str) -> str:
    if read.name is None:
        numbered = (kind if n == 1 else f"{kind}-{n}" for n in range(1, len(taken) + 2))
        return next(name for name in numbered if name not in taken)
    if read.name in taken:
        raise InputError(where, f"{key}.name", _show(read.name), "a name that no other law of the file has")
    if not all(c.isalnum() or c in "-_. " for c in read.name) or read.name.startswith("."):
        raise InputError(where, f"{key}.name", _show(read.name), "letters, digits, '-', '_', '.' and spaces")
    return read.name


def _validate(model: type[_Model], data: dict[str, Any], where: str, prefix: str, extra: Iterable[str] = ()) -> _Model:
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise _translate(error, model, data, where, prefix, list(extra)) from None


def _translate(
    error: ValidationError, model: type[BaseModel], data: Any, where: str, prefix: str, extra: list[str]
) -> InputError:
    """The first fault pydantic found, in starhold's words."""
    # Unknown keys first: a misspelt key is the reason that the right one is missing.
    fault = min(error.errors(include_url=False), key=lambda e: e["type"] != "extra_forbidden")
    place = [f"[{part + 1}]" if isinstance(part, int) else part for part in fault["loc"]]
    context: dict[str, Any] = fault.get("ctx", {})
    if fault["type"] == "quantity_at":
        place.append(context["key"])
    key = ".".join(part for part in [prefix, *place] if part).replace(".[", "[")
    found = _show(context.get("found", fault.get("input")))
    if fault["type"] == "extra_forbidden":
        known = list(_model_at(model, place[:-1]).model_fields) + (extra if len(place) == 1 else [])
        return InputError(where, key, "an unknown key", nearest(place[-1], known))
    if fault["type"] == "missing":
        return InputError(where, key, "nothing", "this key is required")
    if fault["type"] in ("quantity", "quantity_at"):
        return InputError(where, key, found, str(context["reason"]).removeprefix("must be "))
    return InputError(where, key, found, _plain(fault["msg"]))


def _model_at(model: Any, place: list[str]) -> Any:
    for part in place:
        if part.startswith("["):
            continue
        annotation = model.model_fields[part].annotation
        options = [annotation, *getattr(annotation, "__args__", ())]
        model = next(o for o in options if isinstance(o, type) and issubclass(o, BaseModel))
    return model


def _plain(message: str) -> str:
    text = message.removeprefix("Input should be ").removeprefix("a valid ")
    return text.replace("dictionary or instance of", "table of").replace("boolean", "true or false")


def _show(value: Any) -> str:
    text = f'"{value}"' if isinstance(value, str) else str(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _reason(error: Exception) -> str:
    return getattr(error, "strerror", None) or type(error).__name__


def nearest(word: str, known: list[str]) -> str:
    """The nearest known words first; all of them when none is near."""
    near = difflib.get_close_matches(word, known, n=1, cutoff=0.6)
    return f"did you mean {near[0]}?" if near else f"one of {', '.join(sorted(known))}"
