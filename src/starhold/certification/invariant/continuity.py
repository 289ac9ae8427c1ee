"""Whether a piecewise polynomial is continuous: on every surface between two cells both have to be the same."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from starhold.certification.certificate import EXACT
from starhold.certification.invariant import search
from starhold.certification.invariant.descent import Candidate, Guarded
from starhold.certification.invariant.enclosure import Boxes, EnclosedPolynomial, Mask, everywhere
from starhold.certification.invariant.system import solve


def continuous(what: Candidate) -> tuple[str, bool | None, dict[str, Any]]:
    """How it was shown, whether V is continuous in the box (None: not known), and the state that refutes it or a reason."""
    how = EXACT
    cells = what.guarded
    for place, one in enumerate((*cells, *what.thin)):
        for other in cells[place + 1 :] if place < len(cells) else cells:
            between = one.cell.apart(other.cell)
            if what.pieces.agree(one.cell, other.cell, [(one.cell.V, other.cell.V)]):
                continue
            how = "interval arithmetic"
            if _apart(what, one, other, between):
                continue
            jump = _jump(what, one, other, between)
            reason = {"reason": "V is not shown to be the same from both sides of a surface"}
            return how, None if jump is None else False, jump or reason
    return how, True, {}


def _apart(what: Candidate, one: Guarded, other: Guarded, between: Sequence[int]) -> bool:
    """Whether two closed cells have no point of the box in common."""
    surfaces = [EnclosedPolynomial(what.pieces.surfaces[k]) for k in between]

    def shown(boxes: Boxes) -> Mask:
        done = ~one.inside(boxes) | ~other.inside(boxes)
        for surface in surfaces:
            values = surface.on(boxes)
            done |= (values.low > 0.0) | (values.high < 0.0)
        return done

    return everywhere(what.box, shown, most=50_000)


def _jump(what: Candidate, one: Guarded, other: Guarded, between: Sequence[int]) -> dict[str, Any] | None:
    """A state of both closed cells at which their V differ, verified; looked for on linear surfaces."""
    linear = ((surface, solve(surface)) for surface in (what.pieces.surfaces[k] for k in between))
    surface, solved = next((found for found in linear if found[1] is not None), (None, None))
    if solved is None:
        return None
    place, instead = solved
    onto = [surface]
    points = search.grid([(0.0, 0.0) if k == place else side for k, side in enumerate(what.box)], 41)
    gaps = np.abs(EnclosedPolynomial(what.pieces.reduced(one.cell.V - other.cell.V, onto)).at(points))
    for k in np.argsort(-gaps, kind="stable"):
        state = list(next(search.rounded(points[:, k])))
        state[place] = instead(*state)
        cells = search.closed_cells(what, state)
        inside = all(low <= x <= high for x, (low, high) in zip(map(search.number, state), what.box, strict=True))
        if inside and one.cell in cells and other.cell in cells:
            sides = [one.cell.V(*state), other.cell.V(*state)]
            if sides[0] != sides[1]:
                return {"state": search.named(what, state), "V from both sides": [search.number(v) for v in sides]}
    return None
