"""Finds ellipsoids that the sampled linear motion does not leave, under bounded disturbances and any momentum of wheels."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from importlib import import_module
from math import inf, isfinite, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.certification.evidence.cones import interior_point
from starhold.certification.evidence.sparse import entries_of
from starhold.certification.matrices import floats, lyapunov
from starhold.kernel.held import Held
from starhold.kernel.numbers import Rows, norm
from starhold.kernel.regions import AT_REST, RATE, TURN, Radii, Tube

linalg: Any = import_module("scipy.linalg")
Array = NDArray[np.float64]

HEED = 0.5
"""The weights of an ellipsoid's rates relative to its rotations, until they reduce no bound further."""
NEARLY = 1e-3
"""The share by which the linear motion is first scaled, to allow for the wheels' momentum."""
MORE, LARGER = 1.0 + 1e-9, 1.005
"""The margin for rounding, and that of ellipsoids above the least, so that motions enter them in finite time."""


def smallest(A: Array, corners: Array, pushes: list[Array], heed: float) -> tuple[Array, list[float]] | None:
    """Return the matrix of an ellipsoid invariant under disturbances of size 1, approximately the one with the least
    rotation, and its shares. heed: the weight of rates relative to rotations, in powers."""
    radius = float(np.abs(np.linalg.eigvals(A)).max())
    if radius >= 1.0:
        return None

    def shape(x: Array) -> tuple[float, Array, Array]:
        shares, more = np.exp(x[:-1]) / (1.0 + np.exp(x[:-1]).sum()) * (1.0 - radius**2), np.exp(x[-1])
        fed = fed_by(pushes, shares)
        fed += 1e-14 * np.diag(np.diag(fed))
        kept = 1.0 - shares.sum()
        if radius**2 * (1.0 + more) >= kept:
            return inf, A, shares
        solution = lyapunov(A * sqrt((1.0 + more) / kept), fed)
        symmetric = (solution + solution.T) / 2.0
        # Enlarged so that no corner leaves it.
        room = symmetric - corners @ symmetric @ corners.transpose(0, 2, 1) / kept
        if np.linalg.eigvalsh(room).min() <= 0.0:
            return inf, A, shares
        symmetric = symmetric * max(top(fed, one) for one in room)
        return extent(symmetric, heed), symmetric, shares

    def size(x: Array) -> float:
        return shape(x)[0]

    sizes = [float(np.linalg.norm(B, 2)) for B in pushes]
    weight = np.log(np.array([x / sum(sizes) + 1e-12 for x in sizes] + [NEARLY]))
    begun = weight + np.vstack([np.zeros(len(weight)), np.eye(len(weight))])
    options = {"maxfev": 400, "initial_simplex": begun, "xatol": 0.03, "fatol": 3e-4}
    optimize: Any = import_module("scipy.optimize")
    # Where no trial is finite, their differences are not numbers.
    with np.errstate(invalid="ignore"):
        optimum = optimize.minimize(size, weight, method="Nelder-Mead", options=options)
    least, X, shares = shape(optimum.x)
    if not isfinite(least):
        return None
    common = fitted(corners, pushes, shares, X, heed) if len(corners) > 1 else None
    better = X if common is None or extent(common, heed) >= least else common
    return better * LARGER, [float(a) for a in shares]


def fed_by(pushes: Sequence[Array], shares: Iterable[float]) -> Array:
    """Return what disturbances add to the matrix of an ellipsoid that moves with the motion, in floats."""
    return np.sum([B @ B.T / a for B, a in zip(pushes, shares, strict=True)], axis=0)


def extent(X: Array, heed: float) -> float:
    """Return the logarithm of the largest rotation in an ellipsoid, and of its largest rate by its weight."""
    wide, turned = (float(np.log(np.linalg.eigvalsh(X[k, k])[-1])) for k in (RATE, TURN))
    return turned + heed * wide


def fitted(corners: Array, pushes: list[Array], shares: Array, X: Array, heed: float) -> Array | None:
    """Return the ellipsoid with about the least rotation that no corner leaves with these shares, in units in which the
    other one, X, is about 1; None without one."""
    kept, scale = 1.0 - float(shares.sum()), np.sqrt(np.diag(X))
    if kept <= 0.0:
        return None
    plain = fed_by(pushes, shares)
    fed = plain / np.outer(scale, scale)
    size = len(X)
    # The entries of a symmetric matrix by which an interior point knows it.
    pairs = [(i, k) for k in range(size) for i in range(k + 1)]
    basis = np.array([[[float({i, k} == {a, b}) for a in range(size)] for b in range(size)] for i, k in pairs])
    rows, right = list[Array](), list[Array]()
    for corner in corners * scale / scale[:, None]:
        rows.append(np.hstack([-triangle(basis - corner @ basis @ corner.T / kept).T, np.zeros((len(pairs), 2))]))
        right.append(-triangle(fed))
    for place, part in enumerate((RATE, TURN)):
        units = -np.eye(2)[place][:, None, None] * np.diag(1.0 / scale[part] ** 2) * float(np.min(scale[part])) ** 2
        rows.append(triangle(np.concatenate([basis[:, part, part], units])).T)
        right.append(np.zeros(6))
    cost = np.array([*[0.0] * len(pairs), heed, 1.0])
    solution = interior_point(cost, entries_of(np.vstack(rows)), np.concatenate(right), 0, 0, [size] * len(corners) + [3, 3])
    if solution is None:
        return None
    fit = np.einsum("n,nij->ij", solution[: len(pairs)], basis) * np.outer(scale, scale)
    room = fit - corners @ fit @ corners.transpose(0, 2, 1) / kept
    if np.linalg.eigvalsh(fit)[0] <= 0.0 or np.linalg.eigvalsh(room).min() <= 0.0:
        return None
    return fit * max(top(plain, one) for one in room)


def triangle(M: Array) -> Array:
    """Return the upper triangles (..., n (n + 1) / 2) of symmetric matrices, column by column, as an interior point takes
    them."""
    n = M.shape[-1]
    return np.stack([M[..., i, k] * (1.0 if i == k else sqrt(2.0)) for k in range(n) for i in range(k + 1)], axis=-1)


def highest_ratio(a: Rows, b: Rows) -> float:
    """Return an upper bound of the eigenvalues of b^-1 a."""
    return top(floats(a), floats(b)) * MORE


def top(a: Array, b: Array) -> float:
    """Return the largest eigenvalue of b^-1 a, a and b symmetric and b positive definite: by LAPACK at once, because checks
    of small matrices take longer than the eigenvalues."""
    values, _, failed = linalg.lapack.dsygvd(a, b, jobz="N", uplo="L")
    if failed:
        raise np.linalg.LinAlgError("a matrix is not positive definite")
    return float(values[-1])


def ends(motion: Held, tube: Tube, X: Rows, swayed: Radii = AT_REST) -> tuple[float, float]:
    """Return bounds of the angle (rad) and the rate (rad/s), also between samples, of motions that stay within `swayed` of
    an ellipsoid at samples."""
    shape, drift = floats(X), float(norm(tube.drift))
    wide, turned = (
        sqrt(float(np.linalg.eigvalsh(shape[k, k])[-1])) + float(r) for k, r in zip((RATE, TURN), swayed, strict=True)
    )
    fastest = (wide + drift / 2.0) * MORE
    sine = (turned + float(motion.bend_between(tube))) * MORE
    half = sine
    for _ in range(60):
        half = sine + min(half, 1.0) ** 3 / 6.0
    return 2.0 * half * MORE if half < 1.0 else inf, fastest
