"""Dual numbers, values with their derivatives: an equation called with them is differentiated, exactly but for rounding."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextvars import ContextVar
from typing import Any, ClassVar, cast

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.operations import Operation

TOWARD: ContextVar[NDArray[np.float64] | None] = ContextVar("toward", default=None)
"""Direction (n,) of the one-sided derivative where an equation switches branches at this very point."""
DIRECTIONS = 4
"""Number of directions, each taken with its opposite, in which branches must agree."""
AGREED = 1e-9


class BorderError(ArithmeticError):
    """An equation has no derivative here: the branches that meet have different slopes, or it reads a number's bits."""


class _UndecidedError(ArithmeticError):
    """Equal numbers are compared, and no direction says which of them becomes the larger."""


class Dual:
    """A value and its derivatives (n,) with respect to n variables."""

    __slots__ = ("slopes", "value")
    reader: ClassVar[str] = "itself"

    def __init__(self, value: float, slopes: NDArray[np.float64]) -> None:
        self.value, self.slopes = value, slopes

    def __repr__(self) -> str:
        return f"Dual({self.value!r}, {self.slopes.tolist()!r})"

    def __add__(self, other: Any) -> Dual:
        value, slopes = _parts(other)
        return Dual(self.value + value, self.slopes + slopes)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Dual:
        value, slopes = _parts(other)
        return Dual(self.value - value, self.slopes - slopes)

    def __rsub__(self, other: Any) -> Dual:
        return -self + other

    def __mul__(self, other: Any) -> Dual:
        value, slopes = _parts(other)
        return Dual(self.value * value, self.slopes * value + self.value * slopes)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Dual:
        value, slopes = _parts(other)
        if value == 0.0:
            return Dual(math.nan, np.full_like(self.slopes, np.nan))
        quotient = self.value / value
        return Dual(quotient, (self.slopes - quotient * slopes) / value)

    def __rtruediv__(self, other: Any) -> Dual:
        return Dual(float(other), np.zeros_like(self.slopes)) / self

    def __neg__(self) -> Dual:
        return Dual(-self.value, -self.slopes)

    def read(self, entry: Operation, values: Sequence[Any]) -> Any:
        """Apply an operation that has this number as an operand."""
        if entry.name == "sqrt":
            root = math.sqrt(self.value) if self.value >= 0.0 else math.nan
            # The length of a vector has no slope where the vector is zero.
            return Dual(root, self.slopes * (0.5 / root if root > 0.0 else math.nan))
        if "slopes" in entry.meanings:
            numbers = [_parts(value)[0] for value in values]
            pairs = zip(entry.meanings["slopes"], values, strict=True)
            slopes = sum(by(*numbers) * value.slopes for by, value in pairs if isinstance(value, Dual))
            return Dual(entry.plain(*numbers), cast(Any, slopes))
        if entry.name in ("less", "less_equal"):
            (a, da), (b, db) = map(_parts, values)
            if a == b and np.any(da - db):
                toward = TOWARD.get()
                if toward is None:
                    raise _UndecidedError
                return bool(np.dot(da - db, toward) < 0.0)
            return entry.plain(a, b)
        if "symbolic" not in entry.meanings or entry.takes[0] != "number":
            raise BorderError(f"{entry.name} has no derivative")
        # The remaining operations are arithmetic, which duals define themselves.
        return entry.meanings["symbolic"](*values)


def variables(values: Sequence[float], first: int, count: int) -> list[Dual]:
    """Return these values as duals, which are the variables `first`, `first + 1`, ... of `count`."""
    return [Dual(float(value), np.eye(1, count, first + k)[0]) for k, value in enumerate(values)]


def differentiate(equation: Callable[[], Sequence[Any]], count: int) -> NDArray[np.float64]:
    """Return the derivatives (results, count) of an equation's results with respect to its `count` variables.

    Where it compares equal numbers, as a limit on a length does at zero, it is evaluated again in DIRECTIONS directions and
    their opposites. Raise BorderError where values or slopes differ between them, or there is no slope. No other directions
    are tried."""
    try:
        return _agreed([_table(equation(), count)])
    except _UndecidedError:
        pass
    tables: list[NDArray[np.float64]] = []
    for direction in np.random.default_rng(1).standard_normal((DIRECTIONS, count)):
        for toward in (direction, -direction):
            token = TOWARD.set(toward)
            try:
                tables.append(_table(equation(), count))
            finally:
                TOWARD.reset(token)
    return _agreed(tables)


def _table(numbers: Sequence[Any], count: int) -> NDArray[np.float64]:
    """Return the values, each followed by its derivatives."""
    rows: list[NDArray[np.float64]] = []
    for number in numbers:
        value, slopes = _parts(number)
        rows.append(np.concatenate([[value], np.broadcast_to(slopes, (count,))]))
    return np.array(rows).reshape(len(rows), count + 1)


def _agreed(tables: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    first = tables[0]
    close = AGREED * max(1e-300, float(np.abs(first).max(initial=0.0)))
    if not np.isfinite(first).all() or any(not np.abs(table - first).max(initial=0.0) <= close for table in tables):
        raise BorderError("the branches that meet have different slopes, or there is none")
    return first[:, 1:]


def _parts(number: Any) -> tuple[float, Any]:
    return (number.value, number.slopes) if isinstance(number, Dual) else (number, 0.0)
