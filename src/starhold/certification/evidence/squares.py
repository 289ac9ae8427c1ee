"""Guesses of sums of squares: multipliers, cofactors and a Gram matrix by an interior point, then made exact.

All of them are linear in the polynomial. In floats the matrix is made as definite as can be, in units in which the variables
are about one; after rounding to short numbers, the residual is added to the matrix, monomial by monomial.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from itertools import combinations_with_replacement
from math import lcm, ldexp, prod
from typing import Any

import numpy as np
from flint import fmpq_mat

from starhold.algebra.polynomial import exact
from starhold.certification.evidence.cones import interior_point, once
from starhold.certification.evidence.sparse import Entries
from starhold.certification.matrices import fraction
from starhold.kernel.numbers import RefusedError, times, transpose
from starhold.kernel.polynomials import Monomial, Poly, dot, poly
from starhold.kernel.rules import Squares

LARGE = 3000
"""The entries of a matrix beyond which the sparse interior point takes too long."""
DIGITS = (12, 14, 9, 16)
SINGULAR, SHORT = 1e-6, 8
"""The share of the largest eigenvalue below which a matrix counts as singular, and the denominators of what it takes to
zero."""
DEFINITE, CLEAR = -1e-8, 1e-6
"""The least eigenvalue, in scaled units, at which it is worth trying whether the exact matrix is definite."""


@dataclass(frozen=True)
class Problem:
    """p = sum of columns, each with its factor, the last of which are the entries of the upper triangle of the Gram matrix.
    The first `signed` factors are not negative, the first `strict` of them positive."""

    p: Poly
    columns: list[Poly]
    signed: int
    pairs: list[tuple[int, int]]
    z: Sequence[Poly]
    strict: int = 0


def squares(o: Squares, scales: Mapping[str, float]) -> dict[str, Any] | None:
    """Return evidence that the kernel accepts; None where none was found. scales: about how large variables become."""
    p, known, fixed = settled(o)
    for count, ansatz in [(k, each) for k in counts(o) for each in ansatzes(o, p, known, k)]:
        problem = problem_of(o, p, known, ansatz, count)
        # What no column has may be so small that floats do not miss it.
        able = p.terms.keys() <= {m for q in problem.columns for m in q.upper}
        guess = solved(problem, scales) if able else None
        ways = [] if guess is None else [exactly] if o.least else [exactly, on_a_face]
        for way, digits in [(way, digits) for way in ways for digits in DIGITS]:
            shown = way(problem, guess, digits)
            if shown is None:
                continue
            evidence = written(o, problem, shown, fixed, ansatz)
            try:
                o.check(evidence)
            except RefusedError:
                continue
            return evidence
    return None


def problem_of(o: Squares, p: Poly, known: list[Poly], ansatz: Sequence[Sequence[Poly]], count: int) -> Problem:
    """Return the problem of an obligation, for what is settled of it, cofactors of its relations and the first of its z."""
    others = [c * relation for relation, parts in zip(o.modulo, ansatz, strict=True) for c in parts]
    z = o.z[:count] if o.least else free([p, *known, *others], o.z[:count])
    return replace(posed(p, known, others, z), strict=len(o.strict))


def definiteness(o: Squares, scales: Mapping[str, float]) -> float | None:
    """Return how definite the matrix of a sum of squares can be in floats, with the first of its ansatzes; None without."""
    p, known, _ = settled(o)
    ansatz = next(iter(ansatzes(o, p, known, len(o.z))))
    x, _ = most_definite(problem_of(o, p, known, ansatz, len(o.z)), scales)
    return None if x is None else float(x[-1])


def plainly(o: Squares) -> dict[str, Any] | None:
    """Return evidence whose matrix is the remainder of p, without relations; None if that is refused."""
    p, known, fixed = settled(o)
    problem = posed(p, known, [], o.z)
    if o.modulo or not p.terms.keys() <= {m for q in problem.columns for m in q.terms}:
        return None
    shown = exactly(problem, [0.0] * len(problem.columns), 1)
    evidence = None if shown is None else written(o, problem, shown, fixed, [])
    try:
        o.check(evidence)
    except RefusedError:
        return None
    return evidence


def counts(o: Squares) -> list[int]:
    """Return how many entries of z a matrix may use: up to where another kind of monomial begins."""
    kinds = ["".join(sorted(name[0] for name in max(z.terms))) for z in o.z]
    ends = [k for k in range(1, len(kinds)) if kinds[k] != kinds[k - 1]]
    names = {name for p in (o.p, *o.known) for name in p.names}
    count = next((k for k, z in enumerate(o.z) if not z.names <= names), len(o.z))
    return sorted({o.least or max(count, 1), *(k for k in ends if k > o.least > 0), len(o.z)})


def free(columns: Sequence[Poly], z: Sequence[Poly]) -> Sequence[Poly]:
    """Return z without the monomials whose squares occur nowhere else, because the matrix would need a zero there."""
    pairs, grams = products(z)
    others = {m for q in columns for m in q.upper}
    others |= {m for (i, k), q in zip(pairs, grams, strict=True) if i != k for m in q.upper}
    kept = [z[i] for (i, k), q in zip(pairs, grams, strict=True) if i == k and not others.isdisjoint(q.upper)]
    return z if len(kept) == len(z) else free(columns, kept)


def settled(o: Squares) -> tuple[Poly, list[Poly], dict[int, Fraction]]:
    """Return p and the known polynomials without those in variables that z lacks: the coefficients of p determine their
    multipliers, if the signs fit."""
    names, p, fixed = {name for z in o.z for name in z.names}, o.p, dict[int, Fraction]()
    known = [*o.strict, *o.known]
    for place, g in enumerate(known):
        strange = next((m for m in g.upper if not names.issuperset(m)), None)
        if strange is not None:
            fixed[place] = max(Fraction(p.upper.get(strange, 0) * g.lower, p.lower * g.upper[strange]), Fraction(0))
            p = p - g * fixed[place]
    return p, [g for place, g in enumerate(known) if place not in fixed], fixed


def ansatzes(o: Squares, p: Poly, known: list[Poly], count: int) -> list[list[list[Poly]]]:
    """Return the candidate cofactors: first only those without new monomials, so that the matrix can absorb all rounding
    errors."""
    whole = cofactors(o, p, count)
    monomials = {m for q in (p, *known, *products(o.z[:count])[1]) for m in q.upper}
    fitting = [
        [c for c in parts if (c * relation).upper.keys() <= monomials]
        for relation, parts in zip(o.modulo, whole, strict=True)
    ]
    return [fitting, whole] if fitting != whole and any(fitting) else [whole]


def cofactors(o: Squares, p: Poly, count: int) -> list[list[Poly]]:
    """Return for each relation the monomials of its cofactor, of degrees that fit."""
    top = max([degree(p), *(2 * degree(z) for z in o.z[:count]), *(degree(g) for g in o.known)])
    cofactors: list[list[Poly]] = []
    for relation in o.modulo:
        names = sorted({name for z in o.z[:count] for name in z.names})
        spare = range(top - degree(relation) + 1)
        cofactors.append([Poly({m: Fraction(1)}) for d in spare for m in combinations_with_replacement(names, d)])
    return cofactors


def combined(o: Squares, p: Poly, count: int) -> list[Poly]:
    """Return the relations times the monomials of their cofactors."""
    return [c * relation for relation, parts in zip(o.modulo, cofactors(o, p, count), strict=True) for c in parts]


def degree(p: Poly) -> int:
    """Return the degree of a polynomial."""
    return max(map(len, p.terms), default=0)


def posed(p: Poly, known: list[Poly], others: list[Poly], z: Sequence[Poly]) -> Problem:
    """Return the problem of finding multipliers of what is known, factors of the others and a Gram matrix."""
    pairs, grams = products(z)
    return Problem(p, [*known, *others, *grams], len(known), pairs, z)


def products(z: Sequence[Poly]) -> tuple[list[tuple[int, int]], list[Poly]]:
    """Return the indices of a Gram matrix's upper triangle, and the products that its entries multiply."""
    return _products(tuple((p.lower, *sorted(p.upper.items())) for p in z))


@cache
def _products(z: tuple[tuple[Any, ...], ...]) -> tuple[list[tuple[int, int]], list[Poly]]:
    parts, pairs = [Poly(dict(terms), lower) for lower, *terms in z], [(i, k) for k in range(len(z)) for i in range(k + 1)]
    return pairs, [parts[i] * parts[k] * (1 if i == k else 2) for i, k in pairs]


def equations(problem: Problem, scales: Mapping[str, float], more: Sequence[Poly] = ()) -> tuple[Entries, Any, Any]:
    """Return the linear equations in floats, a row for each monomial in scaled variables, and the columns' scales."""
    columns = [*problem.columns, *more]
    rows = {m: k for k, m in enumerate(sorted({m for q in (problem.p, *columns) for m in q.upper}))}

    @cache
    def size(m: Monomial) -> float:
        return float(prod(scales.get(name, 1.0) for name in m))

    # A quotient of integers is rounded once, as a float of a fraction is.
    entries = [(rows[m], k, c / q.lower * size(m)) for k, q in enumerate(columns) for m, c in q.upper.items()]
    largest = np.zeros(len(columns))
    for _, k, c in entries:
        largest[k] = max(largest[k], abs(c))
    # Rows and columns of the matrix are scaled alike, or it would not stay definite.
    sizes = [max(abs(c / z.lower) * size(m) for m, c in z.upper.items()) for z in problem.z]
    head = len(problem.columns) - len(problem.pairs)
    for k, (i, j) in enumerate(problem.pairs, head):
        largest[k] = sizes[i] * sizes[j] * (1.0 if i == j else 2.0)
    places = [r for r, _, _ in entries], [k for _, k, _ in entries]
    A = Entries(*places, [c / largest[k] for _, k, c in entries], (len(rows), len(columns)))
    b = np.zeros(len(rows))
    for m, c in problem.p.upper.items():
        b[rows[m]] = c / problem.p.lower * size(m)
    return A, b, largest


def optimum(
    A: Entries,
    b: Any,
    signed: Sequence[bool],
    blocks: Sequence[Sequence[tuple[int, int]]],
    twice: float,
    margin: bool = True,
) -> Any | None:
    """Return x with Ax = b and the largest last number; None without one. The first numbers are not negative, and before the
    last stand the upper triangles of matrices that are nowhere negative, `twice` what is beside the diagonal. margin: the
    last is no more than 1, the signed ones that say so, and the eigenvalues of the matrices."""
    if margin and twice == 1.0 and max(map(len, blocks), default=0) > LARGE:
        # Loaded here, because few matrices are so large.
        from starhold.certification.evidence.interior import most_definite

        key = A.compressed().key(), b.tobytes(), *signed, *map(tuple, blocks)
        return once(key, lambda: most_definite(A, b, signed, blocks))
    count, entries = A.shape[1] - 1, [(k, k, -1.0) for k in range(len(signed))]
    right = [b, np.zeros(len(signed))]
    if margin:
        entries += [(k, count, 1.0) for k, shared in enumerate([*signed, True]) if shared]
        right.append(np.ones(1))
    height, at = len(signed) + margin, count - sum(map(len, blocks))
    for pairs in blocks:
        for i, k in pairs:
            entries.append((height, at, -1.0 if i == k else -np.sqrt(2.0) / twice))
            entries += [(height, count, 1.0)] if margin and i == k else []
            height, at = height + 1, at + 1
        right.append(np.zeros(len(pairs)))
    rows, columns, values = zip(*entries, strict=True)
    whole = A.above(Entries(rows, columns, values, (height, count + 1)))
    sides = [max((k for _, k in pairs), default=-1) + 1 for pairs in blocks]
    cost = np.r_[np.zeros(count), -1.0]
    return interior_point(cost, whole, np.concatenate(right), A.shape[0], len(signed) + margin, sides)


def most_definite(problem: Problem, scales: Mapping[str, float]) -> tuple[Any | None, Any]:
    """Return the factors that make the Gram matrix most definite, with how much so, in units of others."""
    A, b, largest = equations(problem, scales)
    unit = float(np.abs(b).max()) or 1.0
    whole = A._replace(shape=(A.shape[0], A.shape[1] + 1))
    x = optimum(whole, b / unit, [k < problem.strict for k in range(problem.signed)], [problem.pairs], 2.0)
    return x, unit / largest


def solved(problem: Problem, scales: Mapping[str, float]) -> Any | None:
    """Return the factors in floats that make the Gram matrix most definite; None where it is not."""
    x, units = most_definite(problem, scales)
    if x is None or x[-1] < DEFINITE:
        return None
    x = x[:-1]
    # Numbers that are only rounding would have to be compensated elsewhere.
    return np.where(np.abs(x) < 1e-11 * np.abs(x).max(), 0.0, x) * units


def largest_number(problem: Problem, scales: Mapping[str, float], wanted: Poly) -> float | None:
    """Return the largest x for which p - x wanted is a sum as in the problem; None if there is none."""
    A, b, largest = equations(problem, scales, [wanted])
    unit = float(np.abs(b).max()) or 1.0
    x = optimum(A, b / unit, [False] * problem.signed, [problem.pairs], 2.0, margin=False)
    return None if x is None else float(x[-1] * unit / largest[-1])


def rounded(x: float, digits: int) -> Fraction:
    """Return a short number near a float, a multiple of a power of two."""
    if x == 0.0:
        return Fraction(0)
    exponent = int(np.floor(np.log2(abs(x)))) + 1 - int(digits * 3.33)
    return Fraction(round(ldexp(x, -exponent)) << max(exponent, 0), 1 << max(-exponent, 0))


def exactly(problem: Problem, guess: Any, digits: int) -> list[Fraction] | None:
    """Return exact factors near the guess; None where there are none."""
    x, head = [rounded(float(v), digits) for v in guess], len(problem.columns) - len(problem.pairs)
    x[: problem.signed] = [max(v, Fraction(0)) for v in x[: problem.signed]]
    shown = shared_out(problem, x, head) if all(len(z.terms) == 1 for z in problem.z) else None
    if shown is not None:
        return shown
    rest, count = problem.p - mixed(x, problem.columns), len(x)
    A = matrix_of([*problem.columns, rest])
    echelon, rank = fmpq_mat(count, A.nrows(), [A[r, k] for k in range(count) for r in range(A.nrows())]).rref()
    kept = [next(c for c in range(A.nrows()) if echelon[r, c] != 0) for r in range(rank)]
    square = fmpq_mat(rank, count, [A[r, k] for r in kept for k in range(count)])
    step = square.transpose() * (square * square.transpose()).solve(fmpq_mat(rank, 1, [A[r, count] for r in kept]))
    return [v + fraction(step[k, 0]) for k, v in enumerate(x)]


def coefficients(polys: Sequence[Poly]) -> tuple[tuple[int, int], list[tuple[int, int, Fraction]]]:
    """Return size and entries of the matrix of coefficients, a row for each monomial, a column for each polynomial."""
    rows = {m: k for k, m in enumerate(sorted({m for q in polys for m in q.terms}))}
    return (len(rows), len(polys)), [(rows[m], k, c) for k, q in enumerate(polys) for m, c in q.terms.items()]


def matrix_of(polys: Sequence[Poly]) -> Any:
    """Return the exact matrix of coefficients."""
    (height, width), entries = coefficients(polys)
    matrix = fmpq_mat(max(height, 1), max(width, 1))
    for r, k, c in entries:
        matrix[r, k] = exact(c)
    return matrix


def sparse_of(polys: Sequence[Poly]) -> Entries:
    """Return the matrix of coefficients in floats."""
    size, entries = coefficients(polys)
    return Entries([r for r, _, _ in entries], [k for _, k, _ in entries], [float(c) for _, _, c in entries], size)


def on_a_face(problem: Problem, guess: Any, digits: int) -> list[Fraction] | None:
    """Return exact factors with a singular matrix, whose kernel is near that of the guess."""
    head, size = len(problem.columns) - len(problem.pairs), len(problem.z)
    G = np.zeros((size, size))
    for (i, k), v in zip(problem.pairs, guess[head:], strict=True):
        G[i, k] = G[k, i] = v
    values, vectors = np.linalg.eigh(G)
    null, places = vectors[:, values < SINGULAR * values[-1]].T, list[int]()
    for k in range(len(null)):
        places.append(int(np.abs(null[k]).argmax()))
        null[k] /= null[k, places[-1]]
        null -= np.outer(np.where(np.arange(len(null)) == k, 0.0, null[:, places[-1]]), null[k])
    if not places:
        return None
    # z without its part along what is taken to zero.
    rest = [i for i in range(size) if i not in places]
    taken = [[Fraction(int(i == k)) for k in range(size)] for i in rest]
    for row, i in zip(taken, rest, strict=True):
        for k, place in enumerate(places):
            row[place] = -Fraction(float(null[k, i])).limit_denominator(SHORT)
    face = posed(problem.p, [], problem.columns[:head], [dot(row, problem.z) for row in taken])
    shown = exactly(
        replace(face, signed=problem.signed), [*guess[:head], *(G[rest[i], rest[k]] for i, k in face.pairs)], digits
    )
    if shown is None:
        return None
    gram = [[Fraction(0)] * len(rest) for _ in rest]
    for (i, k), v in zip(face.pairs, shown[head:], strict=True):
        gram[i][k] = gram[k][i] = v
    whole = times(transpose(taken), times(gram, taken))
    return [*shown[:head], *(whole[i][k] for i, k in problem.pairs)]


def shared_out(problem: Problem, x: list[Fraction], head: int) -> list[Fraction] | None:
    """Distribute the error of each monomial over the entries of the matrix that produce it; None if none does."""
    x = list(x)
    places: dict[Monomial, list[int]] = {}
    for k, column in enumerate(problem.columns[head:], head):
        places.setdefault(next(iter(column.terms)), []).append(k)
    rest = problem.p - mixed(x, problem.columns)
    for m, c in rest.terms.items():
        places_of = places.get(m)
        if places_of is None:
            return None
        share = c / sum((problem.columns[k].terms[m] for k in places_of), Fraction(0))
        for k in places_of:
            x[k] += share
    return x


def written(
    o: Squares, problem: Problem, x: list[Fraction], fixed: dict[int, Fraction], ansatz: list[list[Poly]]
) -> dict[str, Any]:
    """Return the evidence as the kernel reads it."""
    loose, place = iter(x[: problem.signed]), problem.signed
    multipliers = [fixed[k] if k in fixed else next(loose) for k in range(len(o.strict) + len(o.known))]
    combined: list[dict[str, str]] = []
    for parts in ansatz:
        combined.append(text(dot(x[place : place + len(parts)], parts) if parts else poly(0)))
        place += len(parts)
    at = [o.z.index(z) for z in problem.z]
    gram = [["0"] * (max(at) + 1) for _ in range(max(at) + 1)]
    for (i, k), v in zip(problem.pairs, x[place:], strict=True):
        gram[at[i]][at[k]] = gram[at[k]][at[i]] = str(v)
    return {"multipliers": list(map(str, multipliers)), "cofactors": combined, "gram": gram}


def mixed(factors: Iterable[Fraction], parts: Iterable[Poly]) -> Poly:
    """Return the sum of polynomials times numbers, reduced to lowest terms once."""
    shares = [(c / p.lower, p) for c, p in zip(factors, parts, strict=True) if c]
    lower, upper = lcm(*(c.denominator for c, _ in shares)), dict[Monomial, int]()
    for c, p in shares:
        scale = c.numerator * (lower // c.denominator)
        for m, x in p.upper.items():
            upper[m] = upper.get(m, 0) + x * scale
    return Poly(upper, lower)


def text(p: Poly) -> dict[str, str]:
    """Return a polynomial as evidence."""
    return {" ".join(m): str(c) for m, c in p.terms.items()}
