"""A system of few variables from its equations, and as programs that the kernel reads."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from starhold.algebra.polynomial import Case, Polynomial, jointly, pieces
from starhold.certification.matrices import fraction

MOST_CELLS, MOST_TERMS = 64, 50_000
"""Cells, and terms that V' may have: beyond these a proof would not end."""


@dataclass(frozen=True)
class System:
    """x' = rates(x). `variables` move, `parameters` stay: whatever is shown holds for each of their values in the box.
    `angles`: those variables whose sines and cosines occur. Rates: polynomials over all of these, or piecewise ones."""

    variables: tuple[str, ...]
    rates: tuple[Any, ...]
    parameters: tuple[str, ...] = ()
    angles: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Variables, then parameters."""
        return self.variables + self.parameters

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names, then sine and cosine of each angle."""
        return self.names + tuple(turned(f, x) for x in self.angles for f in TURNED)

    @classmethod
    def of(
        cls, variables: Sequence[str], rates: Callable[..., Sequence[Any]], parameters: Sequence[str] = (),
        angles: Sequence[str] = (),
    ) -> System:  # fmt: skip
        """From an equation: a function of all variables, parameters, and sine and cosine of each angle that gives the
        derivative of every variable. It may use + - *, division by numbers, and `starhold.algebra.scalar`, whose `where`
        and `less` make pieces."""
        system = cls(tuple(variables), (), tuple(parameters), tuple(angles))
        rates_given = tuple(system.function(rates))
        if len(rates_given) != len(variables):
            raise ValueError(f"{len(rates_given)} derivatives for {len(variables)} variables")
        return replace(system, rates=rates_given)

    def function(self, equation: Callable[..., Any]) -> Any:
        """An equation over the same inputs, as polynomials."""
        return equation(*(Polynomial.variable(name) for name in self.inputs))

    def with_angles(self, points: Any) -> Any:
        """Points (n, N) of the names as points of the inputs in the kernel's form, with 1 - cos for a cosine."""
        turns = [points[self.variables.index(x)] for x in self.angles]
        return np.array([*points, *(value for turn in turns for value in (np.sin(turn), 1.0 - np.cos(turn)))])


TURNED = ("sin", "cos")


def turned(f: str, name: str) -> str:
    """The input that is the sine or cosine of a variable."""
    return f"{f}.{name}"


def check_sizes(system: System, V: Any) -> None:
    """ValueError where a system and a function have too many cells, or V' too many terms."""
    degree = 0
    for _, (*rates, function) in jointly([*system.rates, V], MOST_CELLS):
        # Of an angle's sine and cosine the rates are of one degree more.
        speeds = [_degree(rate) + (name in system.angles) for name, rate in zip(system.variables, rates, strict=True)]
        degree = max(degree, *(_degree(function) + speed for speed in speeds))
    count = len(system.inputs)
    if math.comb(count + degree, degree) > MOST_TERMS:
        raise ValueError(f"V' of degree {degree} in {count} variables")


def _degree(p: Polynomial) -> int:
    return max(map(len, p.terms), default=-1)


class Line:
    """A straight line of steps over named inputs; equal steps are kept once."""

    def __init__(self, names: Sequence[str]) -> None:
        self.names, self.steps = list(names), list[list[Any]]()
        self._places: dict[Any, int] = {}

    def step(self, *parts: Any) -> int:
        """Return the place of a step's value."""
        if parts not in self._places:
            self.steps.append([*parts])
            self._places[parts] = len(self.names) + len(self.steps) - 1
        return self._places[parts]

    def polynomial(self, p: Polynomial) -> int:
        """Return the place of a polynomial's value."""
        total: int | None = None
        for monomial, c in sorted(p.terms.items()):
            text = str(fraction(c))
            term = None if text == "1" and monomial else self.step("constant", text)
            for name in monomial:
                place = self.names.index(name)
                term = place if term is None else self.step("product", term, place)
            total = term if total is None else self.step("plus", total, term)
        return self.step("constant", "0") if total is None else total

    def value(self, cases: Sequence[Case]) -> int:
        """Return the place of a piecewise polynomial's value: a choice by one of its conditions, and so on."""
        condition = next((condition for case in cases for condition, _ in case.truths), None)
        if condition is None:
            return self.polynomial(cases[0].value)
        sides = [_where(cases, condition, side) for side in (True, False)]
        if not all(sides):
            # Whatever else holds there contradicts one side.
            return self.value(sides[0] or sides[1])
        truth = self.step("less", self.step("constant", "0"), self.polynomial(condition.positive))
        return self.step("select", truth, *map(self.value, sides))


def _where(cases: Sequence[Case], condition: Any, side: bool) -> list[Case]:
    """Return the cases where a condition has one truth, without it."""
    kept: list[Case] = []
    for case in cases:
        others = tuple(truth for truth in case.truths if truth[0].key != condition.key)
        if not any(c.key == condition.key and truth != side for c, truth in case.truths):
            kept.append(Case(others, case.value))
    return kept


def program(values: Sequence[Any], names: Sequence[str]) -> dict[str, Any]:
    """Return piecewise polynomials of the named numbers as one program."""
    line = Line(names)
    outputs = [line.value(pieces(value)) for value in values]
    return {"inputs": line.names, "steps": line.steps, "outputs": outputs}
