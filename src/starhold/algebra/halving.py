"""Roots by bisection, which is slow but exact to the last digit."""

from __future__ import annotations

from collections.abc import Callable


def rising(function: Callable[[float], float], low: float, high: float) -> float:
    """Return the root of an increasing function, by bisection of [low, high] until no float lies between. If the function
    is nowhere negative, this is the float after `low`; if it is negative everywhere, `high`."""
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (middle, high) if function(middle) < 0.0 else (low, middle)
    return high
