"""Laws that apply the first of the moves of least cost over a horizon, near the moves that are optimal without limits.

A plan consists of moves v_k, k < N, for the motion linearised about the rate w given to the law, with the stiffness of the
gravity gradient: x_k+1 = A(w) x_k + B(w) v_k. Half its cost is half of the sum of x.Qx + v.Rv and, after the last move,
x.Px. If the unconstrained optimum keeps within the limits, it is also the optimum within the limits, because R > 0 and Q, P
>= 0. Docs/kernel.md, 10.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import combinations_with_replacement
from math import factorial
from typing import NamedTuple, TypeAlias

from .loops import AXES, AttitudeLoop
from .numbers import (
    Account,
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
ORDER, PLACES, MOVES = 2, 80, 100
"""The order in the rate to which matrices are known, their binary places, and how many moves a plan may have."""
KEYS = [key for n in range(ORDER + 1) for key in combinations_with_replacement(AXES, n)]
"""The products of components of the rate, up to that order."""
UNIT, ZERO = Fraction(1, 1 << PLACES), Fraction(0)
Whole: TypeAlias = list[list[int]]


class Expansion(NamedTuple):
    """A matrix that depends on a rate w, |w| <= W: the sum of its parts, integers in units of the last place, times products
    of components of w, and a remainder with a norm of at most fixed + beyond |w|^(ORDER + 1)."""

    parts: dict[tuple[int, ...], Whole]
    sizes: list[Fraction]
    """Bounds of the norm of the parts of each order, for |w| = 1."""
    fixed: Fraction
    beyond: Fraction

    def known(self, W: Fraction) -> Fraction:
        """Return a bound of the norm of the parts."""
        return sum((size * W**n for n, size in enumerate(self.sizes)), ZERO)

    def most(self, W: Fraction) -> Fraction:
        """Return a bound of the norm."""
        return self.known(W) + self.fixed + self.beyond * W ** (ORDER + 1)

    @property
    def turned(self) -> Expansion:
        """Return the transpose."""
        return self._replace(parts={key: [*map(list, zip(*part, strict=True))] for key, part in self.parts.items()})


def expansion(parts: dict[tuple[int, ...], Whole], fixed: Fraction, beyond: Fraction, W: Fraction) -> Expansion:
    """Return an expansion with its parts rounded down, of at most 36 entries: |w1| + |w2| + |w3| <= 2 |w|."""
    sizes = list[Fraction]()
    for n in range(ORDER + 1):
        alike = [part for key, part in parts.items() if len(key) == n]
        rows = [[x for part in alike for x in part[i]] for i in range(len(alike[0]))] if alike else [[0]]
        across, down = (max(sum(map(abs, line)) for line in lines) for lines in (rows, zip(*rows, strict=True)))
        square = min(across * down, sum(x * x for row in rows for x in row))
        sizes.append(root(square * UNIT * UNIT))
    off = 6 * UNIT * sum((2 * W) ** n for n in range(ORDER + 1))
    return Expansion(parts, sizes, up(fixed + off), up(beyond))


def rounded(parts: Sequence[Rows], W: Fraction) -> Expansion:
    """Return the sum of matrices times 1, w1, w2, w3, as many as are given."""
    keys = zip(KEYS, parts, strict=False)
    return expansion(
        {key: [[x.numerator * (1 << PLACES) // x.denominator for x in row] for row in part] for key, part in keys},
        ZERO,
        ZERO,
        W,
    )


def added(a: Expansion, b: Expansion, W: Fraction) -> Expansion:
    """Return the sum."""
    parts = dict(a.parts)
    for key, part in b.parts.items():
        include(parts, key, part)
    return expansion(parts, a.fixed + b.fixed, a.beyond + b.beyond, W)


def include(parts: dict[tuple[int, ...], Whole], key: tuple[int, ...], part: Whole) -> None:
    """Add a matrix to the part of this product of components, if there is one."""
    there = parts.get(key)
    parts[key] = (
        part if there is None else [[x + y for x, y in zip(s, t, strict=True)] for s, t in zip(there, part, strict=True)]
    )


def product(a: Expansion, b: Expansion, W: Fraction) -> Expansion:
    """Return the product."""
    columns = {key: [*zip(*part, strict=True)] for key, part in b.parts.items()}
    sums = dict[tuple[int, ...], Whole]()
    for one, left in a.parts.items():
        for other, right in columns.items():
            if len(one) + len(other) > ORDER:
                continue
            Account.spend(len(left) * len(right), 2 * PLACES)
            part = [[sum([x * y for x, y in zip(row, column, strict=True)]) for column in right] for row in left]
            include(sums, tuple(sorted(one + other)), part)
    cut = ORDER + 1
    pairs = [(m + n - cut, x * y) for m, x in enumerate(a.sizes) for n, y in enumerate(b.sizes) if m + n >= cut]
    fixed = (a.known(W) + a.fixed) * b.fixed + a.fixed * b.known(W)
    beyond = (a.known(W) + a.fixed) * b.beyond + a.beyond * b.most(W)
    beyond += sum(W**n * x for n, x in pairs)
    return expansion({key: [[x >> PLACES for x in row] for row in part] for key, part in sums.items()}, fixed, beyond, W)


def diagonal(entries: Sequence[Fraction]) -> Rows:
    """Return a diagonal matrix."""
    return [[x * (i == k) for k in range(len(entries))] for i, x in enumerate(entries)]


def sampled(
    J: Rows, h: Fraction, units: Sequence[Fraction], stiffness: Fraction, W: Fraction
) -> tuple[Expansion, Expansion]:
    """Return A and B of (w, q) in units: e^M, and the mean of e^Mt for 0 <= t <= 1 times the effect of a torque, with M = M0
    + w1 M1 + w2 M2 + w3 M3 + the effect of gravity. Because M0^2 = 0, powers beyond 2 ORDER + 1 contain none of the known
    orders; higher orders and gravity are bounded by norms."""
    N, none, S, back = inverse(J), scalar(0), diagonal(units), diagonal([1 / x for x in units])

    def seen(ww: Rows, qw: Rows, qq: Rows) -> Rows:
        return times(S, times([[h * x for x in row] for row in beside(ww, none) + beside(qw, qq)], back))

    def skew(v: Sequence[Fraction]) -> Rows:
        return [[ZERO, -v[2], v[1]], [v[2], ZERO, -v[0]], [-v[1], v[0], ZERO]]

    parts = [seen(none, scalar(Fraction(1, 2)), none)]
    for axis, row in zip(scalar(1), J, strict=True):
        spin, momentum = skew(axis), skew(row)
        parts.append(seen(times(N, plus(momentum, times(spin, J), -1)), none, [[-x for x in row] for row in spin]))
    push, M = times(S, [[h * x for x in row] for row in N] + none), rounded(parts, W)
    calm, turning, _ = M.sizes
    pulled = stretch(push) * stretch(back[TURN]) * stiffness + M.fixed
    grown, one = calm + turning * W + pulled, rounded([scalar(1, 6)], W)
    demand(2 * grown < 1, "a period is too long for the plan")
    # e^x <= 1 / (1 - x)
    grown = 1 / (1 - grown)
    power, sums = one, [one, one]
    for k in range(1, 2 * ORDER + 2):
        power = product(power, M, W)
        sums = [added(x, divided(power, n, W), W) for x, n in zip(sums, (factorial(k), factorial(k + 1)), strict=True)]
    beyond = turning ** (ORDER + 1) * grown / factorial(ORDER + 1)
    A, mean = (
        expansion(x.parts, x.fixed + pulled * grown / n, beyond / m, W)
        for x, n, m in zip(sums, (1, 2), (1, ORDER + 2), strict=True)
    )
    return A, product(mean, rounded([push], W), W)


def divided(a: Expansion, n: int, W: Fraction) -> Expansion:
    """Return a fraction of the expansion."""
    return expansion(
        {key: [[x // n for x in row] for row in part] for key, part in a.parts.items()}, a.fixed / n, a.beyond / n, W
    )


class Plan:
    """The moves of a claim, linear in (w, q) and nearly optimal, and their total distance from the optimum: at most the sum
    of missed[n] |w|^n times the norm of (w, q) in units."""

    def __init__(self, loop: AttitudeLoop) -> None:
        numbers, subject, self.loop = loop.claim.numbers, loop.claim.subject, loop
        self.fastest, self.gap, self.stiffness = (numbers[f"plan.{name}"] for name in ("rate", "gap", "stiffness"))
        units, moves = read_table(loop.claim.evidence["plan"], "units", "moves")
        self.units, self.count = [rational(x) for x in read_list(units, 6)], len(read_list(moves))
        demand(0 < self.count <= MOVES and subject["plan.moves"] == self.count, "a plan has another number of moves")
        demand(min(self.units) > 0 and 2 * self.gap <= 1, "a plan is not properly stated")
        self.moves = [[matrix(part, 3, 6) for part in read_list(move, 4)] for move in moves]
        # What makes the motion relative to a target that turns as that to one at rest.
        spins = (cross(rate, apply(loop.given, rate)) for rate in (loop.rate, loop.w))
        self.ahead = [p + x for p, x in zip(minus(*spins), apply(loop.given, loop.speeding), strict=True)]
        left = minus(minus(loop.u, self.ahead), self.first)
        demand(not any(p.terms for p in left), "the law's torque is not the first move of its plan")
        self.back = diagonal([1 / x for x in self.units])
        self.limit, self.longest = (subject.get(f"plan.{name}") for name in ("limit", "limit.norm"))
        self.missed = self._missed()

    @property
    def first(self) -> list[Poly]:
        """Return the first move."""
        x, turned = [*self.loop.w, *self.loop.q[1:]], self.loop.w
        still_part, *others = (apply(F, x) for F in self.moves[0])
        return [total([p, *(w * part[i] for w, part in zip(turned, others, strict=True))]) for i, p in enumerate(still_part)]

    def _missed(self) -> list[Fraction]:
        """Return the distance in each order. The gradient g of half the cost at the moves bounds the distance to the
        optimum: R weighs both, as |R^1/2 d| <= |R^-1/2 g|; and so does the amount by which the cost of a plan may exceed the
        optimum."""
        subject, W, back = self.loop.claim.subject, self.fastest, self.back
        state, command = ([subject[f"plan.{name}.{k}"] for k in range(n)] for name, n in (("state", 6), ("command", 3)))
        end = [[subject[f"plan.end.{min(i, k)}.{max(i, k)}"] for k in range(6)] for i in range(6)]
        least = min(command)
        demand(min(state) >= 0 and least > 0 and definite(end, strictly=False), "a weight is not positive")
        Q, R, P = (
            rounded([x], W)
            for x in (times(back, times(diagonal(state), back)), diagonal(command), times(back, times(end, back)))
        )
        scaled = [rounded([times(F, back) for F in move], W) for move in self.moves]
        A, B = sampled(self.loop.given, self.loop.claim.numbers["period"], self.units, self.stiffness, W)
        states = [rounded([scalar(1, 6)], W)]
        for move in scaled:
            states.append(added(product(A, states[-1], W), product(B, move, W), W))
        costate, slopes = product(P, states[-1], W), list[Expansion]()
        for move, x in zip(reversed(scaled), reversed(states[:-1]), strict=True):
            slopes.append(added(product(R, move, W), product(B.turned, costate, W), W))
            costate = added(product(Q, x, W), product(A.turned, costate, W), W)
        bounds = [(g.sizes[0] + g.fixed, *g.sizes[1:], g.beyond) for g in slopes]
        base, *others = (norm(column) / least for column in zip(*bounds, strict=True))
        cost = Q.most(W) * sum(x.most(W) ** 2 for x in states[:-1]) + P.most(W) * states[-1].most(W) ** 2
        cost += R.most(W) * sum(move.most(W) ** 2 for move in scaled)
        return [base + root(2 * self.gap * cost / least), *others]

    def error(self, sizes: Sizes) -> Fraction:
        """Return a bound of the difference between the torque and the moves, for given sizes of the inputs of the law."""
        w = sizes[SPEED]
        demand(w <= self.fastest, "rates exceed those of the plan")
        return sum((c * w**n for n, c in enumerate(self.missed)), ZERO) * self._length(sizes)

    def _length(self, sizes: Sizes) -> Fraction:
        return norm(max(self.units[part]) * sizes[name] for part, name in ((RATE, SPEED), (TURN, ANGLE)))

    def keeps(self, region: Region, misread: Radii, sizes: Sizes) -> Part[tuple[str, list[Fraction]]]:
        """Check that no move of the optimal plan exceeds the limits; return its largest torques about each axis. misread:
        the largest errors of w and q as given to the law; sizes: those of w and q in the region."""
        demand(self.limit is None or self.longest is None, "moves are limited in two ways")
        others, wide = self.error(sizes), sizes[SPEED] * self._length(sizes)
        highest = [ZERO] * 3
        for F, *turned in self.moves:
            turning = [times(part, self.back) for part in turned]
            slope = stretch(beside(beside(*turning[:2]), turning[2]))
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
