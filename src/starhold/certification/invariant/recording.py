"""Records an equation as a program of the proof kernel, its numbers exactly as they are written."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any, ClassVar


class Line:
    """A straight line of steps over named inputs; equal steps are kept once."""

    def __init__(self, names: Sequence[str]) -> None:
        self.names, self.steps = list(names), list[list[Any]]()
        self._places: dict[Any, int] = {}

    def variable(self, name: str) -> Term:
        """Return an input."""
        return Term(self, self.names.index(name))

    def number(self, x: Any) -> Term:
        """Return a constant; floats count as their exact values."""
        return Term(self, self._step("constant", str(Fraction(x))), Fraction(x))

    def apply(self, operation: str, values: Sequence[Any]) -> Term:
        """Return the value of an operation; numbers alone are worked out."""
        terms = [x if isinstance(x, Term) else self.number(x) for x in values]
        return Term(self, self._step(operation, *(x.place for x in terms)))

    def _step(self, *parts: Any) -> int:
        if parts not in self._places:
            self.steps.append([*parts])
            self._places[parts] = len(self.names) + len(self.steps) - 1
        return self._places[parts]


class Term:
    """A recorded value; `number`: what it is where it does not depend on inputs."""

    reader: ClassVar[str] = "dual"
    __slots__ = ("line", "number", "place")

    def __init__(self, line: Line, place: int, number: Fraction | None = None) -> None:
        self.line, self.place, self.number = line, place, number

    def read(self, entry: Any, values: tuple[Any, ...]) -> Term:
        """Record an operation of equations."""
        return self.line.apply(entry.name, values)

    def __add__(self, other: Any) -> Term:
        return self.line.apply("plus", (self, other))

    def __radd__(self, other: Any) -> Term:
        return self.line.apply("plus", (other, self))

    def __sub__(self, other: Any) -> Term:
        return self.line.apply("minus", (self, other))

    def __rsub__(self, other: Any) -> Term:
        return self.line.apply("minus", (other, self))

    def __mul__(self, other: Any) -> Term:
        return self.line.apply("product", (self, other))

    def __rmul__(self, other: Any) -> Term:
        return self.line.apply("product", (other, self))

    def __truediv__(self, other: Any) -> Term:
        return self.line.apply("divide", (self, other))

    def __neg__(self) -> Term:
        return self.line.apply("negative", (self,))


def recorded(equation: Callable[..., Any], names: Sequence[str]) -> dict[str, Any]:
    """Return an equation of the named numbers as a program: its value, or several."""
    line = Line(names)
    found = equation(*(line.variable(name) for name in names))
    values: list[Any] = [*found] if isinstance(found, (tuple, list)) else [found]  # pyright: ignore[reportUnknownVariableType]
    terms = [x if isinstance(x, Term) else line.number(x) for x in values]
    return {"inputs": line.names, "steps": line.steps, "outputs": [x.place for x in terms]}
