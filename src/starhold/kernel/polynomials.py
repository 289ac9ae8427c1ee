"""Polynomials with exact coefficients, their derivatives, and variables put in place of one another."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from itertools import product
from typing import Any, TypeAlias

from .numbers import Account, added, demand, longest, rational, read_dict, up, whole

Monomial: TypeAlias = tuple[str, ...]
"""The sorted names of its factors, each as often as it occurs."""

DEGREE, TERMS = 24, 100_000


class Poly:
    """A polynomial holds its coefficients, none of them zero, by monomial."""

    __slots__ = ("terms",)

    def __init__(self, terms: dict[Monomial, Fraction]) -> None:
        self.terms = {m: c for m, c in terms.items() if c}
        demand(len(self.terms) <= TERMS, "a polynomial is too long")

    def __add__(self, other: Poly | Fraction | int) -> Poly:
        return total((self, poly(other)))

    def __mul__(self, other: Poly | Fraction | int) -> Poly:
        other = poly(other)
        bits = longest(self.terms.values()) + longest(other.terms.values())
        Account.spend(len(self.terms) * len(other.terms) + 1, bits)
        highest = max(map(len, self.terms), default=0) + max(map(len, other.terms), default=0)
        demand(highest <= DEGREE, "a degree is too high")
        if len(other.terms) == 1:
            ((n, d),) = other.terms.items()
            return Poly({(tuple(sorted(m + n)) if n else m): c * d for m, c in self.terms.items()})
        # In whole numbers, reduced once for each monomial.
        (left, below), (right, under) = whole([*self.terms.values()]), whole([*other.terms.values()])
        terms = dict[Monomial, int]()
        for (m, c), (n, d) in product(zip(self.terms, left, strict=True), zip(other.terms, right, strict=True)):
            both = tuple(sorted(m + n))
            terms[both] = terms.get(both, 0) + c * d
        return Poly({m: Fraction(c, below * under) for m, c in terms.items()})

    def __neg__(self) -> Poly:
        Account.spend(len(self.terms))
        return Poly({m: -c for m, c in self.terms.items()})

    def __sub__(self, other: Poly | Fraction | int) -> Poly:
        return self + -poly(other)

    def __rsub__(self, other: Fraction | int) -> Poly:
        return poly(other) - self

    __radd__, __rmul__ = __add__, __mul__

    @property
    def names(self) -> set[str]:
        """Return the variables that occur."""
        return {name for m in self.terms for name in m}

    @property
    def number(self) -> Fraction:
        """Return the value of a polynomial without variables."""
        demand(not self.names, "a number depends on the state")
        return self.terms.get((), Fraction(0))

    def slope(self, name: str) -> Poly:
        """Return the derivative: every monomial with the name loses one, and gains its count as a factor."""
        Account.spend(len(self.terms))
        terms: dict[Monomial, Fraction] = {}
        for m, c in self.terms.items():
            if name in m:
                place = m.index(name)
                terms[m[:place] + m[place + 1 :]] = c * m.count(name)
        return Poly(terms)

    def powers(self, name: str) -> list[Poly]:
        """Return the coefficients of a polynomial in one variable, from the lowest on."""
        powers = [dict[Monomial, Fraction]() for _ in range(1 + max((m.count(name) for m in self.terms), default=0))]
        for m, c in self.terms.items():
            powers[m.count(name)][tuple(x for x in m if x != name)] = c
        return list(map(Poly, powers))

    def at(self, values: Mapping[str, Poly | Fraction | int]) -> Poly:
        """Return the polynomial with numbers or polynomials in place of variables, all at once."""
        terms = list[Poly]()
        for m, c in self.terms.items():
            terms.append(Poly({tuple(name for name in m if name not in values): c}))
            for name in m:
                if name in values:
                    terms[-1] = terms[-1] * values[name]
        return total(terms)


def poly(value: Poly | Fraction | int) -> Poly:
    """Return a number as a polynomial."""
    return value if isinstance(value, Poly) else Poly({(): Fraction(value)})


def var(name: str) -> Poly:
    """Return a variable."""
    return Poly({(name,): Fraction(1)})


def variables(letter: str, first: int = 1, last: int = 3) -> list[Poly]:
    """Return variables of one letter: q0 to q3, w1 to w3."""
    return [var(f"{letter}{k}") for k in range(first, last + 1)]


def total(parts: Iterable[Poly]) -> Poly:
    """Return a sum."""
    coefficients = dict[Monomial, list[Fraction]]()
    for part in parts:
        Account.spend(len(part.terms) + 1, longest(part.terms.values()))
        for m, c in part.terms.items():
            coefficients.setdefault(m, []).append(c)
    return Poly({m: some[0] if len(some) == 1 else added(some) for m, some in coefficients.items()})


def dot(a: Sequence[Poly | Fraction | int], b: Sequence[Poly | Fraction | int]) -> Poly:
    """Return the sum of products."""
    return total(poly(x) * y for x, y in zip(a, b, strict=True))


def horner(parts: Sequence[Poly], x: Poly) -> Poly:
    """Return parts[0] + parts[1] x + parts[2] x^2 + ..."""
    value = Poly({})
    for part in reversed(parts):
        value = value * x + part
    return value


def apply(rows: Sequence[Sequence[Poly | Fraction | int]], v: Sequence[Poly]) -> list[Poly]:
    """Return a matrix times a vector."""
    return [dot(row, v) for row in rows]


def minus(a: Sequence[Poly], b: Sequence[Poly]) -> list[Poly]:
    """Return the difference of two vectors."""
    return [x - y for x, y in zip(a, b, strict=True)]


def cross(a: Sequence[Poly], b: Sequence[Poly]) -> list[Poly]:
    """Return the vector product."""
    return [a[i] * b[k] - a[k] * b[i] for i, k in ((1, 2), (2, 0), (0, 1))]


def most(p: Poly, sizes: Mapping[str, Fraction]) -> Fraction:
    """Return a number that |p| does not exceed where no variable exceeds its size."""
    ratios = {name: sizes[name].as_integer_ratio() for name in p.names}
    bound, places = 0, 64
    for m, c in p.terms.items():
        upper, lower = abs(c.numerator), c.denominator
        for name in m:
            n, d = ratios[name]
            upper, lower = upper * n, lower * d
        Account.spend(len(m) + 1, upper.bit_length() + lower.bit_length())
        finer = max(0, 64 + lower.bit_length() - upper.bit_length() - places)
        places += finer
        bound = (bound << finer) - ((-upper << places) // lower)
    return up(Fraction(bound, 1 << places))


def fastest(p: Poly, sizes: Mapping[str, Fraction], speeds: Mapping[str, Fraction]) -> Fraction:
    """Return a number that |p'| does not exceed where variables besides change no faster than at their speeds, and others do
    not change."""
    moving = [name for name in speeds if name in p.names]
    shares = {name: up(speeds[name] / sizes[name]) for name in moving if sizes[name]}
    along = Poly({m: c * sum((shares.get(name, 0) for name in m), Fraction(0)) for m, c in p.terms.items()})
    still = (most(p.slope(name), sizes) * speeds[name] for name in moving if not sizes[name])
    return sum(still, most(along, sizes))


def multiple(p: Poly, s: Poly) -> tuple[Fraction, Fraction]:
    """Return f and c with p = f s + c; f is 0 where there are none."""
    first = max(s.terms, key=len)
    factor = p.terms.get(first, Fraction(0)) / s.terms[first]
    rest = p - factor * s
    return (factor, rest.number) if not rest.names else (Fraction(0), Fraction(0))


def read_poly(given: Any) -> Poly:
    """Read a polynomial of the evidence: {"q0 w1 w1": "3/4"}."""
    terms: dict[Monomial, Fraction] = {}
    for names, c in read_dict(given, TERMS).items():
        m = tuple(sorted(names.split()))
        demand(m not in terms and len(m) <= DEGREE, "a monomial stands twice, or is of too high a degree")
        terms[m] = rational(c)
    return Poly(terms)
