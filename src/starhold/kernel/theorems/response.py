"""Bounds of the linear motion near a target under bounded disturbances, by sums of its impulse response. Proof:
docs/kernel.md, sections 10 and 12."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce
from operator import mul
from typing import Any

from ..held import Held
from ..numbers import Account, Rows, beside, demand, norm, plus, rational, reach, read_list, scalar, transpose, up, whole
from ..regions import ANGLE, RATE, SPEED, STATE, TURN, Radii, Tube, stretch
from ..rules import Definite, Part

PLACES, MOST = 80, 6000
"""The binary places of responses, and the most samples that they may take."""
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
) -> Part[Response]:
    """The gains bound those of z+ = Az + the sum of B v. kinds: for each kind of disturbance the places of its B, of three
    columns each. weights: m_k, for each bounded part. For the sum x of C_k B v_k, (y.x)^2 is at most the sum of 1/m_k times
    the sum of m_k |B'C_k'y|^2 (Cauchy and Schwarz)."""
    (moved, below), (B, under) = columns(A), columns(reduce(beside, ways))
    count = len(read_list(read_list(weights, len(parts))[0]))
    demand(0 < count <= MOST, "a response has no samples, or too many")
    weighed = [read_list(one, count) for one in weights]
    most = [list(map(rational, read_list(one, len(kinds)))) for one in read_list(gains, len(parts))]
    demand(all(type(m) is int and m > 0 for chosen in weighed for m in chosen), "a weight is not a whole number")
    rows = [[(x.numerator << PLACES) // x.denominator for x in row] for row in outputs]
    sums = [[[[0] * 3 for _ in range(3)] for _ in ways] for _ in weighed]
    sizes = [[0] * len(A) for _ in rows]
    for k in range(count):
        Account.spend(len(rows) * len(A) * (len(A) + len(B)) // 8, 3 * PLACES)
        sizes = [[x + abs(y) for x, y in zip(*pair, strict=True)] for pair in zip(sizes, rows, strict=True)]
        steps = carried(rows, B, under)
        for part, chosen, totals in zip(parts.values(), weighed, sums, strict=True):
            m = chosen[k]
            for place, total in enumerate(totals):
                block = [row[3 * place : 3 * place + 3] for row in steps[part]]
                for x, row in zip(total, block, strict=True):
                    x[:] = [y + m * sum(map(mul, row, other)) for y, other in zip(x, block, strict=True)]
        rows = carried(rows, moved, below)
    # The accumulated rounding error of each entry.
    off = Fraction(count + 1, 1 << PLACES)
    for name, chosen, totals, gained in zip(parts, weighed, sums, most, strict=True):
        share = Fraction(sum(-(-(1 << PLACES) // m) for m in chosen), 1 << 3 * PLACES)
        for place, (kind, gain) in enumerate(zip(kinds, gained, strict=True)):
            demand(gain > 6 * off, "a gain is too small")
            # (|a| + |b|)^2 <= 2 (|a|^2 + |b|^2)
            both = [list(map(sum, zip(*rows, strict=True))) for rows in zip(*(totals[n] for n in kind), strict=True)]
            weighted = [[len(kind) * share * x for x in row] for row in both]
            yield f"response of the {name} {place}", Definite(plus(scalar((gain - 6 * off) ** 2), weighted, -1))
    left, made = ([[abs(Fraction(x, 1 << PLACES)) + off for x in row] for row in part] for part in (rows, sizes))
    return Response(count, most, left, made)


def columns(rows: Rows) -> tuple[Sparse, int]:
    """Return the columns of a matrix in whole numbers, each without its zeros, and their common denominator."""
    numbers, below = whole([x for column in transpose(rows) for x in column])
    parts = [numbers[k : k + len(rows)] for k in range(0, len(numbers), len(rows))]
    return [[(k, x) for k, x in enumerate(column) if x] for column in parts], below


def carried(rows: list[list[int]], columns: Sparse, below: int) -> list[list[int]]:
    """Return the product of two matrices, rounded down."""
    return [[sum([row[k] * x for k, x in column]) // below for column in columns] for row in rows]
