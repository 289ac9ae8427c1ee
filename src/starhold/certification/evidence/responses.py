"""Finds the weights by which the sums of a loop's impulse response are shown, and these sums."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import import_module
from math import ceil, log
from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.certification.matrices import floats
from starhold.kernel.held import Held
from starhold.kernel.theorems.response import KINDS, MOST, PARTS

Array = NDArray[np.float64]

LEFT, SHORTEST = 7.0, 5.0
"""Minus the logarithm of the share of a state that is left after the samples of a response, and the least of it where that
takes too many."""
ALIKE, AT_ONCE = 1.15, (64, 48, 32, 24, 16, 12, 8, 1)
"""The largest ratio of two of the samples that get one weight, and the numbers of samples that may."""
FINEST, LONGEST, LEAST, MORE = 1e3, 1e9 - 1.0, 1e-4, 1.0 + 1e-7
"""The least and the largest weight, the least share of a sample relative to the mean, and the margin for rounding."""


def find_response(motion: Held) -> dict[str, Any] | None:
    """Return the evidence about the impulse response, for one round; None if it lasts too long."""
    A = floats(motion.near.A)
    radius = float(np.abs(np.linalg.eigvals(A)).max())
    if radius >= 1.0 or -SHORTEST / log(radius) > MOST:
        return None
    count = min(ceil(-LEFT / log(radius)), MOST)
    rows = powers(np.vstack([np.eye(6), floats(motion.near.rates)]) @ np.eye(6, len(A)), A, count)
    return {"rounds": 1} | weighed(rows, PARTS, list(map(floats, motion.ways)), KINDS)


def powers(rows: Array, A: Array, count: int) -> Array:
    """Return rows times so many powers of a matrix."""
    steps = [rows]
    for _ in range(count - 1):
        steps.append(steps[-1] @ A)
    return np.array(steps)


def weighed(
    responses: Array, parts: Mapping[str, slice], ways: Sequence[Array], kinds: Sequence[Sequence[int]]
) -> dict[str, Any]:
    """Return the weights of responses, and the gains that are shown with them."""
    chosen, gains = list[list[int]](), list[list[str]]()
    for part in parts.values():
        rows = responses[:, part]
        squares = [G @ G.transpose(0, 2, 1) for G in (rows @ one for one in ways)]
        weights = np.minimum(np.rint(FINEST * weigh(np.sum([squares[n] for n in kinds[0]], axis=0))), LONGEST)
        share = float((1.0 / weights).sum())
        totals = [np.einsum("k,kij->ij", weights, len(kind) * np.sum([squares[n] for n in kind], axis=0)) for kind in kinds]
        tops = [float(np.linalg.eigvalsh(one)[-1]) * share for one in totals]
        chosen.append([int(m) for m in weights])
        gains.append([float.hex(top**0.5 * MORE) for top in tops])
    return {"weights": chosen, "gains": gains}


def weigh(squares: Array) -> Array:
    """Return weights m_k of matrices S_k, the least of them 1, for which the largest eigenvalue of the sum of m_k S_k times
    the sum of 1/m_k is about least. It is the largest, over mixtures W of directions, of the square of the sum of the roots
    of tr(W S_k), and the best m_k go with the inverses of these roots."""
    optimize: Any = import_module("scipy.optimize")
    lower = np.tril_indices(3)

    def roots(x: Array) -> Array:
        L = np.zeros((3, 3))
        L[lower] = x
        return np.sqrt(np.maximum(np.einsum("ij,kij->k", L @ L.T / (L * L).sum(), squares), 0.0))

    def cost(x: Array) -> float:
        return -float(roots(x).sum()) / scale

    even = np.array([1.0, 0.0, 1.0, 0.0, 0.0, 1.0])
    scale = float(roots(even).sum())
    best = roots(optimize.minimize(cost, even, method="BFGS").x)
    best = evened(np.maximum(best, LEAST * best.mean()))
    return best.max() / best


def evened(best: Array) -> Array:
    """Return numbers of which consecutive ones that hardly differ are replaced by the root of their mean square: the kernel
    sums samples of one weight at once."""
    result, place = best.copy(), 0
    while place < len(best):
        ahead = best[place:]
        count = next(n for n in AT_ONCE if n <= len(ahead) and ahead[:n].max() <= ALIKE * ahead[:n].min())
        result[place : place + count] = np.sqrt(np.mean(ahead[:count] ** 2))
        place += count
    return result
