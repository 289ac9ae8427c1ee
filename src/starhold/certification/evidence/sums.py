"""Guesses of sums of squares with products of what is known (`kernel.rules.Sum`): an interior point, then exact numbers.

In floats the matrices are made as definite as can be, in units (powers of two) in which the variables are about one. Rounded
to few binary digits they still are; the residual is added to the matrix without a factor.
"""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from importlib import import_module
from itertools import combinations
from math import prod
from typing import Any, TypeAlias

import numpy as np

from starhold.certification.evidence.sparse import Entries
from starhold.certification.evidence.squares import degree, optimum, sparse_of, text
from starhold.certification.evidence.terms import (
    identity,
    independent,
    largest,
    monomials,
    multiples,
    product_of,
    quotient,
    solved,
    times,
    unit,
)
from starhold.certification.matrices import unlimited
from starhold.kernel.numbers import RefusedError
from starhold.kernel.polynomials import Monomial, Poly, apply, dot, read_poly, total
from starhold.kernel.rules import Sum

MARGIN = 1e-7
"""The least eigenvalue, in scaled units, with which exact numbers are tried."""
MOST = 60_000
"""The most entries of the matrices."""
Terms: TypeAlias = dict[Monomial, Fraction]


@dataclass
class Block:
    """A sum of squares z'Gz times the known polynomials of some places, whose product in scaled units is `factor`."""

    places: tuple[int, ...]
    factor: Poly
    z: list[Poly]
    pairs: list[tuple[int, int]] = field(default_factory=list[tuple[int, int]])

    def columns(self) -> list[Poly]:
        """Return what the entries of the upper triangle are multiplied with."""
        self.pairs = [(i, k) for k in range(len(self.z)) for i in range(k + 1)]
        return [times(times(self.z[i], self.z[k]), self.factor, 1 if i == k else 2) for i, k in self.pairs]


class Guess:
    """The search for evidence of a sum. scales: approximate sizes of the variables; `basis`: what squares are made of
    besides monomials; `pairs`: which products of two known polynomials are tried; `curved`: without known polynomials of
    first degree."""

    def __init__(
        self,
        o: Sum,
        scales: Mapping[str, float],
        top: int,
        pairs: Iterable[tuple[int, int]],
        basis: Sequence[Poly] | None,
        curved: bool = False,
    ) -> None:
        unlimited()
        self.o, self.basis = o, basis
        names = sorted({x for q in (o.p, *o.known, *o.modulo, *o.strict) for x in q.names})
        self.scale = {x: unit(scales.get(x, 1.0)) for x in names}
        self.p, *self.strict = map(self.scaled, (o.p, *o.strict))
        self.size = unit(largest(self.p))
        self.units = [unit(largest(self.scaled(q))) for q in o.known]
        self.known = [self.scaled(q) * (1 / u) for q, u in zip(o.known, self.units, strict=True)]
        self.modulo = [self.scaled(q) for q in o.modulo]
        self.p = self.p * (1 / self.size)
        # Variables with which all strict polynomials vanish, whatever the others (parameters) are.
        moving = {x for q in o.strict for x in q.names}
        moving |= {f"{f}.{x}" for f in ("sin", "cos") for x in moving}
        self.moving = moving if all(moving.intersection(m) for q in (o.p, *o.strict) for m in q.terms) else set[str]()
        least = 2 if curved or basis is not None else 1
        used = [k for k, q in enumerate(self.known) if least <= degree(q) <= top]
        chosen = [(), *((k,) for k in used), *(p for p in pairs if p[0] in used and p[1] in used)]
        self.blocks = list[Block]()
        for places in chosen:
            factor = product_of(self.known, places)
            room = top - degree(factor)
            if room >= 0:
                self.blocks.append(Block(places, factor, self.z(names, room // 2, places)))
        self.cofactors = [monomials(names, top - degree(q)) for q in self.modulo]
        self.loose = [[times(q, m) for m in basis] for q, basis in zip(self.modulo, self.cofactors, strict=True)]
        self.reduce()

    def z(self, names: Sequence[str], top: int, places: tuple[int, ...]) -> list[Poly]:
        """Return what the squares of a block are made of."""
        if self.basis is None:
            stays = any(not self.moving.intersection(m) for m in product_of(self.known, places).terms)
            every = monomials(names, top)
            return [z for z in every if self.moving.intersection(*z.terms)] if self.moving and stays else every
        scaled_basis = [self.scaled(q) for q in self.basis]
        made = [
            times(q, m) for q in scaled_basis for m in monomials(names, min(max(top - degree(q), 0), 2)) if degree(q) <= top
        ]
        # A factor may vanish with the basis: then its squares may contain anything.
        if any(solved(self.known[k], multiples(scaled_basis, self.known[k])) is not None for k in places):
            return monomials(names, min(top, 2))
        return independent(made)

    def scaled(self, q: Poly) -> Poly:
        """Return a polynomial in scaled units."""
        return Poly({m: prod((self.scale[x] for x in m), start=c) for m, c in q.terms.items()})

    def reduce(self) -> None:
        """Leave out monomials that cannot have a square: nothing else contains it, or everything that does has its sign."""
        while True:
            free = {m for q in (self.p, *(c for columns in self.loose for c in columns)) for m in q.terms}
            squares: dict[Monomial, list[tuple[int, int, bool]]] = defaultdict(list)
            for q in self.strict:
                for m, c in q.terms.items():
                    squares[m].append((-1, -1, c > 0))
            for b, block in enumerate(self.blocks):
                for column, (i, k) in zip(block.columns(), block.pairs, strict=True):
                    if i != k:
                        free |= set(column.terms)
                    for m, c in column.terms.items() if i == k else ():
                        squares[m].append((b, i, c > 0))
            gone = {
                (b, i)
                for m, entries in squares.items()
                if m not in free and len({sign for _, _, sign in entries}) == 1
                for b, i, _ in entries
                if b >= 0
            }
            if not gone:
                break
            for b, block in enumerate(self.blocks):
                block.z = [z for i, z in enumerate(block.z) if (b, i) not in gone]
        self.blocks = [block for block in self.blocks if block.z or not block.places]

    @cached_property
    def columns(self) -> tuple[list[Poly], list[Poly]]:
        """Return the columns of the positive and free numbers, and those of the matrices."""
        return [*self.strict, *(c for columns in self.loose for c in columns)], [c for b in self.blocks for c in b.columns()]

    def floats(self) -> Any | None:
        """Return the numbers in floats that make the matrices most definite; None where they are not."""
        single, grams = self.columns
        every = [*single, *grams]
        if len(grams) > MOST:
            return None
        whole = sparse_of([*every, Poly({}), self.p]).scipy()
        equal, b = whole[:, :-1], whole[:, -1].toarray().ravel()
        if self.basis is not None:
            # Equations that follow from others would stop the interior point.
            pivoted: Any = import_module("scipy.linalg").qr
            _, triangle, order = pivoted(equal.toarray().T, mode="economic", pivoting=True)
            sizes = np.abs(np.diag(triangle))
            kept = np.sort(order[: int((sizes > 1e-10 * sizes[0]).sum())])
            equal, b = equal[kept], b[kept]
        stored = equal.tocoo()
        entries = Entries(stored.row, stored.col, stored.data, stored.shape)
        try:
            x = optimum(entries, b, [True] * len(self.strict), [block.pairs for block in self.blocks], 1.0)
        except BaseException as fault:  # a panic of the solver is one
            if isinstance(fault, (KeyboardInterrupt, SystemExit)):
                raise
            return None
        return None if x is None or not np.isfinite(x).all() or x[-1] < MARGIN else x

    def freed(self, made: Mapping[Monomial, Poly]) -> Poly | None:
        """Return a polynomial E for which p + E' is a sum, by the derivatives of monomials; None without one."""
        self.loose.append([self.scaled(q) * -1 for q in made.values()])
        first = len(self.strict) + sum(map(len, self.loose[:-1]))
        x = self.floats()
        self.loose.pop()
        if x is None:
            return None
        rounded = {m: round(Fraction(float(v)) * self.size * 2**12) for m, v in zip(made, x[first:], strict=False)}
        return Poly({m: Fraction(v, 2**12) for m, v in rounded.items()})

    def exactly(self, x: Any) -> dict[str, Any] | None:
        """Return evidence near floats that the kernel accepts; None where none was found."""
        single, grams = self.columns
        margin = float(x[-1])
        for digits in (10, 20, 34):
            step = unit(margin) / 2**digits
            y = [round(Fraction(float(v)) / step) * step for v in x[:-1]]
            covered = self.covered(len(single))
            rest = self.residual(y)
            alone = {m: c for m, c in rest.items() if m not in covered}
            fixed = self.projected(y, alone, covered) if alone else y
            if fixed is None:
                return None
            for m, c in self.residual(fixed).items():
                whole = sum((next(iter(grams[k - len(single)].terms.values())) for k in covered[m]), Fraction(0))
                for k in covered[m]:
                    fixed[k] += c / whole
            evidence = self.written(fixed)
            try:
                self.o.check(evidence)
            except RefusedError:
                continue
            return evidence
        return None

    def residual(self, y: list[Fraction]) -> Terms:
        """Return the residual of p."""
        single, grams = self.columns
        rest = dict(self.p.terms)
        for v, q in zip(y, [*single, *grams], strict=True):
            for m, c in q.terms.items() if v else ():
                rest[m] = rest.get(m, Fraction(0)) - v * c
        return {m: c for m, c in rest.items() if c}

    def covered(self, head: int) -> dict[Monomial, list[int]]:
        """Return for each monomial the entries of the matrix without a factor that have it alone."""
        places: dict[Monomial, list[int]] = defaultdict(list)
        for k, column in enumerate((c for block in self.blocks if not block.places for c in block.columns()), head):
            if self.basis is None:
                places[next(iter(column.terms))].append(k)
        return dict(places)

    def projected(self, y: list[Fraction], rest: Terms, covered: Mapping[Monomial, Any]) -> list[Fraction] | None:
        """Put the residual of monomials that are not covered on as few numbers as possible."""
        single, grams = self.columns
        every = [Poly({m: c for m, c in q.terms.items() if m not in covered}) for q in (*single, *grams)]
        step = solved(Poly(rest), every)
        return None if step is None else [v + s for v, s in zip(y, step, strict=True)]

    def written(self, y: list[Fraction]) -> dict[str, Any]:
        """Return the evidence in the units of the sum."""
        at, size = len(self.strict), self.size
        numbers = [str(v * size) for v in y[:at]]
        cofactors: list[dict[str, str]] = []
        for basis in self.cofactors:
            terms = [self.unscaled(m) * (v * size) for m, v in zip(basis, y[at : at + len(basis)], strict=True)]
            cofactors.append(text(total(terms)))
            at += len(basis)
        parts: list[dict[str, Any]] = []
        for block in self.blocks:
            count, factor = len(block.z), Fraction(1)
            for k in block.places:
                factor *= self.units[k]
            gram = [[Fraction(0)] * count for _ in range(count)]
            for (i, k), v in zip(block.pairs, y[at : at + len(block.pairs)], strict=True):
                gram[i][k] = gram[k][i] = v * size / factor
            at += len(block.pairs)
            z, powers = [self.unscaled(q) for q in block.z], list[Fraction]()
            for q in z:
                powers.append(next(iter(q.terms.values())) if len(q.terms) == 1 else Fraction(1))
            rows = [[str(v * a * b) for v, b in zip(row, powers, strict=True)] for row, a in zip(gram, powers, strict=True)]
            named = [" ".join(next(iter(q.terms))) if len(q.terms) == 1 else text(q) for q in z]
            if any(v != "0" for row in rows for v in row):
                parts.append({"of": list(block.places), "z": named, "gram": rows})
        return {"numbers": numbers, "cofactors": cofactors, "parts": parts}

    def unscaled(self, q: Poly) -> Poly:
        """Return a polynomial of scaled variables in the variables."""
        return Poly({m: c / prod(self.scale[x] for x in m) for m, c in q.terms.items()})


def divided(o: Sum, *more: Any) -> dict[str, Any] | None:
    """Return evidence where everything wanted has a known factor; None otherwise."""
    for k, q in enumerate(o.known if any(p.terms for p in o.strict) else ()):
        parts = [quotient(p, q) for p in (o.p, *o.strict)] if q.names else [None]
        if None not in parts:
            p, *strict = (part for part in parts if part is not None)
            evidence = find(Sum(p, o.known, o.modulo, strict), *more)
            if evidence:
                evidence["cofactors"] = [text(read_poly(c) * q) for c in evidence["cofactors"]]
                for part in evidence["parts"]:
                    part["of"].append(k)
            if evidence is not None:
                return evidence
    return None


def eliminated(o: Sum, q: Poly, x: str, *more: Any) -> dict[str, Any] | None:
    """Return evidence found without a variable, which a relation determines."""
    instead = {x: Poly({(x,): Fraction(1)}) - q * (1 / q.terms[(x,)])}
    others = [r for r in o.modulo if r is not q]
    evidence = find(Sum(o.p.at(instead), *([r.at(instead) for r in polys] for polys in (o.known, others, o.strict))), *more)
    if not evidence:
        return evidence
    cofactors = [read_poly(c) for c in evidence["cofactors"]]
    rest = o.p - dot([Fraction(v) for v in evidence["numbers"]], o.strict) - dot(cofactors, others)
    for part in evidence["parts"]:
        z = [read_poly({name: "1"} if isinstance(name, str) else name) for name in part["z"]]
        form = dot(z, apply([[Fraction(v) for v in row] for row in part["gram"]], z))
        rest = rest - form * product_of(o.known, part["of"])
    cofactor = quotient(rest, q)
    if cofactor is None:
        return None
    loose = iter(cofactors)
    evidence["cofactors"] = [text(cofactor if r is q else next(loose)) for r in o.modulo]
    return evidence


def find(
    o: Sum,
    scales: Mapping[str, float],
    basis: Sequence[Poly] | None = None,
    degrees: Sequence[int] = (0, 2),
    exact: bool = True,
) -> dict[str, Any] | None:
    """Return evidence that the kernel accepts (exact False: a sum in floats); None where none was found."""
    simple = identity(o)
    if simple is None:
        simple = divided(o, scales, basis, degrees, exact)
    if simple is not None:
        return simple
    for q in o.modulo:
        alone = [x for x in q.names if (x,) in q.terms and sum(x in m for m in q.terms) == 1]
        if alone:
            return eliminated(o, q, alone[0], scales, basis, degrees, exact)
    least = max(degree(q) for q in (o.p, *o.strict))
    least += least % 2
    sides = [k for k, q in enumerate(o.known) if degree(q) == 1]
    few = [(a, b) for a, b in combinations(sides, 2) if o.known[a].names == o.known[b].names]
    few += [(0, 1)] if len(o.known) > 1 else []
    many = list(combinations(range(min(len(o.known), 12)), 2))
    # Of many variables the box has many sides, which a set inside of it does not need; without them evidence is short.
    small = len(o.p.names) < 4
    for more in degrees:
        ways = ((few, False), (many, False)) if more and small else ((few, False),) if small else ((few, True), (few, False))
        for pairs, curved in ways:
            guess = Guess(o, scales, least + more, pairs, basis, curved)
            x = guess.floats()
            if x is not None:
                evidence = guess.exactly(x) if exact else {}
                if evidence is not None:
                    return evidence
    return None
