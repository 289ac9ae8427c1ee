"""The V with a product of rate and attitude, by which a set of attitudes and rates is a region of attraction where the law
knows no axis: V = |w|^2/2 + p u + c2 u^2 + (g + m u) q.w with u = 1 - q0. Shapes are told for a law with the root -1/s."""

from __future__ import annotations

from bisect import bisect
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.quaternion import vector_part
from starhold.algebra.vector import dot


class Shape(NamedTuple):
    """The numbers of V. Where p > 0, p + 2 c2 > 0 and p + 4 c2 > 0 the attitude's part rises with the turn."""

    p: float
    c2: float
    g: float
    m: float

    @property
    def other_equilibrium(self) -> float:
        """V (1/s2) at rest on the other quaternion of the target."""
        return 2.0 * self.p + 4.0 * self.c2

    def value(self, attitude: Any, rate: Any) -> Any:
        """V (1/s2) of attitude and rate (rad/s), numbers or columns."""
        q, u = vector_part(attitude), 1.0 - attitude[0]
        return dot(rate, rate) * 0.5 + (self.p + self.c2 * u) * u + (self.g + self.m * u) * dot(q, rate)

    def room(self, bound: float, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """{V <= bound} at u is a ball of rates: its radius squared, below zero where it is empty."""
        return 2.0 * (bound - self.p * u - self.c2 * u * u) + (self.g + self.m * u) ** 2 * u * (2.0 - u)

    def volume(self, bound: float) -> float:
        """The volume of {V <= bound} among attitudes and rates, up to a factor."""
        u = np.linspace(0.0, 2.0, 201)
        return float(np.sum(np.maximum(self.room(bound, u), 0.0) ** 1.5 * np.sqrt(u * (2.0 - u))))


SHAPES = (
    Shape(6.62, -0.62, 2.56, 0.59),
    Shape(7.07, -0.58, 2.64, 0.62),
    Shape(9.69, -0.9, 3.09, 0.72),
    Shape(11.16, -0.65, 3.3, 0.75),
    Shape(19.24, -1.97, 3.99, -0.45),
    Shape(23.14, 0.0, 3.48, -0.44),
    Shape(22.28, -0.02, 2.74, -1.22),
    Shape(20.69, -0.03, 2.36, -1.18),
)
LIMITS = (0.01, 0.02, 0.045, 0.07, 0.12, 0.2, 0.4)
"""The shapes are near the largest sets for ab of up to these, and from 1 on, from a search among points of a grid."""
SIGNED = (Shape(4.0, 0.0, 0.02, 0.0), Shape(4.0, 0.0, 0.1, 0.0), Shape(5.0, 0.0, 0.7, -0.7))
"""Where the sign of the quaternion is chosen: with a mixed term so small that a change of sign lowers V."""


def near(beta: float) -> tuple[Shape, ...]:
    """Return the shape for ab and its neighbours."""
    place = bisect(LIMITS, beta)
    return SHAPES[max(place - 1, 0) : place + 2]
