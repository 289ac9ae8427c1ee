"""Finds the laws: modules of this package with a `CARD`, the entry points `starhold.laws` of other packages, and files."""

from __future__ import annotations

import hashlib
import importlib.util
import linecache
import pkgutil
import sys
import warnings
from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path
from traceback import extract_tb
from types import ModuleType
from typing import Any, ClassVar, TypeVar

import starhold.laws
from starhold.laws.interface import Card, Craft, Field, NoMemory, Start, fields


@dataclass(frozen=True)
class Law:
    """A law file as an object; its name is the file's, with hyphens."""

    equation: ClassVar[str] = "torque"
    """What the module calls the law itself; by it kinds of laws are told apart."""

    name: str
    module: ModuleType
    file: Path | None = None
    """Where it was read from; None for a law that is installed."""

    @property
    def card(self) -> Card:
        return self.module.CARD

    @property
    def gains(self) -> Any:
        """The class of the gains, a NamedTuple."""
        return self.module.Gains

    @property
    def torque(self) -> Callable[..., Any]:
        """The equation of the control torque."""
        return self.module.torque

    @property
    def lyapunov(self) -> Callable[..., Any] | None:
        """The equation of the Lyapunov function, where the law has one."""
        return getattr(self.module, "lyapunov", None)

    @property
    def forms(self) -> dict[str, Any]:
        """Design forms: name to the NamedTuple class of its inputs."""
        return getattr(self.module, "FORMS", {})

    def fields(self, form: str | None = None) -> list[Field]:
        """The gains in order, or the inputs of a design form."""
        return fields(self.gains if form is None else self.forms[form])

    def examples(self) -> list[Any]:
        """Gains that tests, docs and benchmarks run."""
        return self.module.examples()

    def complete(self, spec: Any, start: Callable[[], Start]) -> Any:
        """The inputs of a design form, with what they leave to the scenario, which `start` tells."""
        teller = getattr(self.module, "complete", None)
        return spec if teller is None else teller(spec, start)

    def design(self, craft: Craft, spec: Any) -> Any:
        """Gains from the inputs of a design form."""
        return self.module.design(craft, spec)

    def explain(self, craft: Craft, spec: Any) -> list[tuple[str, Any]]:
        """What a design can be judged by, name and value; empty for a law that has nothing to add."""
        teller = getattr(self.module, "explain", None)
        return [] if teller is None else teller(craft, spec)

    def check(self, gains: Any) -> None:
        """ValueError where gains, each within its bounds, make a loop that cannot be stable; not every law can tell."""
        teller = getattr(self.module, "check", None)
        if teller is not None:
            teller(gains)

    def remember(self, gains: Any, craft: Any, period: float) -> Any:
        """The memory at the start of a run, made anew for each trajectory."""
        maker = getattr(self.module, "remember", None)
        return NoMemory() if maker is None else maker(gains, craft, period)

    def counters(self, memory: Any) -> tuple[int, ...] | None:
        """Tell what a law that iterates has counted: calls, iterations in all, the most in a call, calls that ended
        without the optimum; None for other laws."""
        teller = getattr(self.module, "counters", None)
        return None if teller is None else teller(memory)


AnyLaw = TypeVar("AnyLaw", bound=Law)


@cache
def catalogue() -> dict[str, Law]:
    """All attitude laws that are installed, by name. One of another package that does not load is left out, with a warning
    that names it."""
    return installed(starhold.laws.__name__, Law)


def installed(package: str, kind: type[AnyLaw]) -> dict[str, AnyLaw]:
    """The laws of a kind by name: those of a package of starhold, and those that other packages offer."""
    modules = pkgutil.iter_modules(import_module(package).__path__, f"{package}.")
    loaded = [import_module(entry.name) for entry in modules if _declares_card(entry.name)]
    found = [_as_law(module, kind) for module in loaded if hasattr(module, kind.equation)]
    for point in entry_points(group="starhold.laws"):
        try:
            module = point.load()
        except Exception as error:
            # Told with the attitude laws, once.
            if kind is Law:
                _leave_out(point.value, error)
            continue
        if hasattr(module, "control") != (kind.equation == "control"):
            continue
        try:
            law: Any = _as_law(module, kind)
            if law.name in {known.name for known in found}:
                raise ValueError(f"a law named {law.name} exists already")
            found.append(law)
        except ValueError as error:
            _leave_out(point.value, error)
    return {law.name: law for law in sorted(found, key=lambda law: law.name)}


def _leave_out(what: str, error: Exception) -> None:
    warnings.warn(f"the law {what} is left out: {told(error)}", stacklevel=4)


@contextmanager
def adopted(law: Law, known: dict[str, Any] | None = None) -> Generator[None]:
    """Make a law from a file known by its name for a while, among the attitude laws or `known` ones of its own kind."""
    known = catalogue() if known is None else known
    before = known.get(law.name)
    known[law.name] = law
    try:
        yield
    finally:
        del known[law.name]
        if before is not None:
            known[law.name] = before


_READ: dict[tuple[Path, str], ModuleType] = {}
_FROM_FILES: dict[str, Law] = {}


def known_law(name: str) -> Law | None:
    """The attitude law of this name: one that is installed, else the one read last from a file so called."""
    found = catalogue().get(name, _FROM_FILES.get(name))
    return found if found is None or found.equation == Law.equation else None


def from_file(path: Path, known: Mapping[str, AnyLaw] | None = None, kind: type[AnyLaw] = Law) -> AnyLaw:
    """The law in a file, which is run for it. `known`: the laws that are installed, of which it may be one.

    ValueError, one line, where the file is none of Python, fails, lacks a part of the interface, or has the name of another
    law that is installed. OSError where it cannot be read.
    """
    known, path = known or {}, path.resolve()
    same = next((law for law in known.values() if _is_of(law, path)), None)
    if same is not None:
        return same
    name = path.stem.replace("_", "-")
    if name in known and known[name].file is None:
        raise ValueError(f"a law named {name} is installed already; rename the file")
    law = _FROM_FILES[name] = _as_law(read_module(path), kind, path)
    return law


def read_module(path: Path) -> ModuleType:
    """A file of Python run as a module, again where its text has changed. Errors as of `from_file`."""
    path = path.resolve()
    source = path.read_bytes()
    if path.suffix != ".py":
        raise ValueError("a law's file ends in .py")
    key = (path, hashlib.sha256(source).hexdigest())
    if key in _READ:
        return _READ[key]
    # A name of its own, so that a file called random.py does not hide the library's, nor one text of a file another.
    place = hashlib.sha256(str(path).encode(errors="replace")).hexdigest()
    module = ModuleType(f"starhold_law_{path.stem}_{place[:8]}_{key[1][:8]}")
    module.__file__ = str(path)
    linecache.checkcache(str(path))
    # Registered so that its NamedTuples can be found by their module name.
    sys.modules[module.__name__] = module
    try:
        exec(compile(source, str(path), "exec", dont_inherit=True), module.__dict__)
    except (Exception, SystemExit) as error:
        del sys.modules[module.__name__]
        raise ValueError(told(error, path)) from None
    _READ[key] = module
    return module


def told(error: BaseException, path: Path | None = None) -> str:
    """An error in one line, with the line of a file that it comes from."""
    lines = [frame.lineno for frame in extract_tb(error.__traceback__) if path and frame.filename == str(path)]
    place = f"{path.name}, line {lines[-1]}: " if path and lines else ""
    return f"{place}{type(error).__name__}: {' '.join(str(error).split())}"


def _is_of(law: Law, path: Path) -> bool:
    return law.file is None and law.module.__file__ is not None and Path(law.module.__file__).resolve() == path


def _declares_card(name: str) -> bool:
    spec = importlib.util.find_spec(name)
    origin = None if spec is None else spec.origin
    return origin is not None and "\nCARD = " in Path(origin).read_text(encoding="utf-8")


def _as_law(module: ModuleType, kind: type[AnyLaw], path: Path | None = None) -> AnyLaw:
    missing = [name for name in ("CARD", "Gains", kind.equation, "examples") if not hasattr(module, name)]
    if missing:
        raise ValueError(f"{module.__file__}: a law needs {', '.join(missing)}")
    law = kind((module.__name__.rpartition(".")[2] if path is None else path.stem).replace("_", "-"), module, path)
    try:
        for form in (None, *law.forms):
            law.fields(form)
    except (AttributeError, NameError, TypeError) as error:
        raise ValueError(f"{module.__file__}: {error}") from None
    if not isinstance(module.CARD, Card):
        raise ValueError(f"{module.__file__}: CARD is not a Card of starhold.laws.interface")
    return law
