"""A bound of what is quadratic in the rate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from starhold.algebra.polynomial import Monomial, Polynomial
from starhold.algebra.vector import apply, cross
from starhold.checker.exact import (
    SHARES,
    ZERO,
    CheckError,
    Rows,
    definite,
    demand,
    floating,
    greatest,
    identity,
    matmul,
    plus,
    rational,
    root_above,
    times,
    transpose,
)
from starhold.checker.loop import RATE, W, letters
from starhold.checker.subject import quadratic


def gyroscopic_bound(parts: Sequence[Polynomial], P: Rows, shift: Any | None, weight: Any | None = None) -> Any:
    """A rational that the norm of what is quadratic in the rate does not exceed where w.Pw = 1.

    With a shift p those parts have to be w x Aw, so w x (A + p)w, of norm |w||(A + p)w| at most: with weight c at most
    (c|w|2 + |(A + p)w|2/c)/2. Without a weight the norm of A + p is taken for it.
    """
    forms = [part.only(lambda m: letters(m) == "ww") for part in parts]
    if shift is None:
        return root_above(sum((_ratio(quadratic(form.terms, RATE), P) ** 2 for form in forms), ZERO))
    demand(len(forms) == 3, "there is a shift, but not three components")
    A = plus(_matrix(forms), identity(3, shift))
    vector: Any = W
    again: Any = cross(vector, apply(tuple(map(tuple, A)), vector))  # pyright: ignore
    demand(not any((form - other).terms for form, other in zip(forms, again, strict=True)), "it is not a cross product")
    square = matmul(transpose(A), A)
    c = root_above(greatest(square)) if weight is None else weight
    demand(c > 0, "the weight is not positive")
    return _ratio(plus(square, identity(3, c * c)), P) / (2 * c)


def _matrix(forms: Sequence[Polynomial]) -> Rows:
    """A with zero as its first entry, read off w x Aw."""
    first, second, third = (form.terms for form in forms)

    def of(terms: Mapping[Monomial, Any], *names: str) -> Any:
        return terms.get(names, ZERO)

    return [
        [ZERO, -of(third, "w2", "w2"), of(second, "w3", "w3")],
        [of(third, "w1", "w1"), of(third, "w1", "w2"), -of(first, "w3", "w3")],
        [-of(second, "w1", "w1"), of(first, "w2", "w2"), -of(second, "w1", "w3")],
    ]


def _ratio(form: Rows, P: Rows) -> Any:
    """A rational that |w.Fw| does not exceed where w.Pw = 1: guessed in floats, shown by minors."""
    metric, values = ([[floating(x) for x in row] for row in matrix] for matrix in (P, form))
    most = float(np.abs(np.linalg.eigvals(np.linalg.solve(metric, values)).real).max())
    for share in SHARES:
        bound = rational(most * (1.0 + share))
        if all(definite(plus(times(bound, P), form, sign), strictly=False) for sign in (1, -1)):
            return bound
    raise CheckError("no bound of a form was found")
