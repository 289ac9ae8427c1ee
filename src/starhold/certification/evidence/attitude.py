"""Finds the claims about ultimate bounds and limits of an attitude loop's motions: levels of V, and evidence."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from math import acos, asin, inf, isfinite, pi, sqrt
from typing import Any

import numpy as np

from starhold.certification.evidence.cones import once
from starhold.certification.evidence.finding import obligations
from starhold.certification.evidence.mirrored import different
from starhold.certification.evidence.recorded import RecordedLoop, curvature, sign_words
from starhold.certification.evidence.squares import combined, largest_number, posed, solved, squares
from starhold.kernel.loops import HYSTERESIS, OUTSIDE, SHORTEST, WHEELS
from starhold.kernel.numbers import RefusedError
from starhold.kernel.polynomials import Poly
from starhold.kernel.rules import Obligation, Squares, Vanishes
from starhold.parts.craft import tensor

CONVERGES, EVENLY, STRICTLY = "converges", "converges from both quaternions", "converges strictly"
NEARBY = "converges near the inertia"
SAMPLED, SLIDING = "stays stable between samples", "reaches its surface"
ANY_ANGLE = 7
"""An angle (rad) that no turn exceeds."""
LEANS = 4e-3
"""The share of the law's own V that a cross term takes."""
FASTER = 1.0 + 1e-2
"""The factor between the least bound of a rate and the claimed one."""
BISECTIONS = 6
"""Of a level, between it and four times it."""
NEAR = 1.1
"""Levels of other limits are examined again up to this multiple of the least."""
LEAST_TURN = 1e-12
"""The turn (rad) that a set holds if it is to hold a smaller one: no sum of squares tells those from none."""
GIVEN_AWAY = [Fraction(1, 10**power) for power in (6, 5, 4, 3, 2)]
"""Shares by which a largest level is reduced, because there the matrices are singular."""


@dataclass
class Loop(RecordedLoop):
    """A recorded loop whose claims are sought; `alone`: only the ultimate bound."""

    alone: bool = False

    def show_end(self, turn: float | None = None) -> None:
        """Find the ultimate bound of motions, by the law's own V or by the kinetic energy in its place. turn: the rotation
        that the set within the limits must contain (rad)."""
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
            chosen = signs if theorem == CONVERGES else []
            more: dict[str, Any] = widths if chosen else {}
            if SHORTEST in chosen:
                # Below the V at which the sign changes.
                level = Fraction(self.cap(theorem, chosen, V) * (1.0 - float(GIVEN_AWAY[0])))
                more = {"level": level, **self.contents(self.form(V), level)}
            if self.try_to_show(self.claim(theorem, [*words, *chosen], V, **more), self.scales(V)):
                self.show_limits(theorem, [*words, *chosen], V, widths if chosen else {}, turn)
                more = {name: x for name, x in more.items() if name != "rate"}
                self.show_any_inertia(theorem, [*(w for w in words if w == WHEELS), *chosen], V, more)
                return
        if signs or not self.show_strictly(turn):
            self.show_bounded([*(w for w in self.words if w != OUTSIDE), *signs], widths, turn)

    def show_any_inertia(self, theorem: str, words: list[str], V: str, more: dict[str, Any]) -> None:
        """Find the claim for every inertia, by the law's own V or by the kinetic energy and its stiffness."""
        if self.alone:
            return
        every = f"{theorem} whatever the inertia"
        if self.try_to_show(self.claim(every, words, V, **more), self.scales(V)) or theorem != CONVERGES:
            return
        rest = obligations(self.claim(theorem, words, V, **more), self.by_digest)[0]["only equilibrium 1"]
        assert isinstance(rest, Vanishes)
        energy = self.lyapunov(-float(rest.modulo[0].terms.get(("q1",), 0)))
        self.try_to_show(self.claim(every, words, energy, **more), self.scales(energy))

    def show_strictly(self, turn: float | None = None) -> bool:
        """Find V = w.Jw/2 + 2 s (1 - q0) + epsilon q.Jw that decreases strictly: V' is linear in s and epsilon."""
        words = [w for w in self.words if w != OUTSIDE]
        try:
            base, *stepped = (self.descent_of(words, *pair) for pair in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0)))
        except RefusedError as reason:
            self.failed[STRICTLY] = str(reason)
            return False
        steps = [o.p - base.p for o in stepped]
        others = combined(base, base.p, 18)
        unit = (
            sqrt(float(abs(steps[0].terms[("q1", "w1")]) / tensor(self.loop.craft.inertia).max())) if steps[0].terms else 1.0
        )
        solution = solved(posed(base.p, [-p for p in steps], others, base.z[:18]), {f"w{k}": unit for k in (1, 2, 3)})
        if solution is None:
            self.failed[STRICTLY] = "no V was found"
            return False
        V = self.crossed(*(float(f"{x:.4g}") for x in solution[:2]))
        shown = self.try_to_show(self.claim(STRICTLY, words, V), self.scales(V))
        # The law's own V decreases where the body is not too fast, and has the larger sets within the limits.
        self.show_limits(STRICTLY, words, self.leaning(LEANS), {"fastest": 1}, turn)
        return shown

    def show_bounded(self, words: list[str], widths: dict[str, Any], turn: float | None) -> None:
        """Find a set in which the law's own V decreases, because the rate is bounded there, and a set within limits."""
        form = self.form(self.lyapunov())
        if not (np.linalg.eigvalsh(curvature(form, "w"))[0] > 0.0 > form.terms.get(("q0",), 0)):
            return
        for theorem, V in ((CONVERGES, self.lyapunov()), (STRICTLY, self.leaning(LEANS))):
            level = self.highest_decreasing(theorem, words, V, widths)
            if level is None:
                continue
            numbers = widths | self.slowly(V, level) | self.contents(self.form(V), level)
            if self.try_to_show(self.claim(theorem, words, V, level=level, **numbers), self.scales(V, float(level))):
                self.show_limits(theorem, words, V, widths | {"fastest": 1}, turn)
                return

    def highest_decreasing(self, theorem: str, words: list[str], V: str, widths: dict[str, Any]) -> Fraction | None:
        """Return about the largest level up to which V decreases, also where the quaternion's sign changes."""

        def decreases(level: float) -> bool:
            numbers = widths | self.slowly(V, Fraction(level))
            try:
                wanted, _ = obligations(self.claim(theorem, words, V, level=level, **numbers), self.by_digest)
            except RefusedError as reason:
                self.failed[theorem] = str(reason)
                return False
            needed = [o for name, o in wanted.items() if name.startswith(("V is non-increasing", "a jump lowers"))]
            return all(isinstance(o, Squares) and squares(o, self.scales(V, level)) is not None for o in needed)

        cap = self.cap(theorem, words, V) * (1.0 - float(GIVEN_AWAY[0]) - LEANS**2 * (theorem == STRICTLY))
        if isfinite(cap) and decreases(cap):
            return Fraction(cap)
        tried = [min(cap, self.potential(V) * 4.0**k) for k in range(-5, 16)]
        decreasing = [decreases(tried[0])]
        while decreasing[-1] and len(decreasing) < len(tried):
            decreasing.append(decreases(tried[len(decreasing)]))
        if not decreasing[0]:
            self.failed.setdefault(theorem, "V decreases on no set that was tried")
            return None
        low, high = (tried[-1],) * 2 if decreasing[-1] else tried[len(decreasing) - 2 : len(decreasing)]
        for _ in range(BISECTIONS if high > low else 0):
            middle = sqrt(low * high)
            low, high = (middle, high) if decreases(middle) else (low, middle)
        return Fraction(low)

    def slowly(self, V: str, level: Fraction) -> dict[str, Any]:
        """Return a bound of the rate on a set, with a small margin."""
        slowest = float(np.linalg.eigvalsh(curvature(self.form(V), "w"))[0])
        return {"fastest": sqrt(2.0 * float(level) / slowest) * FASTER}

    def descent_of(self, words: list[str], s: float, epsilon: float) -> Squares:
        """Return the obligation about V'."""
        claim = self.claim(STRICTLY, words, self.crossed(s, epsilon))
        return descent(obligations(claim, self.by_digest)[0])

    def show_limits(self, theorem: str, words: list[str], V: str, more: dict[str, Any], turn: float | None) -> bool:
        """Find the largest level on which everything is within its limits; False where that does not hold the turn."""
        if self.alone:
            return False
        numbers: dict[str, Any] = dict(more) | self.bounds(words) | self.limits
        if WHEELS in words and self.too_little_momentum():
            self.failed[f"{theorem}, limits"] = "nothing at rest on target has so little momentum"
            return False
        if not self.limits:
            return False
        if "fastest" not in numbers and SHORTEST not in words:
            # A law that saturates may keep its limits everywhere.
            claim = self.claim(theorem, words, V, **numbers)
            if "V is non-increasing" not in obligations(claim, self.by_digest)[0]:
                if self.try_to_show(claim, self.scales(V)):
                    return True
                if "limit.norm" in numbers:
                    # Sums of squares with all axes' cases, and every direction, take too long.
                    self.failed[f"{theorem}, limits"] = "the norm of a clipped torque is not examined"
                    return False
        claim = self.claim(theorem, words, V, level=1, **numbers)
        cap = self.cap(theorem, words, V)
        known = self.known
        scaled_by = [float(x) for x in (known.target_rate, known.target_acceleration, known.total_momentum)]
        level = once(json.dumps(["level", claim, cap, *scaled_by]), lambda: self.largest_level(claim, V, cap))
        if level is None:
            self.failed[f"{theorem}, limits"] = "no level was found"
            return False
        form, scales = self.form(V), self.scales(V, float(level))
        # With a unit vector the first of them are too near to singular, and cost the most.
        for share in GIVEN_AWAY[2:] if "limit.norm" in numbers else GIVEN_AWAY:
            lower = Fraction(float(level * (1 - share)))
            contained = self.contents(form, lower)
            if turn is not None and contained["angle"] < turn:
                self.failed[f"{theorem}, limits"] = "the set found does not contain the turn"
                break
            claimed = numbers | contained | ({} if turn is None else {"angle": max(turn, LEAST_TURN)})
            if "fastest" in numbers:
                claimed |= self.slowly(V, lower)
            if self.try_to_show(self.claim(theorem, words, V, level=lower, **claimed), scales):
                return True
        return False

    def cap(self, theorem: str, words: list[str], V: str) -> float:
        """Return a level below V where other rests are, or where the sign of the quaternion changes."""
        return min(self.resting(V)[1:]) if SHORTEST in words else inf

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
            # A limit on a clipped torque may hold at any level.
            limits = [o for o in limits if squares(replace(o, known=o.known[:-1]), self.scales(V)) is None]
        level, limits = cap, different(limits)
        for _ in range(3):
            scales = self.scales(V, level if isfinite(level) else None)
            levels = [highest(o, scales) for o in limits]
            known = [x for x in levels if x is not None and x > 0.0]
            if len(known) < len(levels):
                return None
            level = min(cap, *known) if levels else cap
            # Scales change what is found by little: the others stay higher.
            limits = [o for o, x in zip(limits, known, strict=True) if x < NEAR * level]
        return Fraction(level) if isfinite(level) else None

    def contents(self, form: Poly, level: Fraction) -> dict[str, Any]:
        """Return the largest turn from rest and the largest rate on target that a set of this level holds, and up to which
        rate it holds every attitude, all a little less."""
        P, N = (curvature(form, x) for x in "wq")
        less, s = 1.0 - 1e-7, -float(form.terms.get(("q0",), 0))
        top = 2.0 * s if s > 0.0 else 0.5 * float(np.linalg.eigvalsh(N)[-1])
        half = acos(max(1.0 - float(level) / s, -1.0)) if s > 0.0 else asin(min(sqrt(float(level) / top), 1.0))
        angle = 2.0 * half
        rate = sqrt(2.0 * float(level) / float(np.linalg.eigvalsh(P)[-1]))
        if not float(level) > top:
            return {"angle": angle * less, "rate": rate * less}
        # Above V at the other rest every turn is in the set. A mixed term is at most 2 lean sqrt(s T), T being the energy.
        lean = 0.5 * LEANS * any({"q", "w"} == {name[0] for name in m} for m in form.terms)
        energy = (sqrt(lean * lean * s + float(level) - top) - lean * sqrt(s)) ** 2
        fastest = sqrt(2.0 * energy / float(np.linalg.eigvalsh(P)[-1])) * less
        return {"angle": 2.0 * pi, "rate": rate * less, "start.angle": ANY_ANGLE, "start.rate": fastest}


def descent(wanted: Mapping[str, Obligation]) -> Squares:
    """Return the obligation about V'. RefusedError for a law that has cases."""
    obligation = wanted.get("V is non-increasing")
    if not isinstance(obligation, Squares):
        raise RefusedError("the law switches")
    return obligation


def highest(o: Squares, scales: Mapping[str, float]) -> float | None:
    """Return the largest level of V for which an obligation about a limit holds: p >= 0 on {V <= level} where V - level is
    a multiple of -p and sums of squares. It was made for the level 1."""
    *bounds, inside = o.known
    V, p = 1 - inside, o.p
    return largest_number(posed(V, [-p, *bounds], combined(o, p, len(o.z)), o.z), scales, Poly({(): Fraction(1)}))
