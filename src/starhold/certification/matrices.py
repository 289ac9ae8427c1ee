"""Definite matrices without rounding: floats only guess, rationals decide. A matrix is a list of rows of these (`fmpq`)."""

from collections.abc import Sequence
from fractions import Fraction
from typing import Any, TypeAlias

import numpy as np
from flint import arb, fmpq, fmpq_mat
from numpy.typing import NDArray

from starhold.algebra.polynomial import Polynomial, exact

Rows: TypeAlias = list[list[Any]]


def rows(array: Any) -> Rows:
    """A matrix of floats at their exact values."""
    return [[exact(x) for x in row] for row in array]


def fraction(x: Any) -> Fraction:
    """A number of FLINT as the kernel has it, and others at their exact value."""
    value = exact(x)
    return Fraction(int(value.p), int(value.q))


def floats(matrix: Sequence[Sequence[Any]]) -> NDArray[np.float64]:
    """The nearest array of floats."""
    return np.array([[number(x) for x in row] for row in matrix], dtype=float)


def number(x: Any) -> float:
    """The nearest float of a rational or of a ball's middle."""
    if isinstance(x, fmpq):
        return int(x.p) / int(x.q)
    return float(x.mid()) if isinstance(x, arb) else float(x)


def identity(size: int, c: Any) -> Rows:
    """c times the unit matrix."""
    return [[c if i == j else fmpq(0) for j in range(size)] for i in range(size)]


def plus(a: Rows, b: Rows, c: Any = 1) -> Rows:
    """a + c b."""
    return [[x + y * c for x, y in zip(s, t, strict=True)] for s, t in zip(a, b, strict=True)]


def times(c: Any, a: Rows) -> Rows:
    """c a."""
    return [[x * c for x in row] for row in a]


def inverse(a: Rows) -> Rows:
    """The exact inverse; ZeroDivisionError for a singular matrix."""
    inverted = fmpq_mat(len(a), len(a), [x for row in a for x in row]).inv()
    return [[inverted[i, j] for j in range(len(a))] for i in range(len(a))]


def definite(a: Rows) -> bool:
    """Return whether a symmetric matrix is positive definite, by its pivots."""
    rest = [list(row) for row in a]
    for k in range(len(rest)):
        pivot = rest[k][k]
        if not pivot > 0:
            return False
        for i in range(k + 1, len(rest)):
            factor = rest[i][k] / pivot
            for j in range(k + 1, len(rest)):
                rest[i][j] = rest[i][j] - factor * rest[k][j]
    return True


def least(a: Rows) -> Any:
    """A rational just below the smallest eigenvalue of a symmetric matrix; positive where the matrix is definite."""
    if definite(a):
        # A small one beside a large one would drown in the rounding of the large one.
        return 1 / greatest(inverse(a))
    values = np.linalg.eigvalsh(floats(a))
    return _just_below(float(values[0]), float(np.abs(values).max()), a)


def greatest(a: Rows) -> Any:
    """A rational just above the largest eigenvalue of a symmetric matrix."""
    values = np.linalg.eigvalsh(floats(a))
    return -_just_below(-float(values[-1]), float(np.abs(values).max()), times(-1, a))


def _just_below(guess: float, size: float, a: Rows) -> Any:
    if size == 0.0:
        return fmpq(0)
    step = 1e-13
    while step < 1e6:
        bound = exact(guess - step * size)
        if definite(plus(a, identity(len(a), bound), -1)):
            return bound
        step *= 4.0
    raise ArithmeticError("no bound of an eigenvalue was found")


def matrix_of(form: Polynomial, names: Sequence[str]) -> Rows:
    """The symmetric matrix of a quadratic form in these variables."""
    entries = [[form.terms.get(tuple(sorted((a, b))), fmpq(0)) for b in names] for a in names]
    return [[c if i == j else c / 2 for j, c in enumerate(row)] for i, row in enumerate(entries)]
