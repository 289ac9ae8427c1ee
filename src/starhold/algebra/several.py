"""Operations on tuples of any length: an equation applied to every element, a weighted sum, a choice by score.

In plain Python they loop; compiled, they are written out for the lengths of their arguments, so that a step with any number
of wheels inlines and vectorises over lanes as one written by hand. The elements may differ in shape from one to the next.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from starhold.algebra.scalar import Scalar, compiled_as, less, where
from starhold.algebra.vector import Vector, add, scale

_Value = TypeVar("_Value")


def each(function: Callable[..., _Value], columns: tuple[tuple[Any, ...], ...], *shared: Any) -> tuple[_Value, ...]:
    """(function(c[0][0], c[1][0], ..., *shared), function(c[0][1], ...), ...): the equation applied to the first elements of
    all columns, to the second ones, and so on. The columns are of one length; `shared` goes to every call as it is."""
    return tuple(function(*row, *shared) for row in zip(*columns, strict=True))


def weighted(weights: tuple[Scalar, ...], vectors: tuple[Vector, ...]) -> Vector:
    """The sum of weights[i] * vectors[i], from the first to the last; there is at least one."""
    total = scale(weights[0], vectors[0])
    for weight, vector in zip(weights[1:], vectors[1:], strict=True):
        total = add(total, scale(weight, vector))
    return total


def choose(scores: tuple[Scalar, ...], options: tuple[tuple[Scalar, ...], ...]) -> tuple[Scalar, ...]:
    """The option of the largest score, the first of equals; options are tuples of numbers of one length."""
    best, chosen = scores[0], options[0]
    for score, option in zip(scores[1:], options[1:], strict=True):
        better = less(best, score)
        best = where(better, score, best)
        chosen = tuple(where(better, new, old) for new, old in zip(option, chosen, strict=True))
    return chosen


def _written(head: str, lines: list[str]) -> Any:
    space: dict[str, Any] = {"less": less, "where": where}
    exec("\n    ".join([f"def written({head}):", *lines]), space)
    return space["written"]


def _tuple(parts: list[str]) -> str:
    return f"({', '.join(parts)}{',' if parts else ''})"


def _same_length(*kinds: Any) -> int:
    lengths = {len(kind) for kind in kinds}
    if len(lengths) != 1:
        raise ValueError(f"tuples of one length are needed, not of {sorted(lengths)}")
    return lengths.pop()


@compiled_as(each)
def _compiled_each(function: Any, columns: Any, *shared: Any) -> Any:
    passed = [f"shared[{k}]" for k in range(len(shared))]
    calls = [
        f"function({', '.join([f'columns[{c}][{i}]' for c in range(len(columns))] + passed)})"
        for i in range(_same_length(*columns))
    ]
    return _written("function, columns, *shared", [f"return {_tuple(calls)}"])


@compiled_as(weighted)
def _compiled_weighted(weights: Any, vectors: Any) -> Any:
    count = _same_length(weights, vectors)
    sums = [" + ".join(f"weights[{i}] * vectors[{i}][{axis}]" for i in range(count)) for axis in range(3)]
    return _written("weights, vectors", [f"return {_tuple(sums)}"])


@compiled_as(choose)
def _compiled_choose(scores: Any, options: Any) -> Any:
    count, numbers = _same_length(scores, options), range(_same_length(*map(tuple, options)))
    lines = ["best = scores[0]", *(f"x{k} = options[0][{k}]" for k in numbers)]
    for i in range(1, count):
        lines += [f"better = less(best, scores[{i}])", f"best = where(better, scores[{i}], best)"]
        lines += [f"x{k} = where(better, options[{i}][{k}], x{k})" for k in numbers]
    return _written("scores, options", [*lines, f"return {_tuple([f'x{k}' for k in numbers])}"])
