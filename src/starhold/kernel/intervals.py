"""Intervals between multiples of 2^-96, rounded outward, and polynomials enclosed on boxes of them."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from math import isqrt
from typing import TypeAlias

from .numbers import Account, demand
from .polynomials import Poly

UNIT = 1 << 96


@dataclass(frozen=True, slots=True)
class Interval:
    """An interval holds all numbers between two multiples of 2^-96."""

    low: int
    high: int

    def __post_init__(self) -> None:
        Account.spend(1, max(self.low.bit_length(), self.high.bit_length()))

    @classmethod
    def of(cls, low: Fraction, high: Fraction | None = None) -> Interval:
        """Enclose what lies between two numbers."""
        high = low if high is None else high
        demand(low <= high, "an interval is empty")
        return cls(low.numerator * UNIT // low.denominator, -(-high.numerator * UNIT // high.denominator))

    @property
    def middle(self) -> Interval:
        """Return a point near the middle."""
        return Interval(*[(self.low + self.high) // 2] * 2)

    def __add__(self, other: Interval) -> Interval:
        return Interval(self.low + other.low, self.high + other.high)

    def __neg__(self) -> Interval:
        return Interval(-self.high, -self.low)

    def __sub__(self, other: Interval) -> Interval:
        return self + -other

    def __mul__(self, other: Interval) -> Interval:
        ends = [a * b for a in (self.low, self.high) for b in (other.low, other.high)]
        return Interval(min(ends) // UNIT, -(-max(ends) // UNIT))

    def __truediv__(self, other: Interval) -> Interval:
        demand(other.low > 0 or other.high < 0, "a divisor may be zero")
        ends = [(a * UNIT, b) for a in (self.low, self.high) for b in (other.low, other.high)]
        return Interval(min(a // b for a, b in ends), max(-(-a // b) for a, b in ends))

    def sqrt(self) -> Interval:
        """Enclose the square root."""
        demand(self.low >= 0, "a root may be of a negative number")
        return Interval(isqrt(self.low * UNIT), isqrt(self.high * UNIT) + 1)

    def power(self, n: int) -> Interval:
        """Enclose x^n, which is not negative where n is even."""
        Account.spend(n, n * max(self.low.bit_length(), self.high.bit_length()))
        ends = sorted((self.low**n, self.high**n))
        scale = UNIT ** (n - 1)
        low = 0 if n % 2 == 0 and self.low < 0 < self.high else ends[0]
        return Interval(low // scale, -(-ends[1] // scale))

    def square(self) -> Interval:
        """Enclose x^2."""
        return self.power(2)

    def hull(self, other: Interval) -> Interval:
        """Return the least interval that holds both."""
        return Interval(min(self.low, other.low), max(self.high, other.high))


Box: TypeAlias = dict[str, Interval]


class Enclosed:
    """A polynomial is made ready to be enclosed on boxes: term by term, and about the middle with its slopes."""

    def __init__(self, p: Poly, sloped: bool = True) -> None:
        self.terms = [(Interval.of(c), [(name, m.count(name)) for name in sorted(set(m))]) for m, c in p.terms.items()]
        self.slopes = {name: Enclosed(p.slope(name), False) for name in p.names} if sloped else {}

    def plain(self, box: Box) -> Interval:
        """Enclose the polynomial term by term."""
        found = Interval(0, 0)
        for c, powers in self.terms:
            for name, n in powers:
                c = c * box[name].power(n)
            found = found + c
        return found

    def on(self, box: Box) -> Interval:
        """Enclose the polynomial both ways (mean value form)."""
        found, middle = self.plain(box), {name: x.middle for name, x in box.items()}
        about = self.plain(middle)
        for name, slope in self.slopes.items():
            about = about + slope.plain(box) * (box[name] - middle[name])
        return Interval(max(found.low, about.low), min(found.high, about.high))
