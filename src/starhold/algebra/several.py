"""Operations on tuples of any length: an equation applied to every element, or a weighted sum.

When recorded they are unrolled for the lengths of their arguments: a step with any number of wheels costs no more than
one written by hand. The elements may differ in shape from one to the next."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from starhold.algebra.scalar import Scalar
from starhold.algebra.vector import Vector, add, scale

_Value = TypeVar("_Value")


def each(function: Callable[..., _Value], columns: tuple[tuple[Any, ...], ...], *shared: Any) -> tuple[_Value, ...]:
    """Return (function(c[0][0], c[1][0], ..., *shared), function(c[0][1], ...), ...): the equation applied to the first
    elements of all columns, to the second ones, and so on. The columns are of one length; `shared` goes to every call as it
    is."""
    return tuple(function(*row, *shared) for row in zip(*columns, strict=True))


def weighted(weights: tuple[Scalar, ...], vectors: tuple[Vector, ...]) -> Vector:
    """Return the sum of weights[i] * vectors[i], from the first to the last; there is at least one."""
    total = scale(weights[0], vectors[0])
    for weight, vector in zip(weights[1:], vectors[1:], strict=True):
        total = add(total, scale(weight, vector))
    return total
