"""Roots are found by halving, which is slow, and sure to the last digit."""

from __future__ import annotations

from collections.abc import Callable


def rising(function: Callable[[float], float], low: float, high: float) -> float:
    """Return where a function that is negative at `low` and not at `high` changes its sign, by halving until no number is
    left between; the end where it does not change."""
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (middle, high) if function(middle) < 0.0 else (low, middle)
    return high
