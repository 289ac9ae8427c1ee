"""Prints how a law reads and writes the numbers that it keeps in an array: by names of places, three or six at a time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from starhold.algebra.operations import INDEX
from starhold.export.types import SIX, VECTOR, Type
from starhold.trace.program import Load, Op, Store, Value

ROWS = (SIX, VECTOR)
"""Structs that are read and written at once."""


class Place(NamedTuple):
    """A place in an array: the sum of a number and of products of counters, as text."""

    first: int
    terms: tuple[str, ...] = ()

    def text(self, names: Mapping[int, str]) -> str:
        """Return the place as text; names: of parts of the array, by their first places."""
        base = max((start for start in names if start <= self.first), default=None)
        parts = [] if base is None else [names[base]]
        rest = self.first - (base or 0)
        parts += [*self.terms, *([str(rest)] if rest or not parts else [])]
        return " + ".join(parts)


class Places:
    """The places that a function speaks of, by the names of indices."""

    def __init__(self) -> None:
        self._known: dict[str, Place] = {}

    def note(self, s: Op) -> None:
        """Remember what an index is the sum of."""
        name = s.operation.name
        if name == "index_plus":
            a, b = (self.of(value) for value in s.args)
            self._known[s.ref] = Place(a.first + b.first, a.terms + b.terms)
        elif name == "index_product":
            a, b = (self.of(value) for value in s.args)
            factor, other = (a, b) if not a.terms else (b, a)
            if not factor.terms and len(other.terms) <= 1 and "*" not in "".join(other.terms):
                terms = tuple(f"{factor.first} * {term}" for term in other.terms)
                self._known[s.ref] = Place(factor.first * other.first, terms)

    def of(self, value: Value) -> Place:
        """Return the place of an index."""
        if not isinstance(value, str):
            return Place(int(value))
        return self._known.get(value, Place(0, (value,)))

    def knows(self, value: Value) -> bool:
        """Tell whether an index is a sum that is written where it is used."""
        return not isinstance(value, str) or value in self._known


class Run(NamedTuple):
    """Statements that read or write neighbouring places, and those among them that only compute."""

    kind: Type | None
    first: Place
    own: tuple[Any, ...]


def runs(block: tuple[Any, ...], places: Places) -> Iterator[Any]:
    """Yield the statements of a block with loads of three or six neighbours as runs, and stores of such likewise. What is
    computed in between comes before a run of stores, and stays where it is between loads."""
    k = 0
    while k < len(block):
        s = block[k]
        if isinstance(s, Op) and s.operation.gives == INDEX:
            places.note(s)
        if not isinstance(s, (Load, Store)):
            yield s
            k += 1
            continue
        own, after = list[Any]([s]), k + 1
        while after < len(block):
            other = block[after]
            if isinstance(other, Op) and (other.operation.gives == INDEX or isinstance(s, Store)):
                if other.operation.gives == INDEX:
                    places.note(other)
            elif (
                isinstance(other, (Load, Store))
                and type(other) is type(s)
                and other.memory == s.memory
                and _follows(places, own[-1], other)
            ):
                own.append(other)
            else:
                break
            after += 1
        kind = next((kind for kind in ROWS if len(own) >= len(kind.members)), None)
        if kind is None:
            yield s
            k += 1
            continue
        own = own[: len(kind.members)]
        last = next(place for place in range(k, after) if block[place] is own[-1])
        yield from (other for other in block[k : last + 1] if isinstance(other, Op))
        yield Run(kind, places.of(s.index), tuple(own))
        k = last + 1


def _follows(places: Places, a: Any, b: Any) -> bool:
    before, now = places.of(a.index), places.of(b.index)
    return now.terms == before.terms and now.first == before.first + 1


def helpers(kinds: Iterator[Type] | list[Type]) -> Iterator[str]:
    """Yield the functions that read and write structs at once."""
    for kind in kinds:
        stem, count = kind.name.removesuffix("_t"), len(kind.members)
        inner = ", ".join(f"numbers[{k}]" for k in range(count))
        yield from (
            "",
            f"/* Read {count} numbers that stand together. */",
            f"static {kind.name} {stem}_at(const double *numbers)",
        )
        yield from (
            "{",
            f"    return ({kind.name}){{{{{inner}}}}};" if kind.elements else f"    return ({kind.name}){{{inner}}};",
            "}",
        )
        yield from ("", f"/* Write {count} numbers that stand together. */")
        yield from (f"static void put_{stem}(double *numbers, {kind.name} value)", "{")
        yield from (f"    numbers[{k}] = value.{member.name};" for k, member in enumerate(kind.members))
        yield "}"
