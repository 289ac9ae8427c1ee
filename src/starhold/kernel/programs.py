"""Recorded programs: straight-line code of the scalar operations that fly, evaluated exactly, case by case."""

from __future__ import annotations

import hashlib
import json
import operator as op
import re
from collections.abc import Callable, Iterable, Mapping
from fractions import Fraction
from itertools import product
from typing import Any, NamedTuple, TypeAlias

from .numbers import Account, demand, rational, read_list, read_table
from .polynomials import Monomial, Poly, multiple, poly, var

OPERATIONS = {
    "plus": "nn>n", "minus": "nn>n", "product": "nn>n", "divide": "nn>n", "negative": "n>n", "sqrt": "n>n",
    "less": "nn>t", "less_equal": "nn>t", "select": "tnn>n", "both": "tt>t", "either": "tt>t", "opposite": "t>t",
}  # fmt: skip
"""The operations, each with the kinds that it takes and gives: numbers and truths."""
STEPS, CASES = 20_000, 2_000
_NAME = re.compile(r"[A-Za-z_]\w*(\.\w+)*", re.ASCII)


class Program(NamedTuple):
    """A program has named inputs, steps, each an operation and the indices of earlier values (or a constant), and the
    indices of its outputs. The reader checks that a step uses only existing values, and numbers where it needs numbers."""

    inputs: tuple[str, ...]
    steps: tuple[tuple[str, Any], ...]
    outputs: tuple[int, ...]
    digest: str

    @classmethod
    def read(cls, given: Any) -> Program:
        """Read a program of a certificate."""
        inputs, steps, outputs = map(read_list, read_table(given, "inputs", "steps", "outputs"))
        demand(len(steps) <= STEPS and len(inputs) <= STEPS, "a program is too long")
        demand(all(isinstance(n, str) and _NAME.fullmatch(n) is not None for n in inputs), "an input has no proper name")
        demand(len(set(inputs)) == len(inputs), "an input stands twice")
        kinds, operations = ["n"] * len(inputs), list[tuple[str, Any]]()

        def place(k: Any, kind: str) -> int:
            demand(type(k) is int and 0 <= k < len(kinds), "a step reads what is not there yet")
            demand(kinds[k] == kind, "a step takes a truth for a number, or a number for a truth")
            return k

        for step in map(read_list, steps):
            demand(len(step) > 0 and isinstance(step[0], str), "a step has no operation")
            if step[0] == "constant":
                operations.append(("constant", rational(step[1] if len(step) == 2 else None)))
                kinds.append("n")
                continue
            demand(step[0] in OPERATIONS, "there is no such operation")
            takes, gives = OPERATIONS[step[0]].split(">")
            operands = step[1:]
            demand(len(operands) == len(takes), f"{step[0]} takes another number of values")
            operations.append((step[0], tuple(place(k, kind) for k, kind in zip(operands, takes, strict=True))))
            kinds.append(gives)
        return cls(tuple(inputs), tuple(operations), tuple(place(k, "n") for k in outputs), digest(given))

    def run(self, given: Mapping[str, Piecewise], ring: Exactly, count: int) -> list[Piecewise]:
        """Return the outputs, of which there have to be so many, case by case."""
        demand(len(self.outputs) == count, f"a program has {len(self.outputs)} outputs and not {count}")
        values = [given[name] for name in self.inputs]
        for operation, operands in self.steps:
            constant = operation == "constant"
            values.append(known(operands) if constant else ring.apply(operation, [values[k] for k in operands]))
        return [values[k] for k in self.outputs]


def digest(given: Any) -> str:
    """Return the name of a program in a certificate: SHA-256 of its shortest JSON with sorted keys."""
    return hashlib.sha256(json.dumps(given, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


Condition: TypeAlias = tuple[tuple[Monomial, Fraction], ...]
Guards: TypeAlias = frozenset[tuple[Condition, bool]]
"""Polynomials, as their sorted terms, that are positive (True) or not (False) where a case holds."""


class Case(NamedTuple):
    """A case is a value, a polynomial or a truth, valid where its guards hold."""

    guards: Guards
    value: Any

    @property
    def known(self) -> list[Poly]:
        """Return the polynomials that are not negative where the case holds, boundary included."""
        return [Poly(dict(p)) * (1 if above else -1) for p, above in sorted(self.guards)]

    def agrees(self, other: Case) -> bool:
        """Tell whether values are equal where both cases hold, boundaries included: a condition of one excludes one of the
        other, or leaves only their common boundary, on which the values are equal."""
        gap = self.value - other.value
        if not gap.terms:
            return True
        for p, r in product(self.known, other.known):
            factor, offset = multiple(r, p)
            if factor < 0 and (offset < 0 or (offset == 0 and not (gap - multiple(gap, p)[0] * p).terms)):
                return True
        return False


Piecewise: TypeAlias = list[Case]


def condition(p: Poly) -> Condition:
    """Return the same condition for p and for p times a positive number."""
    scale = abs(max(p.terms.values(), key=abs))
    return tuple(sorted((m, c / scale) for m, c in p.terms.items()))


def known(p: Poly | Fraction | int) -> Piecewise:
    """Return a value that does not switch."""
    return [Case(frozenset(), poly(p))]


def single(cases: Piecewise) -> Poly:
    """Return the value of what does not switch."""
    demand(len(cases) == 1, "an equation switches")
    return cases[0].value


def joined(values: Iterable[Piecewise], most: int = CASES) -> Piecewise:
    """Return the joint cases of some values, without those whose guards contradict each other."""
    together = [Case(frozenset(), [])]
    for cases in values:
        pairs = ((a.guards | b.guards, [*a.value, b.value]) for a in together for b in cases)
        together = [Case(guards, value) for guards, value in pairs if not contradictory(guards)]
        demand(len(together) <= most, "a program has too many cases")
    return together


def contradictory(guards: Guards) -> bool:
    """Tell whether a condition must both hold and fail, or two opposite ones must hold."""
    Account.spend(1 + len(guards))
    if not guards:
        return False
    against = {(p, False) for p, truth in guards if truth}
    against |= {(tuple((m, -c) for m, c in p), True) for p, truth in guards if truth}
    return not against.isdisjoint(guards)


def positive(guards: Guards, p: Poly) -> bool | None:
    """Tell whether p > 0 where the guards hold, as far as a single guard decides it; None if none does."""
    if not p.names:
        return p.number > 0
    for terms, above in guards:
        g = Poly(dict(terms))
        factor, offset = multiple(p, g if above else -g)
        if factor > 0 and (offset > 0 or (above and offset == 0)):
            return True
        if factor < 0 and offset <= 0:
            return False
    return None


class Exactly:
    """A program is evaluated over exact polynomials, case by case. Roots and quotients of the state are refused."""

    def __init__(self) -> None:
        self.inverses = dict[Condition, str]()

    def apply(self, operation: str, operands: list[Piecewise]) -> Piecewise:
        """Return the cases of an operation's value."""
        chosen = [operands]
        if operation == "select":
            chosen = [[[truth], operands[1 if truth.value else 2]] for truth in operands[0]]
        results = [
            new for values in chosen for case in joined(values) for new in self.cases(case.guards, operation, case.value)
        ]
        demand(len(results) <= CASES, "a program has too many cases")
        return results

    def cases(self, guards: Guards, operation: str, x: list[Any]) -> Piecewise:
        """Return the one case of a value, or the two of a comparison that the guards do not decide."""
        if operation not in ("less", "less_equal"):
            return [Case(guards, self.value(guards, operation, x))]
        # a <= b is that not b < a.
        strict = operation == "less"
        gap = x[1] - x[0] if strict else x[0] - x[1]
        decided = positive(guards, gap)
        if decided is not None:
            return [Case(guards, decided == strict)]
        return [Case(guards | {(condition(gap), sign)}, sign == strict) for sign in (False, True)]

    def value(self, guards: Guards, operation: str, x: list[Any]) -> Any:
        """Return the value of an operation where guards hold."""
        demand(operation in EXACT, f"{operation} has no exact value")
        return EXACT[operation](*x)


def _quotient(x: Poly, y: Poly) -> Poly:
    demand(not y.names, "a program divides by the state")
    demand(y.number != 0, "a program divides by zero")
    return x * (1 / y.number)


def _chosen(truth: bool, value: Poly) -> Poly:
    return value


EXACT: dict[str, Callable[..., Any]] = {
    "plus": op.add, "minus": op.sub, "product": op.mul, "negative": op.neg, "divide": _quotient,
    "select": _chosen, "both": bool.__and__, "either": bool.__or__, "opposite": op.not_,
}  # fmt: skip


class Asking(Exactly):
    """A program is evaluated over polynomials in which roots n >= 0 and inverses s are variables, named by their arguments.
    Unless `nested`, no root is taken and nothing is divided by a quotient."""

    def __init__(self, nested: bool = True) -> None:
        super().__init__()
        self.nested, self.roots = nested, dict[Condition, str]()
        self.divisors: list[Poly] = []
        """What is divided by where no guard says that it is positive."""

    def value(self, guards: Guards, operation: str, x: list[Any]) -> Any:
        """Return the value of an operation; of a root or quotient by the state a variable."""
        if operation == "sqrt" and x[0].names:
            demand(self.nested, "a program takes a root of the state")
            return self._named(self.roots, "n", x[0])
        if operation == "divide" and x[1].names:
            demand(self.nested or x[1].names.isdisjoint(self.inverses.values()), "a program divides by a quotient")
            if positive(guards, x[1]) is not True:
                self.divisors.append(x[1])
            return x[0] * self._named(self.inverses, "s", x[1])
        return super().value(guards, operation, x)

    def _named(self, names: dict[Condition, str], letter: str, p: Poly) -> Poly:
        return var(names.setdefault(tuple(sorted(p.terms.items())), f"{letter}{len(names)}"))
