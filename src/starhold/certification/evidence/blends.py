"""The derivatives of V along a loop with its torque held, as sums of those of V's parts."""

from __future__ import annotations

from fractions import Fraction
from functools import cached_property

from starhold.kernel.held import Held
from starhold.kernel.loops import AttitudeLoop
from starhold.kernel.plans import Plan
from starhold.kernel.polynomials import Monomial, Poly, dot

Parts = dict[tuple[tuple[Monomial, Fraction], ...], "Part"]
"""Parts of V by their terms, in units of the first coefficient."""


class Part:
    """A part of V: its successive derivatives in a period, and these with the law's torque."""

    def __init__(self, motion: Held, p: Poly) -> None:
        self.motion, self.rates, self.commanded = motion, [motion.along(p)], list[Poly]()

    def rate(self, order: int) -> Poly:
        """Return a derivative; 0 is the first."""
        while len(self.rates) <= order:
            self.rates.append(self.motion.along(self.rates[-1]))
        return self.rates[order]

    def by_law(self, order: int) -> Poly:
        """Return a derivative with the law's torque."""
        while len(self.commanded) <= order:
            self.commanded.append(self.rate(len(self.commanded)).at(self.motion.commanded))
        return self.commanded[order]


class Blended(Held):
    """A loop with its torque held, and a V that is a sum of parts. They are kept in `known`, as another V of the same loop
    has the same ones in other shares."""

    def __init__(self, loop: AttitudeLoop, plan: Plan | None, known: Parts) -> None:
        super().__init__(loop, plan)
        self.known = known

    @cached_property
    def split(self) -> list[tuple[Fraction, Part]]:
        """Return the shares and the parts of V, by how many rates a term has as factors."""
        of, shared = dict[int, dict[Monomial, Fraction]](), list[tuple[Fraction, Part]]()
        for m, c in sorted(self.loop.lyapunov.terms.items()):
            of.setdefault(sum(name[0] == "w" for name in m), {})[m] = c
        for terms in of.values():
            share, *_ = terms.values()
            unit = {m: c / share for m, c in terms.items()}
            key = (*unit.items(),)
            if key not in self.known:
                self.known[key] = Part(self, Poly(unit))
            shared.append((share, self.known[key]))
        return shared

    def further(self, rates: list[Poly]) -> Poly:
        """Return the derivative of V' that follows some others, V' being the first."""
        return dot(*zip(*((share, part.rate(len(rates))) for share, part in self.split), strict=True))

    def by_law(self, rates: list[Poly], shares: list[Fraction]) -> Poly:
        """Return the sum of shares of V' and its derivatives, with the law's torque."""
        return dot(*zip(*((c * x, part.by_law(k)) for c, part in self.split for k, x in enumerate(shares)), strict=True))
