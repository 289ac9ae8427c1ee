"""Roots are found by bisection, which is slow and exact to the last digit."""

from __future__ import annotations

from collections.abc import Callable


def rising(function: Callable[[float], float], low: float, high: float) -> float:
    """Return the root of a function that is negative at `low` and not at `high`, by bisection until no float lies between.
    Of a function that is never negative, return the float after `low`; of one that is always negative, `high`."""
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (middle, high) if function(middle) < 0.0 else (low, middle)
    return high
