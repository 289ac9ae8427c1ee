"""The loop near a libration point in symbols, for all states and all numbers of the loop at once: what equations with square
roots, which polynomials have not, are compared in."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from starhold.algebra.symbolic import sympy
from starhold.algebra.vector import add
from starhold.checker.subject import named
from starhold.laws.interface import NoMemory
from starhold.laws.point import PointMeasurement
from starhold.parts.bodies.libration_point import Libration, linear, nonlinear


@dataclass(frozen=True)
class Symbols:
    """Gains, plant, and what the law is told."""

    gains: Any
    plant: Any
    measurement: Any

    @property
    def natural(self) -> Any:
        """The acceleration of the linear model without control."""
        return linear(self.measurement.position, self.measurement.velocity, self.plant)

    def flown(self, law: Any, full: bool) -> Any:
        """The acceleration under the law's command."""
        model: Callable[..., Any] = nonlinear if full else linear
        command = law.control(self.measurement, self.gains, self.plant, NoMemory())[0]
        return add(model(self.measurement.position, self.measurement.velocity, self.plant), command)


def in_symbols(law: Any, told: Mapping[str, Any], vectors: Sequence[str] = ()) -> Symbols:
    """A loop with the gains that are told, all other numbers symbols; `vectors`: gains of three numbers."""
    # Gains and plant have a number of the same name.
    numbers = {
        name: tuple(map(real, named(f"gain {name}"))) if name in vectors else real(f"gain {name}")
        for name in law.Gains._fields
    }
    plant: Any = Libration(*(real(f"plant {name}") for name in Libration._fields))
    position, velocity = (tuple(map(real, named(letter))) for letter in "xv")
    # A law that reads the period or the limit is noticed: no identity that is wanted holds them.
    measurement: Any = PointMeasurement(position, velocity, real("period"), real("limit"))  # pyright: ignore
    return Symbols(law.Gains(**{**numbers, **told}), plant, measurement)


def expanded(expression: Any) -> Any:
    """The expression multiplied out, with every float of the equations at its exact value."""
    return sympy.expand(expression.xreplace({x: sympy.Rational(x) for x in expression.atoms(sympy.Float)}))


def real(name: str) -> Any:
    """A symbol of any real number."""
    return sympy.Symbol(name, real=True)


def positive(name: str) -> Any:
    """A symbol of a positive number."""
    return sympy.Symbol(name, positive=True)
