"""Bounds of the linear motion near a target under bounded disturbances, by sums of its impulse response. Proof:
docs/kernel.md, sections 10 and 12."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce
from itertools import groupby
from operator import mul
from typing import Any

from ..held import Held
from ..numbers import Account, Rows, beside, demand, norm, plus, rational, reach, read_list, scalar, up, whole
from ..regions import ANGLE, RATE, SPEED, STATE, TURN, Radii, Tube, stretch
from ..rules import Definite, Part

PLACES, MOST, LEAST, LONGEST = 80, 6000, 8, 64
"""The binary places of responses, the most samples that they may take, and the fewest and the most that are summed at
once."""
PARTS = {"rate": RATE, "turn": TURN, "acceleration": slice(6, 9)}
KINDS = (0, 1), (1,), (2,)
Sparse = list[list[tuple[int, int]]]


@dataclass(frozen=True)
class Response:
    """So many samples of z+ = Az + the sum of B v, |v| <= b: the gains of the bounded parts from each kind of disturbance
    with b = 1, what is left of the first sample, and the gains, row by row, from anything else that each sample adds."""

    count: int
    gains: list[list[Fraction]]
    left: Rows
    beside: Rows

    def after(self, motion: Held, tube: Tube, begun: Radii, pulled: Fraction) -> tuple[Radii, Fraction, Tube]:
        """Return |w| and |q| of z after these samples in the tube's region, its acceleration, and the tube from there on,
        given what they were before. Kinds of disturbances are the first two B together, the second, and the third. The
        effect of momentum on z is a disturbance here."""
        away, swayed, region_sizes = motion.away, motion.swayed, tube.region.sizes
        first, last, turn = (b for _, b in motion.linear(tube, begun[0], pulled))
        pushes = first, max(last - first, Fraction(0)), turn
        sizes = [min(region_sizes[name] + away[i // 3], begun[i // 3]) for i, name in enumerate(STATE)]
        sizes += [motion.applied] * (len(motion.near.A) - len(STATE))
        wide, turned, pulled = (
            up(sum((gain * b for gain, b in zip(gains, pushes, strict=True)), norm(reach(self.left[part], sizes))))
            for gains, part in zip(self.gains, PARTS.values(), strict=True)
        )
        pull = pulled + motion.pulled(swayed) + motion.lasting * stretch(motion.N)
        return (wide, turned), pulled, motion.tube(tube.region.around((wide + away[0], turned + away[1]), pull))


def first_of(motion: Held, tube: Tube) -> tuple[Radii, Fraction]:
    """Return |w| and |q| of z in the tube's region, and its acceleration."""
    wide, turned = (tube.region.sizes[name] + x for name, x in zip((SPEED, ANGLE), motion.away, strict=True))
    return (wide, turned), motion.pulled((wide, turned))


def responds(motion: Held, weights: Any, gains: Any) -> Part[Response]:
    """The gains bound those of the loop: of its rates, its turn and the linear acceleration."""
    # C_0 acts on (w, q): the late torque is in none of the bounded parts.
    rows = [row + [Fraction(0)] * (len(motion.near.A) - len(STATE)) for row in scalar(1, 6) + motion.near.rates]
    return summed(rows, PARTS, motion.near.A, motion.ways, KINDS, weights, gains)


def summed(
    outputs: Rows,
    parts: Mapping[str, slice],
    A: Rows,
    ways: Sequence[Rows],
    kinds: Sequence[Sequence[int]],
    weights: Any,
    gains: Any,
    sized: bool = False,
) -> Part[Response]:
    """The gains bound those of z+ = Az + the sum of B v. kinds: for each kind of disturbance the places of its B, of three
    columns each. weights: m_k, for each bounded part. For the sum x of C_k B v_k, (y.x)^2 is at most the sum of 1/m_k times
    the sum of m_k |B'C_k'y|^2 (Cauchy and Schwarz). Consecutive samples of one weight are summed at once. sized: with the
    gains from anything else that each sample adds."""
    count = len(read_list(read_list(weights, len(parts))[0]))
    demand(0 < count <= MOST, "a response has no samples, or too many")
    weighed = [read_list(one, count) for one in weights]
    most = [list(map(rational, read_list(one, len(kinds)))) for one in read_list(gains, len(parts))]
    demand(all(type(m) is int and m > 0 for chosen in weighed for m in chosen), "a weight is not a whole number")
    taken = list(map(runs, weighed))
    powers, squares = several(A, ways, {n for chosen in taken for _, n in chosen})
    left, made = list[list[Fraction]](), list[list[Fraction]]()
    for (name, part), chosen, gained in zip(parts.items(), taken, most, strict=True):
        rows = [[(x.numerator << PLACES) // x.denominator for x in row] for row in outputs[part]]
        sums, sizes, wide = [[[0] * 3 for _ in range(3)] for _ in ways], [[0] * len(A) for _ in rows], 0
        for m, n in chosen:
            Account.spend(
                3 * len(A) * (len(A) * (n if sized else 1) + len(ways) * (3 if n == 1 else len(A) + 3)) // 8, 3 * PLACES
            )
            for total, square in zip(sums, squares[n], strict=True):
                half = carried(rows, square, 1)
                other = half if n == 1 else rows
                for x, row in zip(total, half, strict=True):
                    x[:] = [y + m * sum(map(mul, row, z)) for y, z in zip(x, other, strict=True)]
            wide, now = max(wide, *(sum(map(abs, row)) for row in rows)), rows
            for power in powers[1 if sized else n : n + 1]:
                sizes = [[x + abs(y) for x, y in zip(*pair, strict=True)] for pair in zip(sizes, now, strict=True)]
                now = carried(rows, power, 1 << PLACES)
            rows = now
        # The accumulated rounding error of each entry.
        off = Fraction((count + 1) * (1 - (-wide >> PLACES)), 1 << PLACES)
        share = Fraction(sum(-(-(n << PLACES) // m) for m, n in chosen), 1 << 3 * PLACES)
        for place, (kind, gain) in enumerate(zip(kinds, gained, strict=True)):
            demand(gain > 6 * off, "a gain is too small")
            # (|a| + |b|)^2 <= 2 (|a|^2 + |b|^2)
            both = [list(map(sum, zip(*rows, strict=True))) for rows in zip(*(sums[k] for k in kind), strict=True)]
            # Rounded down, three by three entries are off by a form of no more than three times a last place.
            short = [[(x >> 2 * PLACES) + 3 * (i == k) for k, x in enumerate(row)] for i, row in enumerate(both)]
            weighted = [[len(kind) * share * x for x in row] for row in short]
            yield f"response of the {name} {place}", Definite(plus(scalar((gain - 6 * off) ** 2), weighted, -1))
        for bounds, numbers in ((left, rows), (made, sizes)):
            bounds += [[abs(Fraction(x, 1 << PLACES)) + off for x in row] for row in numbers]
    return Response(count, most, left, made if sized else [])


def runs(weights: Sequence[int]) -> list[tuple[int, int]]:
    """Return weights, each with the number of consecutive samples summed at once: one, or from `LEAST` to `LONGEST`."""
    together = list[tuple[int, int]]()
    for m, group in groupby(weights):
        left = len(list(group))
        while left:
            together.append((m, min(left, LONGEST) if left >= LEAST else 1))
            left -= together[-1][1]
    return together


def several(A: Rows, ways: Sequence[Rows], counts: set[int]) -> tuple[list[Sparse], dict[int, list[Sparse]]]:
    """Return the columns of A^i, rounded down, and for each of some numbers n, and for each B, those of the sum of
    (A^i B)(A^i B)', i < n, of rounded A^i B; for n = 1 of B."""
    (moved, below), (B, under) = columns(A), columns(reduce(beside, ways))
    power = [[int(x) << PLACES for x in row] for row in scalar(1, len(A))]
    powers, sums, squares = [sparse(power)], dict[int, list[Sparse]](), [[[0] * len(A) for _ in A] for _ in ways]
    for n in range(1, max(counts) + 1):
        Account.spend(len(A) ** 2 * (len(A) + 4 * len(ways)) // 8, 2 * PLACES)
        pushed = carried(power, B, under)
        steps = [[row[k : k + 3] for row in pushed] for k in range(0, len(B), 3)]
        for square, step in zip(squares, steps, strict=True):
            for x, row in zip(square, step, strict=True):
                x[:] = [y + sum(map(mul, row, z)) for y, z in zip(x, step, strict=True)]
        power = carried(power, moved, below)
        powers.append(sparse(power))
        if n in counts:
            sums[n] = list(map(sparse, steps if n == 1 else squares))
    return powers, sums


def columns(rows: Rows) -> tuple[Sparse, int]:
    """Return the columns of a matrix in whole numbers, and their common denominator."""
    numbers, below = whole([x for row in rows for x in row])
    return sparse([numbers[k : k + len(rows[0])] for k in range(0, len(numbers), len(rows[0]))]), below


def sparse(rows: list[list[int]]) -> Sparse:
    """Return the columns of a matrix, each without its zeros."""
    return [[(k, x) for k, x in enumerate(column) if x] for column in zip(*rows, strict=True)]


def carried(rows: list[list[int]], columns: Sparse, below: int) -> list[list[int]]:
    """Return the product of two matrices, rounded down."""
    return [[sum([row[k] * x for k, x in column]) // below for column in columns] for row in rows]
