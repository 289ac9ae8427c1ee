"""The loop of a craft near a libration point, wired from programs by the kernel.

x are positions and v velocities in axes that rotate with the two bodies: x' = v, v' = field(x, v) + u, with the law's
control u. Roots and quotients of the state are variables, shared by equal expressions.
"""

from __future__ import annotations

from fractions import Fraction
from functools import cached_property

from .loops import Loop, wired
from .numbers import definite, demand
from .polynomials import Poly, apply, dot, poly, var, variables
from .programs import Asking, Case, Piecewise, joined
from .reading import Claim

STATE = ("x1", "x2", "x3", "v1", "v2", "v3")


class PointLoop(Loop):
    """A craft near a libration point under a law; `sides` are the cases of the law, which together cover all states."""

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
        """Return the joint cases of the law's three outputs."""
        return joined(self.read("law", 3))

    def acceleration(self, side: Case) -> list[Poly]:
        """Return v'."""
        return [a + u for a, u in zip(self.field, side.value, strict=True)]

    def depends_on(self, side: Case) -> set[str]:
        """Return the variables in the acceleration."""
        return {name for p in self.acceleration(side) for name in p.names}

    @property
    def assumed(self) -> list[str]:
        """Return the assumptions of every claim about such a loop."""
        linear = all(len(m) <= 1 and {*m} <= {*STATE} for p in self.field for m in p.terms)
        field = "linear-field" if linear else "whole-field"
        return [field, "circling-bodies", "exact-place", "continuous-control"]

    @property
    def bodies(self) -> list[str]:
        """Return the assumptions if the equations are not defined everywhere: they take roots of nonnegative forms and
        divide by distances, which are zero only at the bodies."""
        self.divides_by_distances()
        one = [poly(1), *self.x, *self.v]
        for p in self.radicands.values():
            form = [[p.terms.get(m, 0) / Fraction(1 + (a is not b)) for b in one for m in (a * b).terms] for a in one]
            demand(not (p - dot(one, apply(form, one))).terms and definite(form, False), "a root may have no value")
        return ["off-the-bodies"] if self.ring.roots or self.ring.divisors else []

    @property
    def radicands(self) -> dict[str, Poly]:
        """Return the radicands, by the names of their roots."""
        return {name: Poly(dict(terms)) for terms, name in self.ring.roots.items()}

    def divides_by_distances(self) -> None:
        """Refuse equations with divisors, not guarded to be positive, other than sums of distances: roots of squares of the
        position that grow in all directions."""
        place, distances = STATE[:3], set[str]()
        for name, p in self.radicands.items():
            curved = [[p.slope(a).slope(b).terms.get((), Fraction(0)) for b in place] for a in place]
            distances |= {name} if p.names <= {*place} and definite(curved) else set()
        for b in self.ring.divisors:
            demand(b.names <= distances and min(b.terms.values()) > 0, "a divisor may be zero")

    def relay(self, wrong: list[Poly]) -> tuple[str, str]:
        """Return the names of |wrong| and of its inverse; empty names if none is used."""
        size = self.ring.roots.get(tuple(sorted(dot(wrong, wrong).terms.items())), "")
        return size, self.ring.inverses.get((((size,), var(size).terms[size,]),), "")
