"""The loop of a craft near a libration point, wired from programs by the kernel.

x are places and v velocities in axes that turn with the two bodies: x' = v, v' = field(x, v) + u, with the law's control u.
Roots and quotients by the state are variables, the same wherever the same is asked for.
"""

from __future__ import annotations

from functools import cached_property

from .loops import Loop, wired
from .numbers import demand
from .polynomials import Poly, dot, var, variables
from .programs import Asking, Case, Piecewise, joined
from .reading import Claim

STATE = ("x1", "x2", "x3", "v1", "v2", "v3")


class PointLoop(Loop):
    """A craft near a libration point under a law; `sides` are the cases of the law, which together are all states."""

    ring: Asking
    driven = STATE[3:]

    def __init__(self, claim: Claim) -> None:
        super().__init__(claim, Asking())
        self.x, self.v = variables("x"), variables("v")
        state = wired("position", self.x) | wired("velocity", self.v)
        self.inputs = state | {f"measurement.{name}": p for name, p in state.items()}
        self.rates = dict(zip(STATE, self.v, strict=False))
        self.field = self.single("field", 3)
        demand(not claim.taken.content, "the loop is taken with nothing")

    @cached_property
    def sides(self) -> Piecewise:
        """Return the cases of the law's three outputs together."""
        return joined(self.read("law", 3))

    def acceleration(self, side: Case) -> list[Poly]:
        """Return v'."""
        return [a + u for a, u in zip(self.field, side.value, strict=True)]

    def depends_on(self, side: Case) -> set[str]:
        """Return the variables of the acceleration."""
        return {name for p in self.acceleration(side) for name in p.names}

    @property
    def assumed(self) -> list[str]:
        """Return what every claim about such a loop assumes."""
        linear = all(len(m) <= 1 and {*m} <= {*STATE} for p in self.field for m in p.terms)
        field = "linear-field" if linear else "whole-field"
        return [field, "circling-bodies", "exact-place", "continuous-control"]

    @property
    def bodies(self) -> list[str]:
        """Return what is assumed where the equations have no value everywhere."""
        return ["off-the-bodies"] if self.ring.roots or self.ring.divisors else []

    def relay(self, wrong: list[Poly]) -> tuple[str, str]:
        """Return the names of |wrong| and of its inverse; of none that is asked for where none is."""
        size = self.ring.roots.get(tuple(sorted(dot(wrong, wrong).terms.items())), "")
        return size, self.ring.inverses.get((((size,), var(size).terms[size,]),), "")
