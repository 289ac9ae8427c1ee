"""The rules. Each decides what it says from the evidence that it is given, and searches nothing: `check` refuses evidence
that does not show it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, TypeAlias

from .intervals import Box, Enclosed, Interval
from .numbers import Account, Rows, definite, demand, matrix, plus, rational, read_list, read_table, times, transpose
from .polynomials import Poly, apply, dot, read_poly, var

CELLS = 200_000


def combination(cofactors: Any, relations: Sequence[Poly]) -> Poly:
    """Return the sum of relations, each times its cofactor of the evidence."""
    return dot([read_poly(c) for c in read_list(cofactors, len(relations))], relations)


@dataclass(frozen=True)
class Vanishes:
    """p is zero wherever the relations are. Evidence: their cofactors; none without relations."""

    p: Poly
    modulo: Sequence[Poly] = ()

    def check(self, evidence: Any) -> None:
        demand(bool(self.modulo) or evidence is None, "evidence was not asked for")
        rest = self.p - combination(evidence, self.modulo) if self.modulo else self.p
        demand(not rest.terms, "an identity does not hold")


@dataclass(frozen=True)
class Squares:
    """p >= 0 wherever the known are not negative and the relations are zero; there even p >= c (z_1^2 + ... + z_n^2) with a
    c > 0 for the first n = `least` of z (of 0: p >= 0 alone). A multiplier of what is `strict` is positive.

    Evidence: multipliers, cofactors, and the matrix G of p = multipliers.known + cofactors.relations + z'Gz, positive
    definite, or for least = 0 only nowhere negative; it may be about the first of z alone, no fewer than `least`."""

    p: Poly
    z: Sequence[Poly]
    least: int
    known: Sequence[Poly] = ()
    modulo: Sequence[Poly] = ()
    strict: Sequence[Poly] = ()

    def check(self, evidence: Any) -> None:
        multipliers, cofactors, rows = read_table(evidence, "multipliers", "cofactors", "gram")
        known = [*self.strict, *self.known]
        weights = [rational(x) for x in read_list(multipliers, len(known))]
        demand(all(x >= 0 for x in weights), "a multiplier is negative")
        demand(all(x > 0 for x in weights[: len(self.strict)]), "a multiplier is not positive")
        count = len(read_list(rows))
        demand(self.least <= count <= len(self.z), "a matrix has another size")
        gram, z = matrix(rows, count, count), self.z[:count]
        demand(definite(gram, self.least > 0), "a matrix is not positive definite")
        rest = self.p - dot(weights, known) - combination(cofactors, self.modulo) - dot(z, apply(gram, z))
        demand(not rest.terms, "a sum of squares is another one")


@dataclass(frozen=True)
class Sum:
    """p >= the sum of the `strict`, each times a positive number, wherever the known are not negative and the relations are
    zero (the easy half of Schmuedgen's Positivstellensatz).

    Evidence: those numbers; the relations' cofactors; parts, each the places of known polynomials, whose product it has
    for a factor, and a sum of squares z'Gz: p = numbers.strict + cofactors.relations + the sum of parts."""

    p: Poly
    known: Sequence[Poly] = ()
    modulo: Sequence[Poly] = ()
    strict: Sequence[Poly] = ()

    def check(self, evidence: Any) -> None:
        """Refuse evidence that does not show it."""
        numbers, cofactors, parts = read_table(evidence, "numbers", "cofactors", "parts")
        weights = [rational(x) for x in read_list(numbers, len(self.strict))]
        demand(all(x > 0 for x in weights), "a multiplier is not positive")
        rest = self.p - dot(weights, self.strict) - combination(cofactors, self.modulo)
        for part in read_list(parts):
            places, names, rows = read_table(part, "of", "z", "gram")
            z = [read_poly({name: "1"} if isinstance(name, str) else name) for name in read_list(names)]
            gram = matrix(rows, len(z), len(z))
            demand(definite(gram, False), "a matrix is somewhere negative")
            form = dot(z, apply(gram, z))
            for k in read_list(places):
                demand(type(k) is int and 0 <= k < len(self.known), "a part has a factor that is not known")
                form = form * self.known[k]
            rest = rest - form
        demand(not rest.terms, "a sum of squares is another one")


@dataclass(frozen=True)
class Solves:
    """Where the given vanish, and the relations, so do the wanted. Evidence: a matrix that takes the given to the wanted,
    and for each the cofactors of the relations."""

    given: Sequence[Poly]
    wanted: Sequence[Poly]
    modulo: Sequence[Poly] = ()

    def check(self, evidence: Any) -> None:
        rows, cofactors = read_table(evidence, "matrix", "cofactors")
        found = apply(matrix(rows, len(self.wanted), len(self.given)), self.given)
        for taken, p, own in zip(found, self.wanted, read_list(cofactors, len(self.wanted)), strict=True):
            demand(not (taken - p - combination(own, self.modulo)).terms, "a system is not solved")


@dataclass(frozen=True)
class Contracts:
    """Every eigenvalue of A is smaller than the rate in size, or of a flow x' = Ax has a negative real part. Evidence: P > 0
    with rate^2 P - A'PA > 0, or with -(A'P + PA) > 0 (Lyapunov)."""

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
    """Some motions x+ = Ax do not come to zero. Evidence: P, somewhere positive, with A'PA - P nowhere negative: x'Px does
    not fall (Chetaev)."""

    A: Rows

    def check(self, evidence: Any) -> None:
        A, P = self.A, matrix(evidence, len(self.A), len(self.A))
        demand(definite(plus(times(transpose(A), times(P, A)), P, -1), False), "a form falls")
        demand(not definite([[-x for x in row] for row in P], False), "a form is nowhere positive")


@dataclass(frozen=True)
class Definite:
    """A matrix is symmetric and positive definite. Without evidence."""

    a: Rows

    def check(self, evidence: Any) -> None:
        demand(evidence is None, "evidence was not asked for")
        demand(definite(self.a), "a matrix is not positive definite")


@dataclass(frozen=True)
class Exceeds:
    """A number is larger than another. Without evidence."""

    large: Fraction
    small: Fraction | int = 0

    def check(self, evidence: Any) -> None:
        demand(evidence is None, "evidence was not asked for")
        demand(self.large > self.small, "a number is not the larger one")


@dataclass(frozen=True)
class OnCells:
    """On each box of a subdivision one of the reasons holds. Evidence: the tree in preorder, the letter of a reason or the
    place of the variable whose middle splits the box."""

    box: Mapping[str, tuple[Fraction, Fraction]]
    reasons: Mapping[str, Callable[[Box], bool]]

    def check(self, evidence: Any) -> None:
        demand(isinstance(evidence, str) and len(evidence) <= CELLS, "a subdivision is not a text")
        names, waiting = list(self.box), [{name: Interval.of(*ends) for name, ends in self.box.items()}]
        for mark in evidence:
            demand(bool(waiting), "a subdivision goes on after its end")
            Account.spend(len(names))
            box = waiting.pop()
            if mark in self.reasons:
                demand(self.reasons[mark](box), f"the reason {mark} fails on a box")
                continue
            demand(mark in "0123456789" and int(mark) < len(names), "a subdivision has another mark")
            side = box[names[int(mark)]]
            halves = (Interval(side.middle.low, side.high), Interval(side.low, side.middle.low))
            waiting += [box | {names[int(mark)]: half} for half in halves]
        demand(not waiting, "a subdivision ends early")


@dataclass(frozen=True)
class Local:
    """p > 0 in a box but at the origin, or where it does not matter. Evidence: p = x'G(x)x with a matrix of polynomials, and
    a tree on each of whose cells p is positive (p), or G is positive definite (g), or it does not matter (o)."""

    names: Sequence[str]
    p: Poly
    box: Mapping[str, tuple[Fraction, Fraction]]
    outside: Callable[[Box], bool]

    def check(self, evidence: Any) -> None:
        rows, tree = read_table(evidence, "gram", "tree")
        self.cells(rows).check(tree)

    def cells(self, rows: Any) -> OnCells:
        """Return what the tree has to show."""
        count = len(self.names)
        gram = [[read_poly(entry) for entry in read_list(row, count)] for row in read_list(rows, count)]
        x = [var(name) for name in self.names]
        demand(not (dot(x, apply(gram, x)) - self.p).terms, "a form is another one")
        demand(all((gram[i][k] - gram[k][i]).terms == {} for i in range(count) for k in range(i)), "a form is not symmetric")
        whole, parts = Enclosed(self.p), [[Enclosed(entry) for entry in row] for row in gram]

        def form(cell: Box) -> bool:
            rest = [[entry.on(cell) for entry in row] for row in parts]
            for k, pivots in enumerate(rest):
                if pivots[k].low <= 0:
                    return False
                for i in range(k + 1, count):
                    rest[i] = [a - rest[i][k] * b / pivots[k] for a, b in zip(rest[i], pivots, strict=True)]
            return True

        return OnCells(self.box, {"o": self.outside, "p": lambda cell: whole.on(cell).low > 0, "g": form})


Obligation: TypeAlias = Vanishes | Squares | Sum | Solves | Contracts | Persists | Definite | Exceeds | OnCells | Local
Shown: TypeAlias = Iterator[tuple[str, Obligation]]
"""Obligations, each with the name under which its evidence stands."""
