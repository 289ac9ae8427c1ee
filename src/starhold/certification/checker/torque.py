"""That a law keeps its torque within a limit, on a level set of V or everywhere. Nothing here is shared with the
certifier."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from flint import arb

from starhold.algebra.polynomial import Monomial, Polynomial
from starhold.certification.checker.exact import (
    ZERO,
    Interval,
    Rows,
    chained,
    demand,
    greatest,
    intervals,
    inverted,
    root_up,
    turned,
)
from starhold.certification.checker.loop import RATE, TURN, Loop, W

SHAPES = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
"""Powers of |q| and of the rate's bound z, by which the bound of a torque is sorted."""


def keeps_within(loop: Loop, level: Any | None, limit: Any, each_axis: bool) -> bool:
    """Whether each axis of the torque, or its norm, keeps within a limit where V <= level (None, and for a law of several
    pieces: everywhere)."""
    if level is None or len(loop.pieces) > 1:
        return all(
            _everywhere(loop, found, list(torque.values()), limit, each_axis)
            for truths, torque in loop.pieces
            if (found := intervals(truths, W)) is not None
        )
    parts = list(loop.pieces[0][1].values())
    turned_P = inverted(loop.frame.P)
    stiffness = [[p.terms.get((name,), ZERO) for name in TURN] for p in parts]
    damping = [[p.terms.get((name,), ZERO) for name in RATE] for p in parts]
    rest = [{m: c for m, c in p.terms.items() if not (len(m) == 1 and m[0] in (*TURN, *RATE))} for p in parts]
    loads = [_load(loop, terms, turned_P) for terms in rest]

    def linear(rows: Rows) -> list[Any]:
        # The greatest |Aq| for |q| = 1, and the greatest |Bw| for w.Pw = 1.
        own, square = _rows(stiffness, rows), _rows(damping, rows)
        most = [greatest(chained(own, turned(own))), greatest(chained(chained(square, turned_P), turned(square)))]
        return [ZERO, root_up(most[0]), root_up(most[1]), ZERO, ZERO, ZERO]

    s = loop.frame.s
    if not each_axis:
        return keeps_below(loads, linear([[0], [1], [2]]), limit, level, s)
    return all(keeps_below([load], linear([[k]]), limit, level, s) for k, load in enumerate(loads))


def _rows(matrix: Rows, kept: Rows) -> Rows:
    return [matrix[k] for (k,) in kept]


def _load(loop: Loop, terms: Mapping[Monomial, Any], turned_P: Rows) -> list[Any]:
    """Coefficients of SHAPES that bound a sum of monomials one by one: |w_j| <= z sqrt((P^-1)_jj), |q_j| <= |q|."""
    found: list[Any] = [ZERO] * len(SHAPES)
    for monomial, c in terms.items():
        powers, most = [0, 0], abs(c)
        for name in monomial:
            if name in TURN:
                powers[0] += 1
            elif name in RATE:
                powers[1] += 1
                most *= root_up(turned_P[RATE.index(name)][RATE.index(name)])
            else:
                most *= _outside(loop, name)
        demand(tuple(powers) in SHAPES, f"the torque has the term {' '.join(monomial)}")
        found[SHAPES.index((powers[0], powers[1]))] += most
    return found


def _outside(loop: Loop, name: str) -> Any:
    """What a variable that is neither a rate nor of the vector part does not exceed."""
    subject = loop.subject
    if name[0] == "e":
        return subject.modelled[int(name[1]) - 1]
    known = {"q": 1, "r": subject.target_rate, "a": subject.target_acceleration}
    demand(name[0] in known, f"the torque depends on {name}")
    return known[name[0]]


def _everywhere(loop: Loop, found: Sequence[Interval], parts: Sequence[Polynomial], limit: Any, each_axis: bool) -> bool:
    """The same on a piece where the rates are in intervals, whatever the attitude."""
    bounds = [_bound(loop, found, part) for part in parts]
    if each_axis:
        return all(bound <= limit for bound in bounds)
    return sum((bound**2 for bound in bounds), ZERO) <= limit**2


def _bound(loop: Loop, found: Sequence[Interval], part: Polynomial) -> Any:
    still = part.only(lambda m: len(m) == 1 and m[0] in TURN)
    # A single one needs no root, so that a stiffness and what it leaves to the damping fill the limit exactly.
    values = [abs(c) for c in still.terms.values()]
    total = sum(values, ZERO) if len(values) < 2 else root_up(sum((c * c for c in values), ZERO))
    low = high = part.terms.get((), ZERO)
    for monomial, c in (part - still).terms.items():
        if len(monomial) == 1 and monomial[0] in RATE:
            ends = found[RATE.index(monomial[0])]
            demand(None not in ends, f"the torque grows with {monomial[0]}")
            low, high = low + min(c * ends[0], c * ends[1]), high + max(c * ends[0], c * ends[1])
        elif monomial:
            most = abs(c)
            for name in monomial:
                demand(name not in RATE, f"the torque grows with {name}")
                most *= 1 if name in TURN else _outside(loop, name)
            total += most
    return total + max(abs(low), abs(high))


def keeps_below(loads: Sequence[Sequence[Any]], common: Sequence[Any], limit: Any, level: Any, s: Any) -> bool:
    """Whether sum_k common_k f_k(t) + |(sum_k loads_ik f_k(t))_i| <= limit for 0 <= t <= min(level, 2 s), the f_k being the
    products SHAPES of |q|2 = x (2 - x), x = t/s, and z2 = 2 (level - t).

    Each f_k is concave in t, as are squares of both, their roots, and the root of their product. So it lies under its
    tangents, and over a tangent the whole is convex: no more than at the ends of the piece.
    """
    demand(level > 0, "the level is not positive")
    waiting = [(ZERO, min(level, 2 * s))]
    for _ in range(4096):
        if not waiting:
            return True
        low, high = waiting.pop()
        tangents = _tangents((low + high) / 2, level, s)
        half = (high - low) / 2
        sizes: list[Any] = []
        for step in (ZERO, -half, half):
            heights = [height + slope * step for height, slope in tangents]
            sums = [sum((c * h for c, h in zip(load, heights, strict=True)), arb(0)) for load in (common, *loads)]
            sizes.append(sums[0] + sum((x * x for x in sums[1:]), arb(0)).sqrt())
        if sizes[0] > limit:
            # At the middle the tangents touch.
            return False
        if not (sizes[1] <= limit and sizes[2] <= limit):
            waiting += [(low, low + half), (low + half, high)]
    return False


def _tangents(at: Any, level: Any, s: Any) -> list[tuple[Any, Any]]:
    """Value and slope at t of each of SHAPES, as balls."""
    turn, energy = at / s * (2 - at / s), 2 * (level - at)
    found: list[tuple[Any, Any]] = []
    for p, r in SHAPES:
        inner, slope = turn**p * energy**r, ZERO
        if p:
            slope += p * turn ** (p - 1) * energy**r * (2 - 2 * at / s) / s
        if r:
            slope -= 2 * r * turn**p * energy ** (r - 1)
        height = arb(inner).sqrt()
        found.append((height, arb(slope) / (2 * height)))
    return found
