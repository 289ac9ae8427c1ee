"""Laws that ask for the first of the moves that cost least over a horizon, near the moves that do without limits.

A plan is of moves v_k, k < N, for the motion linearised about the rate w that the law is told, with gravity's stiffness:
x_k+1 = A(w) x_k + B(w) v_k. Half its cost is half of the sum of x.Qx + v.Rv and, after the last move, x.Px. Where the best
moves of all keep within the limits they are the best within the limits, as R > 0 and Q, P >= 0. Docs/kernel.md, 10.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import reduce
from typing import NamedTuple

from .loops import AttitudeLoop
from .numbers import (
    Rows,
    beside,
    definite,
    demand,
    inverse,
    matrix,
    norm,
    plus,
    rational,
    read_list,
    read_table,
    root,
    scalar,
    shortened,
    times,
    transpose,
    up,
)
from .polynomials import Poly, apply, cross, minus, most, total
from .regions import ANGLE, RATE, SPEED, TURN, Radii, Region, Sizes, stretch
from .rules import Exceeds, Part
from .sentences import above, below

PLANNED = "plan"
"""The law's torque is the first of the moves that cost least, and the torque that follows the target."""
PLACES, MOVES = 80, 100
"""Binary places of matrices, and how many moves a plan may have."""
HALF, ZERO = Fraction(1, 2), Fraction(0)


class Expansion(NamedTuple):
    """A matrix that depends on a rate w, |w| <= W: parts[0] + w1 parts[1] + w2 parts[2] + w3 parts[3] and a rest, of a norm
    of no more than fixed + curved |w|^2."""

    parts: list[Rows]
    fixed: Fraction = ZERO
    curved: Fraction = ZERO

    @property
    def sizes(self) -> tuple[Fraction, Fraction]:
        """Return bounds of the norms of the first part, and of the sum of the others for |w| = 1."""
        first, *others = self.parts
        return stretch(first), stretch(joined(others))

    def most(self, W: Fraction) -> Fraction:
        """Return a bound of the norm."""
        size, slope = self.sizes
        return size + slope * W + self.fixed + self.curved * W * W

    def __add__(self, other: Expansion) -> Expansion:  # pyright: ignore
        parts = [plus(x, y) for x, y in zip(self.parts, other.parts, strict=True)]
        return Expansion(parts, self.fixed + other.fixed, self.curved + other.curved)

    @property
    def turned(self) -> Expansion:
        """Return the transpose."""
        return self._replace(parts=list(map(transpose, self.parts)))


def product(a: Expansion, b: Expansion, W: Fraction) -> Expansion:
    """Return the product, of which the parts are rounded."""
    width, (first, *_) = len(b.parts[0][0]), b.parts
    row = times(a.parts[0], joined(b.parts))
    split = [[line[k * width : (k + 1) * width] for line in row] for k in range(4)]
    parts = [plus(x, times(y, first)) for x, y in zip(split[1:], a.parts[1:], strict=True)]
    (a0, a1), (b0, b1) = a.sizes, b.sizes
    fixed = (a0 + a1 * W + a.fixed) * b.fixed + a.fixed * (b0 + b1 * W)
    curved = a1 * b1 + (a0 + a1 * W + a.fixed) * b.curved + a.curved * (b0 + b1 * W + b.fixed + b.curved * W * W)
    return short(Expansion([split[0], *parts], fixed, curved), W)


def short(a: Expansion, W: Fraction) -> Expansion:
    """Return the same with rounded numbers: no matrix here has more than 36 entries, and |w1| + |w2| + |w3| <= 2 |w|."""
    off = Fraction(6, 1 << PLACES) * (1 + 2 * W)
    return Expansion([shortened(part, PLACES) for part in a.parts], up(a.fixed + off), up(a.curved))


def fixed(a: Rows) -> Expansion:
    """Return a matrix that does not depend on w."""
    none = [[ZERO] * len(a[0]) for _ in a]
    return Expansion([a, none, none, none])


def joined(parts: Sequence[Rows]) -> Rows:
    """Return the columns of all parts beside each other."""
    return reduce(beside, parts)


def diagonal(entries: Sequence[Fraction]) -> Rows:
    """Return a diagonal matrix."""
    return [[x * (i == k) for k in range(len(entries))] for i, x in enumerate(entries)]


def sampled(
    J: Rows, h: Fraction, units: Sequence[Fraction], stiffness: Fraction, W: Fraction
) -> tuple[Expansion, Expansion]:
    """Return A and B of (w, q) in units: e^M, and the mean of e^Mt for 0 <= t <= 1 times what a torque does, with M = h (C0
    + w1 C1 + w2 C2 + w3 C3 + what gravity does). What is beside e^M0 and what is linear in w, which C0^2 = 0 ends, is no
    more than what norms make of it."""
    N, none, S, back = inverse(J), scalar(0), diagonal(units), diagonal([1 / x for x in units])

    def seen(ww: Rows, qw: Rows, qq: Rows) -> Rows:
        return times(S, times([[h * x for x in row] for row in beside(ww, none) + beside(qw, qq)], back))

    def skew(v: Sequence[Fraction]) -> Rows:
        return [[ZERO, -v[2], v[1]], [v[2], ZERO, -v[0]], [-v[1], v[0], ZERO]]

    still_motion = seen(none, scalar(HALF), none)
    turning = list[Rows]()
    for axis, row in zip(scalar(1), J, strict=True):
        spin, momentum = skew(axis), skew(row)
        turning.append(seen(times(N, plus(momentum, times(spin, J), -1)), none, [[-x for x in row] for row in spin]))
    calm, most_turning = stretch(still_motion), stretch(joined(turning))
    push = times(S, [[h * x for x in row] for row in N] + none)
    pulled = stretch(push) * stretch(back[TURN]) * stiffness
    grown = calm + most_turning * W + pulled
    demand(grown < HALF, "a period is too long for the plan")
    # e^x <= 1 / (1 - x)
    grown = 1 / (1 - grown)

    def series(c: Sequence[int]) -> list[Rows]:
        parts = [plus(scalar(1, 6), still_motion, Fraction(1, c[0]))]
        for E in turning:
            twice = plus(times(still_motion, E), times(E, still_motion))
            thrice = times(still_motion, times(E, still_motion))
            terms = ([[x / n for x in row] for row in part] for n, part in zip(c, (E, twice, thrice), strict=True))
            parts.append(plus(plus(next(terms), next(terms)), next(terms)))
        return parts

    A = short(Expansion(series((1, 2, 6)), pulled * grown, most_turning**2 / 2 * grown), W)
    mean = short(Expansion(series((2, 6, 24)), pulled / 2 * grown, most_turning**2 / 6 * grown), W)
    return A, product(mean, short(fixed(push), W), W)


class Plan:
    """The moves of a claim, linear in (w, q) and nearly the best ones, and how far from these they are: no more than base +
    slope |w| + curve |w|^2 times the norm of (w, q) in units, all moves together."""

    def __init__(self, loop: AttitudeLoop) -> None:
        numbers, subject, self.loop = loop.claim.numbers, loop.claim.subject, loop
        self.fastest, self.gap, self.stiffness = (numbers[f"plan.{name}"] for name in ("rate", "gap", "stiffness"))
        units, moves = read_table(loop.claim.evidence["plan"], "units", "moves")
        self.units, self.count = [rational(x) for x in read_list(units, 6)], len(read_list(moves))
        demand(0 < self.count <= MOVES and subject["plan.moves"] == self.count, "a plan has another number of moves")
        demand(min(self.units) > 0 and self.gap <= HALF, "a plan is not properly told")
        self.moves = [[matrix(part, 3, 6) for part in read_list(move, 4)] for move in moves]
        # What makes the motion relative to a target that turns as that to one at rest.
        spins = (cross(rate, apply(loop.given, rate)) for rate in (loop.rate, loop.w))
        self.ahead = [p + x for p, x in zip(minus(*spins), apply(loop.given, loop.speeding), strict=True)]
        left = minus(minus(loop.u, self.ahead), self.first)
        demand(not any(p.terms for p in left), "the law's torque is not the first move of its plan")
        self.back = diagonal([1 / x for x in self.units])
        self.limit, self.longest = (subject.get(f"plan.{name}") for name in ("limit", "limit.norm"))
        self.base, self.slope, self.curve = self._missed()

    @property
    def first(self) -> list[Poly]:
        """Return the first move."""
        x, turned = [*self.loop.w, *self.loop.q[1:]], self.loop.w
        still_part, *others = (apply(F, x) for F in self.moves[0])
        return [total([p, *(w * part[i] for w, part in zip(turned, others, strict=True))]) for i, p in enumerate(still_part)]

    def _missed(self) -> list[Fraction]:
        """Return base, slope and curve. The gradient g of half the cost at the moves bounds how far the best ones are: R
        weighs both, as |R^1/2 d| <= |R^-1/2 g|; and so does by how much a plan may cost more than the best one."""
        subject, W, back = self.loop.claim.subject, self.fastest, self.back
        state, command = ([subject[f"plan.{name}.{k}"] for k in range(n)] for name, n in (("state", 6), ("command", 3)))
        end = [[subject[f"plan.end.{min(i, k)}.{max(i, k)}"] for k in range(6)] for i in range(6)]
        least = min(command)
        demand(min(state) >= 0 and least > 0 and definite(end, strictly=False), "a weight is not positive")
        Q, R, P = (
            fixed(x) for x in (times(back, times(diagonal(state), back)), diagonal(command), times(back, times(end, back)))
        )
        scaled = [Expansion([times(F, back) for F in move]) for move in self.moves]
        A, B = sampled(self.loop.given, self.loop.claim.numbers["period"], self.units, self.stiffness, W)
        states = [fixed(scalar(1, 6))]
        for move in scaled:
            states.append(product(A, states[-1], W) + product(B, move, W))
        costate, slopes = product(P, states[-1], W), list[Expansion]()
        for move, x in zip(reversed(scaled), reversed(states[:-1]), strict=True):
            slopes.append(product(R, move, W) + product(B.turned, costate, W))
            costate = product(Q, x, W) + product(A.turned, costate, W)
        bounds = [(g.sizes[0] + g.fixed, g.sizes[1], g.curved) for g in slopes]
        base, slope, curve = (norm(column) / least for column in zip(*bounds, strict=True))
        cost = Q.most(W) * sum(x.most(W) ** 2 for x in states[:-1]) + P.most(W) * states[-1].most(W) ** 2
        cost += R.most(W) * sum(move.most(W) ** 2 for move in scaled)
        return [base + root(2 * self.gap * cost / least), slope, curve]

    def error(self, sizes: Sizes) -> Fraction:
        """Return how far the torque is at most from that of the moves, at sizes of what the law is told."""
        w = sizes[SPEED]
        demand(w <= self.fastest, "rates exceed those of the plan")
        return (self.base + self.slope * w + self.curve * w * w) * self._length(sizes)

    def _length(self, sizes: Sizes) -> Fraction:
        return norm(max(self.units[part]) * sizes[name] for part, name in ((RATE, SPEED), (TURN, ANGLE)))

    def keeps(self, region: Region, misread: Radii, sizes: Sizes) -> Part[tuple[str, list[Fraction]]]:
        """No move of the best plan is beyond the limits; returns how large its torques are about each axis. misread: how far
        w and q of what the law is told are off at most; sizes: of what it is told in the region."""
        demand(self.limit is None or self.longest is None, "moves are limited in two ways")
        others, wide = self.error(sizes), sizes[SPEED] * self._length(sizes)
        highest = [ZERO] * 3
        for F, *turning in self.moves:
            slope = stretch(joined([times(part, self.back) for part in turning]))
            for i, row in enumerate(F):
                linear = root(times(times([row], region.X), transpose([row]))[0][0])
                linear += norm(row[RATE]) * misread[0] + norm(row[TURN]) * misread[1]
                highest[i] = max(highest[i], linear + slope * wide)
        highest = [x + others + most(p, sizes) for x, p in zip(highest, self.ahead, strict=True)]
        most_off, limited = self.loop.claim.numbers["plan.error"], "not limited"
        yield "error of the plan", Exceeds(most_off, others)
        if self.limit is not None:
            yield "moves within the limit", Exceeds(self.limit, max(highest))
            limited = f"limited to {above(self.limit)} N m about each axis"
        if self.longest is not None:
            yield "moves within the limit", Exceeds(self.longest, norm(highest))
            limited = f"limited to {above(self.longest)} N m"
        said = (
            f"the torque that follows the target and the first of {self.count} moves which are {limited}, cost no more than"
            f" the best ones and a share {below(self.gap)} of this, and are planned with a gravity gradient of up to"
            f" {below(self.stiffness)} N m for each unit of q, all within {above(most_off)} N m of what the program gives"
        )
        return said, highest
