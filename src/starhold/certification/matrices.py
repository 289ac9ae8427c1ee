"""Exact numbers and matrices of the kernel from floats and FLINT's numbers, and bounds of eigenvalues: floats only guess."""

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from flint import arb, fmpq
from numpy.typing import NDArray

from starhold.algebra.polynomial import Polynomial, exact
from starhold.kernel.numbers import Account, Rows, definite, inverse, plus, scalar


def unlimited() -> None:
    """Compute with the kernel's numbers as long as a search takes; a check opens an account of its own."""
    Account.left = 10**12


def rows(array: Any) -> Rows:
    """Return a matrix of floats at their exact values."""
    return [[fraction(x) for x in row] for row in array]


def fraction(x: Any) -> Fraction:
    """Return a number of FLINT as the kernel has it, and others at their exact value."""
    value = exact(x)
    return Fraction(int(value.p), int(value.q))


def floats(matrix: Sequence[Sequence[Any]]) -> NDArray[np.float64]:
    """Return a matrix in floats."""
    return np.array([[float(x) for x in row] for row in matrix], dtype=np.float64)


def lyapunov(A: NDArray[np.float64], Q: NDArray[np.float64], flow: bool = False) -> NDArray[np.float64]:
    """Return X with AX + XA' = Q (flow), or X - AXA' = Q, for few states: as linear equations of its entries. LinAlgError
    without a solution."""
    count, one = len(A), np.eye(len(A))

    def paired(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
        return (a[:, None, :, None] * b[None, :, None, :]).reshape(count**2, count**2)

    over = paired(A, one) + paired(one, A) if flow else np.eye(count**2) - paired(A, A)
    return np.asarray(np.linalg.solve(over, Q.ravel()).reshape(count, count), dtype=np.float64)


def number(x: Any) -> float:
    """Return the nearest float of a rational or of a ball's middle."""
    if isinstance(x, fmpq):
        return int(x.p) / int(x.q)
    return float(x.mid()) if isinstance(x, arb) else float(x)


def above(x: Any) -> float:
    """Return a float not below a rational."""
    exactly = fraction(x)
    value = float(exactly)
    return value if value >= exactly else float(np.nextafter(value, np.inf))


def below(x: Any) -> float:
    """Return a float not above a rational."""
    return -above(-x)


def upper(ball: arb) -> Any:
    """Return a rational not below a ball."""
    return exact(above(exact(float(ball.abs_upper().mid())))) * exact(1.0 + 1e-15)


def inverted(a: Rows) -> Rows:
    """Return the inverse of a definite matrix."""
    unlimited()
    return inverse(a)


def least(a: Rows) -> Fraction:
    """Return a number just below the smallest eigenvalue of a symmetric matrix; positive where the matrix is definite."""
    unlimited()
    if definite(a):
        # A small one next to a large one would drown in the rounding of the large one.
        return 1 / greatest(inverted(a))
    return -greatest(negative(a))


def greatest(a: Rows) -> Fraction:
    """Return a number just above the largest eigenvalue of a symmetric matrix."""
    values = np.linalg.eigvalsh(floats(a))
    size, step = float(np.abs(values).max()), 1e-13
    while size and step < 1e6:
        bound = Fraction(float(values[-1]) + step * size)
        unlimited()
        if definite(plus(scalar(bound, len(a)), a, -1)):
            return bound
        step *= 4.0
    if size:
        raise ArithmeticError("no bound of an eigenvalue was found")
    return Fraction(0)


def negative(a: Rows) -> Rows:
    """Return -a."""
    return [[-x for x in row] for row in a]


def matrix_of(form: Polynomial, names: Sequence[str]) -> Rows:
    """Return the symmetric matrix of a quadratic form in these variables."""
    entries = [[fraction(form.terms.get(tuple(sorted((a, b))), 0)) for b in names] for a in names]
    return [[c if i == j else c / 2 for j, c in enumerate(row)] for i, row in enumerate(entries)]
