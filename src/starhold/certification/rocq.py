"""Prints what the kernel checked for Rocq (Coq 8.16 and later): each obligation is a lemma about real numbers, proved from
its evidence by the rules in rocq.v. Polynomials are multiplied by positive numbers, so that their coefficients are whole."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from importlib import resources
from itertools import chain
from math import ceil, isqrt, lcm, prod
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from starhold.certification.matrices import unlimited
from starhold.kernel import rules
from starhold.kernel.check import Proved
from starhold.kernel.numbers import Rows, definite, demand, matrix, plus, rational, scalar, times, transpose
from starhold.kernel.polynomials import Poly, apply, dot, poly, read_poly, total, var

WORDS = {
    *("as", "at", "cofix", "else", "end", "exists", "fix", "for", "forall", "fun", "if", "in", "let", "match", "mod"),
    *("return", "then", "using", "where", "with", "R", "exceeds", "num", "shows", "vanishes"),
}
"""Words that no variable may be called."""


class Part(NamedTuple):
    """Places of polynomials that are not negative, and the sum of squares z'Gz that is a factor of their product."""

    of: Sequence[int]
    z: Sequence[Poly]
    gram: Rows


class Lemma(NamedTuple):
    """p >= low, or p = 0 where low is None, wherever the known are not negative and the zeros are zero: p - low is the sum
    of cofactors times zeros, and of parts."""

    p: Poly
    low: Poly | None
    cofactors: Sequence[Poly]
    zeros: Sequence[Poly]
    known: Sequence[Poly] = ()
    parts: Sequence[Part] = ()


class Matrix(NamedTuple):
    """A symmetric matrix is positive definite."""

    rows: Rows


Polynomial: TypeAlias = rules.Vanishes | rules.Squares | rules.Sum | rules.Contracts | rules.Persists | rules.Definite
"""Obligations about polynomials; the other compares two numbers."""


def printed(proved: Sequence[Proved]) -> str:
    """Return the text of a file that coqc accepts, with one or more lemmas for each obligation that was checked."""
    unlimited()
    lines = list[str]()
    for i, one in enumerate(proved):
        lines.append(f"(* {_remark(one.statement.written())} *)\n")
        for k, (name, obligation) in enumerate(one.obligations):
            lines.append(f"(* {_remark(name)} *)")
            evidence = one.claim.evidence.content.get(name)
            lines += (f"{text}\n" for text in _texts(obligation, evidence, f"claim{i}_{k}"))
    # A place among variables is a word defined in the file, which is read faster than a numeral.
    count = max((int(x) + 1 for line in lines for x in re.findall(r"\bv(\d+) ", line)), default=0)
    rules = resources.files("starhold.certification").joinpath("rocq.v").read_text(encoding="utf-8")
    return "\n".join([rules, *(f"Definition v{k} := v {k}." for k in range(count)), "", *lines])


def _texts(o: rules.Obligation, evidence: Any, name: str) -> Iterator[str]:
    if isinstance(o, rules.Exceeds):
        small, large = (f"num {_number(x.numerator)} / num {_number(x.denominator)}" for x in (Fraction(o.small), o.large))
        yield _proved(f"{name}_0", f"{small} < {large}", "apply smaller.", CHECKED)
    else:
        for j, given in enumerate(lemmas(o, evidence)):
            yield _definite(f"{name}_{j}", given.rows) if isinstance(given, Matrix) else _text(f"{name}_{j}", given)


def lemmas(o: Polynomial, evidence: Any) -> Iterator[Lemma | Matrix]:
    """Yield the statements of an obligation, with its evidence."""
    if isinstance(o, rules.Vanishes):
        yield Lemma(o.p, None, _polys(evidence or []), o.modulo)
    elif isinstance(o, rules.Squares):
        known, count = [*o.strict, *o.known], len(evidence["gram"])
        weights = [rational(x) for x in evidence["multipliers"]]
        gram, z = matrix(evidence["gram"], count, count), list(o.z[:count])
        c, rest = _least(gram, o.least)
        low = dot(weights[: len(o.strict)], o.strict) + c * total(x * x for x in z[: o.least])
        parts = [Part([k], [poly(1)], [[x]]) for k, x in enumerate(weights) if x and k >= len(o.strict)]
        yield Lemma(o.p, low, _polys(evidence["cofactors"]), o.modulo, known, [*parts, Part([], z, rest)])
    elif isinstance(o, rules.Sum):
        low = dot([rational(x) for x in evidence["numbers"]], o.strict)
        yield Lemma(o.p, low, _polys(evidence["cofactors"]), o.modulo, o.known, [*map(_part, evidence["parts"])])
    elif isinstance(o, rules.Definite):
        yield Matrix(o.a)
    elif isinstance(o, rules.Contracts):
        yield from _contracting(o, matrix(evidence, len(o.A), len(o.A)))
    else:
        yield from _persisting(o.A, matrix(evidence, len(o.A), len(o.A)))


def _form(a: Rows, p: Poly, cofactors: Sequence[Poly], zeros: Sequence[Poly]) -> Lemma:
    """Return the lemma that p, which is x'ax up to the zeros, exceeds a multiple of |x|^2."""
    x, (c, rest) = _vector("x", len(a)), _least(a, len(a))
    return Lemma(p, c * dot(x, x), cofactors, zeros, (), [Part([], x, rest)])


def _contracting(o: rules.Contracts, P: Rows) -> Iterator[Lemma | Matrix]:
    """Yield the statements that P is positive definite, and that where y = Ax its form decreases, or is below rate^2 times
    that of x."""
    x, y, PA = _vector("x", len(P)), _vector("y", len(P)), times(P, o.A)
    Ax, Px, Py = apply(o.A, x), apply(P, x), apply(P, y)
    zeros = [b - a for a, b in zip(Ax, y, strict=True)]
    yield Matrix(P)
    if o.flow:
        yield _form(plus(scalar(0, len(P)), plus(PA, transpose(PA)), -1), dot(x, Py) * -2, [p * -2 for p in Px], zeros)
    else:
        square = o.rate * o.rate
        falls = plus([[square * b for b in row] for row in P], times(transpose(o.A), PA), -1)
        turned = [-(a + b) for a, b in zip(Py, apply(P, Ax), strict=True)]
        yield _form(falls, square * dot(x, Px) - dot(y, Py), turned, zeros)


def _persisting(A: Rows, P: Rows) -> Iterator[Lemma]:
    """Yield the statements that where y = Ax the form y'Py is at least x'Px, and that this is positive at some x."""
    x, y = _vector("x", len(P)), _vector("y", len(P))
    Ax, Px, Py = apply(A, x), apply(P, x), apply(P, y)
    turned = [a + b for a, b in zip(Py, apply(P, Ax), strict=True)]
    zeros = [b - a for a, b in zip(Ax, y, strict=True)]
    gains = plus(times(transpose(A), times(P, A)), P, -1)
    yield Lemma(dot(y, Py) - dot(x, Px), Poly({}), turned, zeros, (), [Part([], x, gains)])
    largest: Any = np.linalg.eigh(np.array([[float(p) for p in row] for row in P]))[1][:, -1]
    v = [poly(Fraction(float(part))) for part in largest]
    near = [a - b for a, b in zip(x, v, strict=True)]
    sums = [a + b for a, b in zip(Px, apply(P, v), strict=True)]
    low = dot(v, apply(P, v))
    demand(low.number > 0, "no state was found at which a form is positive")
    yield Lemma(dot(x, Px), low, sums, near)


def _least(gram: Rows, count: int) -> tuple[Fraction, Rows]:
    """Return a c > 0 that may be taken from the first entries of a positive definite matrix's diagonal, and what is left."""
    c = Fraction(1)
    while count:
        rest = [[x - c * (i == k < count) for k, x in enumerate(row)] for i, row in enumerate(gram)]
        if definite(rest, False):
            return c, rest
        c /= 16
    return c, gram


def _polys(given: Any) -> list[Poly]:
    return [read_poly(p) for p in given]


def _part(given: Any) -> Part:
    z = [read_poly({name: "1"} if isinstance(name, str) else name) for name in given["z"]]
    return Part(given["of"], z, matrix(given["gram"], len(z), len(z)))


def _vector(letter: str, count: int) -> list[Poly]:
    return [var(f"{letter}{k}") for k in range(count)]


EASY = 6
"""The number of rows from which on elimination takes long."""
CHECKED = "vm_cast_no_check (eq_refl true)."
"""The end of a proof by computation, which Rocq does where the proof is accepted."""


def _proved(name: str, statement: str, *proof: str) -> str:
    steps = "\n".join(f"  {step}" for step in proof)
    return f"Lemma {name} : {statement}.\nProof.\n{steps}\nQed."


def _definite(name: str, a: Rows) -> str:
    """Return the lemma that a matrix times a number is positive definite, and its proof: about it less 1 on its diagonal."""
    size, (c, _) = lcm(*(x.denominator for row in a for x in row)), _least(a, len(a))
    size *= ceil(1 / (c * size))
    size *= _room([[[size * x - (i == k) for k, x in enumerate(row)] for i, row in enumerate(a)]])
    whole = [[size * x for x in row] for row in a]
    squares = _squares([[x - (i == k) for k, x in enumerate(row)] for i, row in enumerate(whole)])
    return _proved(name, f"positive_definite {_rows(_upper(whole))}", f"apply (positive {squares}).", CHECKED)


def _text(name: str, given: Lemma) -> str:
    """Return the statement of a lemma and its proof, in which every number is whole."""
    size, (p, low) = _whole(given.p, given.low or Poly({}))
    used = [(c, r) for c, r in zip(given.cofactors, given.zeros, strict=True) if c.terms]
    zeros, known = [_whole(r) for _, r in used], {k: _whole(given.known[k]) for part in given.parts for k in part.of}
    cofactors = [c * (size / of) for (c, _), (of, _) in zip(used, zeros, strict=True)]
    parts = list[Part]()
    for of, z, gram in given.parts:
        multiple, whole = _whole(*z)
        share = size / multiple / multiple / prod(known[k][0] for k in of)
        parts.append(Part([[*known].index(k) for k in of], whole, [[share * x for x in row] for row in gram]))
    fractions = chain(*(c.terms.values() for c in cofactors), *(row for part in parts for row in part.gram))
    least = lcm(*(x.denominator for x in fractions))
    K = least * _room([[[least * x for x in row] for row in part.gram] for part in parts])
    relations, sides = [r for _, (r,) in zeros], [g for _, (g,) in known.values()]
    polys = [p, low, *relations, *sides, *cofactors, *(x for part in parts for x in part.z)]
    write = Writer(_names({name for q in polys for name in q.names}))
    premises = [*(f"{write.sum(r)} = 0" for r in relations), *(f"0 <= {write.sum(g)}" for g in sides)]
    premises.append(f"{write.sum(p)} = 0" if given.low is None else f"{write.sum(low)} <= {write.sum(p)}")
    data = [_number(K), write.terms(p), write.terms(low), *map(write.list, (relations, sides, [c * K for c in cofactors]))]
    data.append(f"[{'; '.join(write.part(part, K) for part in parts)}]")
    rule, condition = ("vanishes", "level") if given.low is None else ("exceeds", "holds")
    variables = " ".join(write.names.values())
    every, each = (f"forall {variables} : R, ", f"fun {variables} : R => ") if variables else ("", "")
    return f"Definition {name}_evidence := Shown {' '.join(data)}.\n" + _proved(
        name,
        f"{every}{' -> '.join(premises)}",
        f"assert (shows : {condition} {name}_evidence = true) by ({CHECKED[:-1]}).",
        f"exact_no_check ({each}{rule} _ shows [{'; '.join(write.names.values())}]).",
    )


class Writer:
    """Writes polynomials as sums, and as lists of their terms, in which a variable is its place."""

    def __init__(self, names: Mapping[str, str]) -> None:
        self.names, self.places = names, {name: k for k, name in enumerate(names)}

    def sum(self, p: Poly) -> str:
        """Write a polynomial for reading."""
        rows = (" * ".join([f"num {_number(c)}", *(self.names[x] for x in m)]) for m, c in p.terms.items())
        return " + ".join(rows) or "0"

    def terms(self, p: Poly) -> str:
        """Write a polynomial for the rules."""
        rows = [f"t {_number(c)} {_places(self.places[x] for x in m)}" for m, c in p.terms.items()]
        return _nested(rows, "o")

    def list(self, polys: Iterable[Poly]) -> str:
        """Write polynomials for the rules."""
        return f"[{'; '.join(map(self.terms, polys))}]"

    def part(self, part: Part, K: int) -> str:
        """Write a part of a sum, times K, for the rules."""
        gram = [[K * x for x in row] for row in part.gram]
        return f"Part {_places(part.of)} {self.list(part.z)} {_rows(_upper(gram))} {_squares(gram)}"


def _nested(words: Sequence[str], last: str) -> str:
    return f"{''.join(f'({word} ' for word in words)}{last}{')' * len(words)}"


def _places(places: Iterable[int]) -> str:
    return _nested([f"v{k}" for k in places], "e")


def _rows(rows: Iterable[Iterable[Fraction | int]]) -> str:
    written = (", ".join(map(_number, row)) for row in rows)
    return f"[{'; '.join(f'(|{row}|)' for row in written)}]"


def _upper(a: Rows) -> list[list[Fraction]]:
    """Return the rows of a symmetric matrix from the diagonal on."""
    return [row[i:] for i, row in enumerate(a)]


def _number(x: Fraction | int) -> str:
    """Write a whole number; Rocq reads long ones sooner from hexadecimal digits."""
    text = f"{int(x)}" if abs(x) < 10**6 else f"{int(x):#x}"
    return f"({text})" if x < 0 else text


def _squares(gram: Rows) -> str:
    """Write the squares that leave little of a matrix."""
    size, error, taken = _taken(gram)
    return f"{size} {error} {_rows(taken)}"


def _room(grams: Sequence[Rows]) -> int:
    """Return the factor by which matrices of whole numbers are multiplied so that short squares leave little of each, or
    1."""
    large = [gram for gram in grams if len(gram) > EASY]
    return next((c for c in (1, 2**40, 2**80) if all(_taken([[c * x for x in row] for row in a])[2] for a in large)), 1)


def _taken(gram: Rows) -> tuple[int, int, list[list[int]]]:
    """Return s, r and short u, each from its pivot on, such that a matrix less the sum of 2^s uu' has entries of at most 2^r
    off its diagonal, and count times 2^r on it; no u where there are none."""
    G, count = [[int(x) for x in row] for row in gram], len(gram)
    bits = max((row[k].bit_length() for k, row in enumerate(G)), default=0)
    for s in (*range(bits - 40, 0, -20), 0):
        # Entries of u are rounded, so entries of uu' are off by at most the largest.
        r = (s + bits) // 2 + 1
        taken = _factored([[x - (count * (i == k) << r) for k, x in enumerate(row)] for i, row in enumerate(G)], 2**s)
        if taken:
            return s, r, taken
    return 0, 0, []


def _factored(rest: list[list[int]], m: int) -> list[list[int]]:
    """Return the rows of U, from the diagonal on, such that m U'U is a matrix, but for what is rounded, or none where it is
    not positive."""
    rows: list[list[int]] = [row[i:] for i, row in enumerate(rest)]
    taken = list[list[int]]()
    while rows:
        pivot = isqrt(max(rows[0][0], 0) // m)
        if not pivot:
            return []
        u: list[int] = [pivot, *((2 * x + m * pivot) // (2 * m * pivot) for x in rows[0][1:])]
        rows = [
            [x - m * a * b for x, b in zip(row, u[i:], strict=True)]
            for i, (row, a) in enumerate(zip(rows, u, strict=True))
            if i
        ]
        taken.append(u)
    return taken


def _whole(*polys: Poly) -> tuple[Fraction, list[Poly]]:
    """Return the least whole number that makes polynomials' coefficients whole, and them times it."""
    size = Fraction(lcm(*(c.denominator for p in polys for c in p.terms.values())))
    return size, [p * size for p in polys]


def _names(variables: Iterable[str]) -> dict[str, str]:
    """Name variables as Rocq may."""
    names = dict[str, str]()
    for variable in sorted(variables):
        name = variable.replace(".", "_")
        while name in WORDS or name in names.values():
            name += "_"
        names[variable] = name
    return names


def _remark(text: str) -> str:
    return re.sub(r'[("*)]', " ", text)
