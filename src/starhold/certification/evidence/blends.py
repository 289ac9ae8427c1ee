"""Motions of one loop with different V, which share the derivatives of V's parts, and all that does not depend on V."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from typing import Any

from starhold.certification.evidence.squares import mixed
from starhold.kernel.held import Held
from starhold.kernel.loops import AttitudeLoop
from starhold.kernel.numbers import Rows, demand
from starhold.kernel.plans import Plan
from starhold.kernel.polynomials import Monomial, Poly
from starhold.kernel.programs import Program
from starhold.kernel.reading import Claim, Numbers, Told
from starhold.kernel.regions import Region, Tube
from starhold.kernel.rules import Proof
from starhold.kernel.theorems.pointing import descends


@dataclass
class Shared:
    """Parts of V by their terms, in units of the first coefficient, and a motion's attributes."""

    parts: dict[tuple[tuple[Monomial, Fraction], ...], Part] = field(default_factory=dict[Any, "Part"])
    motion: dict[str, Any] = field(default_factory=dict[str, Any])


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
    has the same ones in other shares; so is all that does not depend on V. Regions and tubes are asked for repeatedly."""

    def __init__(self, loop: AttitudeLoop, known: Shared) -> None:
        if known.motion:
            vars(self).update(known.motion)
            self.measure(loop)
        else:
            super().__init__(loop)
            known.motion.update(vars(self))
        self.known = known.parts
        self.regions = dict[tuple[Any, ...], Region]()
        self.tubes = dict[tuple[Any, ...], tuple[Region, Tube]]()
        self.falls = dict[tuple[Any, ...], tuple[Tube, Any]]()

    @property
    def bounds(self) -> tuple[Any, ...]:
        """Return what sets depend on besides a level, and the search for a claim changes."""
        return self.late, self.kinetic, *self.commands.items()

    def region(self, c: Fraction) -> Region:
        """Return a region that contains {V <= c}."""
        key = c, *self.bounds
        if key not in self.regions:
            self.regions[key] = super().region(c)
        return self.regions[key]

    def tube(self, region: Region, amiss: list[Fraction] | None = None) -> Tube:
        """Return a set that motions from a region do not leave for a period."""
        if amiss is not None:
            return super().tube(region, amiss)
        key = id(region), *self.bounds
        if key not in self.tubes:
            # With the region, so that no other one gets its identity.
            self.tubes[key] = region, super().tube(region)
        return self.tubes[key][1]

    def fall(self, tube: Tube) -> tuple[Rows, Rows, Rows, Fraction, Fraction, Fraction]:
        """Return how V changes in a period."""
        key = id(tube), *self.bounds
        if key not in self.falls:
            self.falls[key] = tube, super().fall(tube)
        return self.falls[key][1]

    def points(self, claim: Claim) -> Proof:
        """The theorem `points`, in which what was found out about this motion, that of the claim, is not found out again."""
        loop, other = AttitudeLoop(claim, remembers=True), copy(self)
        yield from loop.sound()
        # The claim knows what of it is read.
        demand([p.upper for p in loop.u] == [p.upper for p in self.loop.u], "the motion is that of another loop")
        other.loop, other.plan = loop, self.plan and Plan(loop)
        return (yield from descends(loop, other))

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
        return mixed(*zip(*((share, part.rate(len(rates))) for share, part in self.split), strict=True))

    def by_law(self, rates: list[Poly], shares: list[Fraction]) -> Poly:
        """Return the sum of shares of V' and its derivatives, with the law's torque."""
        return mixed(*zip(*((c * x, part.by_law(k)) for c, part in self.split for k, x in enumerate(shares)), strict=True))


def rewired(loop: AttitudeLoop, numbers: Mapping[str, Any], V: Program | None = None) -> AttitudeLoop:
    """Return a loop with other numbers in its claim, and maybe another V, without wiring it again."""
    other, claim = copy(loop), replace(loop.claim, numbers=Numbers("numbers", {k: Fraction(x) for k, x in numbers.items()}))
    if V is not None:
        claim = replace(claim, programs=Told("programs", claim.programs.content | {"lyapunov": V}))
        vars(other).pop("lyapunov", None)
    other.claim = claim
    return other


def renumbered(motion: Held, numbers: Mapping[str, Any]) -> Held:
    """Return a motion with other numbers in its claim, which do not change the motion."""
    other = copy(motion)
    other.loop = rewired(motion.loop, numbers)
    if motion.plan is not None:
        other.plan = copy(motion.plan)
        other.plan.loop = other.loop
    return other
