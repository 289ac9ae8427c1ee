"""Finds the claim about the loop that flies: V, the levels down to which motions come, and the ellipsoids of their end."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from importlib import import_module
from math import degrees, inf, isfinite, pi, radians, sin, sqrt
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.polynomial import exact
from starhold.certification.evidence.attitude import Loop
from starhold.certification.evidence.ellipsoids import HEED, MORE, ends, highest_ratio, smallest
from starhold.certification.evidence.finding import concluded, read
from starhold.certification.evidence.lates import begun_late, numbers_of, of_late, resting, weighed
from starhold.certification.evidence.noise import find_radii
from starhold.certification.evidence.plans import told_of
from starhold.certification.evidence.recorded import sign_words
from starhold.certification.evidence.responses import find_response
from starhold.certification.evidence.squares import rounded
from starhold.certification.evidence.starts import POINTS, asks_more, begins, feedback, start_rate
from starhold.certification.matrices import above, floats
from starhold.certification.unmodelled import Pushes, change_of_modelled
from starhold.kernel.held import CHANGE, Held
from starhold.kernel.loops import OUTSIDE, TOLD_TORQUE, AttitudeLoop
from starhold.kernel.numbers import RefusedError, demand, plus, times, transpose
from starhold.kernel.plans import Plan
from starhold.kernel.regions import TURN, Tube, balls
from starhold.kernel.theorems.noise import SHARE
from starhold.kernel.theorems.pointing import ROUNDS, forgotten, on_level, periods, spread, waited
from starhold.kernel.theorems.response import first_of, responds
from starhold.parts.craft import tensor

linalg: Any = import_module("scipy.linalg")
Array = NDArray[np.float64]

ANGLES = (175, 150, 120, 90, 75, 60, 45, 35, 30, 25, 20, 15, 10)
"""The initial rotations (deg) from which convergence is attempted."""
NEAR = (7, 5, 3, 2, 1, 0.5)
"""Further ones, for laws that are known near the target alone."""
RATES = (5, 3, 2, 1, 0.5)
"""The initial rates (deg/s) beyond that of the loop's own start that are attempted at the largest rotation."""
NEARLY = 10.0
"""A chain of levels that ends below this multiple of its `aim` is taken, and no other one is looked for."""
LEAST = 1e-6
"""The deflection (rad) of a spring as stiff as the law under the least external torque that is considered."""
NEARER = 0.25
"""A claim is made only if the ultimate bound is below this share of the largest rotation in the set."""
LEANS = (0.1, 0.18, 0.3, 0.45)
"""How large epsilon of V = w.Jw/2 + 2k (1 - q0) + epsilon q.Jw is tried to be, in sqrt(k / the largest moment); the law's
own V, if it is a form of q, takes the place of the first two terms."""
FLOOR, DIGITS, DEEPEST, LEVELS, ELLIPSOIDS = 1.03, 7, 8.0, 20, 24
"""The margin of the last level above its limit, so that motions enter it in finite time; the digits of ellipsoids' numbers;
the largest ratio of successive levels; the most levels and ellipsoids."""

Lower: TypeAlias = tuple[Fraction, Fraction, Fraction]
Beginning: TypeAlias = tuple[list[float], float, dict[str, float], list[float]]


@dataclass
class Chain:
    """Levels from a set down to where disturbances outweigh the damping, and ellipsoids from there on."""

    motion: Held
    V: str
    level: float
    tried: dict[Any, Lower | None] = field(default_factory=dict[Any, "Lower | None"])
    """The results of `lower`, for all chains of one V."""
    levels: list[dict[str, str]] = field(default_factory=list[dict[str, str]])
    ellipsoids: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])
    response: dict[str, Any] = field(default_factory=dict[str, Any])
    samples: int = 0

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


def find_pointed(loop: Loop, like: Mapping[str, Any] | None = None, begun: float | None = None) -> bool:
    """Find the pointing bound of the loop under the disturbances of its parts and the requested ones, within its limits if
    possible: from the largest rotations, at the rate `begun` (rad/s), by default that of the loop's start, or from rest.
    like: the numbers of a claim, for the same start set and limits, and with noise if it includes noise."""
    if like is None:
        rates = dict.fromkeys((start_rate(loop.loop) * MORE if begun is None else begun, 0.0))
        angles = list(map(radians, (*ANGLES, *NEAR) if loop.plan is not None or loop.known.late else ANGLES))
        beyond = list(map(radians, RATES)) if begun is None else []
        tried = [(angles, rate, limits, beyond) for limits in (loop.limits, {}) for rate in rates]
        # If the noise is too large for a proof, without it.
        kinds = [True] * loop.known.noisy + [False]
    else:
        turn, rate = (float(Fraction(like.get(f"start.{name}", like.get(name, 0)))) for name in ("angle", "rate"))
        tried = [([turn], rate, {name: x for name, x in loop.limits.items() if name in like}, list[float]())]
        kinds = [SHARE in like]
    for noisy in kinds:
        against = loop.known.against(loop.known.envelope(noisy))
        try:
            if any(pushed.find_largest(*one) for pushed in ways(loop, against, noisy, tried[0]) for one in tried):
                return True
        except (RefusedError, ArithmeticError, ValueError, np.linalg.LinAlgError) as reason:
            # Floats may be too far apart in size, or too large.
            loop.failed[POINTS] = str(reason)
    return False


def ways(loop: Loop, against: Pushes, noisy: bool, begin: Beginning) -> list[Pushed]:
    """Return the searches by the law's own even V and by another, that of the larger start first."""
    first = Pushed(loop, against, noisy)
    both = [first, Pushed(loop, against, noisy, given=False)] if first.even else [first]
    angle, rate = both[-1].start(*begin) if first.even else (0.0, 0.0)
    return both if not angle or first.may_begin(angle, rate, begin[2]) else both[::-1]


class Pushed:
    """A loop under unmodelled torques and errors. RefusedError for a law outside the theorem."""

    def __init__(self, loop: Loop, against: Pushes, noisy: bool = False, given: bool = True) -> None:
        words, outside = [word for word in loop.words if word != OUTSIDE], against.outside
        if OUTSIDE in loop.words and loop.is_told(TOLD_TORQUE):
            words.append(OUTSIDE)
        else:
            outside = above(exact(outside) + loop.known.modelled_norm)
        self.loop, self.words = loop, words + sign_words(loop.loop)
        bounds = loop.bounds(words)
        wired = AttitudeLoop(read(loop.claim(POINTS, self.words, None, **bounds), loop.by_digest), remembers=True)
        self.stiffness = feedback(wired)
        demand(self.stiffness > 0.0, "the law does not rotate the body to its target")
        law = loop.loop.law
        # The law's own potential has no force beside the law's, however far from the target.
        self.even = given and law.lyapunov is not None and not any("q0" in m for m in loop.form(loop.lyapunov()).terms)
        against = against._replace(outside=max(outside, LEAST * self.stiffness))
        bounded = all(map(isfinite, against.numbers.values()))
        demand(bounded, "the wheels' friction has no bound, because their momentum has no limit")
        self.plan: Plan | None = None
        self.larger, self.refused = list[tuple[float, float, str]](), dict[tuple[Any, ...], str]()
        self.numbers: dict[str, Any] = {"period": loop.loop.period}
        self.numbers |= {} if loop.known.tolerance is None else {"tolerance": loop.known.tolerance}
        self.numbers |= numbers_of(loop.known.late)
        self.numbers |= {name: x for name, x in against.numbers.items() if x or name in ("outside", "error")}
        more, self.evidence = (find_radii(loop, wired) if noisy else None) or ({}, {})
        if loop.plan is not None:
            planned, about = told_of(loop, loop.plan)
            more, self.evidence = more | planned, self.evidence | about
        self.radii = [*map(Fraction, self.evidence.get("swayed", ()))]
        changes = change_of_modelled(loop.loop, loop.known.envelope(noisy)) if OUTSIDE in words else (inf,)
        self.numbers |= bounds | more | (dict(zip(CHANGE, changes, strict=True)) if all(map(isfinite, changes)) else {})
        self.J = float(np.linalg.eigvalsh(tensor(loop.loop.craft.inertia))[-1])
        slow = sqrt(self.stiffness / self.J)
        self.scales = {f"w{k}": slow for k in (1, 2, 3)} | {f"q{k}": 1.0 for k in (1, 2, 3)}
        self.leans = [
            (float(f"{lean * slow:.4g}"), *self.sampled(float(f"{lean * slow:.4g}")), dict[Any, Lower | None]())
            for lean in LEANS
        ]
        # The locally best is tried first, and taken if it descends from the whole set.
        self.leans.sort(key=lambda lean: Chain(lean[2], lean[1], 0.0, lean[3]).aim())

    def sampled(self, epsilon: float) -> tuple[str, Held]:
        """Return V and the loop."""
        V = self.loop.crossed(None if self.even else self.stiffness, epsilon)
        wired = AttitudeLoop(read(self.claim(V, self.numbers), self.loop.by_digest), remembers=True)
        motion = Held(wired, self.plan)
        self.plan = motion.plan
        if self.radii:
            motion.sways(self.radii)
        motion.late = weighed(motion, self.scales)
        return V, motion

    def claim(self, V: str, numbers: dict[str, Any], **evidence: Any) -> dict[str, Any]:
        """Return the claim with its numbers, and its evidence except that about noise."""
        return self.loop.claim(POINTS, self.words, V, **numbers) | {"evidence": self.evidence | evidence}

    def find_largest(self, angles: list[float], rate: float, limits: dict[str, float], beyond: list[float]) -> bool:
        """Find the claim from the largest possible angle, at the largest possible rate there; both decrease."""
        for angle, rates in self.starts(angles, rate, limits, beyond):
            for one in rates:
                if self.kept(self.find, angle, one, limits):
                    *_, nearest = min((start for start in self.larger if start[:2] > (angle, one)), default=("",))
                    self.loop.failed |= {POINTS: nearest} if nearest else {}
                    return True
        return False

    def starts(
        self, angles: list[float], rate: float, limits: dict[str, float], beyond: list[float]
    ) -> Iterator[tuple[float, tuple[float, ...]]]:
        """Yield the rotations to begin from, the largest first, each with the rates to begin at there."""
        # A start within a smaller set is also within the larger one.
        first = bisect_left(angles, True, key=lambda angle: self.kept(self.may_begin, angle, rate, limits))
        faster = [one for one in beyond if one > rate > 0.0]
        for angle in angles[first:]:
            place = bisect_left(faster, True, key=lambda one: self.kept(self.may_begin, angle, one, limits))
            yield angle, (*faster[place : place + 1], rate)

    def start(self, *begin: Any) -> tuple[float, float]:
        """Return the largest of the starts, zeros where there is none."""
        angle, rates = next(self.starts(*begin), (0.0, (0.0,)))
        return angle, rates[0]

    def may_begin(self, angle: float, rate: float, limits: dict[str, float]) -> bool:
        """Return whether there is a start set, which is looked for once."""
        key = angle, rate, *limits.items()
        if key not in self.refused:
            self.refused[key] = "" if self.begun(angle, rate, limits, True) is not None else self.loop.failed[POINTS]
        if self.refused[key]:
            self.loop.failed[POINTS] = self.refused[key]
        return not self.refused[key]

    def kept(self, tried: Callable[..., Any], angle: float, rate: float, limits: dict[str, float]) -> bool:
        """Return whether a start is taken, and keep why it is not."""
        if tried(angle, rate, limits):
            return True
        start = f"from {degrees(angle):.3g} deg at {degrees(rate):.3g} deg/s: "
        self.larger.append((angle, rate, start + self.loop.failed[POINTS]))
        return False

    def begun(
        self, angle: float, rate: float, limits: dict[str, float], examined: bool = False
    ) -> tuple[dict[str, Any], list[Chain]] | None:
        """Return the claim's numbers of the start set, and a chain from there for each lean of V; None, and the reason in
        `failed`, where V does not decrease on the set or, as far as this is examined, the torque exceeds its limits."""
        loop, J, begun, half = self.loop, self.J, list[Chain](), min(angle, pi) / 2.0
        numbers = self.numbers | limits
        numbers |= {"start.angle": angle, "start.rate": rate} if rate > 0.0 else {"angle": angle}
        for epsilon, V, motion, tried in self.leans:
            motion.late = begun_late(motion, sin(half), rate)
            rest = 2.0 * float(motion.s) * sin(angle / 4.0) ** 2
            rest += float(np.linalg.eigvalsh(floats(motion.G)[TURN, TURN])[-1]) * sin(half) ** 2
            level = rest + J * rate * (rate / 2.0 + epsilon * sin(half))
            level += float(motion.late.weight * motion.late.begun**2) if motion.late else 0.0
            motion.late = resting(motion, level * (1.0 + 1e-6))
            begun.append(Chain(motion, V, level * (1.0 + 1e-6), tried))
        if asks_more(begun[0].motion, begun[0].level, limits):
            loop.failed[POINTS] = "the torque exceeds its limit"
            return None
        if not any(chain.decreases() for chain in begun):
            loop.failed[POINTS] = "V does not decrease on the set from which motions start"
            return None
        if examined and not begins(loop, self.claim(begun[0].V, numbers | begun[0].of_level()), self.scales):
            return None
        return numbers, begun

    def find(self, angle: float, rate: float = 0.0, limits: dict[str, float] | None = None) -> bool:
        """Find the pointing claim of the loop, and add it. The set contains rotations of up to `angle` (rad) at up to `rate`
        (rad/s); limits: of the torque about each axis (`limit`) or its norm (`limit.norm`), or of wheels."""
        loop, start_of = self.loop, self.begun(angle, rate, limits or {})
        if start_of is None:
            return False
        numbers, begun = start_of
        for chain in begun:
            if chain.descend() < NEARLY * chain.aim() and chain.levels:
                break
        else:
            chain = min(begun, key=lambda one: float(Fraction(one.levels[-1]["end"])) if one.levels else inf)
        if not chain.levels:
            loop.failed[POINTS] = "V does not decrease on the set from which motions start"
            return False
        motion, start = chain.motion, Fraction(chain.level)
        chain, (angle, fastest) = chain.nearest()
        numbers |= chain.of_level()
        numbers["highest"] = float(start + motion.h / 2 * motion.swing(motion.tube(motion.region(start)))) * MORE
        numbers |= {"end.angle": angle, "end.rate": fastest, "settling": float(motion.h * chain.samples) * MORE}
        if not isfinite(angle) or angle > NEARER * numbers.get("angle", numbers.get("start.angle", 0.0)):
            loop.failed[POINTS] = "motions do not come near the target"
            return False
        claim = self.claim(chain.V, numbers, levels=chain.levels, ellipsoids=chain.ellipsoids, **chain.response)
        return loop.try_to_show(claim, self.scales)
