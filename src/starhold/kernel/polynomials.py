"""Polynomials with exact coefficients, their derivatives, and substitution."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from fractions import Fraction
from functools import cached_property, reduce
from itertools import product
from math import gcd, lcm, prod
from operator import mul
from typing import Any, TypeAlias, cast

from .numbers import Account, RefusedError, Rows, demand, rational, read_dict, up, up_quotient, whole

Monomial: TypeAlias = tuple[str, ...]
"""The sorted names of its factors, each as often as it occurs."""

DEGREE, TERMS, ZERO = 24, 100_000, Fraction(0)
ORDER, LONG = 4, 800
"""How many derivatives a mean is expanded in, and how many terms the last but one has at most."""


class Poly:
    """A polynomial holds its nonzero coefficients by monomial: integers (`upper`) over a common denominator (`lower`), in
    lowest terms. It is immutable."""

    def __init__(self, terms: Mapping[Monomial, Fraction | int], lower: int = 0) -> None:
        """Take coefficients, or integers over a positive number."""
        numbers, below = (cast("Collection[int]", terms.values()), lower) if lower else whole([*terms.values()])
        common = gcd(below, *numbers)
        upper = {m: c // common for m, c in zip(terms, numbers, strict=True) if c}
        self.upper, self.lower = upper, below // common
        self.degree = max(map(len, upper)) if upper else 0
        """The largest number of factors in a term."""
        self.bits = max(map(abs, (self.lower, *upper.values()))).bit_length()
        """The bit length of the longest integer."""
        if len(upper) > TERMS:
            raise RefusedError("a polynomial is too long")

    @cached_property
    def terms(self) -> dict[Monomial, Fraction]:
        """Return the coefficients by monomial."""
        return {m: Fraction(c, self.lower) for m, c in self.upper.items()}

    def __add__(self, other: Poly | Fraction | int) -> Poly:
        return total((self, poly(other)))

    def __mul__(self, other: Poly | Fraction | int) -> Poly:
        other = poly(other)
        Account.spend(len(self.upper) * len(other.upper) + 1, self.bits + other.bits)
        demand(self.degree + other.degree <= DEGREE, "a degree is too high")
        upper: dict[Monomial, int] = {}
        for (m, c), (n, d) in product(self.upper.items(), other.upper.items()):
            both = tuple(sorted(m + n)) if m and n else m or n
            upper[both] = upper.get(both, 0) + c * d
        return Poly(upper, self.lower * other.lower)

    def __neg__(self) -> Poly:
        Account.spend(len(self.upper))
        return Poly({m: -c for m, c in self.upper.items()}, self.lower)

    def __sub__(self, other: Poly | Fraction | int) -> Poly:
        return self + -poly(other)

    def __rsub__(self, other: Fraction | int) -> Poly:
        return poly(other) - self

    __radd__, __rmul__ = __add__, __mul__

    @cached_property
    def names(self) -> set[str]:
        """Return the variables that occur."""
        return {name for m in self.upper for name in m}

    @property
    def number(self) -> Fraction:
        """Return the value of a polynomial without variables."""
        demand(not any(self.upper), "a number depends on the state")
        return Fraction(self.upper.get((), 0), self.lower)

    def only(self, wanted: Callable[[Monomial], bool]) -> Poly:
        """Return the terms with the wanted monomials."""
        return Poly({m: c for m, c in self.upper.items() if wanted(m)}, self.lower)

    @cached_property
    def _slopes(self) -> dict[str, Poly]:
        return {}

    def slope(self, name: str) -> Poly:
        """Return the derivative with respect to a variable."""
        if name not in self._slopes:
            Account.spend(len(self.upper))
            upper = dict[Monomial, int]()
            for m, c in self.upper.items():
                if name in m:
                    place = m.index(name)
                    upper[m[:place] + m[place + 1 :]] = c * m.count(name)
            self._slopes[name] = Poly(upper, self.lower)
        return self._slopes[name]

    def powers(self, name: str) -> list[Poly]:
        """Return the coefficients of a polynomial in one variable, in ascending order."""
        powers = [dict[Monomial, int]() for _ in range(1 + max((m.count(name) for m in self.upper), default=0))]
        for m, c in self.upper.items():
            powers[m.count(name)][tuple(x for x in m if x != name)] = c
        return [Poly(upper, self.lower) for upper in powers]

    def at(self, values: Mapping[str, Poly | Fraction | int]) -> Poly:
        """Return the polynomial with numbers or polynomials substituted for variables, all at once."""
        rest: dict[Monomial, dict[Monomial, int]] = {}
        for m, c in self.upper.items():
            placed = tuple(name for name in m if name in values)
            rest.setdefault(placed, {})[tuple(name for name in m if name not in values) if placed else m] = c
        products = ((upper, reduce(mul, (values[name] for name in placed), poly(1))) for placed, upper in rest.items())
        return total(Poly(upper, self.lower) * p for upper, p in products)


def poly(value: Poly | Fraction | int) -> Poly:
    """Return a number as a polynomial."""
    return value if isinstance(value, Poly) else Poly({(): value.numerator}, value.denominator)


def var(name: str) -> Poly:
    """Return a variable."""
    return Poly({(name,): Fraction(1)})


def variables(letter: str, first: int = 1, last: int = 3) -> list[Poly]:
    """Return variables of one letter: q0 to q3, w1 to w3."""
    return [var(f"{letter}{k}") for k in range(first, last + 1)]


def total(parts: Iterable[Poly]) -> Poly:
    """Return a sum."""
    parts = list(parts)
    upper: dict[Monomial, int] = {}
    lower = lcm(*[part.lower for part in parts])
    bits = lower.bit_length()
    for part in parts:
        Account.spend(len(part.upper) + 1, max(part.bits, bits))
        scale = lower // part.lower
        for m, c in part.upper.items():
            upper[m] = upper.get(m, 0) + c * scale
    return Poly(upper, lower)


def dot(a: Sequence[Poly | Fraction | int], b: Sequence[Poly | Fraction | int]) -> Poly:
    """Return the sum of products."""
    return total(poly(x) * y for x, y in zip(a, b, strict=True) if x)


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


def largest(rows: Sequence[Sequence[Poly]], sizes: Mapping[str, Fraction], shares: Mapping[str, int] | None = None) -> Rows:
    """Return short upper bounds of polynomials, |p|, for variables within their sizes. shares: each monomial counts as often
    as those of its factors do together."""
    names = [*set[str]().union(*(p.names for row in rows for p in row))]
    numbers, below = whole([sizes[name] for name in names])
    bits, size = max(map(int.bit_length, (below, *numbers))), dict(zip(names, numbers, strict=True)).__getitem__
    share = None if shares is None else {name: shares.get(name, 0) for name in names}.__getitem__

    def bound(p: Poly) -> Fraction:
        if not p.upper:
            return ZERO
        Account.spend(len(p.upper), p.bits + p.degree * bits)
        # The sums of the terms of each degree.
        sums = [0] * (p.degree + 1)
        for m, c in p.upper.items():
            sums[len(m)] += prod(map(size, m), start=abs(c)) * (1 if share is None else sum(map(share, m)))
        return up_quotient(reduce(lambda higher, terms: higher * below + terms, sums), p.lower * below**p.degree)

    return [list(map(bound, row)) for row in rows]


def most(p: Poly, sizes: Mapping[str, Fraction]) -> Fraction:
    """Return a short upper bound of |p| for variables within their sizes."""
    ((bound,),) = largest([[p]], sizes)
    return bound


def fastest(p: Poly, sizes: Mapping[str, Fraction], speeds: Mapping[str, Fraction]) -> Fraction:
    """Return an upper bound of |p'| if the given variables change at most at their speeds, and the others are constant."""
    moving = [name for name in speeds if name in p.names]
    changing = [name for name in moving if sizes[name]]
    numbers, lower = whole([up(speeds[name] / sizes[name]) for name in changing])
    ((along,),) = largest([[p]], sizes, dict(zip(changing, numbers, strict=True)))
    still = (most(p.slope(name), sizes) * speeds[name] for name in moving if not sizes[name])
    return sum(still, along / lower)


def derivatives(
    first: Poly, further: Callable[[list[Poly]], Poly], h: Fraction
) -> tuple[list[Poly], list[Fraction], Fraction]:
    """Return successive derivatives, up to one that is long, their shares in the mean of the first over a time, by Taylor,
    and the share of a bound of the derivative of the last. further: the derivative that follows some."""
    rates, shares = [first], [Fraction(1)]
    while len(rates) < ORDER and len(rates[-1].upper) < LONG:
        rates.append(further(rates))
        shares.append(shares[-1] * h / len(rates))
    return rates, shares, shares[-1] * h / (len(rates) + 1)


def multiple(p: Poly, s: Poly) -> tuple[Fraction, Fraction]:
    """Return f and c with p = f s + c; f is 0 if there are none."""
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
