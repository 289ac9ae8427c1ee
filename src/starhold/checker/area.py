"""Bounds of the size of {V <= level}, by parts of the box that are surely inside or outside of it."""

from __future__ import annotations

from typing import Any

import numpy as np
from flint import fmpq

from starhold.checker.bernstein import halves, stacked, steepest
from starhold.checker.covering import as_terms, highest
from starhold.checker.exact import ONE, NotCheckedError, demand
from starhold.checker.indicator import Indicator

MOST = 1_000_000


def area(what: Indicator, low: Any, high: Any) -> str:
    """That the size is between two numbers: parts are halved until those inside have the one and those not outside have not
    the other."""
    pieces = what.pieces
    demand(pieces.moving == len(pieces.names) and what.level is not None, "such a claim has no size")
    box = dict(zip(pieces.names, pieces.box, strict=True))
    whole = ONE
    for start, end in box.values():
        whole *= end - start
    stack: list[Any] = []
    places: list[tuple[int, list[int]]] = []
    for cell in pieces.cells:
        places.append((len(stack), list(range(len(stack) + 2, len(stack) + 2 + len(cell.guards)))))
        stack += [as_terms(what.level - cell.V), as_terms(cell.V - what.level), *map(as_terms, cell.guards)]
    waiting = stacked(stack, box, highest(stack, box))
    # Shares of the box are powers of 1/2 and sums of few of them: floats hold them exactly.
    share, inside, seen = np.ones(1), 0.0, 0
    while seen < MOST:
        seen += len(waiting)
        rows: Any = waiting.reshape(len(waiting), len(stack), -1)
        surely: Any = (rows < 0).all(axis=2)
        within, without = np.ones(len(rows), dtype=bool), np.ones(len(rows), dtype=bool)
        for place, guards in places:
            missed = surely[:, guards].any(axis=1)
            without &= missed | surely[:, place]
            within &= missed | surely[:, place + 1]
        inside += float(share[within & ~without].sum())
        left = ~(within | without)
        waiting, share = waiting[left], share[left]
        least, most = (fmpq(*float(x).as_integer_ratio()) * whole for x in (inside, inside + float(share.sum())))
        demand(least <= high and most >= low, "the size is not between the numbers")
        if least >= low and most <= high:
            return "counted in parts of the box"
        axes = steepest(waiting)
        parts = [(halves(waiting[axes == k], k), share[axes == k] / 2.0) for k in range(2, waiting.ndim)]
        waiting = np.concatenate([both for both, _ in parts])
        share = np.concatenate([np.concatenate([own, own]) for _, own in parts])
    raise NotCheckedError("bounds of the size that are as close")
