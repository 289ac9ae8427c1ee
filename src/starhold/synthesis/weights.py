"""Checks the weights of regulators, and balances them onto the globally stable family."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]

MOST_SPREAD = 1e12
"""Largest ratio of the largest to the smallest eigenvalue of q's rate part, of q's attitude part and of r, each separately
because their units differ. Gains then span at most as much, and stay positive definite as full matrices of doubles, which
have sixteen digits."""

SAME = 1e-10
"""Principal moments that differ by at most this share of the largest are equal: rounding alone decides their axes."""

BALANCES = ("none", "least", "q4", "q5", "q6", "r1", "r2", "r3")
"""Weights that `balance` may change: none, all by the least change in logarithm, or the one named."""


def kappa(moments: Array, y: Array) -> float:
    """Return (J3 - J2)/y1 + (J1 - J3)/y2 + (J2 - J1)/y3 (s2): zero exactly where the gyroscopic torque does no work on V."""
    return float(((np.roll(moments, -2) - np.roll(moments, -1)) / y).sum())


def balance(moments: Array, q: Array, r: Array, how: str) -> tuple[Array, Array]:
    """Return weights q (6,) and r (3,) for moments (3,) changed so that kappa vanishes: the one that `how` names, or all by
    the least change.

    Raise ValueError if kappa vanishes for no value of the named weight; for the middle moment's axis it always does."""
    share = np.roll(moments, -2) - np.roll(moments, -1)
    parts = share / np.sqrt(q[3:] / r)
    if abs(parts.sum()) <= 4.0 * np.finfo(float).eps * np.abs(parts).sum():
        return q, r
    q, r = q.copy(), r.copy()
    # The term of the middle moment's axis has the opposite sign of both others, so a positive y there always balances.
    middle = int(np.argmax(np.abs(share)))
    axis = middle if how == "least" else (int(how[1]) - 1) % 3
    if how == "least":
        shift = _least_shift(parts, middle)
        q[3:], r, parts = q[3:] * np.exp(shift), r * np.exp(-shift), parts * np.exp(-shift)
    rest = float(np.delete(parts, axis).sum())
    wanted = -share[axis] / rest if rest else np.nan
    if not (np.isfinite(wanted) and wanted > 0.0):
        raise ValueError(f"no value of {how} balances the weights; q{middle + 4} or r{middle + 1} can")
    if how.startswith("r"):
        r[axis] = q[3 + axis] / wanted**2
    else:
        q[3 + axis] = r[axis] * wanted**2
    return q, r


def _least_shift(parts: Array, middle: int) -> Array:
    """Return the least change of log y (3,) for which the sum of `parts` exp(-change) vanishes."""
    library: Any = import_module("scipy.optimize")
    # The middle change follows from the others, whose terms have the opposite sign.
    others = [axis for axis in range(3) if axis != middle and parts[axis]]
    size = np.log(np.abs(parts[others]) / abs(parts[middle]))

    def follows(change: Array) -> float:
        return -float(np.logaddexp.reduce(size - change))

    def length(change: Array) -> float:
        return float(change @ change) + follows(change) ** 2

    def slope(change: Array) -> Array:
        last = follows(change)
        return 2.0 * (change + last * np.exp(size - change + last))

    # There may be a local least change near each axis that changes alone.
    starts = [np.zeros(len(others))]
    for number, part in enumerate(size):
        alone = 1.0 - float(np.exp(np.delete(size, number)).sum())
        if alone > 0.0:
            starts.append(np.eye(len(others))[number] * (part - np.log(alone)))
    best: Any = min((library.minimize(length, start, jac=slope, tol=1e-12) for start in starts), key=lambda end: end.fun)
    shift = np.zeros(3)
    shift[others], shift[middle] = best.x, follows(best.x)
    return shift


def positive(given: Any, size: int, name: str) -> Array:
    """Return the weights as an array of `size`. Raise ValueError, with `name` in the message, if they are not positive."""
    array = np.array(given, dtype=float)
    if array.shape != (size,) or not np.isfinite(array).all() or not (array > 0.0).all():
        raise ValueError(f"{name} must be {size} numbers above 0")
    return array


def positive_definite(given: Any, size: int, name: str) -> Array:
    """Return the weights, a matrix or its diagonal, as a symmetric array (size, size). Raise ValueError, with `name` in the
    message, if they are not symmetric and positive definite."""
    array = np.array(given, dtype=float)
    if array.shape == (size,):
        array = np.diag(array)
    if array.shape != (size, size) or not np.isfinite(array).all():
        raise ValueError(f"{name} must be a {size}x{size} matrix of finite numbers")
    diagonal = np.diagonal(array)
    if (diagonal <= 0.0).any():
        raise ValueError(f"{name} must be positive definite; its diagonal holds {diagonal.min():g}")
    # Scaled to a unit diagonal, so that neither units nor large weights hide faults in small ones.
    root = np.sqrt(diagonal)
    scaled = array / root / root[:, None]
    if not np.abs(scaled - scaled.T).max() <= 1e-9:
        raise ValueError(f"{name} must be symmetric")
    least = np.linalg.eigvalsh(0.5 * (scaled + scaled.T))[0]
    if not least > 0.0:
        raise ValueError(f"{name} must be positive definite; scaled to a diagonal of ones its least eigenvalue is {least:g}")
    return 0.5 * array + 0.5 * array.T


def spread(values: Array) -> Array:
    """Return the ratio of the largest to the smallest number along the first axis; numbers below 1e-16 of the largest count
    as that."""
    most = values.max(axis=0)
    return most / np.maximum(values.min(axis=0), 1e-16 * most)


def check_spreads(rate: Array, attitude: Array, cost: Array, *, kind: str = "") -> None:
    """Raise ValueError if eigenvalues of q's rate part, of its attitude part or of r, each (3,), differ by a factor above
    MOST_SPREAD; `kind` precedes the name in the message."""
    for name, part, values in (("q", "rate", rate), ("q", "attitude", attitude), ("r", "torque", cost)):
        # The least eigenvalue of a full matrix has the rounding error of the largest: a thousandth is tolerated.
        factor = float(spread(values))
        if not factor <= 1.001 * MOST_SPREAD:
            reason = f"{kind}{name}: the weights of the {part} differ by a factor of {factor:.3g}"
            raise ValueError(f"{reason}; at most {MOST_SPREAD:g} is allowed")


def check_axes(moments: Array, q: Array, r: Array) -> None:
    """Raise ValueError if weights q (6,), r (3,) differ about principal axes that only rounding distinguishes; `moments`
    (3,) are in ascending order."""
    for one, other in ((0, 1), (1, 2)):
        weights = np.array([q[:3], q[3:], r])
        if moments[other] - moments[one] <= SAME * moments[2] and (weights[:, one] != weights[:, other]).any():
            raise ValueError(
                f"principal moments {one + 1} and {other + 1} are equal ({moments[one]:g} kg m^2), so their axes are not "
                "determined: give both the same weights q and r, or use form 'numeric'"
            )
