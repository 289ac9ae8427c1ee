"""Bounds of polynomials by the lengths of the vectors in them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from fractions import Fraction
from math import factorial, prod

from .loops import AXES
from .numbers import Rows, root
from .polynomials import Monomial, Poly
from .regions import stretch

Norms = dict[str, Fraction]
"""Bounds of multilinear functions of vectors, by the letters of these."""


def norms(p: Poly) -> Norms:
    """Return bounds of the terms with factors of the same letters, for vectors of the length 1 and |q0| <= 1: of the matrix
    that takes one of the vectors to products of the others."""
    groups: dict[tuple[str, ...], dict[Monomial, Fraction]] = {}
    for m, c in p.terms.items():
        groups.setdefault(tuple(name if name == "q0" else name[0] for name in m), {})[m] = c
    bounds = Norms()
    for letters, terms in groups.items():
        vectors = "".join(letter for letter in letters if letter != "q0")
        ways = (stretch(unfolded(terms, letter, vectors.count(letter))) for letter in {*vectors})
        least = min(ways, default=sum(map(abs, terms.values()), Fraction(0)))
        bounds[vectors] = bounds.get(vectors, Fraction(0)) + least
    return bounds


def total_of(bounds: Norms, lengths: Mapping[str, Fraction]) -> Fraction:
    """Return the bound of a sum for vectors of these lengths."""
    return sum((x * prod(lengths[letter] for letter in letters) for letters, x in bounds.items()), Fraction(0))


def unfolded(terms: Mapping[Monomial, Fraction], letter: str, count: int) -> Rows:
    """Return bounds of the entries of the matrix M of terms x.My, where x is one of `count` vectors with the letter, and y
    has the products of all others: the square of the product of their lengths is the sum of squares of products, each as
    often as it occurs."""
    rest = sorted({without(m, name) for m in terms for name in m if name[0] == letter and name != "q0"})
    place, rows = {m: k for k, m in enumerate(rest)}, [[Fraction(0)] * len(rest) for _ in AXES]
    for m, c in terms.items():
        for name in {name for name in m if name[0] == letter and name != "q0"}:
            left = without(m, name)
            rows[int(name[1]) - 1][place[left]] += abs(c) * m.count(name) / count * root(Fraction(1, often(left)))
    return rows


def without(m: Monomial, name: str) -> Monomial:
    """Return a monomial without one of its factors."""
    place = m.index(name)
    return m[:place] + m[place + 1 :]


def often(m: Monomial) -> int:
    """Return in how many orders the factors of each letter can stand."""
    names = [name for name in m if name != "q0"]
    letters = Counter(name[0] for name in names)
    return prod(map(factorial, letters.values())) // prod(map(factorial, Counter(names).values()))
