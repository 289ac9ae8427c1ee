"""Recorded programs: straight lines of the scalar operations that fly, read exactly, piecewise, and over intervals."""

from __future__ import annotations

import hashlib
import json
import operator as op
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from itertools import product
from typing import Any, TypeAlias

from .intervals import Interval
from .numbers import Account, demand, rational, read_list, read_table
from .polynomials import Monomial, Poly, poly

OPERATIONS = {
    "plus": "nn>n", "minus": "nn>n", "product": "nn>n", "divide": "nn>n", "negative": "n>n", "sqrt": "n>n",
    "less": "nn>t", "less_equal": "nn>t", "select": "tnn>n", "both": "tt>t", "either": "tt>t", "opposite": "t>t",
}  # fmt: skip
"""The operations, each with the kinds that it takes and gives: numbers and truths."""
STEPS, CASES = 20_000, 2_000
_NAME = re.compile(r"[A-Za-z_]\w*(\.\w+)*", re.ASCII)


@dataclass(frozen=True)
class Program:
    """A program has named inputs, steps, each an operation and the places of earlier values (or a constant), and the places
    of its outputs. All are checked here: that a step reads only what is there, and numbers where it needs numbers."""

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
        kinds, found = ["n"] * len(inputs), list[tuple[str, Any]]()

        def place(k: Any, kind: str) -> int:
            demand(type(k) is int and 0 <= k < len(kinds), "a step reads what is not there yet")
            demand(kinds[k] == kind, "a step takes a truth for a number, or a number for a truth")
            return k

        for step in map(read_list, steps):
            demand(len(step) > 0 and isinstance(step[0], str), "a step has no operation")
            if step[0] == "constant":
                found.append(("constant", rational(step[1] if len(step) == 2 else None)))
                kinds.append("n")
                continue
            demand(step[0] in OPERATIONS, "there is no such operation")
            takes, gives = OPERATIONS[step[0]].split(">")
            operands = step[1:]
            demand(len(operands) == len(takes), f"{step[0]} takes another number of values")
            found.append((step[0], tuple(place(k, kind) for k, kind in zip(operands, takes, strict=True))))
            kinds.append(gives)
        return cls(tuple(inputs), tuple(found), tuple(place(k, "n") for k in outputs), digest(given))

    def run(self, given: Mapping[str, Any], ring: Exactly | Enclosing, count: int) -> list[Any]:
        """Return the values of the outputs, of which there have to be so many, over a ring."""
        demand(len(self.outputs) == count, f"a program has {len(self.outputs)} outputs and not {count}")
        values = [given[name] for name in self.inputs]
        for operation, operands in self.steps:
            if operation == "constant":
                values.append(ring.constant(operands))
                continue
            values.append(ring.apply(self.meant(operation, operands), [values[k] for k in operands]))
        return [values[k] for k in self.outputs]

    def meant(self, operation: str, operands: tuple[int, ...]) -> str:
        """Name a product of a value with itself a square, and a choice between the two values that its truth compares their
        minimum or maximum: what intervals could not tell."""
        if operation == "product" and operands[0] == operands[1]:
            return "square"
        if operation == "select" and operands[0] >= len(self.inputs):
            test, compared = self.steps[operands[0] - len(self.inputs)]
            if test in ("less", "less_equal") and sorted(compared) == sorted(operands[1:]):
                return "minimum" if compared == operands[1:] else "maximum"
        return operation


def digest(given: Any) -> str:
    """Return the name of a program as a certificate holds it: SHA-256 of its shortest JSON with sorted keys."""
    return hashlib.sha256(json.dumps(given, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


Condition: TypeAlias = tuple[tuple[Monomial, Fraction], ...]
Guards: TypeAlias = frozenset[tuple[Condition, bool]]
"""Polynomials, as their sorted terms, that are positive (True) or not (False) where a case holds."""


@dataclass(frozen=True)
class Case:
    """A case is a value, a polynomial or a truth, where its guards hold."""

    guards: Guards
    value: Any


Piecewise: TypeAlias = list[Case]


def condition(p: Poly) -> Condition:
    """Return the same for p and for p times a positive number."""
    scale = abs(max(p.terms.values(), key=abs))
    return tuple(sorted((m, c / scale) for m, c in p.terms.items()))


def known(p: Poly | Fraction | int) -> Piecewise:
    """Return a value that does not switch."""
    return [Case(frozenset(), poly(p))]


def single(cases: Piecewise) -> Poly:
    """Return the value of what does not switch."""
    demand(len(cases) == 1, "an equation switches")
    return cases[0].value


class Exactly:
    """A program is read over exact polynomials, case by case. Roots, and quotients by the state, are refused."""

    def constant(self, x: Fraction) -> Piecewise:
        """Return a constant."""
        return known(x)

    def apply(self, operation: str, operands: list[Piecewise]) -> Piecewise:
        """Return the cases of an operation's value, without those whose guards contradict each other."""
        if operation in ("select", "minimum", "maximum"):
            truth, *sides = operands
            chosen: Any = ((t, s) for t in truth for s in sides[0 if t.value else 1])
            joined = [(cases, "select", [cases[1].value]) for cases in chosen]
        else:
            chosen = product(*(operands[:1] if operation == "square" else operands))
            joined = [(cases, operation, [case.value for case in cases]) for cases in chosen]
        found: Piecewise = []
        for cases, name, x in joined:
            guards: Guards = frozenset(guard for case in cases for guard in case.guards)
            Account.spend(1 + len(guards))
            if not any((p, not truth) in guards for p, truth in guards):
                found += self.cases(guards, name, x)
            demand(len(found) <= CASES, "a program has too many cases")
        return found

    def cases(self, guards: Guards, operation: str, x: list[Any]) -> Piecewise:
        """Return the one case of a value, or the two of a comparison."""
        if operation not in ("less", "less_equal"):
            return [Case(guards, self.value(operation, x))]
        # a <= b is that not b < a.
        strict = operation == "less"
        gap = x[1] - x[0] if strict else x[0] - x[1]
        if not gap.names:
            return [Case(guards, (gap.number > 0) == strict)]
        told = {sign for sign in (True, False) if (condition(gap), sign) in guards} or {True, False}
        return [Case(guards | {(condition(gap), sign)}, sign == strict) for sign in sorted(told)]

    def value(self, operation: str, x: list[Any]) -> Any:
        """Return the value of an operation."""
        demand(operation in EXACT, f"{operation} has no exact value")
        return EXACT[operation](*x)


def _quotient(x: Poly, y: Poly) -> Poly:
    demand(not y.names, "a program divides by the state")
    demand(y.number != 0, "a program divides by zero")
    return x * (1 / y.number)


def _square(x: Poly) -> Poly:
    return x * x


EXACT: dict[str, Callable[..., Any]] = {
    "plus": op.add, "minus": op.sub, "product": op.mul, "square": _square, "negative": op.neg, "divide": _quotient,
    "select": op.pos, "both": bool.__and__, "either": bool.__or__, "opposite": op.not_,
}  # fmt: skip


class Enclosing:
    """A program is read over intervals; a truth is True, False or None."""

    def constant(self, x: Fraction) -> Interval:
        """Return a constant."""
        return Interval.of(x)

    def apply(self, operation: str, x: list[Any]) -> Any:
        """Return an enclosure of an operation's value."""
        Account.spend(4)
        return ENCLOSING[operation](*x[: 1 if operation == "square" else 3])


def _less(x: Interval, y: Interval) -> bool | None:
    return True if x.high < y.low else False if x.low >= y.high else None


def _not(t: bool | None) -> bool | None:
    return None if t is None else not t


def _both(t: bool | None, u: bool | None) -> bool | None:
    return False if False in (t, u) else None if None in (t, u) else True


def _select(t: bool | None, x: Interval, y: Interval) -> Interval:
    return x.hull(y) if t is None else x if t else y


def _minimum(t: bool | None, x: Interval, y: Interval) -> Interval:
    return Interval(min(x.low, y.low), min(x.high, y.high))


def _maximum(t: bool | None, x: Interval, y: Interval) -> Interval:
    return Interval(max(x.low, y.low), max(x.high, y.high))


def _either(t: bool | None, u: bool | None) -> bool | None:
    return _not(_both(_not(t), _not(u)))


def _less_equal(x: Interval, y: Interval) -> bool | None:
    return _not(_less(y, x))


ENCLOSING: dict[str, Callable[..., Any]] = {
    "plus": op.add, "minus": op.sub, "product": op.mul, "square": Interval.square, "negative": op.neg,
    "divide": Interval.__truediv__, "sqrt": Interval.sqrt, "less": _less, "less_equal": _less_equal, "select": _select,
    "minimum": _minimum, "maximum": _maximum, "both": _both, "either": _either, "opposite": _not,
}  # fmt: skip
