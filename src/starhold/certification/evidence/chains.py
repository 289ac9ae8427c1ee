"""Levels of V down which motions come, and the ellipsoids of their end, from a start on."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from fractions import Fraction
from importlib import import_module
from math import inf
from typing import Any, TypeAlias

import numpy as np

from starhold.certification.evidence.ellipsoids import HEED, MORE, ends, highest_ratio, smallest
from starhold.certification.evidence.finding import concluded
from starhold.certification.evidence.lates import of_late
from starhold.certification.evidence.responses import find_response
from starhold.certification.evidence.shapes import Shape
from starhold.certification.evidence.squares import rounded
from starhold.certification.matrices import floats
from starhold.kernel.held import Held
from starhold.kernel.numbers import RefusedError, plus, times, transpose
from starhold.kernel.regions import STATE, Tube, balls
from starhold.kernel.theorems.pointing import ROUNDS, forgotten, on_level, periods, spread, waited
from starhold.kernel.theorems.response import first_of, responds

linalg: Any = import_module("scipy.linalg")

FLOOR, DIGITS, DEEPEST, LEVELS, ELLIPSOIDS = 1.03, 7, 8.0, 20, 24
"""The margin of the last level above its limit, so that motions enter it in finite time; the digits of ellipsoids' numbers;
the largest ratio of successive levels; the most levels and ellipsoids."""

Lower: TypeAlias = tuple[Fraction, Fraction, Fraction]


@dataclass
class Chain:
    """Levels from a set down to where disturbances outweigh the damping, and ellipsoids from there on."""

    motion: Held
    V: str
    level: float
    tried: dict[Any, Lower | None] = field(default_factory=dict[Any, "Lower | None"])
    """The results of `lower`, for all chains of one V."""
    shape: Shape = field(default_factory=lambda: Shape(0.0))
    levels: list[dict[str, str]] = field(default_factory=list[dict[str, str]])
    ellipsoids: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])
    response: dict[str, Any] = field(default_factory=dict[str, Any])
    samples: int = 0

    @property
    def scales(self) -> dict[str, float]:
        """Return the sizes of the state in the set, and of all external inputs."""
        motion = self.motion
        sizes = motion.region(Fraction(self.level)).sizes
        return {name: float(sizes[name]) or 1.0 for name in (*STATE, *motion.others)}

    def aim(self) -> float:
        """Return the level that disturbances allow where all motions are nearly linear."""
        lower = self.lower((self.motion.s + self.motion.G[3][3]) / 2**20)
        return inf if lower is None else float(lower[2])

    def decreases(self) -> bool:
        """Return whether V decreases on the whole set, down to a lower level."""
        lower = self.lower(Fraction(self.level))
        return lower is not None and lower[2] < Fraction(self.level)

    def of_level(self) -> dict[str, Any]:
        """Return the claim's numbers that follow from its level."""
        late = of_late(self.motion.late)
        if self.motion.plan is None:
            return {"level": self.level} | late
        region = self.motion.region(Fraction(self.level))
        off = self.motion.planned((self.motion.tube(region).region if self.motion.grows else region).sizes)
        return {"level": self.level} | late | {"plan.error": float(off) * MORE}

    def descend(self) -> float:
        """Find the levels, and return the last."""
        c, tube = Fraction(self.level), None
        while len(self.levels) < LEVELS and (lower := self.lower(c)) is not None:
            tau, beta, floor = lower
            end = Fraction(max(float(floor) * FLOOR, float(c) / DEEPEST))
            if end > c * Fraction(9, 10):
                break
            self.levels.append({"end": str(end), "tau": str(tau), "beta": str(beta)})
            tube, more = on_level(self.motion, end, tube or self.motion.tube(self.motion.region(c)))
            self.samples += periods(self.motion.h * beta, floor, c, end) + more
            c = end
        return float(c)

    def lower(self, c: Fraction) -> Lower | None:
        """Return tau and beta for the lowest level proved to be reached from another, and that level."""
        key = c, self.motion.late
        if key not in self.tried:
            self.tried[key] = self.lowest(c)
        return self.tried[key]

    def lowest(self, c: Fraction) -> Lower | None:
        """Find what `lower` returns."""
        motion = self.motion
        try:
            exact, above, felt, push, rest, spare = motion.fall(on_level(motion, c)[0])
        except RefusedError:
            return None
        Q, H, F = floats(exact), floats(above), floats(felt)
        if float(np.linalg.eigvalsh(Q)[0]) <= 0.0:
            return None
        R = F.T @ F
        largest = 1.0 / float(linalg.eigh(R, Q, eigvals_only=True)[-1])

        def floor(share: float) -> tuple[float, float, float]:
            tau = largest * share
            beta = float(linalg.eigh(Q - tau * R, H, eigvals_only=True)[0]) * (1.0 - 1e-6)
            beta = min(beta, float(spare) * (1.0 - 1e-6) / float(motion.h))
            return ((float(push) ** 2 / (4.0 * tau) + float(rest)) / beta if beta > 0.0 else inf), tau, beta

        _, tau, beta = min(floor(share) for share in np.linspace(0.02, 0.98, 33))
        if beta <= 0.0:
            return None
        t, b = Fraction(tau), Fraction(beta)
        return t, b, (push * push / (4 * t) + rest) / b

    def tighten(self, tube: Tube) -> tuple[float, float]:
        """Find the ellipsoids, and return the ultimate bounds of angle (rad) and rate (rad/s)."""
        angle, fastest = ends(self.motion, tube, tube.region.X)
        heed, corners = HEED, self.motion.corners()
        away, entered = self.motion.away, self.motion.entered(tube)
        for _ in range(ELLIPSOIDS):
            within, more = forgotten(self.motion, tube)
            pushes = self.motion.linear(within)
            sized = [floats(B) * float(b) for B, b in pushes]
            ellipsoid = smallest(floats(self.motion.near.A), np.array(list(map(floats, corners))), sized, heed)
            if ellipsoid is None:
                break
            shape, shares = ellipsoid
            X, a = [[rounded(x, DIGITS) for x in row] for row in shape.tolist()], [rounded(x, DIGITS) for x in shares]
            added = spread(a, pushes)
            moved = (plus(added, times(A, times(X, transpose(A))), Fraction(1) / (1 - sum(a, Fraction(0)))) for A in corners)
            rate = max(highest_ratio(after, X) for after in moved)
            reach = highest_ratio(entered, X)
            inner = self.motion.tube(within.region.within(X, away))
            more += waited(self.motion, within, inner)
            end = ends(self.motion, inner, X, away)
            if rate >= 1.0 or end[0] > angle * 0.99:
                if not heed:
                    break
                heed = 0.0
                continue
            self.samples += more
            one = {"shape": [[str(x) for x in row] for row in X], "shares": [str(x) for x in a]}
            self.ellipsoids.append(one | {"rate": str(Fraction(rate)), "reach": str(Fraction(reach))})
            room = 1 - sum(a)
            fall = 1 - Fraction(rate) * room
            self.samples += periods(fall, Fraction(rate) * (1 - room) / fall, Fraction(reach), Fraction(1))
            tube, entered, (angle, fastest) = inner, X, end
        return angle, fastest

    def nearest(self) -> tuple[Chain, tuple[float, float]]:
        """Return the chain with the response or with ellipsoids, whichever leads nearer, and the ultimate bounds of angle
        (rad) and rate (rad/s). Without wheels no ellipsoid does better than the response."""
        tube, _ = on_level(self.motion, Fraction(self.levels[-1]["end"]))
        self.motion.nears(tube)
        one = replace(self, ellipsoids=list[Any]())
        ends = [(one, one.respond(tube))]
        if not one.response or self.motion.loop.wheels:
            ends.append((self, self.tighten(tube)))
        return min(ends, key=lambda pair: pair[1][0])

    def respond(self, tube: Tube) -> tuple[float, float]:
        """Find how often the response brings motions nearer, and return the ultimate bounds."""
        motion, evidence = self.motion, find_response(self.motion)
        (begun, pulled), rounds = first_of(motion, tube), 0
        angle, fastest = ends(self.motion, tube, tube.region.X)
        response = None if evidence is None else concluded(responds(motion, evidence["weights"], evidence["gains"]))
        while evidence is not None and response is not None and rounds < ROUNDS:
            try:
                within, more = forgotten(motion, tube)
                begun, pulled, inner = response.after(motion, within, begun, pulled)
                more += waited(motion, within, inner)
            except RefusedError:
                break
            end = ends(self.motion, inner, balls(begun), motion.away)
            if not end[0] < angle * 0.999:
                break
            tube, (angle, fastest), rounds = inner, end, rounds + 1
            self.samples += response.count + more
            self.response = {"response": evidence | {"rounds": rounds}}
        return angle, fastest
