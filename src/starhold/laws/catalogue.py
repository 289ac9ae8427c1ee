"""Finds the laws: modules of this package with a `CARD`, and the entry points `starhold.laws` of other packages."""

from __future__ import annotations

import importlib.util
import pkgutil
import sys
import warnings
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar, overload

import starhold.laws
from starhold.laws.interface import Card, Craft, Field, NoMemory, fields

INTERFACE = ("CARD", "Gains", "torque", "examples")


@dataclass(frozen=True)
class Law:
    """A law file as an object; its name is the file's, with hyphens."""

    name: str
    module: ModuleType

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

    def complete(self, spec: Any, angle: Callable[[], float]) -> Any:
        """The inputs of a design form, with what they leave to the start of the run: `angle` gives its error angle (rad)."""
        teller = getattr(self.module, "complete", None)
        return spec if teller is None else teller(spec, angle)

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

    def remember(self, gains: Any, craft: Craft, period: float) -> Any:
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
    """All laws by name. A law of another package that does not load is left out, with a warning that names it."""
    found = found_in(starhold.laws.__name__, Law, INTERFACE)
    for point in entry_points(group="starhold.laws"):
        try:
            found.append(_as_law(point.load()))
        except Exception as error:
            reason = " ".join(str(error).split())
            warnings.warn(f"the law {point.value} is left out: {type(error).__name__}: {reason}", stacklevel=2)
    return {law.name: law for law in sorted(found, key=lambda law: law.name)}


def found_in(package: str, kind: type[AnyLaw], interface: tuple[str, ...]) -> list[AnyLaw]:
    """The laws of a package: its modules with a `CARD`, which must have all of an interface."""
    modules = pkgutil.iter_modules(import_module(package).__path__, f"{package}.")
    return [_as_law(import_module(entry.name), kind, interface) for entry in modules if _declares_card(entry.name)]


@contextmanager
def adopted(law: Law) -> Generator[None]:
    """Make a law from elsewhere known for a while; ValueError when its name is taken by another file."""
    known = catalogue()
    if known.get(law.name, law).module.__file__ != law.module.__file__:
        raise ValueError(f"a law named {law.name} exists already; rename the file")
    before = known.get(law.name)
    known[law.name] = law
    try:
        yield
    finally:
        del known[law.name]
        if before is not None:
            known[law.name] = before


def from_file(path: Path) -> Law:
    """The law in a file outside the package. ValueError when it lacks a part of the interface."""
    # A name of its own, so that a file called random.py does not hide the library's.
    name = f"starhold_law_{path.stem}"
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ValueError(f"{path}: not a Python file")
    module = importlib.util.module_from_spec(spec)
    # Registered so that its NamedTuples can be found by their module name.
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return _as_law(module, name=path.stem)


def _declares_card(name: str) -> bool:
    spec = importlib.util.find_spec(name)
    origin = None if spec is None else spec.origin
    return origin is not None and "\nCARD = " in Path(origin).read_text(encoding="utf-8")


@overload
def _as_law(module: ModuleType, *, name: str | None = None) -> Law: ...
@overload
def _as_law(module: ModuleType, kind: type[AnyLaw], interface: tuple[str, ...]) -> AnyLaw: ...
def _as_law(
    module: ModuleType, kind: type[Law] = Law, interface: tuple[str, ...] = INTERFACE, name: str | None = None
) -> Law:
    missing = [name for name in interface if not hasattr(module, name)]
    if missing:
        raise ValueError(f"{module.__file__}: a law needs {', '.join(missing)}")
    name = module.__name__.rpartition(".")[2] if name is None else name
    return kind(name.replace("_", "-"), module)
