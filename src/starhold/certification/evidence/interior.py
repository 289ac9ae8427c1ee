"""An interior point for programs with one large matrix and few equations, which a solver of sparse systems does not end.

The step of Helmberg, Kojima and Monteiro with Mehrotra's corrector. Its dense system has a row for each equation instead of
one for each entry of a matrix, so a matrix of 119 rows takes seconds an iteration.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.certification.evidence.sparse import Entries

sparse: Any = import_module("scipy.sparse")
linalg: Any = import_module("scipy.linalg")
Array = NDArray[np.float64]
ITERATIONS, CHUNK = 80, 256
FEASIBLE, ENOUGH = 0.01, 0.25
"""The residual of the equations, and the gap, as shares of the margin, at which the search ends."""


def most_definite(equal: Entries, b: Any, signed: Sequence[bool], blocks: Sequence[Sequence[tuple[int, int]]]) -> Any | None:
    """Return x with equal x = b and a large last number, which the matrices' eigenvalues, and signed numbers that say so,
    are not below; None where none is found. The columns are as for `squares.optimum`, with its `twice` 1."""
    a, count = equal.scipy(), equal.shape[1] - 1
    scales = np.sqrt(np.asarray(a.multiply(a).sum(1)).ravel())
    rows = sparse.diags(1.0 / np.where(scales > 0.0, scales, 1.0))
    first = head = count - sum(map(len, blocks))
    places = [([k], [(0, 0)]) for k in range(len(signed))]
    # With G = X + margin the margin is a free number.
    shared = np.zeros((count, 1))
    shared[: len(signed), 0] = signed
    for pairs in blocks:
        columns = list(range(first, first + len(pairs)))
        places.append((columns, list(pairs)))
        shared[columns, 0] = [i == k for i, k in pairs]
        first += len(pairs)
    free = sparse.hstack([a[:, len(signed) : head], a[:, :count] @ sparse.csc_matrix(shared)])
    program = Program([_cone(rows @ a[:, columns], pairs) for columns, pairs in places], (rows @ free).toarray(), rows @ b)
    with warnings.catch_warnings():
        # The kernel decides of what an ill-conditioned matrix gives.
        warnings.simplefilter("ignore", linalg.LinAlgWarning)
        if not program.ended():
            return None
    x = np.empty(count + 1)
    x[len(signed) : head], x[-1] = program.f[:-1], program.f[-1]
    for (columns, pairs), cone in zip(places, program.cones, strict=True):
        x[columns] = cone.x[tuple(np.array(pairs).T)]
    x[:count] += x[-1] * shared[:, 0]
    return x


@dataclass
class Cone:
    """A matrix that is nowhere negative, its dual, and what the equations make of its entries (equations, n^2)."""

    a: Any
    x: Any
    z: Any
    inverse: Any = None

    def step(self, sure: float, dual: Any, more: Any) -> Any:
        """Return the step to a product of `sure` with a step of the dual; more: the product of both steps."""
        d = sure * self.inverse - self.x - (self.x @ dual + more) @ self.inverse
        return (d + d.T) / 2.0

    def complement(self) -> Array:
        """Return the matrix of <A_i, X A_k Z^-1>."""
        n, rows = len(self.x), np.unique(self.a.nonzero()[0])
        mine = self.a[rows]
        columns = [
            mine @ (self.x @ mine[k : k + CHUNK].toarray().reshape(-1, n, n) @ self.inverse).reshape(-1, n * n).T
            for k in range(0, len(rows), CHUNK)
        ]
        whole = np.zeros((self.a.shape[0],) * 2)
        whole[np.ix_(rows, rows)] = np.hstack(columns)
        return (whole + whole.T) / 2.0


def _cone(columns: Any, pairs: Sequence[tuple[int, int]]) -> Cone:
    """Return a cone at the identity, from the columns of an upper triangle."""
    i, k = np.array(pairs).T
    n, order = 1 + int(k.max()), range(len(pairs))
    spread = sparse.csc_matrix((np.full(len(pairs), 0.5), (order, i * n + k)), (len(pairs), n * n))
    spread += sparse.csc_matrix((np.full(len(pairs), 0.5), (order, k * n + i)), (len(pairs), n * n))
    return Cone((columns @ spread).tocsr(), np.eye(n), np.eye(n))


class Program:
    """Matrices and free numbers f with sum of <A_i, X> + free f = b, the last of which is to be large."""

    def __init__(self, cones: Sequence[Cone], free: Any, b: Any) -> None:
        self.cones, self.free, self.b = cones, free, b
        self.y, self.f, self.cost = np.zeros(len(b)), np.zeros(free.shape[1]), np.zeros(free.shape[1])
        self.cost[-1] = -1.0

    def ended(self) -> bool:
        """Iterate until the last number is near its largest; False where it does not become positive."""
        order = sum(len(c.x) for c in self.cones)
        for _ in range(ITERATIONS):
            short = self.b - self.free @ self.f - sum(c.a @ c.x.ravel() for c in self.cones)
            gap = sum(float(np.sum(c.x * c.z)) for c in self.cones)
            if np.linalg.norm(short) < FEASIBLE * self.f[-1] and gap < ENOUGH * self.f[-1]:
                return True
            try:
                self.improve(short, gap / order)
            except np.linalg.LinAlgError:
                return False
        return False

    def improve(self, short: Any, mean: float) -> None:
        """Make one iteration."""
        off = [-c.z - (c.a.T @ self.y).reshape(c.z.shape) for c in self.cones]
        for c in self.cones:
            c.inverse = np.linalg.inv(c.z)
        schur: Any = sum(c.complement() for c in self.cones)
        schur[np.diag_indices_from(schur)] += 1e-13 * np.trace(schur) / len(schur)
        whole = np.block([[schur, self.free], [self.free.T, np.zeros((len(self.f),) * 2)]])
        factors = linalg.lu_factor(whole, check_finite=False)

        def steps(sure: float, more: Sequence[Any]) -> tuple[list[Any], list[Any], Any]:
            fixed = sum(c.a @ c.step(sure, d, m).ravel() for c, d, m in zip(self.cones, off, more, strict=True))
            right = np.r_[short - fixed, self.cost - self.free.T @ self.y]
            s = linalg.lu_solve(factors, right)
            s += linalg.lu_solve(factors, right - whole @ s)
            dual = [d - (c.a.T @ s[: len(short)]).reshape(d.shape) for c, d in zip(self.cones, off, strict=True)]
            return [c.step(sure, d, m) for c, d, m in zip(self.cones, dual, more, strict=True)], dual, s

        dx, dz, _ = steps(0.0, [0.0] * len(off))
        along, across = self.lengths(dx, dz, 1.0)
        ends = [(c.x + along * p) * (c.z + across * q) for c, p, q in zip(self.cones, dx, dz, strict=True)]
        kept = sum(float(np.sum(end)) for end in ends) / sum(map(len, ends)) / mean
        sure = min(1.0, max(kept * kept, 1e-4 if min(along, across) > 0.2 else 0.3)) * mean
        dx, dz, s = steps(sure, [p @ q for p, q in zip(dx, dz, strict=True)])
        along, across = self.lengths(dx, dz, 0.95)
        for c, p, q in zip(self.cones, dx, dz, strict=True):
            c.x, c.z = c.x + along * p, c.z + across * q
        self.y, self.f = self.y + across * s[: len(short)], self.f + along * s[len(short) :]

    def lengths(self, dx: Sequence[Any], dz: Sequence[Any], share: float) -> tuple[float, float]:
        """Return how much of the steps stays in the cones, in their share of the way to the border."""
        matrices, duals = zip(*((c.x, c.z) for c in self.cones), strict=True)
        return _length(matrices, dx, share), _length(duals, dz, share)


def _length(matrices: Sequence[Any], steps: Sequence[Any], share: float) -> float:
    longest = 1.0
    for x, d in zip(matrices, steps, strict=True):
        lower: Any = linalg.cholesky(x, lower=True)
        inside = linalg.solve_triangular(lower, linalg.solve_triangular(lower, d, lower=True).T, lower=True)
        least = float(np.linalg.eigvalsh((inside + inside.T) / 2.0)[0])
        longest = min(longest, share / -least) if least < 0.0 else longest
    return longest
