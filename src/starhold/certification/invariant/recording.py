"""Writes piecewise polynomials as a program of the proof kernel, their numbers exactly."""

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from starhold.algebra.polynomial import Case, Polynomial, pieces


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
            text = str(Fraction(int(c.p), int(c.q)))
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
    found: list[Case] = []
    for case in cases:
        others = tuple(truth for truth in case.truths if truth[0].key != condition.key)
        if not any(c.key == condition.key and truth != side for c, truth in case.truths):
            found.append(Case(others, case.value))
    return found


def program(values: Sequence[Any], names: Sequence[str]) -> dict[str, Any]:
    """Return piecewise polynomials of the named numbers as one program."""
    line = Line(names)
    outputs = [line.value(pieces(value)) for value in values]
    return {"inputs": line.names, "steps": line.steps, "outputs": outputs}
