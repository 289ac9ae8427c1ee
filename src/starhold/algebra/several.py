"""Operations on tuples of any length: an equation applied to every element, or a weighted sum.

When recorded, they are unrolled to the lengths of their arguments: a step with any number of wheels costs no more than one
written by hand. Elements may differ in shape; on one lane, those of the same shape are computed in short vectors."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import reduce
from typing import TYPE_CHECKING, Any, TypeVar

from starhold.algebra.scalar import Scalar
from starhold.algebra.structured import RECORDER

if TYPE_CHECKING:
    from starhold.algebra.vector import Vector

_Value = TypeVar("_Value")


def each(function: Callable[..., _Value], columns: tuple[tuple[Any, ...], ...], *shared: Any) -> tuple[_Value, ...]:
    """Return (function(c[0][0], c[1][0], ..., *shared), function(c[0][1], ...), ...): the equation applied to the first
    elements of all columns, to the second ones, and so on. All columns have the same length; every call gets `shared`."""
    rows, recorder = [*zip(*columns, strict=True)], RECORDER.get()
    if recorder is not None:
        return recorder.each(function, rows, shared)
    return tuple(function(*row, *shared) for row in rows)


def folded(begin: Callable[..., Any], further: Callable[..., Any], rows: Sequence[Sequence[Any]]) -> Iterable[Any]:
    """Return further(... further(begin(*row[0]), *row[1]) ..., *row[-1]) for every row, lazily or all at once. No row is
    longer than the one before."""
    recorder = RECORDER.get()
    if recorder is None or not recorder.by_rows:
        return (reduce(lambda total, item: further(total, *item), row[1:], begin(*row[0])) for row in rows)
    totals = each(begin, tuple(zip(*(row[0] for row in rows), strict=True)))
    for place in range(1, len(rows[0])):
        items = [row[place] for row in rows if len(row) > place]
        totals = each(further, (totals[: len(items)], *zip(*items, strict=True))) + totals[len(items) :]
    return totals


def weighted(weights: tuple[Scalar, ...], vectors: tuple[Vector, ...]) -> Vector:
    """Return the sum of weights[i] * vectors[i], added from the first to the last; there is at least one."""
    x, y, z = (weights[0] * component for component in vectors[0])
    for weight, (a, b, c) in zip(weights[1:], vectors[1:], strict=True):
        x, y, z = x + weight * a, y + weight * b, z + weight * c
    return (x, y, z)
