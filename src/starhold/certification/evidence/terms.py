"""Helpers about polynomials for those who look for sums of squares."""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from functools import reduce
from importlib import import_module
from itertools import combinations, combinations_with_replacement
from typing import Any

import numpy as np
from flint import Ordering, fmpq_mpoly_ctx
from numpy.typing import NDArray

from starhold.algebra.polynomial import exact
from starhold.certification.evidence.squares import degree, matrix_of, sparse_of, text
from starhold.certification.matrices import fraction
from starhold.kernel.numbers import RefusedError
from starhold.kernel.polynomials import Monomial, Poly, dot, poly
from starhold.kernel.rules import Sum

PAIRED = 10
"""The most known quantities of which products in pairs are tried."""


def times(a: Poly, b: Poly, c: int = 1) -> Poly:
    """Return c a b, without an account."""
    terms: dict[Monomial, Fraction] = defaultdict(Fraction)
    for m, x in a.terms.items():
        for n, y in b.terms.items():
            terms[tuple(sorted(m + n)) if m and n else m or n] += x * y * c
    return Poly(terms)


def monomials(names: Sequence[str], most: int, least: int = 0) -> list[Poly]:
    """Return all monomials of these degrees."""
    spare = range(least, most + 1)
    return [Poly({tuple(m): Fraction(1)}) for d in spare for m in combinations_with_replacement(sorted(names), d)]


def unit(x: float) -> Fraction:
    """Return the power of two next to a positive number."""
    return Fraction(2) ** round(np.log2(x)) if 0.0 < x < np.inf else Fraction(1)


def independent(given: list[Poly]) -> list[Poly]:
    """Return polynomials without those that others before them make."""
    echelon, rank = matrix_of(given).rref()
    return [given[next(k for k in range(len(given)) if echelon[r, k] != 0)] for r in range(rank)]


def multiples(basis: Sequence[Poly], p: Poly) -> list[Poly]:
    """Return the multiples of some polynomials that are of no higher degree than another."""
    names = sorted(p.names)
    return [times(q, m) for q in basis for m in monomials(names, degree(p) - degree(q))]


def valued(p: Poly, at: Mapping[str, NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return a polynomial in floats, of many states at once."""
    values = np.zeros(np.broadcast_shapes(*(x.shape for x in at.values())))
    for m, c in p.terms.items():
        values = values + float(c) * reduce(np.multiply, [at[name] for name in m], 1.0)
    return values


def largest(q: Poly) -> float:
    """Return the largest coefficient."""
    return max((abs(float(c)) for c in q.terms.values()), default=1.0)


def identity(o: Sum) -> dict[str, Any] | None:
    """Return evidence without squares: p as a combination of what is known and of relations."""
    if o.strict:
        return None
    names = sorted({x for q in (o.p, *o.modulo) for x in q.names})
    top = max(degree(q) for q in (o.p, *o.modulo))
    loose = [monomials(names, top - degree(q)) for q in o.modulo]
    few = [k for k, q in enumerate(o.known) if degree(q) <= top]
    places = [(), *((k,) for k in few), *combinations(few[:PAIRED], 2)]
    made: dict[tuple[int, ...], Poly] = {
        factors: q for factors in places if degree(q := product_of(o.known, factors)) <= top
    }
    free = [times(q, m) for q, factors in zip(o.modulo, loose, strict=True) for m in factors]
    used = needed(o.p, free, made)
    y = None if used is None else solved(o.p, [*free, *(made[factors] for factors in used)])
    if used is None or y is None:
        return None
    cofactors, at = list[dict[str, str]](), 0
    for factors in loose:
        cofactors.append(text(dot(y[at : at + len(factors)], factors)))
        at += len(factors)
    parts = [{"of": [*factors], "z": [""], "gram": [[str(c)]]} for factors, c in zip(used, y[at:], strict=True) if c]
    evidence = {"numbers": [], "cofactors": cofactors, "parts": parts}
    try:
        o.check(evidence)
    except RefusedError:
        return None
    return evidence


def product_of(known: Sequence[Poly], places: Iterable[int]) -> Poly:
    """Return the product of the known polynomials of some places."""
    product = poly(1)
    for k in places:
        product = times(product, known[k])
    return product


def needed(p: Poly, free: list[Poly], made: dict[tuple[int, ...], Poly]) -> list[tuple[int, ...]] | None:
    """Return the places of products that p is made of with positive factors, and of free polynomials, in floats."""
    if not p.terms:
        return []
    whole = sparse_of([*free, *made.values(), p]).dense()
    A, b = whole[:, :-1], whole[:, -1]
    cost = np.r_[np.zeros(len(free)), np.ones(len(made))]
    linprog: Any = import_module("scipy.optimize").linprog
    solution = linprog(cost, A_eq=A, b_eq=b, bounds=[(None, None)] * len(free) + [(0, None)] * len(made))
    return (
        [factors for factors, v in zip(made, solution.x[len(free) :], strict=True) if v > 1e-9]
        if solution.status == 0
        else None
    )


def solved(p: Poly, every: list[Poly]) -> list[Fraction] | None:
    """Return numbers that make p of these polynomials, as few as elimination finds; None where there are none."""
    echelon, rank = matrix_of([*every, p]).rref()
    y = [Fraction(0)] * len(every)
    for r in range(rank):
        lead = next(k for k in range(len(every) + 1) if echelon[r, k] != 0)
        if lead == len(every):
            return None
        y[lead] = fraction(echelon[r, len(every)])
    return y


def quotient(p: Poly, q: Poly) -> Poly | None:
    """Return p / q, None where that is no polynomial."""
    names = sorted(p.names | q.names)
    ring = fmpq_mpoly_ctx.get(tuple(names), Ordering.degrevlex)

    def within(a: Poly) -> Any:
        items = a.terms.items()
        return ring.from_dict({tuple(m.count(x) for x in names): exact(c) for m, c in items})

    quotient, rest = divmod(within(p), within(q))
    if rest != 0:
        return None
    items = quotient.to_dict().items()
    powers = {tuple(x for x, n in zip(names, e, strict=True) for _ in range(int(n))): c for e, c in items}
    return Poly({m: fraction(c) for m, c in powers.items()})
