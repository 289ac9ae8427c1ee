"""Finds the parts of each role: modules of the role's package with a `CARD`, entry points `starhold.parts` of other
packages, and files."""

from __future__ import annotations

import hashlib
import importlib.util
import inspect
import linecache
import os
import pkgutil
import sys
import warnings
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoints, entry_points
from pathlib import Path
from traceback import extract_tb
from types import ModuleType
from typing import Any, TypeVar

from starhold.errors import is_interrupt
from starhold.files import read_bytes
from starhold.parts import roles
from starhold.parts.contract import GIVEN, Card
from starhold.parts.part import Fitted, Part
from starhold.parts.roles import ROLES

PACKAGES = {
    "body": "starhold.parts.bodies",
    "effector": "starhold.parts.effectors",
    "environment": "starhold.parts.environments",
    "sensor": "starhold.parts.sensors",
    "estimator": "starhold.parts.estimators",
    "target": "starhold.parts.targets",
    "actuator": "starhold.parts.actuators",
}
"""The packages of starhold's own parts, by role."""
DEMANDED: dict[str, tuple[str, ...]] = {
    "body": ("COMMAND", "State", "Measurement", "Sample", "rates", "renormalised", "is_sound", "observe", "sample"),
    "effector": ("Params", "examples", "reaction", "rates", "momentum"),
    "environment": ("Params", "examples"),
    "sensor": ("Params", "examples", "Reading", "measure"),
    "estimator": ("Params", "examples", "NEEDS", "Estimate", "estimate"),
    "target": ("Params", "examples", "goal"),
    "actuator": ("Params", "examples"),
}
"""The attributes that a part of each role must define, besides `CARD` and `ROLE`."""
EITHER: dict[str, tuple[str, ...]] = {"environment": ("torque", "acceleration"), "actuator": ("command", "rates")}
"""Equations of which parts of a role must define at least one."""
BOUNDS: dict[str, tuple[str, ...]] = {
    "bound": ("params", "envelope"),
    "torque_change": ("params", "craft", "envelope"),
    "noise": ("params", "period"),
    "recursion": ("params", "noise", "period", "rate"),
}
"""Functions with which a part of any role bounds its effect, and their arguments."""
BY_NUMBERS: dict[str, tuple[str, ...]] = {"needs": ("params",), "about": ("params",)}
"""Functions that replace `NEEDS` and `ABOUT` of a part of any role if these depend on its parameters."""

AnyPart = TypeVar("AnyPart", bound=Part)


@cache
def parts(role: str) -> dict[str, Part]:
    """Return all installed parts of a role except laws, by name. A part of another package that does not load is omitted,
    with a warning that names it."""
    return installed(PACKAGES[role], role, as_part)


_BODIES: dict[str, Part] = {}
"""Bodies from files, by name: the last one read under each name."""


def find(role: str, name: str) -> Part:
    """Return the installed part of this role and name, or the body of this name from a file. Raise KeyError if there is
    none."""
    if (part := own_part(PACKAGES[role], name, as_part)) is not None:
        return part
    installed = parts(role)
    return _BODIES[name] if role == "body" and name not in installed else installed[name]


def body_from_file(path: Path) -> Part:
    """Execute a file and return its body, which from then on is found by its name. Errors as in `from_file`."""
    body = from_file(path, parts("body"), as_part)
    if body.role != "body":
        raise ValueError(f"its ROLE must be body, not {body.role}")
    if body.file is not None:
        _BODIES[body.name] = body
    return body


def fit(role: str, name: str, *numbers: Any, called: str = "", start: Any = None) -> Fitted:
    """Return an installed part with these parameters; start: an effector's state. Raise KeyError for an unknown part."""
    part = find(role, name)
    return Fitted(part, part.params(*numbers), called, start)


def telling(readings: Iterable[str]) -> list[Fitted]:
    """Return installed sensors that give these readings, each with the parameters of its first example; one sensor may give
    several readings. Raise LookupError if none gives a reading."""
    chosen: dict[str, Fitted] = {}
    for reading in (one for one in readings if one not in GIVEN):
        sensors = (one for one in parts("sensor").values() if not one.table and reading in one.module.Reading._fields)
        sensor = next(sensors, None)
        if sensor is None:
            raise LookupError(f"no sensor of starhold measures {reading}")
        chosen.setdefault(sensor.name, Fitted(sensor, sensor.examples()[0]))
    return list(chosen.values())


@cache
def _offered() -> Any:
    """Return the entry points of all installed packages. Packages are searched once, not for each role."""
    return entry_points()


def entries(group: str) -> EntryPoints:
    """Return the entry points of all installed packages in a group."""
    return _offered().select(group=group)


def installed(package: str, role: str, make: Callable[..., AnyPart]) -> dict[str, AnyPart]:
    """Return the parts of a role by name: those in `package`, and those that other packages offer."""
    modules = pkgutil.iter_modules(import_module(package).__path__, f"{package}.")
    collected = [part for entry in modules if (part := _of_module(entry.name, make)) is not None]
    for point in entries("starhold.parts"):
        try:
            module = _loaded(point)
        except BaseException as error:
            if is_interrupt(error):
                raise
            # The search for laws warns of it, once.
            if role == "law":
                _leave_out(point.value, error)
            continue
        if role_of(module) != role:
            continue
        try:
            part = make(module)
            if part.name in {known.name for known in collected}:
                raise ValueError(f"a part named {part.name} exists already")
            collected.append(part)
        except ValueError as error:
            _leave_out(point.value, error)
    if role == "law":
        for point in entries("starhold.laws"):
            _leave_out(point.value, ValueError("its entry point is called starhold.laws, now starhold.parts"))
    return {part.name: part for part in sorted(collected, key=lambda part: part.name)}


def own_part(package: str, name: str, make: Callable[..., AnyPart]) -> AnyPart | None:
    """Return starhold's own part of this name, of whose package no other module is loaded; None where there is none, or
    where other packages offer parts: then all are loaded, because some may have to be left out."""
    word = name.replace("-", "_")
    part = _of_module(f"{package}.{word}", make) if word.isidentifier() and alone() else None
    return part if part is not None and part.name == name else None


@cache
def alone() -> bool:
    """Tell whether no other package offers parts."""
    return not (entries("starhold.parts") or entries("starhold.laws"))


@cache
def _of_module(name: str, make: Callable[..., AnyPart]) -> AnyPart | None:
    """Return the part in a module of this name, which is made once; None where it has no card."""
    return make(import_module(name)) if _declares_card(name) else None


def _loaded(point: Any) -> ModuleType:
    module = point.load()
    if role_of(module) not in ROLES:
        raise ValueError(f"no part: its ROLE must be one of {', '.join(ROLES)}")
    return module


def role_of(module: ModuleType) -> str | None:
    """Return the role that a module declares; a module with `Gains` is a law without declaring it."""
    return getattr(module, "ROLE", "law" if hasattr(module, "Gains") else None)


def _leave_out(what: str, error: BaseException) -> None:
    warnings.warn(f"the part {what} is left out: {error_line(error)}", stacklevel=4)


def as_part(module: ModuleType, path: Path | None = None) -> Part:
    """Return the part in a module. Raise ValueError, in one line, if it lacks a part of its role's contract."""
    role = role_of(module)
    if role not in DEMANDED:
        raise ValueError(f"{module.__file__}: ROLE must be one of {', '.join(ROLES)}, not {role!r}")
    part = make(Part, module, path, DEMANDED[role])
    either = EITHER.get(role, ())
    if either and not any(hasattr(module, name) for name in either):
        raise ValueError(f"{module.__file__}: this {role} needs {' or '.join(either)}")
    _check_equations(part)
    if hasattr(module, "Params") and not part.table:
        try:
            part.fields()
        except (AttributeError, NameError, TypeError) as error:
            raise ValueError(f"{module.__file__}: {error}") from None
    return part


def _check_equations(part: Part) -> None:
    """Raise ValueError for an equation, or a bound, that does not take the arguments of its role."""
    acts = part.role in ("actuator", "effector")
    wanted = (
        BOUNDS | BY_NUMBERS | {"late": ("params", "period")} | {"error": ("params", "envelope") if acts else ("params",)}
    )
    protocol: Any = getattr(roles, part.role.capitalize())
    declarations: dict[str, Any] = {**vars(protocol)}
    for name, declared in declarations.items():
        if inspect.isfunction(declared) and not (name == "goal" and part.flag("BY_MODE")):
            wanted[name] = tuple(word for word in inspect.signature(declared).parameters if word != "self")
    for name, words in wanted.items():
        equation: Any = part.hook(name)
        if inspect.isfunction(equation):
            try:
                inspect.signature(equation).bind(*words)
            except TypeError:
                given = ", ".join(inspect.signature(equation).parameters)
                raise ValueError(f"{part.module.__file__}: {name}({given}) must be {name}({', '.join(words)})") from None


def make(kind: type[AnyPart], module: ModuleType, path: Path | None, demanded: tuple[str, ...]) -> AnyPart:
    """Return an object of this kind for a module. Raise ValueError, in one line, if it lacks a demanded attribute."""
    missing = [name for name in ("CARD", *demanded) if not hasattr(module, name)]
    if missing:
        raise ValueError(f"{module.__file__}: this {role_of(module) or 'part'} needs {', '.join(missing)}")
    if not isinstance(module.CARD, Card):
        raise ValueError(f"{module.__file__}: CARD is not a Card of starhold.parts.contract")
    return kind((module.__name__.rpartition(".")[2] if path is None else path.stem).replace("_", "-"), module, path)


_READ: dict[tuple[Path, str], ModuleType] = {}


def from_file(path: Path, known: Mapping[str, AnyPart], make: Callable[..., AnyPart]) -> AnyPart:
    """Execute a file and return its part; known: the installed parts of its role, which may include it.

    Raise ValueError, in one line, if the file is not Python, fails, lacks a part of the contract, or has the name of
    another installed part, and OSError if it cannot be read."""
    path = _real(path)
    same = next((part for part in known.values() if _is_of(part, path)), None)
    if same is not None:
        return same
    name = path.stem.replace("_", "-")
    if name in known and known[name].file is None:
        raise ValueError(f"a part named {name} is installed already; rename the file")
    return make(read_module(path), path)


def read_module(path: Path) -> ModuleType:
    """Run a Python file as a module, and again if its text has changed. Errors as in `from_file`."""
    given, path = path, _real(path)
    source = read_bytes(path)
    # The suffix of the link counts too: a link named like a table is not run.
    if {given.suffix, path.suffix} != {".py"}:
        raise ValueError("a part's file ends in .py")
    key = (path, hashlib.sha256(source).hexdigest())
    if key in _READ:
        return _READ[key]
    # A unique name, so that a file called random.py does not hide the library's module, nor one version of a file another.
    place = hashlib.sha256(str(path).encode(errors="replace")).hexdigest()
    module = ModuleType(f"starhold_part_{path.stem}_{place[:8]}_{key[1][:8]}")
    module.__file__ = str(path)
    linecache.checkcache(str(path))
    # Registered so that its NamedTuples can be found by their module name.
    sys.modules[module.__name__] = module
    try:
        exec(compile(source, str(path), "exec", dont_inherit=True), module.__dict__)
    except BaseException as error:
        del sys.modules[module.__name__]
        if is_interrupt(error):
            raise
        raise ValueError(error_line(error, path)) from None
    _READ[key] = module
    return module


def _real(path: Path) -> Path:
    """Return the path with links resolved; a loop of links stays as it is, so that opening it reports the error."""
    return Path(os.path.realpath(path))


def error_line(error: BaseException, path: Path | None = None) -> str:
    """Return an error in one line, with the line of the file from which it comes."""
    lines = [frame.lineno for frame in extract_tb(error.__traceback__) if path and frame.filename == str(path)]
    place = f"{path.name}, line {lines[-1]}: " if path and lines else ""
    return f"{place}{type(error).__name__}: {' '.join(str(error).split())}"


def _is_of(part: Part, path: Path) -> bool:
    return part.file is None and part.module.__file__ is not None and Path(part.module.__file__).resolve() == path


def _declares_card(name: str) -> bool:
    spec = importlib.util.find_spec(name)
    origin = None if spec is None else spec.origin
    return origin is not None and "\nCARD = " in Path(origin).read_text(encoding="utf-8")
