"""Metrics of any run: when values stay within a bound, and what share of the time is on a limit."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

LAST = 0.25
"""Share of the run over which chatter and the final error are measured."""
ALMOST = 1.0 - 1e-9
"""A share of a limit from which on it counts as reached."""
KEPT = 0.1
"""Share of the run at its end in which nothing counts as settled: a motion that goes to and fro, or that a longer run
would show to leave again, is within its bounds there by chance."""


def stays_within(values: Any, bound: float) -> int | None:
    """The index from which all values are at most the bound, or None."""
    outside = np.flatnonzero(~(np.asarray(values) <= bound))
    first = int(outside[-1]) + 1 if outside.size else 0
    return first if first < len(values) else None


def too_late(index: float, count: int, kept: float = KEPT) -> bool:
    """Whether the sample of this index, of so many, lies within the last share of a run."""
    return index > (1.0 - kept) * (count - 1)


def on_limit(u: NDArray[np.float64], limit: float, kind: str) -> NDArray[np.bool_]:
    """Tell which samples (n, components) are on their limit; none where there is none."""
    if kind == "none" or not np.isfinite(limit):
        return np.zeros(len(u), dtype=bool)
    size = np.linalg.norm(u, axis=1) if kind == "norm" else np.abs(u).max(axis=1)
    return size >= limit * ALMOST
