"""A system, a function V and a box, for what floats and exact values at states tell of them."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from starhold.certification.invariant.system import Cells, Poly, System, split
from starhold.certification.matrices import number


@dataclass(frozen=True)
class Candidate:
    """A system, a function V and a box; M is {V <= 0} in it. `equilibrium`: the point that M is told to be, its
    coordinates, None for parameters; else None."""

    system: System
    V: Any
    box: tuple[tuple[float, float], ...]
    equilibrium: tuple[Any, ...] | None = None

    @cached_property
    def pieces(self) -> Cells:
        """Return the cells of rates and V together."""
        return split(self.system, self.V)


class Floats:
    """A polynomial is evaluated in floats."""

    def __init__(self, polynomial: Poly) -> None:
        self._terms = [(tuple(int(power) for power in powers), number(c)) for powers, c in polynomial.to_dict().items()]

    def at(self, points: Any) -> Any:
        """Return its values at points (n, ...)."""
        total = np.zeros(np.shape(points)[1:])
        for powers, c in self._terms:
            term = c
            for x, power in zip(points, powers, strict=True):
                term = term * x**power if power else term
            total = total + term
        return total
