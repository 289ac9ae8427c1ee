"""Shows that a law keeps its torque, or what wheels have of it, within a limit, on a level set of V or everywhere."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import prod
from typing import Any

from starhold.algebra.polynomial import Monomial, Polynomial
from starhold.checker.exact import (
    ZERO,
    Interval,
    Rows,
    definite,
    demand,
    greatest,
    intervals,
    inverse,
    matmul,
    plus,
    rational,
    root_above,
    times,
    transpose,
)
from starhold.checker.gyroscopic import gyroscopic_bound
from starhold.checker.loop import RATE, TURN, ExactLoop, W, letters
from starhold.checker.region import Region
from starhold.checker.subject import LoopSubject, quadratic
from starhold.checker.well import SHAPES, keeps_below

__all__ = ["SHAPES", "bounded", "keeps_below", "keeps_within"]


def keeps_within(region: Region[Any], limit: Any, each_axis: bool, shift: Any | None, weight: Any | None) -> bool:
    """Whether each axis of the torque, or its norm, keeps within a limit on the region's level set (without one, and for a
    law of several pieces: everywhere). `shift`, `weight`: what bounds the part of the norm that is quadratic in the rate."""
    loop = region.loop
    plainly = each_axis or region.level is None or len(loop.pieces) > 1
    demand(not plainly or shift is None is weight, "a shift or a weight is for the norm of one piece of the law")
    if region.level is None or len(loop.pieces) > 1:
        return _in_every_state(loop, limit, each_axis)
    parts = list(loop.pieces[0][1].values())
    if each_axis:
        return all(bounded(region, [part], limit) for part in parts)
    return bounded(region, parts, limit, shift, weight)


def never_beyond(subject: LoopSubject) -> bool:
    """Whether the law keeps its torque within the loop's limit in every state."""
    limit, each_axis = subject.torque_limit, subject.limit == "axis"
    return limit is not None and subject.limit != "none" and _in_every_state(ExactLoop(subject), limit, each_axis)


def _in_every_state(loop: ExactLoop, limit: Any, each_axis: bool) -> bool:
    return all(
        _everywhere(loop, found, list(torque.values()), limit, each_axis)
        for truths, torque in loop.pieces
        if (found := intervals(truths, W)) is not None
    )


def bounded(
    region: Region[Any], parts: Sequence[Polynomial], limit: Any, shift: Any | None = None, weight: Any | None = None
) -> bool:
    """Whether the norm of polynomials in the state keeps within a limit on the region's level set."""
    s, well = region.well()
    P = region.frame.P
    P_inverse = inverse(P)
    springs = [(*well.beside, name) for name in TURN]
    dampers = [(name,) for name in RATE]
    stiffness, damping = ([[p.terms.get(m, ZERO) for m in own] for p in parts] for own in (springs, dampers))
    rest = [p.only(lambda m: m not in springs and m not in dampers and letters(m) != "ww") for p in parts]
    # The greatest |Aq| for |q| = 1, and for w.Pw = z2 the greatest |Bw + G(w)|, G quadratic, of which the square is at most
    # damped2 z2 + 2 mixed z3 + gyro2 z4 = (gyro z2 + along z)2 + (damped2 - along2) z2.
    common: list[Any] = [ZERO] * len(well.shapes)
    common[well.spring] = root_above(greatest(matmul(stiffness, transpose(stiffness))))
    damped, gyro = (
        greatest(matmul(matmul(damping, P_inverse), transpose(damping))),
        gyroscopic_bound(parts, P, shift, weight),
    )
    along = ZERO if gyro == 0 else min(_mixed(parts, damping, P_inverse) / gyro, root_above(damped))
    moving: list[list[Any]] = [[ZERO] * len(well.shapes) for _ in range(2)]
    moving[0][SHAPES.index((0, 2))], moving[0][SHAPES.index((0, 1))] = gyro, along
    moving[1][SHAPES.index((0, 1))] = root_above(max(damped - along**2, ZERO))
    loads = [_load(region.loop, p.terms, P_inverse, len(well.shapes)) for p in rest]
    ways: list[Any] = [((moving, loads), common)]
    if len(parts) == 1 and gyro > 0:
        for slope, offset in _lines(quadratic(parts[0].only(lambda m: letters(m) == "ww").terms, RATE), damping[0], P, gyro):
            line = list(common)
            line[SHAPES.index((0, 2))], line[SHAPES.index((0, 0))] = slope, offset
            ways.append(((loads,), line))
    return keeps_below(ways, limit, region.level, s, well)


def _lines(F: Rows, b: list[Any], P: Rows, gyro: Any) -> Iterator[tuple[Any, Any]]:
    """l and r with |b.w + w.Fw| <= l w.Pw + r: where [[l P -+ F, -+ b/2], [., r]] is nowhere negative."""
    for k in range(-8, 15):
        slope = gyro * (1 + rational(2.0 ** (k / 2)))
        forms = [plus(times(slope, P), F, sign) for sign in (1, -1)]
        demand(all(definite(form) for form in forms), "a form of the rate is not positive")
        yield slope, max(matmul(matmul([b], inverse(form)), transpose([b]))[0][0] for form in forms) / 4


def _mixed(parts: Sequence[Polynomial], damping: Rows, P_inverse: Rows) -> Any:
    """A bound of |Bw.G(w)| where w.Pw = 1, its monomials bounded one by one."""
    product = Polynomial({})
    for part, row in zip(parts, damping, strict=True):
        linear: Any = sum((c * w for c, w in zip(row, W, strict=True)), Polynomial({}))
        product = product + linear * part.only(lambda m: letters(m) == "ww")
    most = {name: root_above(P_inverse[k][k]) for k, name in enumerate(RATE)}
    return sum((abs(c) * prod(most[name] for name in m) for m, c in product.terms.items()), ZERO)


def _load(loop: ExactLoop, terms: Mapping[Monomial, Any], P_inverse: Rows, count: int) -> list[Any]:
    """Coefficients of so many shapes that bound a sum of monomials one by one: |w_j| <= z sqrt((P^-1)_jj), |q_j| <= |q|."""
    found: list[Any] = [ZERO] * count
    for monomial, c in terms.items():
        powers, most = [0, 0], abs(c)
        for name in monomial:
            if name in TURN:
                powers[0] += 1
            elif name in RATE:
                powers[1] += 1
                most *= root_above(P_inverse[RATE.index(name)][RATE.index(name)])
            else:
                most *= _outside(loop, name)
        demand(tuple(powers) in SHAPES, f"the torque has the term {' '.join(monomial)}")
        found[SHAPES.index((powers[0], powers[1]))] += most
    return found


def _outside(loop: ExactLoop, name: str) -> Any:
    """A bound of a variable that is neither a rate nor of the vector part."""
    subject = loop.subject
    if name[0] == "e":
        return subject.modelled[int(name[1]) - 1]
    known = {"q": 1, "r": subject.target_rate, "a": subject.target_acceleration}
    if subject.wheels is not None:
        known["h"] = subject.wheels.total
    demand(name[0] in known, f"the torque depends on {name}")
    return known[name[0]]


def _everywhere(
    loop: ExactLoop, found: Sequence[Interval], parts: Sequence[Polynomial], limit: Any, each_axis: bool
) -> bool:
    """Whether the torque keeps within the limit on a piece where the rates are in intervals, whatever the attitude."""
    bounds = [_bound(loop, found, part) for part in parts]
    if each_axis:
        return all(bound <= limit for bound in bounds)
    return sum((bound**2 for bound in bounds), ZERO) <= limit**2


def _bound(loop: ExactLoop, found: Sequence[Interval], part: Polynomial) -> Any:
    still = part.only(lambda m: len(m) == 1 and m[0] in TURN)
    # A single one needs no root, so that a stiffness and what it leaves to the damping fill the limit exactly.
    values = [abs(c) for c in still.terms.values()]
    total = sum(values, ZERO) if len(values) < 2 else root_above(sum((c * c for c in values), ZERO))
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
