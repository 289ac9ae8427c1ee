"""The claim that the torque keeps within the actuators' limit on a level set of V, or everywhere."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
from flint import arb, fmpq
from numpy.typing import NDArray

from starhold.algebra.polynomial import Polynomial, exact, jointly
from starhold.certification.assumptions import UNLIMITED
from starhold.certification.certificate import BALLS, Claim, Obligation
from starhold.certification.convergence import Basin, assumed, reached
from starhold.certification.frame import contents
from starhold.certification.gyroscopic import GyroscopicTorque, gyroscopic_torque, is_gyroscopic
from starhold.certification.matrices import (
    Rows,
    floats,
    greatest,
    inverse,
    matmul,
    matrix_of,
    number,
    plus,
    root_above,
    times,
    transpose,
)
from starhold.certification.motion import ATTITUDE, AXES, RATE, Motion, Truths
from starhold.certification.refutation import rational_turn, state_evidence
from starhold.certification.subject import above, upper

DEPTH = 40
TRIES = (1e-6, 1e-5, 1e-4, 1e-3)
SLIGHTLY_MORE = 1 + fmpq(1, 2**40)
"""For what is rounded down on the way from a turn to a level and back."""
LINES = range(-8, 15)
UNEQUAL = "the weights of the direction cosines differ, for which no bound of the torque is built"


Terms: TypeAlias = tuple[tuple[tuple[int, int, int], int, Any], ...]


@dataclass(frozen=True)
class LimitedLoad:
    """Bounds of one axis of the torque (or of its norm, or of a motor's), with z2 = w.Pw.

    `rate`, of the part Bw that is linear in the rate: the square of its greatest norm for z = 1. `gyroscopic`: of the part
    G(w) that is quadratic. `mixed`: what |Bw.G(w)| does not exceed, so that |Bw + G(w)|2 is at most
    rate z2 + 2 mixed z3 + gyroscopic2 z4. `lines`: of a single component pairs l, r with |Bw + G(w)| <= l z2 + r too.
    `attitude`, of what is linear in the attitude: the square of its size. `rest`: of each component the other monomials as
    (powers of |w_j|, power of |q|, size). `limit`: what the whole has to keep below."""

    rate: Any
    attitude: Any
    gyroscopic: GyroscopicTorque
    mixed: Any
    lines: tuple[tuple[Any, Any], ...]
    rest: tuple[Terms, ...]
    limit: Any


def torque_limit(basin: Basin, turn: float | None = None) -> Claim | None:
    """The claim for the largest level, or for every turn from rest up to `turn` (rad); None for a craft without limit."""
    subject = basin.motion.subject
    limit, kind = subject.loop.craft.torque_limit, subject.loop.limit
    if kind == "none" or not np.isfinite(limit):
        return None
    pieces = jointly(basin.motion.torque)
    numbers: dict[str, Any] = {"limit": limit, "kind": kind}
    shown_by = GyroscopicTorque(fmpq(0))

    def claim(level: Any | None, holds: bool, evidence: dict[str, Any] | None = None) -> Claim:
        told = told_set(basin, level, turn)
        outcome = "proved" if holds else "refuted" if evidence and "state" in evidence else "undecided"
        torque = Obligation("torque", BALLS, outcome, {} if holds or evidence is None else evidence)
        before, witness = reached(basin, level)
        for name, value in (("shift", shown_by.shift), ("weight", shown_by.weight)):
            witness[name] = None if value is None else number(value)
        return Claim("torque-limit", numbers | told, witness, assumed(subject, limits=()), (*before, torque))

    if len(pieces) > 1:
        reason = {"reason": "a clipped torque is bounded for a target at rest and limits of each axis only"}
        return claim(basin.stay, _everywhere(pieces, exact(limit), kind), reason)
    if basin.frame.s is None:
        return claim(fmpq(0), False, {"reason": UNEQUAL})
    parts = pieces[0][1]
    carried = loads(basin, parts, kind, exact(limit))
    if kind == "norm":
        shown_by = carried[0].gyroscopic
    if turn is None:
        level = largest_level(basin, carried)
        return claim(fmpq(0), False, {"reason": "no level is small enough"}) if level is None else claim(level, True)
    start, level = level_of_turn(basin, turn)
    if basin.stay is not None and level > basin.stay:
        return claim(level, False, {"reason": "the region of convergence does not reach that far"})
    if within(basin, carried, level):
        return claim(level, True)
    return claim(level, False, _overload(basin, parts, start, exact(limit), kind) or {"reason": "not shown"})


def needed(claims: Sequence[Claim], motion: Motion) -> list[Claim]:
    """The claims without the assumption that torque is not limited, where the law itself never asks for more than its
    limit."""
    limit, kind = motion.subject.loop.craft.torque_limit, motion.subject.loop.limit
    pieces = jointly(motion.torque) if kind != "none" and np.isfinite(limit) else []
    if len(pieces) < 2 or not _everywhere(pieces, exact(limit), kind):
        return [*claims]
    return [
        c if c.proof else replace(c, assumptions=tuple(name for name in c.assumptions if name != UNLIMITED)) for c in claims
    ]


def told_set(basin: Basin, level: Any | None, turn: float | None) -> dict[str, Any]:
    """The numbers of {V <= level}, and of the set that motions start from; of its turn what was asked for."""
    start = basin.start_of(level)
    told = {"level": None if level is None else number(level), "start": None if start is None else number(start)}
    told |= contents(start, basin.frame.P, basin.frame.potential)
    return told if turn is None else told | {"slew_angle": turn}


def level_of_turn(basin: Basin, turn: float) -> tuple[Any, Any]:
    """V at rest after a turn (rad), and the level that motions from there stay below, both from above."""
    potential = basin.frame.potential
    # Without cancellation: 1 - cos(turn/2) is twice the square of a sine.
    sine = (arb(turn) / (2 if potential.even else 4)).sin()
    size: Any = potential.s
    start = exact(above(upper(size * (1 if potential.even else 2) * sine * sine) * SLIGHTLY_MORE))
    return start, exact(above(start * (1 + basin.rho) / (1 - basin.rho) * SLIGHTLY_MORE))


def _everywhere(pieces: list[tuple[Truths, list[Polynomial]]], limit: Any, kind: str) -> bool:
    """Whether on every piece each axis of the torque is within the limit, whatever the state."""
    if kind != "axis":
        return False
    return all(_clipped_axis(truths, component, limit) for truths, parts in pieces for component in parts)


def _clipped_axis(truths: Truths, component: Polynomial, limit: Any) -> bool:
    stiff = component.only(lambda m: len(m) == 1 and m[0] in AXES)
    rest = component - stiff
    room = limit - _root_above_sum(stiff)
    value = rest.value
    if value is not None:
        return abs(value) <= room
    above = below_ = None
    for condition, truth in truths:
        # What is not positive bounds the rest from the side on which it holds it.
        if truth:
            continue
        offset = (condition.positive - rest).value
        if offset is not None:
            above = -offset
        offset = (condition.positive + rest).value
        if offset is not None:
            below_ = -offset
    return above is not None and below_ is not None and max(above, below_) <= room


def _root_above_sum(linear: Polynomial) -> Any:
    # One component needs no square root, so that a stiffness and its clip fill the limit exactly.
    values = [abs(c) for c in linear.terms.values()]
    if len(values) <= 1:
        return sum(values, fmpq(0))
    return root_above(sum((c * c for c in values), fmpq(0)))


def loads(basin: Basin, parts: list[Polynomial], kind: str, limit: Any) -> list[LimitedLoad]:
    """The loads of each axis, or of the norm, with their common limit."""
    return [load_of(basin, group, limit) for group in ([[part] for part in parts] if kind == "axis" else [parts])]


def load_of(basin: Basin, parts: list[Polynomial], limit: Any) -> LimitedLoad:
    """The load of one component, or of the norm of several."""
    rows = [_linear(basin, part) for part in parts]
    rates, attitudes = [row[0] for row in rows], [row[1] for row in rows]
    inverse_of = inverse(basin.frame.P)
    rate = greatest(matmul(matmul(rates, inverse_of), transpose(rates)))
    attitude = greatest(matmul(attitudes, transpose(attitudes)))
    turning = gyroscopic_torque(parts, basin.frame.P)
    mixed = min(_mixed(parts, rates, inverse_of), root_above(rate) * turning.most)
    lines = _lines(parts[0], rates[0], basin.frame.P, turning.most) if len(parts) == 1 else ()
    return LimitedLoad(rate, attitude, turning, mixed, lines, tuple(_rest(basin, part) for part in parts), limit)


def _lines(part: Polynomial, row: list[Any], P: Rows, most: Any) -> tuple[tuple[Any, Any], ...]:
    """Lines that bound b.w + w.Fw, |w.Fw| <= most w.Pw, for some l above most: as l P - F and l P + F are positive
    definite, its size exceeds l w.Pw by b.(l P -+ F)^-1 b/4 at most. The least over all l is its maximum on w.Pw = z2
    (S-procedure)."""
    if most == 0 or not any(row):
        return ()
    F, found = matrix_of(part.only(is_gyroscopic), RATE, RATE), list[tuple[Any, Any]]()
    for k in LINES:
        slope = most * (1 + exact(2.0 ** (k / 2)))
        turned = [inverse(plus(times(slope, P), F, sign)) for sign in (1, -1)]
        found.append((slope, max(matmul(matmul([row], form), transpose([row]))[0][0] for form in turned) / 4))
    return tuple(found)


def _mixed(parts: list[Polynomial], rates: Rows, inverse_of: Rows) -> Any:
    """A bound of |Bw.G(w)| for w.Pw = 1, monomial by monomial: exactly zero where G only turns Bw."""
    total: Any = Polynomial.constant(0)
    for part, row in zip(parts, rates, strict=True):
        linear = Polynomial({(name,): c for name, c in zip(RATE, row, strict=True) if c != 0})
        total = total + linear * part.only(is_gyroscopic)
    sizes = {name: root_above(inverse_of[j][j]) for j, name in enumerate(RATE)}
    return sum((abs(c) * sizes[m[0]] * sizes[m[1]] * sizes[m[2]] for m, c in total.terms.items()), fmpq(0))


def _linear(basin: Basin, part: Polynomial) -> tuple[list[Any], list[Any]]:
    rate = [part.terms.get((name,), fmpq(0)) for name in RATE]
    return rate, [part.terms.get(monomial, fmpq(0)) for monomial in basin.frame.potential.linear]


def _rest(basin: Basin, component: Polynomial) -> Terms:
    subject = basin.motion.subject
    sizes = {
        "r": subject.target_rate,
        "a": subject.target_acceleration,
        "m": subject.disturbance,
        "h": subject.total_momentum,
    }
    found: list[tuple[tuple[int, int, int], int, Any]] = []
    for monomial, c in component.terms.items():
        if (
            monomial in basin.frame.potential.linear
            or (len(monomial) == 1 and monomial[0] in RATE)
            or is_gyroscopic(monomial)
        ):
            continue
        size, attitude = abs(c), 0
        for name in monomial:
            if name[0] == "e":
                size = size * subject.modelled[int(name[1]) - 1]
            elif name in AXES:
                attitude += 1
            elif name[0] in sizes:
                size = size * sizes[name[0]]
        powers = (monomial.count("w1"), monomial.count("w2"), monomial.count("w3"))
        found.append((powers, attitude, size))
    return tuple(found)


class Bound:
    """The bound of a load on {V = level, potential = t}, as balls."""

    def __init__(self, load: LimitedLoad, basin: Basin, level: Any) -> None:
        turned = inverse(basin.frame.P)
        self.load, self.potential, self.level = load, basin.frame.potential, arb(level)
        self.rate, self.attitude, self.mixed = arb(load.rate), arb(load.attitude).sqrt(), 2 * arb(load.mixed)
        self.square = arb(load.gyroscopic.most) ** 2
        self.axes = [arb(turned[j][j]).sqrt() for j in range(3)]
        self.lines = [(arb(slope), arb(offset)) for slope, offset in load.lines]
        self.rest = [[(powers, attitude, arb(size)) for powers, attitude, size in terms] for terms in load.rest]

    def between(self, first: Any, last: Any) -> arb:
        """An enclosure of an upper bound for t between two rationals."""
        energy = (2 * (self.level - arb(first))).nonnegative_part().sqrt()
        linear, turned = self.potential.sizes(first, last)
        square = energy**2
        moving = energy * (self.rate + self.mixed * energy + self.square * square).sqrt()
        for slope, offset in self.lines:
            moving = moving.min(slope * square + offset)
        squares = arb(0)
        for terms in self.rest:
            total = arb(0)
            for powers, attitude, size in terms:
                term = size * turned**attitude
                for axis, power in zip(self.axes, powers, strict=True):
                    term = term * (axis * energy) ** power
                total = total + term
            squares = squares + total**2
        return moving + self.attitude * linear + squares.sqrt()

    def below(self, limit: Any, first: Any, last: Any, depth: int = 0) -> bool:
        """Whether it is at most a rational for t between two others, by branch and bound."""
        if self.between(first, last) <= limit:
            return True
        if depth == DEPTH or self.between(first, first) > limit:
            return False
        middle = (first + last) / 2
        return self.below(limit, first, middle, depth + 1) and self.below(limit, middle, last, depth + 1)


def within(basin: Basin, carried: list[LimitedLoad], level: Any) -> bool:
    """Whether every load is within its limit on {V <= level}."""
    last = min(level, basin.frame.potential.top)
    return all(Bound(load, basin, level).below(load.limit, fmpq(0), last) for load in carried)


def largest_level(
    basin: Basin, carried: list[LimitedLoad], cap: Any | None = None, tries: tuple[float, ...] = TRIES
) -> Any | None:
    """The largest level, no more than `cap`, that is shown to keep every load within its limit; `tries`: what share of the
    largest by floats is given away for that, the first that will do."""
    size = guesser(basin, carried)
    limits = np.array([number(load.limit) for load in carried])

    def guess(level: float) -> bool:
        return bool((size(level) <= limits).all())

    low, high = 0.0, number(basin.frame.s) * 1e-6
    caps = [number(bound) * (1.0 - 1e-12) for bound in (basin.stay, cap) if bound is not None]
    top = min(caps, default=np.inf)
    while high < min(top, 1e300) and guess(high):
        low, high = high, 2.0 * high
    if high >= top and guess(top):
        low = top
    for _ in range(60):
        middle = 0.5 * (low + min(high, top))
        low, high = (middle, high) if guess(middle) else (low, middle)
    for less in tries:
        level = exact(float(low * (1.0 - less)))
        if level > 0 and within(basin, carried, level):
            return level
    return None


def guesser(basin: Basin, carried: list[LimitedLoad]) -> Callable[[float], NDArray[np.float64]]:
    """The bounds of the loads on {V <= level} in floats, on a grid."""
    potential = basin.frame.potential
    top = number(potential.top)
    grid = 0.5 * (1.0 - np.cos(np.linspace(0.0, np.pi, 801)))
    axes = np.sqrt(np.diagonal(floats(inverse(basin.frame.P))))

    def size(terms: Terms, turned: Any, energy: Any) -> Any:
        shares = [(axes ** np.array(powers)).prod() * energy ** sum(powers) for powers, _, _ in terms]
        return sum((number(c) * turned**a * share for (_, a, c), share in zip(terms, shares, strict=True)), 0.0 * energy)

    def sizes(level: float) -> NDArray[np.float64]:
        t = min(level, top) * grid
        energy = np.sqrt(2.0 * np.maximum(level - t, 0.0))
        linear, turned = potential.grid(t)
        found: list[float] = []
        for load in carried:
            rate, attitude, mixed, most = (number(x) for x in (load.rate, load.attitude, load.mixed, load.gyroscopic.most))
            moving = energy * np.sqrt(rate + 2.0 * mixed * energy + (most * energy) ** 2)
            for slope, offset in load.lines:
                moving = np.minimum(moving, number(slope) * energy**2 + number(offset))
            rest = np.sqrt(sum((size(terms, turned, energy) ** 2 for terms in load.rest), 0.0 * energy))
            found.append(float((moving + np.sqrt(attitude) * linear + rest).max()))
        return np.array(found)

    return sizes


def _overload(basin: Basin, parts: list[Polynomial], level: Any, limit: Any, kind: str) -> dict[str, Any] | None:
    """A state in {V <= level} at which the torque exceeds its limit, verified."""
    P, potential = basin.frame.P, basin.frame.potential
    turned = floats(inverse(P))
    random = np.random.default_rng(0)
    for i, part in enumerate(parts):
        rate, attitude = _linear(basin, part)
        stiff, damp = np.array([number(c) for c in attitude]), turned @ np.array([number(c) for c in rate])
        damp /= max(np.sqrt(damp @ floats(P) @ damp), 1e-300)
        for share in np.concatenate([np.linspace(0.0, 1.0, 101), random.uniform(size=100)]):
            axis = stiff / max(np.linalg.norm(stiff), 1e-300)
            t = share * min(number(level), number(potential.top)) * (1.0 - 1e-9)
            q0 = float(np.ravel(potential.cosine(t, axis[None]))[0])
            q = rational_turn([q0, *(np.sqrt(max(1.0 - q0 * q0, 0.0)) * axis)])
            left = number(level - potential.at(q))
            if left < 0.0:
                continue
            w = [exact(float(x)) for x in np.sqrt(2.0 * left) * (1.0 - 1e-9) * damp]
            values: dict[str, Any] = dict(zip([*ATTITUDE, *RATE], [*q, *w], strict=True))
            outside = {name for p in parts for name in p.variables() if name not in values}
            values |= dict.fromkeys(outside, fmpq(0))
            found = [p.at(values) for p in parts]
            energy = sum((w[j] * P[j][k] * w[k] for j in range(3) for k in range(3)), fmpq(0)) / 2
            over = abs(found[i]) > limit if kind == "axis" else sum((x * x for x in found), fmpq(0)) > limit * limit
            if over and energy + potential.at(q) <= level:
                size = abs(found[i]) if kind == "axis" else exact(float(np.linalg.norm([number(x) for x in found])))
                return state_evidence(q, w, "torque", size)
    return None
