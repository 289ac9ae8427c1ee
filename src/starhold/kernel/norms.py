"""Bounds of polynomials by the lengths of the vectors in them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from fractions import Fraction
from functools import cache
from math import factorial, isqrt, prod

from .loops import AXES
from .numbers import root
from .polynomials import Monomial, Poly
from .regions import stretch_squared

UNIT = 1 << 32
Norms = dict[str, Fraction]
"""Bounds of multilinear functions of vectors, by the letters of these."""


def norms(p: Poly) -> Norms:
    """Return bounds of the terms with factors of the same letters, for vectors of the length 1 and |q0| <= 1: of the matrix
    that takes one of the vectors to products of the others."""
    groups: dict[tuple[str, ...], dict[Monomial, int]] = {}
    for m, c in p.upper.items():
        groups.setdefault(tuple(name if name == "q0" else name[0] for name in m), {})[m] = abs(c)
    bounds = Norms()
    for letters, terms in groups.items():
        vectors = "".join(letter for letter in letters if letter != "q0")
        ways = (root(Fraction(unfolded(terms, x))) / (vectors.count(x) * UNIT) for x in {*vectors})
        bounds[vectors] = bounds.get(vectors, Fraction(0)) + min(ways, default=Fraction(sum(terms.values()))) / p.lower
    return bounds


def total_of(bounds: Norms, lengths: Mapping[str, Fraction]) -> Fraction:
    """Return the bound of a sum for vectors of these lengths."""
    return sum((x * prod(lengths[letter] for letter in letters) for letters, x in bounds.items()), Fraction(0))


def unfolded(terms: Mapping[Monomial, int], letter: str) -> int:
    """Return a bound, in squares of units, of the squared norm of the matrix M of terms x.My, where x is the sum of all
    vectors with the letter, and y has the products of all others: the square of the product of their lengths is the sum of
    squares of products, each as often as it occurs."""
    columns = dict[Monomial, list[int]]()
    for m, c in terms.items():
        for k in AXES:
            if count := m.count(name := f"{letter}{k + 1}"):
                left = without(m, name)
                columns.setdefault(left, [0] * len(AXES))[k] += c * count * share(left)
    return stretch_squared([*columns.values()])


def without(m: Monomial, name: str) -> Monomial:
    """Return a monomial without one of its factors."""
    place = m.index(name)
    return m[:place] + m[place + 1 :]


@cache
def share(m: Monomial) -> int:
    """Return what a monomial is at most, in units, of the length of the vector in which it stands once for each order of the
    factors with the same letter."""
    names = [name for name in m if name != "q0"]
    letters = Counter(name[0] for name in names)
    often = prod(map(factorial, letters.values())) // prod(map(factorial, Counter(names).values()))
    return isqrt(UNIT * UNIT // often) + 1
