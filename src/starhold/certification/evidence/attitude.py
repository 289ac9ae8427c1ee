"""Claims about an attitude loop for the kernel: its programs as they fly, its numbers exactly, levels and evidence."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from math import asin, cos, inf, isfinite, pi, sqrt
from typing import Any

import numpy as np

from starhold.algebra.quaternion import derivative
from starhold.certification.evidence.finding import NotFoundError, complete, obligations
from starhold.certification.evidence.squares import cofactors, largest_number, posed, settled
from starhold.certification.subject import Subject, above, make_subject
from starhold.kernel.loops import MOVING, OUTSIDE, WHEELS
from starhold.kernel.numbers import RefusedError
from starhold.kernel.polynomials import Poly
from starhold.kernel.programs import digest
from starhold.kernel.rules import Squares
from starhold.kernel.theorems.attitude import HYSTERESIS, SHORTEST
from starhold.laws.interface import Measurement
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.bodies import rigid_body
from starhold.parts.craft import tensor
from starhold.trace.straight_line import labelled, straight_line

V3, Q4 = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)
FULL = (V3, V3, V3)
ASKED = Measurement(Q4, V3, V3, V3, V3, V3, V3, 0.0, V3, V3)
"""A measurement of which every number is an input."""
GIVEN_AWAY = Fraction(1, 10**6)
"""The share of a largest level that is given away, for at the largest the matrices are singular."""


@dataclass
class Loop:
    """The programs and numbers of a closed loop, and the claims that were found."""

    loop: ClosedLoop
    disturbance: float = 0.0
    programs: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])
    claims: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])
    failed: dict[str, str] = field(default_factory=dict[str, str])

    @cached_property
    def known(self) -> Subject:
        """The bounds of what acts on the loop from outside."""
        return make_subject(self.loop, self.disturbance)

    @cached_property
    def roles(self) -> dict[str, str]:
        """The digests of the programs that every claim is about."""
        loop, law = self.loop, self.loop.law
        memory = law.remember(loop.gains, loop.known, loop.period)
        plant = loop.craft._replace(inertia=FULL, inverse_inertia=FULL)
        return {
            "law": self.add(lambda m, g, c: law.command(m, g, c, memory)[0], measurement=ASKED, gains=loop.gains, craft=loop.known),
            "body": self.add(rigid_body.angular_acceleration, rate=V3, torque=V3, craft=plant),
            "turning": self.add(derivative, q=Q4, rate=V3),
        }

    def add(self, equation: Callable[..., Any], **given: Any) -> str:
        """Record a program, and return its digest."""
        program = straight_line(equation, **given)
        self.programs.append(program)
        return digest(program)

    def lyapunov(self, stiffness: float | None = None) -> str:
        """Record V: the law's own, or the kinetic energy and 2 stiffness (1 - q0)."""
        loop = self.loop
        plant = loop.craft._replace(inertia=FULL, inverse_inertia=FULL)
        if stiffness is None:
            return self.add(loop.law.lyapunov, measurement=ASKED, gains=loop.gains, craft=plant)  # pyright: ignore

        def energy(measurement: Measurement, craft: Any) -> Any:
            return rigid_body.kinetic_energy(measurement.rate, craft) + 2.0 * stiffness * (1.0 - measurement.attitude[0])

        return self.add(energy, measurement=ASKED, craft=plant)

    @cached_property
    def subject(self) -> dict[str, str]:
        """The exact numbers that programs and the body may ask for."""
        loop, J = self.loop, tensor(self.loop.craft.inertia).tolist()
        named = [*labelled("gains", loop.gains), *labelled("craft", loop.known), ("measurement.period", float(loop.period))]
        found = {name: x.hex() for name, x in named if isfinite(x)}
        found |= {f"body.inertia.{i}.{k}": float(J[i][k]).hex() for i in range(3) for k in range(i, 3)}
        if loop.wheels is not None:
            for k, (axis, p) in enumerate(zip(loop.wheels.axes, loop.rotors, strict=True)):
                found |= {f"wheel.{k}.axis.{i}": float(x).hex() for i, x in enumerate(axis)}
                found[f"wheel.{k}.momentum"] = float(p).hex()
        return found

    @property
    def words(self) -> list[str]:
        """What the loop is taken with, as far as it has it."""
        loop, known = self.loop, self.known
        found = [OUTSIDE] if any(known.modelled) else []
        found += [MOVING] if known.moving else []
        return found + ([WHEELS] if loop.wheels is not None else [])

    def claim(self, theorem: str, taken: list[str], V: str | None, **numbers: Any) -> dict[str, Any]:
        """Return a claim without evidence."""
        roles = self.roles | ({} if V is None else {"lyapunov": V})
        exact = {name.replace("__", "."): str(Fraction(x)) for name, x in numbers.items()}
        return {"theorem": theorem, "taken": taken, "programs": roles, "subject": self.subject, "numbers": exact, "evidence": {}}

    @property
    def by_digest(self) -> dict[str, Any]:
        """The programs by their digests."""
        return {digest(program): program for program in self.programs}

    def scales(self, V: str | None, level: float | None = None) -> dict[str, float]:
        """Return about how large variables become."""
        known, J = self.known, tensor(self.loop.craft.inertia)
        found = {"q1": 1.0}
        energy = level or self.potential(V)
        mass = self.kinetic(V)
        found |= {f"w{k}": sqrt(2.0 * energy / mass[k - 1]) for k in (1, 2, 3)}
        found |= {f"r{k}": float(known.target_rate) or 1.0 for k in (1, 2, 3)}
        found |= {f"a{k}": float(known.target_acceleration) or 1.0 for k in (1, 2, 3)}
        found |= {f"h{k}": float(known.total_momentum) or float(J.max()) * found["w1"] for k in (1, 2, 3)}
        return found

    def form(self, V: str | None) -> Poly:
        """Return V as a polynomial."""
        if V is None:
            return Poly({})
        from starhold.certification.evidence.finding import read
        from starhold.kernel.loops import AttitudeLoop

        return AttitudeLoop(read(self.claim("converges", [], V), self.by_digest)).lyapunov

    def potential(self, V: str | None) -> float:
        """Return the largest of V at rest."""
        p = self.form(V).at({"w1": 0, "w2": 0, "w3": 0})
        values = [float(p.at(dict(zip(("q0", "q1", "q2", "q3"), q, strict=True))).number) for q in TURNS]
        return max([abs(v) for v in values] + [1e-300]) if V is not None else 1.0

    def kinetic(self, V: str | None) -> list[float]:
        """Return twice the coefficients of the squares of the rates in V."""
        p = self.form(V)
        return [2.0 * float(p.terms.get((f"w{k}", f"w{k}"), 0.5)) for k in (1, 2, 3)]

    def try_to_show(self, claim: dict[str, Any], scales: Mapping[str, float]) -> bool:
        """Add a claim if evidence for it is found."""
        try:
            self.claims.append(complete(claim, self.by_digest, scales))
        except NotFoundError as reason:
            self.failed[claim["theorem"]] = str(reason)
            return False
        return True


TURNS = [(-1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)]


def sign_words(loop: ClosedLoop) -> list[str]:
    """Return how the quaternion's sign is chosen, in the kernel's words."""
    return {"shortest": [SHORTEST], "hysteresis": [HYSTERESIS]}.get(loop.sign_policy, [])
