"""Finds the laws: modules of this package with a `CARD`, the entry points `starhold.parts` of other packages, and files."""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import starhold.laws
from starhold.laws.interface import Card, Field, NoMemory, Start, fields
from starhold.parts import catalogue as parts
from starhold.parts.catalogue import error_line as error_line
from starhold.parts.catalogue import read_module as read_module
from starhold.parts.part import Part


@dataclass(frozen=True)
class Law(Part):
    """A law file as an object; its name is that of the file, with hyphens."""

    @property
    def role(self) -> str:
        """Its role."""
        return "law"

    @property
    def card(self) -> Card:
        """The law's card: title, formula, assumptions and the stability that it claims."""
        return self.module.CARD

    @property
    def body(self) -> str:
        """The name of the body that it controls: the one named in its file, or the one whose command it computes."""
        return getattr(self.module, "BODY", None) or next(
            name for name, command in _commands().items() if self.hook(command)
        )

    @property
    def command(self) -> Callable[..., Any]:
        """The equation of the command, named after the command of its body: `torque` or `control`."""
        return getattr(self.module, self.equation)

    @property
    def equation(self) -> str:
        """The name of the command's equation in the module."""
        return parts.find("body", self.body).module.COMMAND

    @property
    def gains(self) -> Any:
        """The class of the gains, a NamedTuple."""
        return self.module.Gains

    @property
    def lyapunov(self) -> Callable[..., Any] | None:
        """The equation of the Lyapunov function; None where the law has none."""
        return getattr(self.module, "lyapunov", None)

    @property
    def forms(self) -> dict[str, Any]:
        """Design forms by name, each the NamedTuple class of its inputs."""
        return getattr(self.module, "FORMS", {})

    def fields(self, form: str | None = None) -> list[Field]:
        """Return the fields of the gains in order, or the inputs of a design form."""
        listed = self.hook("fields") if form is None else None
        return fields(self.gains if form is None else self.forms[form]) if listed is None else listed()

    def complete(self, spec: Any, start: Callable[[], Start]) -> Any:
        """Return the inputs of a design form, completed from the scenario's start."""
        teller = getattr(self.module, "complete", None)
        return spec if teller is None else teller(spec, start)

    def design(self, craft: Any, spec: Any) -> Any:
        """Return the gains computed from the inputs of a design form."""
        return self.module.design(craft, spec)

    def design_all(self, cases: Sequence[tuple[Any, Any]]) -> list[Any]:
        """Return the gains for many pairs of craft and inputs of one form, in one pass if the law has `design_all`."""
        together = getattr(self.module, "design_all", None)
        return [self.design(*case) for case in cases] if together is None else together(cases)

    def explain(self, craft: Any, spec: Any) -> list[tuple[str, Any]]:
        """Return the figures of merit of a design by name; none for a law without `explain`."""
        teller = getattr(self.module, "explain", None)
        return [] if teller is None else teller(craft, spec)

    def check(self, gains: Any, craft: Any) -> None:
        """Raise ValueError for gains within their bounds whose loop cannot be stable; not every law checks this."""
        teller = getattr(self.module, "check", None)
        if teller is not None:
            teller(gains, craft)

    def remember(self, gains: Any, craft: Any, period: float) -> Any:
        """Return the initial memory, new for each trajectory."""
        maker = getattr(self.module, "remember", None)
        return NoMemory() if maker is None else maker(gains, craft, period)

    def counters(self, memory: Any) -> tuple[int, ...] | None:
        """Return the counters of an iterating law: calls, total iterations, most iterations in a call, calls that ended
        without the optimum; None for other laws."""
        teller = getattr(self.module, "counters", None)
        return None if teller is None else teller(memory)


@cache
def _commands() -> dict[str, str]:
    """Return the name of the command's equation in laws, for each installed body."""
    return {name: part.module.COMMAND for name, part in parts.parts("body").items()}


@cache
def _installed() -> dict[str, Law]:
    return parts.installed(starhold.laws.__name__, "law", as_law)


def catalogue(body: str = "rigid-body") -> dict[str, Law]:
    """Return all installed laws for a body, by name. A law of another package that does not load is omitted, with a warning
    that names it."""
    return _of_body(body)


@cache
def _of_body(body: str) -> dict[str, Law]:
    return {name: law for name, law in _installed().items() if law.body == body}


def find(body: str, name: str) -> Law | None:
    """Return the installed law of this name for a body; None if there is none. No other law is loaded for it."""
    # Once all are loaded, laws from files may be listed among them.
    known = _installed.cache_info().currsize > 0
    law = None if known else parts.own_part(starhold.laws.__name__, name, as_law)
    return law if law is not None and law.body == body else catalogue(body).get(name)


@contextmanager
def adopted(law: Law) -> Generator[None]:
    """Inside this context, list a law from a file among the laws for its body."""
    known = catalogue(law.body)
    before = known.get(law.name)
    known[law.name] = law
    try:
        yield
    finally:
        del known[law.name]
        if before is not None:
            known[law.name] = before


_FROM_FILES: dict[str, Law] = {}


def known_law(name: str) -> Law | None:
    """Return the attitude law of this name: the installed one, else the one last read from a file of this name."""
    law = find("rigid-body", name) or _FROM_FILES.get(name)
    return law if law is None or law.body == "rigid-body" else None


def file_of(name: str) -> Path | None:
    """Return the file from which the law of this name was last read; None for an installed law."""
    law = _FROM_FILES.get(name)
    return None if law is None or name in _installed() else law.file


def from_file(path: Path, known: Mapping[str, Law] | None = None) -> Law:
    """Execute a file and return its law. `known`: the installed laws, which may include it. Errors as in
    `parts.catalogue.from_file`."""
    law = parts.from_file(path, known or {}, as_law)
    if law.file is not None:
        _FROM_FILES[law.name] = law
    return law


def as_law(module: ModuleType, path: Path | None = None) -> Law:
    """Return the law in a module. Raise ValueError, in one line, if it lacks a part of the contract."""
    body = getattr(module, "BODY", None)
    commands = _commands().values() if body is None else [_command_of(body, module, path)]
    if not any(hasattr(module, command) for command in commands):
        raise ValueError(f"{module.__file__}: a law needs {' or '.join(commands)}")
    law = parts.make(Law, module, path, ("Gains", "examples"))
    try:
        for form in (None, *law.forms):
            law.fields(form)
    except (AttributeError, NameError, TypeError) as error:
        raise ValueError(f"{module.__file__}: {error}") from None
    if not isinstance(module.CARD, Card):
        raise ValueError(f"{module.__file__}: CARD is not a Card of starhold.laws.interface")
    return law


def _command_of(body: Any, module: ModuleType, path: Path | None) -> str:
    """Return the name of the command of a law's body. An unknown body may be in a file of that name beside the law's."""
    try:
        return parts.find("body", body).module.COMMAND
    except (KeyError, TypeError):
        beside = None if path is None else path.with_name(f"{body}.py".replace("-", "_"))
        if beside is None or not beside.is_file():
            known = ", ".join(_commands())
            raise ValueError(
                f"{module.__file__}: there is no body {body}; one of {known}, or a file beside the law's"
            ) from None
    return parts.body_from_file(beside).module.COMMAND
