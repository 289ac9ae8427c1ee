"""Claims about an attitude loop for the kernel: its programs as they fly, its numbers exactly, levels and evidence."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from math import acos, asin, inf, isfinite, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.quaternion import derivative, vector_part
from starhold.algebra.vector import apply, dot
from starhold.certification.evidence.finding import NotFoundError, complete, obligations, read
from starhold.certification.evidence.squares import cofactors, largest_number, posed, solved, squares
from starhold.certification.subject import Subject, above
from starhold.kernel.loops import HYSTERESIS, MOVING, OUTSIDE, SHORTEST, WHEELS, AttitudeLoop
from starhold.kernel.numbers import RefusedError
from starhold.kernel.polynomials import Poly
from starhold.kernel.programs import Program, digest
from starhold.kernel.rules import Obligation, Solves, Squares
from starhold.laws import program
from starhold.laws.interface import Measurement
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.bodies import rigid_body
from starhold.parts.craft import tensor
from starhold.parts.effectors.wheels import BAND
from starhold.trace.straight_line import labelled, straight_line

V3, Q4 = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)
FULL = (V3, V3, V3)
NOWHERE: dict[str, int] = dict.fromkeys(("q0", "q1", "q2", "q3", "w1", "w2", "w3"), 0)
ASKED = program.ASKED["rigid-body"]
TURNS = [(-1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)]
"""The other quaternion of the target, and half turns."""
CONVERGES, EVENLY, STRICTLY = "converges", "converges from both quaternions", "converges strictly"
NEARBY = "converges near the inertia"
SAMPLED, SLIDING = "stays stable between samples", "reaches its surface"
WRITTEN: dict[str, float | None] = {"stiffness": None, "epsilon": 0.0, "rho": 0.0, "rate_bound": None}
"""The numbers of a V that is the law's own."""
ANY_ANGLE = 7
"""An angle (rad) that no turn exceeds."""
LEANS = 4e-3
"""The share of the law's own V that a mixed term takes."""
FASTER = 1.0 + 1e-2
"""How much faster than the least bound a rate is told to be at most."""
BISECTIONS = 6
"""Of a level, between it and four times it."""
NEAR = 1.1
"""How many times the least level those of other limits may be, to be looked at again."""
GIVEN_AWAY = [Fraction(1, 10**power) for power in (6, 5, 4, 3, 2)]
"""Shares of a largest level that are given away, for at the largest the matrices are singular."""


@dataclass
class Loop:
    """The programs and numbers of a closed loop, and the claims that were found."""

    known: Subject
    programs: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])
    claims: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])
    failed: dict[str, str] = field(default_factory=dict[str, str])

    written_by: dict[str, dict[str, float | None]] = field(default_factory=dict[str, dict[str, float | None]])
    """The numbers that a V which is not the law's own is made of, by its digest."""
    forms: dict[str, Poly] = field(default_factory=dict[str, Poly])
    """The polynomials V, by their digests."""
    eigenvalues: list[list[float]] = field(default_factory=list[list[float]])
    """Those of a step near rest, in floats."""
    pushed_at: list[float] | None = None
    """Where on the orbit (m) the gravity gradient pushes the motion off the law's surface."""

    @property
    def loop(self) -> ClosedLoop:
        """The loop that the claims are about."""
        return self.known.loop

    @cached_property
    def roles(self) -> dict[str, str]:
        """The digests of the programs that every claim is about."""
        loop = self.loop
        plant = loop.craft._replace(inertia=FULL, inverse_inertia=FULL)
        return {
            "law": self.keep(program.law_program(loop.law, loop.gains, loop.known, loop.period)),
            "body": self.add(rigid_body.angular_acceleration, rate=V3, torque=V3, craft=plant),
            "turning": self.add(derivative, q=Q4, rate=V3),
        }

    def add(self, equation: Callable[..., Any], **given: Any) -> str:
        """Record a program, and return its digest."""
        return self.keep(straight_line(equation, **given))

    def keep(self, program: dict[str, Any]) -> str:
        """Take a program, and return its digest."""
        self.programs.append(program)
        return digest(program)

    def lyapunov(self, stiffness: float | None = None) -> str:
        """Record V: the law's own, or the kinetic energy and 2 stiffness (1 - q0)."""
        loop = self.loop
        plant = loop.craft._replace(inertia=FULL, inverse_inertia=FULL)
        if stiffness is None:
            own = self.add(loop.law.lyapunov, measurement=ASKED, gains=loop.gains, craft=plant)  # pyright: ignore
            self.written_by[own] = WRITTEN
            return own

        def energy(measurement: Measurement, craft: Any) -> Any:
            return rigid_body.kinetic_energy(measurement.rate, craft) + 2.0 * stiffness * (1.0 - measurement.attitude[0])

        found = self.add(energy, measurement=ASKED, craft=plant)
        self.written_by[found] = WRITTEN | {"stiffness": stiffness}
        return found

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
        """Name what the loop is taken with, as far as it has it."""
        loop, known = self.loop, self.known
        found = [OUTSIDE] if any(known.modelled) else []
        found += [MOVING] if known.moving else []
        return found + ([WHEELS] if loop.wheels is not None else [])

    def claim(self, theorem: str, taken: list[str], V: str | None, **numbers: Any) -> dict[str, Any]:
        """Return a claim without evidence."""
        roles = self.roles | ({} if V is None else {"lyapunov": V})
        exact = {name: str(Fraction(x)) for name, x in numbers.items()}
        return {
            "theorem": theorem,
            "taken": taken,
            "programs": roles,
            "subject": self.subject,
            "numbers": exact,
            "evidence": {},
        }

    @property
    def by_digest(self) -> dict[str, Any]:
        """The programs by their digests."""
        return {digest(program): program for program in self.programs}

    def scales(self, V: str | None, level: float | None = None) -> dict[str, float]:
        """Return about how large variables become on {V <= level}."""
        known, J, top = self.known, tensor(self.loop.craft.inertia), self.potential(V)
        energy = min(level or top, top)
        found = {f"q{k}": sqrt(energy / top) for k in (1, 2, 3)}
        found |= {f"w{k}": sqrt(2.0 * energy / self.kinetic(V)[k - 1]) for k in (1, 2, 3)}
        found |= {f"r{k}": float(known.target_rate) or 1.0 for k in (1, 2, 3)}
        found |= {f"a{k}": float(known.target_acceleration) or 1.0 for k in (1, 2, 3)}
        return found | {f"h{k}": float(known.total_momentum) or float(J.max()) * found["w1"] for k in (1, 2, 3)}

    def form(self, V: str | None) -> Poly:
        """Return V as a polynomial."""
        if V is None:
            return Poly({})
        if V not in self.forms:
            self.forms[V] = AttitudeLoop(read(self.claim("converges", [], V), self.by_digest)).lyapunov
        return self.forms[V]

    def potential(self, V: str | None) -> float:
        """Return the largest of V at rest."""
        p = self.form(V).at({"w1": 0, "w2": 0, "w3": 0})
        values = [float(p.at(dict(zip(("q0", "q1", "q2", "q3"), q, strict=True))).number) for q in TURNS]
        return max(*map(abs, values), 1e-300) if V is not None else 1.0

    def kinetic(self, V: str | None) -> list[float]:
        """Return twice the sizes of the coefficients of the squares of the rates in V."""
        p = self.form(V)
        return [2.0 * abs(float(p.terms.get((f"w{k}", f"w{k}"), 0.5))) for k in (1, 2, 3)]

    def try_to_show(self, claim: dict[str, Any], scales: Mapping[str, float]) -> bool:
        """Add a claim if evidence for it is found."""
        try:
            self.claims.append(complete(claim, self.by_digest, scales))
        except NotFoundError as reason:
            self.failed[claim["theorem"]] = str(reason)
            return False
        self.failed.pop(claim["theorem"], None)
        return True

    def show_end(self, turn: float | None = None) -> None:
        """Find where motions end, by the law's own V or by the kinetic energy in its place. turn: what the set within the
        limits is to hold (rad)."""
        V, signs = self.lyapunov(), sign_words(self.loop)
        try:
            self.form(V)
        except RefusedError as reason:
            self.failed[CONVERGES] = str(reason)
            return
        widths = {"hysteresis": self.loop.hysteresis_width} if HYSTERESIS in signs else {}
        ways = [
            (theorem, words)
            for theorem in (CONVERGES, EVENLY)
            for words in (self.words, [w for w in self.words if w != OUTSIDE])
        ]
        for theorem, words in ways:
            own = signs if theorem == CONVERGES else []
            more: dict[str, Any] = widths if own else {}
            if SHORTEST in own:
                # Below V where the sign changes.
                level = Fraction(self.cap(theorem, own, V) * (1.0 - float(GIVEN_AWAY[0])))
                more = {"level": level, **self.contents(self.form(V), level)}
            if self.try_to_show(self.claim(theorem, [*words, *own], V, **more), self.scales(V)):
                self.show_limits(theorem, [*words, *own], V, widths if own else {}, turn)
                more = {name: x for name, x in more.items() if name != "rate"}
                self.show_any_inertia(theorem, [*(w for w in words if w == WHEELS), *own], V, more)
                return
        if signs:
            self.show_bounded([*(w for w in self.words if w != OUTSIDE), *signs], widths, turn)
        else:
            self.show_strictly(turn)

    def show_any_inertia(self, theorem: str, words: list[str], V: str, more: dict[str, Any]) -> None:
        """Find the claim for every inertia, by the law's own V or by the kinetic energy and its stiffness."""
        every = f"{theorem} whatever the inertia"
        if self.try_to_show(self.claim(every, words, V, **more), self.scales(V)) or theorem != CONVERGES:
            return
        rest = obligations(self.claim(theorem, words, V, **more), self.by_digest)[0]["only equilibrium"]
        assert isinstance(rest, Solves)
        energy = self.lyapunov(-float(rest.given[0].terms.get(("q1",), 0)))
        self.try_to_show(self.claim(every, words, energy, **more), self.scales(energy))

    def show_strictly(self, turn: float | None = None) -> None:
        """Find V = w.Jw/2 + 2 s (1 - q0) + epsilon q.Jw that falls strictly: V' is linear in s and epsilon."""
        words = [w for w in self.words if w != OUTSIDE]
        try:
            base, *own = (self.falling(words, *pair) for pair in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0)))
        except RefusedError as reason:
            self.failed[STRICTLY] = str(reason)
            return
        steps = [o.p - base.p for o in own]
        others = [c * r for r, parts in zip(base.modulo, cofactors(base, base.p, 18), strict=True) for c in parts]
        unit = (
            sqrt(float(abs(steps[0].terms[("q1", "w1")]) / tensor(self.loop.craft.inertia).max())) if steps[0].terms else 1.0
        )
        found = solved(posed(base.p, [-p for p in steps], others, base.z[:18]), {f"w{k}": unit for k in (1, 2, 3)})
        if found is None:
            self.failed[STRICTLY] = "no V was found"
            return
        V = self.crossed(*(float(f"{x:.4g}") for x in found[:2]))
        self.try_to_show(self.claim(STRICTLY, words, V), self.scales(V))
        # The law's own V falls where the body is not too fast, and has the larger sets within the limits.
        self.show_limits(STRICTLY, words, self.leaning(LEANS), {"fastest": 1}, turn)

    def show_bounded(self, words: list[str], widths: dict[str, Any], turn: float | None) -> None:
        """Find a set in which the law's own V falls, for the rate is bounded there, and a set within limits."""
        for theorem, V in ((CONVERGES, self.lyapunov()), (STRICTLY, self.leaning(LEANS))):
            level = self.highest_falling(theorem, words, V, widths)
            if level is None:
                continue
            told = widths | self.slowly(V, level) | self.contents(self.form(V), level)
            if self.try_to_show(self.claim(theorem, words, V, level=level, **told), self.scales(V, float(level))):
                self.show_limits(theorem, words, V, widths | {"fastest": 1}, turn)
                return

    def highest_falling(self, theorem: str, words: list[str], V: str, widths: dict[str, Any]) -> Fraction | None:
        """Return about the largest level up to which V falls, where the quaternion's sign changes too."""

        def falls(level: float) -> bool:
            told = widths | self.slowly(V, Fraction(level))
            try:
                wanted, _ = obligations(self.claim(theorem, words, V, level=level, **told), self.by_digest)
            except RefusedError as reason:
                self.failed[theorem] = str(reason)
                return False
            needed = [o for name, o in wanted.items() if name.startswith(("V is non-increasing", "a jump lowers"))]
            return all(isinstance(o, Squares) and squares(o, self.scales(V, level)) is not None for o in needed)

        cap = self.cap(theorem, words, V) * (1.0 - float(GIVEN_AWAY[0]) - LEANS**2 * (theorem == STRICTLY))
        if isfinite(cap) and falls(cap):
            return Fraction(cap)
        tried = [min(cap, self.potential(V) * 4.0**k) for k in range(-5, 16)]
        held = [falls(tried[0])]
        while held[-1] and len(held) < len(tried):
            held.append(falls(tried[len(held)]))
        if not held[0]:
            self.failed.setdefault(theorem, "V falls on no set that was tried")
            return None
        low, high = (tried[-1],) * 2 if held[-1] else tried[len(held) - 2 : len(held)]
        for _ in range(BISECTIONS if high > low else 0):
            middle = sqrt(low * high)
            low, high = (middle, high) if falls(middle) else (low, middle)
        return Fraction(low)

    def slowly(self, V: str, level: Fraction) -> dict[str, Any]:
        """Return the rate that is not exceeded on a set, a little more."""
        slowest = float(np.linalg.eigvalsh(curvature(self.form(V), "w"))[0])
        return {"fastest": sqrt(2.0 * float(level) / slowest) * FASTER}

    def falling(self, words: list[str], s: float, epsilon: float) -> Squares:
        """Return what has to be shown of V'."""
        claim = self.claim(STRICTLY, words, self.crossed(s, epsilon))
        return fall(obligations(claim, self.by_digest)[0])

    def crossed(self, s: float, epsilon: float) -> str:
        """Record V = w.Jw/2 + 2 s (1 - q0) + epsilon q.Jw."""

        def energy(measurement: Measurement, craft: Any) -> Any:
            lean = dot(vector_part(measurement.attitude), apply(craft.inertia, measurement.rate))
            return (
                rigid_body.kinetic_energy(measurement.rate, craft)
                + 2.0 * s * (1.0 - measurement.attitude[0])
                + epsilon * lean
            )

        found = self.add(energy, measurement=ASKED, craft=self.loop.craft._replace(inertia=FULL, inverse_inertia=FULL))
        self.written_by[found] = WRITTEN | {"stiffness": s, "epsilon": epsilon}
        return found

    def leaning(self, share: float) -> str:
        """Record the law's own V and epsilon q.Jw, at most this share of it."""
        loop, own = self.loop, self.form(self.lyapunov())
        scaled: Any = np.linalg.solve(np.linalg.cholesky(curvature(own, "w")), tensor(loop.craft.inertia))
        most = float(np.linalg.norm(scaled, 2))
        epsilon = float(f"{share * sqrt(-float(own.terms.get(('q0',), 0)) / 2.0) / most:.3g}")

        def energy(measurement: Measurement, gains: Any, craft: Any) -> Any:
            lean = dot(vector_part(measurement.attitude), apply(craft.inertia, measurement.rate))
            return loop.law.lyapunov(measurement, gains, craft) + epsilon * lean  # pyright: ignore

        plant = loop.craft._replace(inertia=FULL, inverse_inertia=FULL)
        found = self.add(energy, measurement=ASKED, gains=loop.gains, craft=plant)
        self.written_by[found] = WRITTEN | {"epsilon": epsilon}
        return found

    def show_limits(self, theorem: str, words: list[str], V: str, more: dict[str, Any], turn: float | None) -> bool:
        """Find the largest level on which everything is within its limits; False where that does not hold the turn."""
        numbers: dict[str, Any] = dict(more) | self.bounds(words) | self.limits
        if WHEELS in words and self.too_little_momentum():
            self.failed[f"{theorem}, limits"] = "nothing at rest on target has so little momentum"
            return False
        if not self.limits:
            return False
        if "fastest" not in numbers and SHORTEST not in words:
            # A law that clips may keep its limits everywhere.
            claim = self.claim(theorem, words, V, **numbers)
            if "V is non-increasing" not in obligations(claim, self.by_digest)[0]:
                if self.try_to_show(claim, self.scales(V)):
                    return True
                if "limit.norm" in numbers:
                    # Sums of squares with all axes' cases, and every direction, take too long.
                    self.failed[f"{theorem}, limits"] = "the norm of a clipped torque is not looked at"
                    return False
        claim = self.claim(theorem, words, V, level=1, **numbers)
        cap = self.cap(theorem, words, V)
        level = self.largest_level(claim, V, cap)
        if level is None:
            self.failed[f"{theorem}, limits"] = "no level was found"
            return False
        form, scales = self.form(V), self.scales(V, float(level))
        for share in GIVEN_AWAY:
            lower = Fraction(float(level * (1 - share)))
            held = self.contents(form, lower)
            if turn is not None and held["angle"] < turn:
                self.failed[f"{theorem}, limits"] = "the set that was found does not hold the turn"
                break
            told = numbers | held | ({} if turn is None else {"angle": turn})
            if "fastest" in numbers:
                told |= self.slowly(V, lower)
            if self.try_to_show(self.claim(theorem, words, V, level=lower, **told), scales):
                return True
        return False

    def bounds(self, words: list[str]) -> dict[str, Any]:
        """Return the numbers that bound what the loop is taken with."""
        known, found = self.known, dict[str, Any]()
        if OUTSIDE in words:
            found |= {f"outside.{k}": above(x) for k, x in enumerate(known.modelled)}
        if MOVING in words:
            found |= {"target.rate": above(known.target_rate), "target.acceleration": above(known.target_acceleration)}
        return found | ({"momentum": float(known.total_momentum)} if WHEELS in words else {})

    @property
    def limits(self) -> dict[str, Any]:
        """Return the limits of the torque, or those of the wheels; nothing where there are none."""
        loop, wheels = self.loop, self.loop.wheels
        limit = loop.craft.torque_limit if loop.limit != "none" else inf
        shared = dict[str, Any]()
        if wheels is not None and wheels.allocation == 0:
            shared = {f"motors.{k}": x for k, x in enumerate(wheels.torque_limit) if isfinite(x)}
            shared |= {f"stored.{k}": x * (1.0 - BAND) for k, x in enumerate(wheels.momentum_limit) if isfinite(x)}
        if shared:
            return shared
        return {"limit" if loop.limit == "axis" else "limit.norm": limit} if isfinite(limit) else {}

    def is_told(self, name: str) -> bool:
        """Tell whether the law's program asks for an input."""
        return name + ".0" in Program.read(self.by_digest[self.roles["law"]]).inputs

    def too_little_momentum(self) -> bool:
        """Tell whether a body at rest on a target that turns has more momentum than is told."""
        loop, known = self.loop, self.known
        stored = np.array(loop.rotors) @ np.array(loop.wheels.axes) if loop.wheels is not None else np.zeros(3)
        least = float(np.linalg.eigvalsh(tensor(loop.craft.inertia))[0]) * (1.0 - 1e-12)
        return float(known.total_momentum) + float(np.linalg.norm(stored)) < least * float(known.target_rate)

    def cap(self, theorem: str, words: list[str], V: str) -> float:
        """Return a level below V where other rests are, or where the sign of the quaternion changes."""
        p = self.form(V).at({"w1": 0, "w2": 0, "w3": 0})
        values = [float(p.at(dict(zip(("q0", "q1", "q2", "q3"), q, strict=True))).number) for q in TURNS]
        return min(values[1:]) if theorem == EVENLY or SHORTEST in words else inf

    def largest_level(self, claim: dict[str, Any], V: str, cap: float) -> Fraction | None:
        """Return the largest level that keeps all limits of a claim, and stays below the cap."""
        try:
            wanted, _ = obligations(claim, self.by_digest)
        except RefusedError:
            return None
        limits = [
            o
            for name, o in wanted.items()
            # What a lost wheel keeps is a number, at any level.
            if isinstance(o, Squares) and o.p.names and name.startswith(("torque", "norm", "motor", "wheel"))
        ]
        if "V is non-increasing" not in wanted:
            # What is clipped may hold at any level.
            limits = [o for o in limits if squares(replace(o, known=o.known[:-1]), self.scales(V)) is None]
        level = cap
        for _ in range(3):
            scales = self.scales(V, level if isfinite(level) else None)
            found = [highest(o, scales) for o in limits]
            known = [x for x in found if x is not None and x > 0.0]
            if len(known) < len(found):
                return None
            level = min(cap, *known) if found else cap
            # Scales change what is found by little: the others stay higher.
            limits = [o for o, x in zip(limits, known, strict=True) if x < NEAR * level]
        return Fraction(level) if isfinite(level) else None

    def contents(self, form: Poly, level: Fraction) -> dict[str, Any]:
        """Return the largest turn from rest and the largest rate on target that a set of this level holds, and up to which
        rate it holds every attitude, all a little less."""
        P, N = (curvature(form, x) for x in "wq")
        less, s = 1.0 - 1e-7, -float(form.terms.get(("q0",), 0))
        if s > 0.0:
            angle = 2.0 * acos(max(1.0 - float(level) / s, -1.0))
        else:
            angle = 2.0 * asin(min(sqrt(2.0 * float(level) / float(np.linalg.eigvalsh(N)[-1])), 1.0))
        rate = sqrt(2.0 * float(level) / float(np.linalg.eigvalsh(P)[-1]))
        if not float(level) > 2.0 * s > 0.0:
            return {"angle": angle * less, "rate": rate * less}
        # Above V at the other rest every turn is in the set. A mixed term is at most 2 lean sqrt(s T), T being the energy.
        lean = 0.5 * LEANS * any({"q", "w"} == {name[0] for name in m} for m in form.terms)
        energy = (sqrt(lean * lean * s + float(level) - 2.0 * s) - lean * sqrt(s)) ** 2
        fastest = sqrt(2.0 * energy / float(np.linalg.eigvalsh(P)[-1])) * less
        return {"angle": angle, "rate": rate * less, "start.angle": ANY_ANGLE, "start.rate": fastest}


def fall(wanted: Mapping[str, Obligation]) -> Squares:
    """Return what has to be shown of V'. RefusedError for a law that has cases."""
    found = wanted.get("V is non-increasing")
    if not isinstance(found, Squares):
        raise RefusedError("the law switches")
    return found


def curvature(form: Poly, x: str) -> NDArray[np.float64]:
    """Return the second derivative of V by the rate (w) or the attitude (q) where both vanish."""
    slopes = [[form.slope(f"{x}{i}").slope(f"{x}{k}").at(NOWHERE).number for k in (1, 2, 3)] for i in (1, 2, 3)]
    return np.array(slopes, dtype=np.float64)


def highest(o: Squares, scales: Mapping[str, float]) -> float | None:
    """Return the largest level of V for which an obligation about a limit holds: p >= 0 on {V <= level} where V - level is
    a multiple of -p and sums of squares. It was made for the level 1."""
    *bounds, inside = o.known
    V, p = 1 - inside, o.p
    others = [c * relation for relation, parts in zip(o.modulo, cofactors(o, p, len(o.z)), strict=True) for c in parts]
    return largest_number(posed(V, [-p, *bounds], others, o.z), scales, Poly({(): Fraction(1)}))


def sign_words(loop: ClosedLoop) -> list[str]:
    """Return how the quaternion's sign is chosen, in the kernel's words."""
    return {"shortest": [SHORTEST], "hysteresis": [HYSTERESIS]}.get(loop.sign_policy, [])
