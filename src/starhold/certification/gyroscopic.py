"""Bounds of the part of a torque, or of an acceleration, that is quadratic in the rate, mostly a gyroscopic one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from flint import fmpq

from starhold.algebra.polynomial import Monomial, Polynomial, exact
from starhold.certification.matrices import (
    Rows,
    definite,
    floats,
    identity,
    matmul,
    matrix_of,
    plus,
    root_above,
    symmetric_part,
    times,
    transpose,
)
from starhold.certification.motion import RATE


@dataclass(frozen=True)
class GyroscopicTorque:
    """|G(w)| <= most w.Pw for a vector G of quadratic forms; `shift` and `weight`: what showed it, see `gyroscopic_torque`;
    None where the forms were bounded one by one."""

    most: Any
    shift: Any | None = None
    weight: Any | None = None


def gyroscopic_torque(parts: Sequence[Polynomial], P: Rows) -> GyroscopicTorque:
    """The least bound that was found of the part of polynomials that is quadratic in the rate.

    If G(w) = w x Aw, so G(w) = w x (A + p)w for every p, and |G(w)| <= |w||(A + p)w| <= (c|w|2 + |(A + p)w|2/c)/2, which is
    at most most w.Pw if (A + p)'(A + p) + c2 <= 2 c most P. Of w x Jw this is sharp: half the range of the moments for
    P = 1, (J3 - J1)/(2 sqrt(J1 J3)) for P = J.
    """
    forms = [matrix_of(part.only(is_gyroscopic), RATE, RATE) for part in parts]
    each = [max(relative_greatest(times(sign, form), P) for sign in (1, -1)) for form in forms]
    found = GyroscopicTorque(each[0] if len(each) == 1 else root_above(sum((x * x for x in each), fmpq(0))))
    A = crossed(forms)
    if A is None or found.most == 0:
        return found
    try:
        root = np.linalg.inv(np.linalg.cholesky(floats(P)))
    except np.linalg.LinAlgError:
        # Definite, but not in floats.
        return found
    size, full = float(np.linalg.norm(floats(A), 2)), floats(A)

    def both(p: float, c: float) -> Rows:
        moved = plus(A, identity(3, p))
        return plus(matmul(transpose(moved), moved), identity(3, exact(c) ** 2))

    def most(x: Any) -> float:
        moved = full + x[0] * size * np.eye(3)
        c = size * np.exp(x[1])
        return float(np.linalg.eigvalsh(root @ (moved.T @ moved + c * c * np.eye(3)) @ root.T)[-1] / (2.0 * c))

    starts = ((-0.5, -1.0), (0.5, -1.0))
    library: Any = import_module("scipy.optimize")
    tried = [library.minimize(most, x, method="Nelder-Mead", options={"xatol": 1e-6}) for x in starts]
    best = min(tried, key=lambda found: found.fun).x
    p, c = float(best[0] * size), float(size * np.exp(best[1]))
    other = relative_greatest(both(p, c), P) / (2 * exact(c))
    return found if found.most <= other else GyroscopicTorque(other, exact(p), exact(c))


def is_gyroscopic(monomial: Monomial) -> bool:
    """Whether a monomial is quadratic in the rate and holds nothing else."""
    return len(monomial) == 2 and set(monomial) <= set(RATE)


def crossed(forms: Sequence[Rows]) -> Rows | None:
    """A with G(w) = w x Aw and A[0][0] = 0, for any multiple of the unit matrix may be added; None where there is none."""
    if len(forms) != 3:
        return None
    F, G, H = forms
    A = [[fmpq(0), -H[1][1], G[2][2]], [H[0][0], 2 * H[0][1], -F[2][2]], [-G[0][0], F[1][1], -2 * G[0][2]]]
    for i, form in enumerate(forms):
        j, k = (i + 1) % 3, (i + 2) % 3
        one, other = ([A[row] if unit == axis else [fmpq(0)] * 3 for axis in range(3)] for unit, row in ((j, k), (k, j)))
        if symmetric_part(plus(one, other, -1)) != form:
            return None
    return A


def relative_greatest(a: Rows, b: Rows) -> Any:
    """A rational mu, not negative, with mu b - a positive definite or a = 0, just above the smallest."""
    if all(x == 0 for row in a for x in row):
        return fmpq(0)
    guess = float(np.linalg.eigvals(np.linalg.solve(floats(b), floats(a))).real.max())
    for step in (1e-13, 1e-11, 1e-9, 1e-6, 1e-3, 1.0):
        mu = exact(max(guess, 1e-300) * (1.0 + step))
        if definite(plus(times(mu, b), a, -1)):
            return mu
    raise ArithmeticError("no bound of the damping was found")
