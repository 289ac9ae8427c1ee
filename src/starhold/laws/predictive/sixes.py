"""Operations on matrices and vectors of six and three numbers, which are tuples, written out term by term.

Sums of six terms begin with the number to which they are added, in the order of columns; sums of three are those of
`algebra.vector`. A vector in place of a matrix of weights stands for a diagonal one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

from starhold.algebra.scalar import Scalar
from starhold.algebra.structured import Buffer, Index
from starhold.algebra.vector import Vector

Numbers: TypeAlias = tuple[Scalar, ...]
Rows: TypeAlias = tuple[Numbers, ...]
Weight: TypeAlias = Numbers | Rows
"""A symmetric matrix, or the diagonal of one."""


def dot(a: Sequence[Scalar], b: Sequence[Scalar], start: Scalar = 0.0) -> Scalar:
    """Return start + a'b."""
    total = start
    for x, y in zip(a, b, strict=True):
        total = total + x * y
    return total


def plus(a: Sequence[Scalar], b: Sequence[Scalar]) -> Numbers:
    """Return a + b."""
    return tuple(x + y for x, y in zip(a, b, strict=True))


def transposed(m: Rows) -> Rows:
    """Return the transposed matrix."""
    return tuple(zip(*m, strict=True))


def apply(m: Rows, x: Sequence[Scalar]) -> Numbers:
    """Return m x."""
    return tuple(dot(row, x) for row in m)


def product(m: Rows, n: Rows) -> Rows:
    """Return m n."""
    columns = transposed(n)
    return tuple(apply(columns, row) for row in m)


def is_diagonal(m: Weight) -> bool:
    """Return whether only the diagonal is given."""
    return not isinstance(m[0], tuple)


def entry(m: Weight, i: int, j: int) -> Scalar:
    """Return the number in row i and column j."""
    weight: Any = m
    if is_diagonal(m):
        return weight[i] if i == j else 0.0
    return weight[i][j]


def form(m: Weight, x: Sequence[Scalar]) -> Scalar:
    """Return x'm x."""
    weight: Any = m
    if is_diagonal(m):
        return dot([w * y for w, y in zip(weight, x, strict=True)], x)
    return dot(apply(weight, x), x)


def triple(buffer: Buffer, k: Index) -> Vector:
    """Return the k-th group of three numbers of a buffer."""
    return (buffer[3 * k], buffer[3 * k + 1], buffer[3 * k + 2])


def matrix(buffer: Buffer, width: int) -> Rows:
    """Return the matrix that a buffer holds row by row, of rows of `width`."""
    return tuple(buffer.row(i, width) for i in range(buffer.size // width))
