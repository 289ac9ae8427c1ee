"""Levels of V down which motions come, and the ellipsoids of their end, from a start on."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from fractions import Fraction
from importlib import import_module
from math import inf, log
from typing import Any, TypeAlias

import numpy as np

from starhold.certification.evidence.blends import Blended
from starhold.certification.evidence.ellipsoids import HEED, MORE, ends, fed_by, highest_ratio, smallest
from starhold.certification.evidence.finding import concluded
from starhold.certification.evidence.lates import of_late
from starhold.certification.evidence.responses import find_response
from starhold.certification.evidence.shapes import Shape
from starhold.certification.evidence.squares import rounded
from starhold.certification.matrices import floats
from starhold.kernel.numbers import RefusedError
from starhold.kernel.regions import STATE, Tube, balls, factored, least_form
from starhold.kernel.theorems.pointing import ROUNDS, forgotten, on_level, periods, waited
from starhold.kernel.theorems.response import Response, first_of, responds

linalg: Any = import_module("scipy.linalg")

FLOOR, DIGITS, DEEPEST, LEVELS, ELLIPSOIDS = 1.03, 7, 4.0, 40, 24
"""The margin of the last level above its limit, so that motions enter it in finite time; the digits of ellipsoids' numbers;
the largest ratio of successive levels; the most levels and ellipsoids."""
SMALLER, FAR = 4, 0.05
"""The ratio of the levels that tell how disturbances weigh in sets of different size; and by how much a form, in units of
its diagonal, has to be indefinite not to count as a near miss."""
LOWER, SHORTEST, WORTH, ALIKE = 0.97, 0.12, 1.003, 1.005
"""The share of a level that the next one is at most; the least share of the largest ratio, in powers; up to which multiple
of the last bound no further response is worth its time, and up to which multiple of another a bound counts as no wider."""

Lower: TypeAlias = tuple[Fraction, Fraction, Fraction]
Ends: TypeAlias = tuple[float, float]
"""Ultimate bounds of angle (rad) and rate (rad/s)."""


class Falls(list[Lower]):
    """Tau, beta and the lowest level proved to be reached from another; the lowest of these levels comes first."""

    @property
    def pace(self) -> float:
        """Return by what share V decreases at most in a unit of time."""
        return max((float(beta) for _, beta, _ in self), default=0.0)

    def quickest(self, c: Fraction, end: Fraction) -> Lower:
        """Return that by which motions come soonest from one level to another."""

        def lasts(one: Lower) -> float:
            _, beta, floor = map(float, one)
            return log((float(c) - floor) / (float(end) - floor)) / beta if FLOOR * floor <= float(end) * MORE else inf

        return min(self, key=lasts)


@dataclass
class Chain:
    """Levels from a set down to where disturbances outweigh the damping, and ellipsoids from there on."""

    motion: Blended
    V: str
    level: float
    tried: dict[Any, Falls] = field(default_factory=dict[Any, Falls])
    """The results of `falls`, for all chains of one V."""
    shape: Shape = field(default_factory=lambda: Shape(0.0))
    levels: list[dict[str, str]] = field(default_factory=list[dict[str, str]])
    ellipsoids: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])
    response: dict[str, Any] = field(default_factory=dict[str, Any])
    reached: list[int] = field(default_factory=list[int])
    """After how many samples motions are in each of the levels."""
    samples: int = 0
    slow: dict[str, float] = field(default_factory=dict[str, float])
    """The claim's numbers of a bound of the rate."""

    @property
    def scales(self) -> dict[str, float]:
        """Return the sizes of the state in the set, and of all external inputs."""
        motion = self.motion
        sizes = motion.region(Fraction(self.level)).sizes
        return {name: float(sizes[name]) or 1.0 for name in (*STATE, *motion.others)}

    @property
    def nearly_linear(self) -> Fraction:
        """Return a level in which all motions are."""
        return (self.motion.s + self.motion.G[3][3]) / 2**20

    def aim(self) -> float:
        """Return the level that disturbances allow where all motions are nearly linear."""
        lower = self.lower(self.nearly_linear)
        return inf if lower is None else float(lower[2])

    def decreases(self, noticeably: bool = True) -> bool:
        """Return whether V decreases on the whole set, down to a noticeably lower level, or to any lower one."""
        if self.rises():
            return False
        lower = self.lower(Fraction(self.level))
        return lower is not None and float(lower[2]) * (FLOOR / LOWER if noticeably else 1.0) < self.level

    def rises(self) -> bool:
        """Return whether V is far from decreasing on the whole set even with a torque that is not held, which takes a
        fraction of the time to tell."""
        motion = self.motion
        try:
            slope = factored(-motion.by_law([motion.rate], [Fraction(1)]))
            form = floats(least_form(slope, motion.region(Fraction(self.level))))
        except RefusedError:
            return True
        if float(np.diag(form).min()) <= 0.0:
            return True
        scale = np.sqrt(np.diag(form))
        return float(np.linalg.eigvalsh(form / np.outer(scale, scale))[0]) < -FAR

    def wants_more(self) -> bool:
        """Return whether larger sets may do where V does not decrease to a lower level on this one: relative to the level,
        disturbances weigh more on a smaller set still. Where the motion itself is too fast for V they weigh less there."""
        here, c = self.lower(Fraction(self.level)), Fraction(self.level) / SMALLER
        less = None if here is None else self.lower(c)
        return here is not None and less is not None and here[2] / less[2] < SMALLER

    def of_level(self) -> dict[str, Any]:
        """Return the claim's numbers that follow from its level."""
        late = of_late(self.motion.late) | self.slow
        if self.motion.plan is None:
            return {"level": self.level} | late
        region = self.motion.region(Fraction(self.level))
        off = self.motion.planned((self.motion.tube(region).region if self.motion.grows else region).sizes)
        return {"level": self.level} | late | {"plan.error": float(off) * MORE}

    def descend(self) -> float:
        """Find the levels, and return the last. Where V hardly decreases, they follow each other closely."""
        c, tube, pace = Fraction(self.level), None, self.falls(self.nearly_linear).pace
        while len(self.levels) < LEVELS and (falls := self.falls(c)):
            ratio = DEEPEST ** min(max(falls.pace / pace if pace else 1.0, SHORTEST), 1.0)
            end = Fraction(max(float(falls[0][2]) * FLOOR, float(c) / ratio))
            if float(end) > float(c) * LOWER:
                break
            tau, beta, floor = falls.quickest(c, end)
            self.levels.append({"end": str(end), "tau": str(tau), "beta": str(beta)})
            tube, more = on_level(self.motion, end, tube or self.motion.tube(self.motion.region(c)))
            self.samples += periods(self.motion.h * beta, floor, c, end) + more
            self.reached.append(self.samples)
            c = end
        return float(c)

    def lower(self, c: Fraction) -> Lower | None:
        """Return tau and beta for the lowest level proved to be reached from another, and that level."""
        return next(iter(self.falls(c)), None)

    def falls(self, c: Fraction) -> Falls:
        """Return how V decreases from a level."""
        key = c, *self.motion.bounds
        if key not in self.tried:
            self.tried[key] = self.sought(c)
        return self.tried[key]

    def sought(self, c: Fraction) -> Falls:
        """Find what `falls` returns."""
        motion = self.motion
        try:
            exact, above, felt, push, rest, spare = motion.fall(on_level(motion, c)[0])
        except RefusedError:
            return Falls()
        Q, H, F = floats(exact), floats(above), floats(felt)
        if float(np.linalg.eigvalsh(Q)[0]) <= 0.0:
            return Falls()
        R = F.T @ F
        largest = 1.0 / float(linalg.eigh(R, Q, eigvals_only=True)[-1])
        falls = Falls()
        for tau in largest * np.linspace(0.02, 0.98, 33):
            beta = float(linalg.eigh(Q - tau * R, H, eigvals_only=True)[0]) * (1.0 - 1e-6)
            beta = min(beta, float(spare) * (1.0 - 1e-6) / float(motion.h))
            if beta > 0.0:
                t, b = Fraction(float(tau)), Fraction(beta)
                falls.append((t, b, (push * push / (4 * t) + rest) / b))
        falls.sort(key=lambda one: one[2])
        return falls

    def tighten(self, tube: Tube) -> Ends:
        """Find the ellipsoids, and return the ultimate bounds of angle (rad) and rate (rad/s)."""
        angle, fastest = ends(self.motion, tube, tube.region.X)
        heed, A, corners = HEED, floats(self.motion.near.A), np.array(list(map(floats, self.motion.corners())))
        away, entered = self.motion.away, self.motion.entered(tube)
        for _ in range(ELLIPSOIDS):
            within, more = forgotten(self.motion, tube)
            pushes = self.motion.linear(within)
            sized = [floats(B) * float(b) for B, b in pushes]
            ellipsoid = smallest(A, corners, sized, heed)
            if ellipsoid is None:
                break
            shape, shares = ellipsoid
            X, a = [[rounded(x, DIGITS) for x in row] for row in shape.tolist()], [rounded(x, DIGITS) for x in shares]
            room, added = 1 - sum(a), fed_by(sized, map(float, a))
            moved = added + corners @ floats(X) @ corners.transpose(0, 2, 1) / float(room)
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
            fall = 1 - Fraction(rate) * room
            self.samples += periods(fall, Fraction(rate) * (1 - room) / fall, Fraction(reach), Fraction(1))
            tube, entered, (angle, fastest) = inner, X, end
        return angle, fastest

    def nearest(self) -> tuple[Chain, Ends]:
        """Return the chain with the response or with ellipsoids, whichever leads nearer, and the ultimate bounds of angle
        (rad) and rate (rad/s). Without wheels no ellipsoid does better than the response. They begin in the level from
        which motions are there the soonest."""
        evidence, count = find_response(self.motion), len(self.levels)
        response = None if evidence is None else concluded(responds(self.motion, evidence["weights"], evidence["gains"]))

        def respond(chain: Chain, tube: Tube, /) -> Ends:
            return chain.respond(tube, evidence, response)

        one = self.ended(respond, count)
        ways: list[tuple[Callable[[Chain, Tube], Ends], tuple[Chain, Ends]]] = [(respond, one)]
        if not one[0].response or self.motion.loop.wheels:
            ways.append((Chain.tighten, self.ended(Chain.tighten, count)))
        way, best = min(ways, key=lambda pair: pair[1][1][0])
        most, after = best[1][0] * ALIKE, best[0].samples - self.reached[-1]
        sooner = dict[int, tuple[Chain, Ends]]()

        def near(count: int) -> bool:
            try:
                sooner[count] = self.ended(way, count)
            except (RefusedError, np.linalg.LinAlgError):
                # Too far from the target.
                return False
            return sooner[count][1][0] <= most

        first = bisect_left(range(1, count), True, key=near) + 1
        for place in range(first, count):
            # From lower levels no less follows than from the last.
            if self.reached[place - 1] + after >= best[0].samples:
                break
            if place in sooner or near(place):
                best = min(best, sooner[place], key=lambda one: one[0].samples)
        return best

    def ended(self, way: Callable[[Chain, Tube], Ends], count: int) -> tuple[Chain, Ends]:
        """Return the chain with only so many levels and what follows them, and the ultimate bounds."""
        one = replace(self, levels=self.levels[:count], ellipsoids=list[Any](), samples=self.reached[count - 1])
        tube, _ = on_level(self.motion, Fraction(one.levels[-1]["end"]))
        self.motion.nears(tube)
        return one, way(one, tube)

    def respond(self, tube: Tube, evidence: dict[str, Any] | None, response: Response | None) -> Ends:
        """Find how often a response brings motions nearer, and return the ultimate bounds."""
        motion = self.motion
        (begun, pulled), samples = first_of(motion, tube), self.samples
        after = [(samples, ends(self.motion, tube, tube.region.X))]
        while evidence is not None and response is not None and len(after) <= ROUNDS:
            try:
                within, more = forgotten(motion, tube)
                begun, pulled, tube = response.after(motion, within, begun, pulled)
                more += waited(motion, within, tube)
            except RefusedError:
                break
            end = ends(self.motion, tube, balls(begun), motion.away)
            if not end[0] < after[-1][1][0] * 0.999:
                break
            samples += response.count + more
            after.append((samples, end))
        # As often as is worth the time.
        rounds = next(k for k, (_, end) in enumerate(after) if end[0] <= after[-1][1][0] * WORTH)
        self.samples, end = after[rounds]
        self.response = {"response": (evidence or {}) | {"rounds": rounds}} if rounds else {}
        return end
