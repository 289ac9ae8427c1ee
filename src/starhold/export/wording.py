"""Types, names and texts, as the printer of readable C asks for them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from starhold.algebra.operations import NUMBER, TRUTH
from starhold.export.types import Type, paths
from starhold.trace.program import Function, Value
from starhold.trace.source import TIE, names

SHORT = 130
"""Characters of a call that is written where its value is used."""


def groups(kind: Type, first: int) -> Iterator[tuple[int, Type]]:
    """Yield a type and those of its members, each with the place of its first leaf."""
    yield first, kind
    for member in kind.members:
        yield from groups(member.type, first)
        first += len(list(paths(member.type, "")))


def kind_of_type(kind: Type) -> str:
    return TRUTH if kind.name == "bool" else NUMBER


def tied(text: str) -> str:
    """Return a text that stays on one line where it is short."""
    return text.replace(" ", TIE) if len(text) < SHORT // 2 else text


def strings(values: Iterable[Value]) -> tuple[str, ...]:
    return tuple(value for value in values if isinstance(value, str))


def names_of(function: Function) -> set[str]:
    """Return the first parts of all names within a function."""
    return {name.split(".")[0].split("->")[0] for name in names(function)}
