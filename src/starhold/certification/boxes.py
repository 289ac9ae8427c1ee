"""Branch and bound: a statement about all points of a box, from enclosures on ever smaller boxes that cover it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.intervals import Intervals

Sides: TypeAlias = tuple[Intervals, ...]
"""Many boxes: for each variable the interval of every box."""


def holds_on(
    box: Sequence[tuple[float, float]], shown: Callable[[Sides], NDArray[np.bool_]], most: int, first: int = 1
) -> bool:
    """Whether `shown`, which tells of many boxes at once which of them need no further look, comes to tell it of boxes that
    cover this one before more than `most` have been looked at. `first`: parts into which each side is cut at once."""
    ends = [np.linspace(low, high, first + 1) for low, high in box]
    low, high = (
        np.array([side.ravel() for side in np.meshgrid(*(e[part] for e in ends), indexing="ij")])
        for part in (slice(None, -1), slice(1, None))
    )
    size = np.array([[b - a if b > a else 1.0] for a, b in box])
    looked = 0
    while low.shape[1]:
        looked += low.shape[1]
        if looked > most:
            return False
        left = ~shown(tuple(Intervals(a, b) for a, b in zip(low, high, strict=True)))
        low, high = low[:, left], high[:, left]
        # In two across the side that is longest as a share of the whole box's.
        side, lane = np.argmax((high - low) / size, axis=0), np.arange(low.shape[1], dtype=np.intp)
        middle = 0.5 * (low[side, lane] + high[side, lane])
        if ((middle <= low[side, lane]) | (middle >= high[side, lane])).any():
            return False
        lower, upper = high.copy(), low.copy()
        lower[side, lane] = upper[side, lane] = middle
        low, high = np.concatenate([low, upper], axis=1), np.concatenate([lower, high], axis=1)
    return True
