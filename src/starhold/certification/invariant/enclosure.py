"""Polynomials on many boxes at once, by interval arithmetic rounded outward, and on many points in floats, to guess."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.intervals import Intervals
from starhold.certification.boxes import Sides, holds_on
from starhold.certification.invariant.system import Poly
from starhold.certification.matrices import number
from starhold.certification.subject import enclosed

Mask = NDArray[np.bool_]


class EnclosedPolynomial:
    """A polynomial made ready to be enclosed."""

    def __init__(self, polynomial: Poly) -> None:
        self.polynomial = polynomial
        terms = [(tuple(int(power) for power in powers), c) for powers, c in polynomial.to_dict().items()]
        self._terms = [(powers, enclosed(c)) for powers, c in terms]
        self._floats = [(powers, number(c)) for powers, c in terms]

    @cached_property
    def _gradient(self) -> list[EnclosedPolynomial]:
        return [EnclosedPolynomial(self.polynomial.derivative(k)) for k in range(len(self.polynomial.context().gens()))]

    def on(self, boxes: Boxes) -> Intervals:
        """An enclosure of its values on each box."""
        found = self._plain(boxes)
        if boxes.middle is None:
            return found
        # About the middle: the closer, the smaller the box.
        centred = self._plain(boxes.middle)
        for slope, radius in zip(self._gradient, boxes.radii, strict=True):
            if slope._terms:
                centred = centred + slope._plain(boxes) * radius
        return Intervals(np.maximum(found.low, centred.low), np.minimum(found.high, centred.high))

    def _plain(self, boxes: Boxes) -> Intervals:
        total = Intervals(np.zeros(boxes.count))
        for powers, c in self._terms:
            total = total + boxes.monomial(powers) * c
        return total

    def at(self, points: Any) -> Any:
        """Values in floats at points (n, ...)."""
        total = np.zeros(np.shape(points)[1:])
        for powers, c in self._floats:
            term = c
            for x, power in zip(points, powers, strict=True):
                term = term * x**power if power else term
            total = total + term
        return total


class Boxes:
    """Many boxes, and the monomials that were enclosed on them. `sharp`: polynomials are also taken about the middle."""

    def __init__(self, sides: Sides, sharp: bool = False) -> None:
        self.sides = sides
        self.count = len(sides[0].low)
        self._monomials: dict[tuple[int, ...], Intervals] = {}
        self.middle: Boxes | None = None
        self.radii: list[Intervals] = []
        if sharp:
            middles = [Intervals(0.5 * (side.low + side.high)) for side in sides]
            self.middle = Boxes(tuple(middles))
            self.radii = [side - middle for side, middle in zip(sides, middles, strict=True)]

    def monomial(self, powers: tuple[int, ...]) -> Intervals:
        """A product of powers on each box."""
        if powers not in self._monomials:
            used = [k for k, power in enumerate(powers) if power]
            if not used:
                found = Intervals(np.ones(self.count))
            elif len(used) == 1:
                found = self._power(used[0], powers[used[0]])
            else:
                last = used[-1]
                rest = tuple(0 if k == last else power for k, power in enumerate(powers))
                found = self.monomial(rest) * self._power(last, powers[last])
            self._monomials[powers] = found
        return self._monomials[powers]

    def _power(self, place: int, power: int) -> Intervals:
        if power == 1:
            return self.sides[place]
        unit = tuple(int(k == place) for k in range(len(self.sides)))
        half = self.monomial(tuple(power // 2 * x for x in unit)).square()
        return half * self.sides[place] if power % 2 else half


MOST, ALL = 250_000, 5_000_000
"""Boxes that one proof may take, a few seconds, and all proofs of a claim together."""
LEAST = 1e-7
"""As a share of the whole: boxes below it that are not shown yet lie around a point or a line where nothing can be shown."""
CHUNK = 4_096
"""Boxes that are looked at at once: what a processor keeps at hand, several times as fast as more."""


def starts(sides: Sides) -> range:
    """Where the chunks of many boxes start."""
    return range(0, len(sides[0].low), CHUNK)


def part(sides: Sides, start: int) -> Sides:
    """One chunk of many boxes."""
    return tuple(Intervals(s.low[start : start + CHUNK], s.high[start : start + CHUNK]) for s in sides)


_left: ContextVar[list[int] | None] = ContextVar("left", default=None)


@contextmanager
def allowed(boxes: int) -> Generator[None]:
    """Within, no more boxes are looked at, in all: then nothing more is shown."""
    before = _left.set([boxes])
    try:
        yield
    finally:
        _left.reset(before)


class _AgainstError(Exception):
    """A point, a small box or the number of boxes tells that a proof will not end well."""


def everywhere(
    box: Sequence[tuple[float, float]],
    shown: Callable[[Boxes], Mask],
    most: int | None = None,
    first: int = 8,
    against: Callable[[Any], Mask] | None = None,
) -> bool:
    """Whether branch and bound shows something of every point of a box, by what `shown` tells of many boxes at once.
    `most`: boxes, MOST if not given; `against` tells of points (n, N) in floats where it is false for certain, so that no
    time is lost on it."""

    widths = [high - low if high > low else 1.0 for low, high in box]

    left_over = _left.get()

    def told(sides: Sides) -> Mask:
        if left_over:
            left_over[0] -= len(sides[0].low)
            if left_over[0] < 0:
                raise _AgainstError
        return np.concatenate([some(part(sides, k)) for k in starts(sides)])

    def some(sides: Sides) -> Mask:
        done = shown(Boxes(sides))
        left = ~done
        if left.any():
            rest = tuple(Intervals(side.low[left], side.high[left]) for side in sides)
            if against is not None and against(np.array([0.5 * (side.low + side.high) for side in rest])).any():
                raise _AgainstError
            done[left] = shown(Boxes(rest, sharp=True))
            sizes = np.max([(side.high - side.low) / width for side, width in zip(rest, widths, strict=True)], axis=0)
            if (sizes[~done[left]] < LEAST).any():
                raise _AgainstError
        return done

    try:
        return holds_on(box, told, MOST if most is None else most, first)
    except _AgainstError:
        return False


def definite(form: Sequence[Sequence[EnclosedPolynomial]], boxes: Boxes) -> Mask:
    """On which boxes a symmetric matrix of polynomials is positive definite throughout, by its pivots."""
    rest = [[entry.on(boxes) for entry in row] for row in form]
    found = np.ones(boxes.count, dtype=bool)
    for k in range(len(rest)):
        pivot = rest[k][k]
        found &= pivot.low > 0.0
        for i in range(k + 1, len(rest)):
            for j in range(k + 1, i + 1):
                product = rest[i][k].square() if i == j else rest[i][k] * rest[j][k]
                rest[i][j] = rest[i][j] - product / pivot
                rest[j][i] = rest[i][j]
    return found


def determinant(rows: Sequence[Sequence[Intervals]]) -> Intervals:
    """The determinant of a matrix of intervals, by its first row."""
    if len(rows) == 1:
        return rows[0][0]
    total = Intervals(np.zeros_like(rows[0][0].low))
    for k, entry in enumerate(rows[0]):
        minor = determinant([[*row[:k], *row[k + 1 :]] for row in rows[1:]])
        total = total + entry * minor if k % 2 == 0 else total - entry * minor
    return total
