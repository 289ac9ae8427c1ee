"""The claim that the torque keeps within the actuators' limit on a level set of V, or everywhere."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from flint import arb, fmpq

from starhold.algebra.polynomial import Polynomial, exact, jointly
from starhold.certification.certificate import BALLS, Claim, Obligation
from starhold.certification.convergence import ASSUMPTIONS, Basin, reached
from starhold.certification.frame import AXES, contents
from starhold.certification.matrices import (
    Rows,
    definite,
    floats,
    inverse,
    number,
    plus,
    product,
    root_above,
    scaled,
    transposed,
)
from starhold.certification.motion import ATTITUDE, RATE, Motion, Truths
from starhold.certification.refutation import rational_turn, state_evidence

DEPTH = 40


@dataclass(frozen=True)
class Load:
    """What bounds one axis of the torque (or its norm): squares of the greatest linear part of the rate for w.Pw = 1 and
    of the attitude for |q| = 1, and the other monomials as (powers of |w_j|, power of |q|, size)."""

    rate: Any
    attitude: Any
    rest: tuple[tuple[tuple[int, int, int], int, Any], ...]


def torque_limit(basin: Basin, turn: float | None = None) -> Claim | None:
    """The claim for the largest level, or for every turn from rest up to `turn` (rad); None for a craft without limit."""
    subject = basin.motion.subject
    limit, kind = subject.loop.craft.torque_limit, subject.loop.limit
    if kind == "none" or not np.isfinite(limit):
        return None
    assumptions = tuple(a for a in ASSUMPTIONS if a != "torque not limited")
    pieces = jointly(basin.motion.torque)
    numbers: dict[str, Any] = {"limit": limit, "kind": kind}

    def claim(level: Any | None, holds: bool, evidence: dict[str, Any] | None = None) -> Claim:
        start = basin.start_of(level)
        told = {"level": None if level is None else number(level), "start": None if start is None else number(start)}
        told |= contents(start, basin.frame.P, basin.frame.s)
        if turn is not None:
            told["turn"] = turn
        outcome = "proved" if holds else "refuted" if evidence and "state" in evidence else "undecided"
        torque = Obligation("torque", BALLS, outcome, {} if holds or evidence is None else evidence)
        before, witness = reached(basin, level)
        return Claim("torque-limit", numbers | told, witness, assumptions, (*before, torque))

    if len(pieces) > 1:
        reason = {"reason": "a clipped torque is bounded for a target at rest and limits of each axis only"}
        return claim(basin.stay, _everywhere(pieces, exact(limit), kind), reason)
    parts = pieces[0][1]
    carried = loads(basin, parts, kind)
    if turn is None:
        level = _largest_level(basin, carried, exact(limit))
        return claim(fmpq(0), False, {"reason": "no level is small enough"}) if level is None else claim(level, True)
    start = exact(number(basin.frame.s) * (1.0 - np.cos(0.5 * turn)) * (1.0 + 1e-12))
    level = start * (1 + basin.rho) / (1 - basin.rho)
    if basin.stay is not None and level > basin.stay:
        return claim(level, False, {"reason": "the region of convergence does not reach that far"})
    level = exact(number(level))
    if _within(basin, carried, level, exact(limit)):
        return claim(level, True)
    return claim(level, False, _overload(basin, parts, start, exact(limit), kind) or {"reason": "not shown"})


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


def loads(basin: Basin, parts: list[Polynomial], kind: str) -> list[Load]:
    """The loads of each axis, or of the norm."""
    turned = inverse(basin.frame.P)
    linear_rate = [[p.terms.get((name,), fmpq(0)) for name in RATE] for p in parts]
    linear_attitude = [[p.terms.get((name,), fmpq(0)) for name in AXES] for p in parts]
    rests = [_rest(basin.motion, p) for p in parts]
    if kind == "axis":
        return [
            Load(_square(row, turned), sum((c * c for c in stiff), fmpq(0)), rest)
            for row, stiff, rest in zip(linear_rate, linear_attitude, rests, strict=True)
        ]
    gram = product(transposed(linear_rate), linear_rate)
    rate = _relative_greatest(gram, basin.frame.P)
    attitude = _relative_greatest(product(transposed(linear_attitude), linear_attitude), _unit())
    return [Load(rate, attitude, tuple(item for rest in rests for item in rest))]


def _unit() -> Rows:
    return [[fmpq(int(i == j)) for j in range(3)] for i in range(3)]


def _square(row: list[Any], form: Rows) -> Any:
    return sum((row[i] * form[i][j] * row[j] for i in range(3) for j in range(3)), fmpq(0))


def _relative_greatest(a: Rows, b: Rows) -> Any:
    """A rational mu with mu b - a positive definite, just above the smallest."""
    size = floats(b)
    guess = float(np.linalg.eigvals(np.linalg.solve(size, floats(a))).real.max())
    for step in (1e-13, 1e-11, 1e-9, 1e-6, 1e-3, 1.0):
        mu = exact(max(guess, 1e-300) * (1.0 + step))
        if definite(plus(scaled(b, mu), a, -1)):
            return mu
    raise ArithmeticError("no bound of the damping was found")


def _rest(motion: Motion, component: Polynomial) -> tuple[tuple[tuple[int, int, int], int, Any], ...]:
    subject = motion.subject
    sizes = {"r": subject.target_rate, "a": subject.target_acceleration, "m": subject.disturbance}
    found: list[tuple[tuple[int, int, int], int, Any]] = []
    for monomial, c in component.terms.items():
        if len(monomial) == 1 and (monomial[0] in RATE or monomial[0] in AXES):
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
    """The bound of a load on {V = level, s (1 - q0) = t}, as balls."""

    def __init__(self, load: Load, basin: Basin, level: Any) -> None:
        turned = inverse(basin.frame.P)
        self.load, self.s, self.level = load, arb(basin.frame.s), arb(level)
        self.rate, self.attitude = arb(load.rate).sqrt(), arb(load.attitude).sqrt()
        self.axes = [arb(turned[j][j]).sqrt() for j in range(3)]

    def between(self, first: Any, last: Any) -> arb:
        """An enclosure of an upper bound for t between two rationals."""
        energy = (2 * (self.level - arb(first))).nonnegative_part().sqrt()
        share, other = arb(first) / self.s, arb(last) / self.s
        # |q|2 = x (2 - x) with x = t/s rises up to x = 1 and falls after.
        widest = other if other <= 1 else share if share >= 1 else arb(1)
        turned = (widest * (2 - widest)).nonnegative_part().sqrt()
        total = self.rate * energy + self.attitude * turned
        for powers, attitude, size in self.load.rest:
            term = arb(size) * turned**attitude
            for axis, power in zip(self.axes, powers, strict=True):
                term = term * (axis * energy) ** power
            total = total + term
        return total


def _within(basin: Basin, carried: list[Load], level: Any, limit: Any) -> bool:
    """Whether the torque is within its limit on {V <= level}, by branch and bound in balls."""
    last = min(level, 2 * basin.frame.s)
    return all(_below_limit(Bound(load, basin, level), fmpq(0), last, arb(limit), 0) for load in carried)


def _below_limit(bound: Bound, first: Any, last: Any, limit: arb, depth: int) -> bool:
    if bound.between(first, last) <= limit:
        return True
    if depth == DEPTH or bound.between(first, first) > limit:
        return False
    middle = (first + last) / 2
    return _below_limit(bound, first, middle, limit, depth + 1) and _below_limit(bound, middle, last, limit, depth + 1)


def _largest_level(basin: Basin, carried: list[Load], limit: Any) -> Any | None:
    """The largest level, to six digits, that is shown to keep the torque within its limit."""
    guess = _guesser(basin, carried, number(limit))
    low, high = 0.0, number(basin.frame.s) * 1e-6
    top = np.inf if basin.stay is None else number(basin.stay) * (1.0 - 1e-12)
    while high < top and guess(high):
        low, high = high, 2.0 * high
    if high >= top and guess(top):
        low = top
    for _ in range(60):
        middle = 0.5 * (low + min(high, top))
        low, high = (middle, high) if guess(middle) else (low, middle)
    for less in (1e-6, 1e-5, 1e-4, 1e-3):
        level = exact(float(low * (1.0 - less)))
        if level > 0 and _within(basin, carried, level, limit):
            return level
    return None


def _guesser(basin: Basin, carried: list[Load], limit: float) -> Callable[[float], bool]:
    """A test in floats, on a grid, of what `_within` proves."""
    s = number(basin.frame.s)
    grid = 0.5 * (1.0 - np.cos(np.linspace(0.0, np.pi, 801)))
    axes = np.sqrt(np.diagonal(floats(inverse(basin.frame.P))))
    plain = [
        (float(np.sqrt(number(c.rate))), float(np.sqrt(number(c.attitude))), [(p, a, number(size)) for p, a, size in c.rest])
        for c in carried
    ]

    def guess(level: float) -> bool:
        t = min(level, 2.0 * s) * grid
        energy, turned = np.sqrt(2.0 * np.maximum(level - t, 0.0)), np.sqrt(np.maximum(t / s * (2.0 - t / s), 0.0))
        for rate, attitude, rest in plain:
            total = rate * energy + attitude * turned
            for powers, degree, size in rest:
                total = total + size * turned**degree * float(np.prod(axes ** np.array(powers))) * energy ** sum(powers)
            if total.max() > limit:
                return False
        return True

    return guess


def _overload(basin: Basin, parts: list[Polynomial], level: Any, limit: Any, kind: str) -> dict[str, Any] | None:
    """A state in {V <= level} at which the torque exceeds its limit, verified."""
    P, s = basin.frame.P, basin.frame.s
    turned = floats(inverse(P))
    random = np.random.default_rng(0)
    for i, part in enumerate(parts):
        stiff = np.array([number(part.terms.get((name,), fmpq(0))) for name in AXES])
        damp = turned @ np.array([number(part.terms.get((name,), fmpq(0))) for name in RATE])
        damp /= max(np.sqrt(damp @ floats(P) @ damp), 1e-300)
        for share in np.concatenate([np.linspace(0.0, 1.0, 101), random.uniform(size=100)]):
            t = share * min(number(level), 2.0 * number(s)) * (1.0 - 1e-9)
            q0 = 1.0 - t / number(s)
            axis = stiff / max(np.linalg.norm(stiff), 1e-300)
            q = rational_turn([q0, *(np.sqrt(max(1.0 - q0 * q0, 0.0)) * axis)])
            left = number(level - s * (1 - q[0]))
            if left < 0.0:
                continue
            w = [exact(float(x)) for x in np.sqrt(2.0 * left) * (1.0 - 1e-9) * damp]
            values: dict[str, Any] = dict(zip([*ATTITUDE, *RATE], [*q, *w], strict=True))
            outside = {name for p in parts for name in p.variables() if name not in values}
            values |= dict.fromkeys(outside, fmpq(0))
            found = [p.at(values) for p in parts]
            energy = sum((w[j] * P[j][k] * w[k] for j in range(3) for k in range(3)), fmpq(0)) / 2
            over = abs(found[i]) > limit if kind == "axis" else sum((x * x for x in found), fmpq(0)) > limit * limit
            if over and energy + s * (1 - q[0]) <= level:
                size = abs(found[i]) if kind == "axis" else exact(float(np.linalg.norm([number(x) for x in found])))
                return state_evidence(q, w, "torque", size)
    return None
