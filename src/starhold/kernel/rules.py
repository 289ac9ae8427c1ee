"""The rules. Each decides its statement from evidence, without a search: `check` refuses evidence that does not prove it."""

from __future__ import annotations

from collections.abc import Generator, Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, TypeAlias, TypeVar

from .numbers import Rows, definite, demand, matrix, plus, rational, read_list, read_table, times, transpose
from .polynomials import Poly, dot, read_poly, total
from .sentences import Statement


def combination(cofactors: Any, relations: Sequence[Poly]) -> Poly:
    """Return the sum of the relations, each times its cofactor in the evidence."""
    return dot([read_poly(c) for c in read_list(cofactors, len(relations))], relations)


def weighted(weights: Any, parts: Sequence[Poly], strict: int) -> Poly:
    """Return the sum of the parts, each times its number in the evidence: none is negative, and the first are positive."""
    multipliers = [rational(x) for x in read_list(weights, len(parts))]
    demand(all(x >= 0 for x in multipliers), "a multiplier is negative")
    demand(all(x > 0 for x in multipliers[:strict]), "a multiplier is not positive")
    return dot(multipliers, parts)


def form(rows: Any, z: Sequence[Poly], strictly: bool) -> Poly:
    """Return z'Gz, with a positive definite or semidefinite G of the evidence."""
    gram = matrix(rows, len(z), len(z))
    demand(definite(gram, strictly), "a matrix is not positive definite")
    return total(a * dot([x * (1 + (i != k)) for k, x in enumerate(gram[i][: i + 1])], z[: i + 1]) for i, a in enumerate(z))


@dataclass(frozen=True)
class Vanishes:
    """p is zero wherever the relations are. Evidence: their cofactors; none if there are no relations."""

    p: Poly
    modulo: Sequence[Poly] = ()

    def check(self, evidence: Any) -> None:
        demand(bool(self.modulo) or evidence is None, "evidence was not asked for")
        rest = self.p - combination(evidence, self.modulo) if self.modulo else self.p
        demand(not rest.terms, "an identity does not hold")


@dataclass(frozen=True)
class Squares:
    """p >= 0 wherever the known polynomials are nonnegative and the relations are zero; there even p >= c (z_1^2 + ... +
    z_n^2) with a c > 0 for the first n = `least` of z (n = 0: only p >= 0). A multiplier of a `strict` polynomial is
    positive.

    Evidence: p = multipliers.known + cofactors.relations + z'Gz. G may use only the first entries of z, at least n of them;
    it is positive definite, or for n = 0 positive semidefinite.
    """

    p: Poly
    z: Sequence[Poly]
    least: int
    known: Sequence[Poly] = ()
    modulo: Sequence[Poly] = ()
    strict: Sequence[Poly] = ()

    def check(self, evidence: Any) -> None:
        multipliers, cofactors, rows = read_table(evidence, "multipliers", "cofactors", "gram")
        rest = self.p - weighted(multipliers, [*self.strict, *self.known], len(self.strict))
        count = len(read_list(rows))
        demand(self.least <= count <= len(self.z), "a matrix has another size")
        rest = rest - combination(cofactors, self.modulo) - form(rows, self.z[:count], self.least > 0)
        demand(not rest.terms, "a sum of squares is another one")


@dataclass(frozen=True)
class Sum:
    """p >= the sum of the `strict` polynomials, each times a positive number, wherever the known ones are nonnegative and
    the relations are zero (the easy half of Schmuedgen's Positivstellensatz).

    Evidence: p = numbers.strict + cofactors.relations + the sum of parts, each z'Gz times the known polynomials at these
    indices.
    """

    p: Poly
    known: Sequence[Poly] = ()
    modulo: Sequence[Poly] = ()
    strict: Sequence[Poly] = ()

    def check(self, evidence: Any) -> None:
        numbers, cofactors, parts = read_table(evidence, "numbers", "cofactors", "parts")
        rest = self.p - weighted(numbers, self.strict, len(self.strict)) - combination(cofactors, self.modulo)
        for part in read_list(parts):
            places, names, rows = read_table(part, "of", "z", "gram")
            z = [read_poly({name: "1"} if isinstance(name, str) else name) for name in read_list(names)]
            term = form(rows, z, False)
            for k in read_list(places):
                demand(type(k) is int and 0 <= k < len(self.known), "a part has a factor that is not known")
                term = term * self.known[k]
            rest = rest - term
        demand(not rest.terms, "a sum of squares is another one")


@dataclass(frozen=True)
class Contracts:
    """Every eigenvalue of A has a modulus below the rate; for a flow x' = Ax, a negative real part. Evidence: P > 0 with
    rate^2 P - A'PA > 0, or with -(A'P + PA) > 0 (Lyapunov)."""

    A: Rows
    rate: Fraction = Fraction(1)
    flow: bool = False

    def check(self, evidence: Any) -> None:
        A, P = self.A, matrix(evidence, len(self.A), len(self.A))
        PA = times(P, A)
        left = plus(PA, transpose(PA)) if self.flow else plus(times(transpose(A), PA), P, -self.rate * self.rate)
        demand(definite(P) and definite([[-x for x in row] for row in left]), "a motion does not contract")


@dataclass(frozen=True)
class Persists:
    """Some motions x+ = Ax do not converge to zero. Evidence: P, positive somewhere, with A'PA - P positive semidefinite:
    x'Px is non-decreasing (Chetaev)."""

    A: Rows

    def check(self, evidence: Any) -> None:
        A, P = self.A, matrix(evidence, len(self.A), len(self.A))
        demand(definite(plus(times(transpose(A), times(P, A)), P, -1), False), "a form falls")
        demand(not definite([[-x for x in row] for row in P], False), "a form is nowhere positive")


@dataclass(frozen=True)
class Definite:
    """A matrix is symmetric and positive definite. It needs no evidence."""

    a: Rows

    def check(self, evidence: Any) -> None:
        demand(evidence is None, "evidence was not asked for")
        demand(definite(self.a), "a matrix is not positive definite")


@dataclass(frozen=True)
class Exceeds:
    """A number is larger than another. It needs no evidence."""

    large: Fraction
    small: Fraction | int = 0

    def check(self, evidence: Any) -> None:
        demand(evidence is None, "evidence was not asked for")
        demand(self.large > self.small, "a number is not the larger one")


Obligation: TypeAlias = Vanishes | Squares | Sum | Contracts | Persists | Definite | Exceeds
Shown: TypeAlias = Iterator[tuple[str, Obligation]]
"""Obligations, each with the name under which its evidence stands."""
_T = TypeVar("_T")
Part: TypeAlias = Generator[tuple[str, Obligation], None, _T]
"""Obligations, and what follows from them."""
Proof: TypeAlias = Part[Statement]


def vanish(name: str, parts: Iterable[Poly], modulo: Sequence[Poly] = (), first: int = 0) -> Shown:
    """Check that each of some polynomials is zero; they are numbered."""
    yield from ((f"{name} {k}", Vanishes(p, modulo)) for k, p in enumerate(parts, first))
