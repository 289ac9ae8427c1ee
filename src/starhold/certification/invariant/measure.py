"""How large a set {V <= level} is: bounds from boxes inside it, and from boxes that may meet it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.intervals import Intervals
from starhold.certification.boxes import Sides
from starhold.certification.invariant.descent import Candidate
from starhold.certification.invariant.enclosure import Boxes, part, starts

BOXES = 150_000
ROUNDING = 1e-9
"""Taken from the lower bound and added to the upper one for the sums in floats."""


def _told(what: Candidate, level: float, sides: Sides) -> NDArray[np.bool_]:
    """Which boxes are in the set for certain, and which are outside: (2, boxes)."""
    boxes = Boxes(sides, sharp=True)
    inside, outside = np.ones(boxes.count, dtype=bool), np.ones(boxes.count, dtype=bool)
    for cell in what.guarded:
        values, absent = cell.V.on(boxes), ~cell.inside(boxes)
        inside &= absent | (values.high <= level)
        outside &= absent | (values.low > level)
    return np.array([inside, outside])


def volume(what: Candidate, level: float) -> list[float]:
    """Between which numbers the area (or volume) of {V <= level} in the box lies."""
    low = np.array([[a] for a, _ in what.box])
    high = np.array([[b] for _, b in what.box])
    within, looked = 0.0, 0
    while low.shape[1] and looked + 2 * low.shape[1] <= BOXES:
        looked += low.shape[1]
        sides = tuple(Intervals(a, b) for a, b in zip(low, high, strict=True))
        told = [_told(what, level, part(sides, k)) for k in starts(sides)]
        inside, outside = np.concatenate(told, axis=1)
        within += float(np.prod(high - low, axis=0)[inside & ~outside].sum())
        left = ~(inside | outside)
        low, high = low[:, left], high[:, left]
        side, lane = np.argmax(high - low, axis=0), np.arange(low.shape[1], dtype=np.intp)
        middle = 0.5 * (low[side, lane] + high[side, lane])
        lower, upper = high.copy(), low.copy()
        lower[side, lane] = upper[side, lane] = middle
        low, high = np.concatenate([low, upper], axis=1), np.concatenate([lower, high], axis=1)
    return [within * (1.0 - ROUNDING), (within + float(np.prod(high - low, axis=0).sum())) * (1.0 + ROUNDING)]
