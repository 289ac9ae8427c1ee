"""Exact polynomials as readers of equations: coefficients are rationals (or balls), and floats have their exact value.

A comparison that depends on a variable splits the result into cases, so that an equation with `clip` or `sign` reads as a
piecewise polynomial. Nothing is rounded: an identity between two readings holds for all values of the variables.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any, ClassVar, TypeAlias

from flint import arb, fmpq

from starhold.algebra.operations import unreadable

Coefficient: TypeAlias = Any
"""A rational (`fmpq`), or a ball (`arb`) that contains the coefficient."""
Monomial: TypeAlias = tuple[str, ...]
"""Variables in alphabetical order, each repeated as many times as its power; () is the constant."""


def exact(number: Any) -> Coefficient:
    """Return a number as a rational of the same value, a ball as it is. Raise ValueError unless it is finite."""
    if isinstance(number, (fmpq, arb)):
        return number
    try:
        return fmpq(*Fraction(number).as_integer_ratio())
    except (OverflowError, ValueError):
        raise ValueError(f"{number} has no exact value") from None


def constants(value: Any) -> Any:
    """Return a number, tuple or NamedTuple with every number in it made a constant polynomial."""
    if isinstance(value, tuple):
        parts: list[Any] = [constants(part) for part in value]  # pyright: ignore[reportUnknownVariableType]
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)  # pyright: ignore
    return value if isinstance(value, Polynomial) else Polynomial.constant(value)


class Polynomial:
    """A polynomial's `terms` map monomials to coefficients, none of them an exact zero."""

    __slots__ = ("terms",)
    reader = "polynomial"

    def __init__(self, terms: Mapping[Monomial, Coefficient]) -> None:
        self.terms = {m: c for m, c in terms.items() if not (isinstance(c, fmpq) and c == 0)}

    @classmethod
    def constant(cls, value: Any) -> Polynomial:
        """Return the polynomial without variables."""
        return cls({(): exact(value)})

    @classmethod
    def variable(cls, name: str) -> Polynomial:
        """Return the polynomial `name`."""
        return cls({(name,): fmpq(1)})

    @property
    def value(self) -> Coefficient | None:
        """Return the coefficient of a polynomial without variables, else None."""
        if not self.terms:
            return fmpq(0)
        return self.terms.get(()) if len(self.terms) == 1 else None

    def variables(self) -> set[str]:
        """Return the names of the variables in it."""
        return {name for monomial in self.terms for name in monomial}

    def slope(self, name: str) -> Polynomial:
        """Return the partial derivative with respect to `name`."""
        terms: dict[Monomial, Coefficient] = {}
        for monomial, c in self.terms.items():
            power = monomial.count(name)
            if power:
                place = monomial.index(name)
                terms[monomial[:place] + monomial[place + 1 :]] = c * power
        return Polynomial(terms)

    def at(self, values: Mapping[str, Any]) -> Coefficient:
        """Return its value for given values of all variables."""
        total: Coefficient = fmpq(0)
        for monomial, c in self.terms.items():
            for name in monomial:
                c = c * values[name]
            total = total + c
        return total

    def __add__(self, other: Any) -> Any:
        if isinstance(other, Cases):
            return NotImplemented
        terms = dict(self.terms)
        for monomial, c in _polynomial(other).terms.items():
            terms[monomial] = terms[monomial] + c if monomial in terms else c
        return Polynomial(terms)

    __radd__ = __add__

    def __neg__(self) -> Polynomial:
        return Polynomial({m: -c for m, c in self.terms.items()})

    def __sub__(self, other: Any) -> Any:
        return self + (-other)

    def __rsub__(self, other: Any) -> Any:
        return (-self) + other

    def __mul__(self, other: Any) -> Any:
        if isinstance(other, Cases):
            return NotImplemented
        terms: dict[Monomial, Coefficient] = {}
        for n, d in _polynomial(other).terms.items():
            for m, c in self.terms.items():
                both = tuple(sorted(m + n)) if m and n else m or n
                terms[both] = terms[both] + c * d if both in terms else c * d
        return Polynomial(terms)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Polynomial:
        divisor = _polynomial(other)
        value = divisor.value
        if value is None:
            name = next((name for known, name in _RECIPROCALS.get() if not (divisor - known).terms), None)
            if name is None:
                raise unreadable("a division by what varies: a polynomial is divided by constants only")
            return self * Polynomial.variable(name)
        return Polynomial({m: c / value for m, c in self.terms.items()})

    def __rtruediv__(self, other: Any) -> Polynomial:
        return _polynomial(other) / self

    def __repr__(self) -> str:
        return " + ".join(f"({c}) {' '.join(m)}".strip() for m, c in sorted(self.terms.items())) or "0"


_RECIPROCALS: ContextVar[tuple[tuple[Polynomial, str], ...]] = ContextVar("reciprocals", default=())


@contextmanager
def reciprocal(divisor: Any, name: str) -> Generator[None]:
    """Inside this context, division by `divisor` is multiplication by the variable `name`, which stands for its reciprocal:
    results are identities only together with divisor * name = 1."""
    token = _RECIPROCALS.set((*_RECIPROCALS.get(), (divisor, name)))
    try:
        yield
    finally:
        _RECIPROCALS.reset(token)


@dataclass(frozen=True)
class Condition:
    """A condition says that `positive` > 0; the comparison a < b becomes b - a > 0."""

    positive: Polynomial
    reader: ClassVar[str] = "polynomial"

    @cached_property
    def key(self) -> tuple[Any, ...]:
        """Return a key that is equal for equal polynomials."""
        return tuple(sorted((m, str(c)) for m, c in self.positive.terms.items()))


@dataclass(frozen=True)
class Case:
    """One case of a piecewise polynomial: conditions, each true or false in it, and a polynomial."""

    truths: tuple[tuple[Condition, bool], ...]
    value: Polynomial


class Cases:
    """A piecewise polynomial: cases that exclude one another and together cover everything."""

    __slots__ = ("pieces",)
    reader = "polynomial"

    def __init__(self, pieces: Iterable[Case]) -> None:
        self.pieces = tuple(pieces)

    def _with(self, other: Any, operation: Callable[[Polynomial, Polynomial], Polynomial]) -> Cases:
        return Cases(
            Case(truths, operation(mine.value, yours.value))
            for mine in self.pieces
            for yours in pieces(other)
            if (truths := _merged(mine.truths, yours.truths)) is not None
        )

    def __add__(self, other: Any) -> Cases:
        return self._with(other, lambda a, b: a + b)

    __radd__ = __add__

    def __neg__(self) -> Cases:
        return Cases(Case(piece.truths, -piece.value) for piece in self.pieces)

    def __sub__(self, other: Any) -> Cases:
        return self._with(other, lambda a, b: a - b)

    def __rsub__(self, other: Any) -> Cases:
        return (-self) + other

    def __mul__(self, other: Any) -> Cases:
        return self._with(other, lambda a, b: a * b)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Cases:
        return self._with(other, lambda a, b: a / b)


@dataclass(frozen=True)
class Split:
    """A comparison of piecewise polynomials: cases, each with the truth of the comparison or its condition."""

    pieces: tuple[tuple[tuple[tuple[Condition, bool], ...], bool | Condition], ...]
    reader: ClassVar[str] = "polynomial"


def pieces(value: Any) -> tuple[Case, ...]:
    """Return the cases of a piecewise polynomial; a polynomial or a number has a single case."""
    return value.pieces if isinstance(value, Cases) else (Case((), _polynomial(value)),)


def jointly(
    values: Iterable[Any], most: int | None = None
) -> list[tuple[tuple[tuple[Condition, bool], ...], list[Polynomial]]]:
    """Return the joint cases of several piecewise polynomials: conditions and one polynomial for each value. Raise Raise
    ValueError for more than `most` cases."""
    cells: list[tuple[tuple[tuple[Condition, bool], ...], list[Polynomial]]] = [((), [])]
    for value in values:
        cells = [
            (truths, [*before, piece.value])
            for conditions, before in cells
            for piece in pieces(value)
            if (truths := _merged(conditions, piece.truths)) is not None
        ]
        if most is not None and len(cells) > most:
            raise ValueError(f"{len(cells)} cells, more than {most}")
    return cells


def _polynomial(value: Any) -> Polynomial:
    return value if isinstance(value, Polynomial) else Polynomial.constant(value)


def _merged(
    a: tuple[tuple[Condition, bool], ...], b: tuple[tuple[Condition, bool], ...]
) -> tuple[tuple[Condition, bool], ...] | None:
    """Return the union of two sets of conditions, or None if they contradict one another."""
    merged = {condition.key: (condition, truth) for condition, truth in a}
    for condition, truth in b:
        if merged.setdefault(condition.key, (condition, truth))[1] != truth:
            return None
    positive = [condition.positive for condition, truth in merged.values() if truth]
    for place, one in enumerate(positive):
        for other in positive[place + 1 :]:
            # The sum can be constant only if both have the same monomials apart from the constant.
            if (one.terms.keys() ^ other.terms.keys()) - {()}:
                continue
            total = (one + other).value
            # Two quantities whose sum is not positive cannot both be.
            if total is not None and total <= 0:
                return None
    return tuple(merged.values())


# --- the operations that `algebra.scalar` needs ----------------------------------------------------------------------------


def sqrt(x: Any) -> Any:
    raise unreadable("a square root: a polynomial has no square root")


def less(a: Any, b: Any) -> bool | Condition | Split:
    if isinstance(a, Cases) or isinstance(b, Cases):
        return Split(tuple((truths, _less(one, other)) for truths, (one, other) in jointly((a, b))))
    return _less(a, b)


def _less(a: Any, b: Any) -> bool | Condition:
    difference = _polynomial(b) - a
    value = difference.value
    if isinstance(value, arb) and not (value > 0 or value <= 0):
        raise ValueError(f"undecided: whether {value} is positive")
    return Condition(difference) if value is None else bool(value > 0)


def less_equal(a: Any, b: Any) -> bool:
    turned = less(b, a)
    if not isinstance(turned, bool):
        raise unreadable("less_equal: polynomials are compared by less alone")
    return not turned


def where(condition: Any, a: Any, b: Any) -> Any:
    if isinstance(condition, bool):
        return a if condition else b
    if isinstance(condition, Split):
        return Cases(
            Case(merged, case.value)
            for truths, here in condition.pieces
            for case in pieces((a if here else b) if isinstance(here, bool) else where(here, a, b))
            if (merged := _merged(truths, case.truths)) is not None
        )
    chosen = [(case, True) for case in pieces(a)] + [(case, False) for case in pieces(b)]
    return Cases(
        Case(truths, case.value)
        for case, truth in chosen
        if (truths := _merged(((condition, truth),), case.truths)) is not None
    )


def both(a: Any, b: Any) -> Any:
    raise unreadable("both or either: conditions on polynomials are not joined")


either = both


def opposite(a: Any) -> Any:
    raise unreadable("opposite: conditions on polynomials are not turned round")
