"""Finds the claim about the loop that flies: V, the levels down to which motions come, and the ellipsoids of their end."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import replace
from fractions import Fraction
from functools import cached_property
from importlib import import_module
from math import degrees, inf, isfinite, pi, radians, sin, sqrt
from types import MappingProxyType
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.polynomial import exact
from starhold.certification.evidence.attitude import Loop
from starhold.certification.evidence.blends import Blended, Shared, rewired
from starhold.certification.evidence.chains import Chain, Falls
from starhold.certification.evidence.ellipsoids import MORE
from starhold.certification.evidence.finding import read
from starhold.certification.evidence.lates import begun_late, numbers_of, resting, weighed
from starhold.certification.evidence.noise import find_radii
from starhold.certification.evidence.plans import told_of
from starhold.certification.evidence.recorded import sign_words
from starhold.certification.evidence.shapes import Shape, largest_in, soft
from starhold.certification.evidence.slow import slowed
from starhold.certification.evidence.starts import POINTS, begins, feedback, start_rate
from starhold.certification.matrices import above
from starhold.certification.unmodelled import Pushes, change_of_modelled
from starhold.kernel.held import CHANGE
from starhold.kernel.loops import OUTSIDE, TOLD_TORQUE, AttitudeLoop
from starhold.kernel.numbers import RefusedError, demand
from starhold.kernel.programs import Program
from starhold.kernel.reading import Told
from starhold.kernel.theorems.kinetic import KINETIC, commanded
from starhold.kernel.theorems.noise import SHARE
from starhold.parts.craft import tensor

linalg: Any = import_module("scipy.linalg")
Array = NDArray[np.float64]

ANGLES = (
    *(175, 165, 150, 135, 120, 112, 105, 97, 90, 86, 80, 75, 67, 60, 52, 45, 40, 35, 30, 25, 22, 20, 17, 15, 12),
    *(10, 8, 7, 6, 5, 4, 3, 2, 1, 0.5),
)
"""The initial rotations (deg) from which convergence is attempted."""
RATES = (5, 3, 2, 1)
"""The initial rates (deg/s) beyond that of the loop's own start that are attempted at the largest rotation."""
WORTH = 0.75
"""The share of the largest possible rotation that is worth to begin at a higher rate."""
NEARLY = 10.0
"""A chain of levels that ends below this multiple of its `aim` is taken, and no other one is looked for."""
LEAST = 1e-6
"""The deflection (rad) of a spring as stiff as the law under the least external torque that is considered."""
NEARER = 0.25
"""A claim is made only if the ultimate bound is below this share of the largest rotation in the set."""
LEANS = (0.1, 0.18, 0.33, 0.45)
"""How large epsilon of V = w.Jw/2 + 2k (1 - q0) + epsilon q.Jw is tried to be, in sqrt(k / the largest moment); the law's
own V, if it is a form of q, takes the place of the first two terms."""
RISES = "V does not decrease on the set from which motions start"

Start: TypeAlias = tuple[Shape, dict[str, float]]
Beginning: TypeAlias = tuple[list[float], float, dict[str, float], list[float]]


def find_pointed(loop: Loop, like: Mapping[str, Any] | None = None, begun: float | None = None) -> bool:
    """Find the pointing bound of the loop under the disturbances of its parts and the requested ones, within its limits if
    possible: from the largest rotations, at the rate `begun` (rad/s), by default that of the loop's start, or from rest.
    like: the numbers of a claim, for the same start set and limits, and with noise if it includes noise."""
    if like is None:
        rates = dict.fromkeys((start_rate(loop.loop) * MORE if begun is None else begun, 0.0))
        angles = list(map(radians, ANGLES))
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
            if finds(Pushed(loop, against, noisy), tried):
                return True
        except (RefusedError, ArithmeticError, ValueError, np.linalg.LinAlgError) as reason:
            # Floats may be too far apart in size, or too large.
            loop.failed[POINTS] = str(reason)
    return False


def finds(first: Pushed, tried: list[Beginning]) -> bool:
    """Find the claim from the largest start: by the law's own even V if it may begin there, or else by another V."""
    both = [first]
    if first.even:
        other, (angles, rate, limits, beyond) = first.by_another(), tried[0]
        start = first.start(*tried[0])
        faster = start[0], min((x for x in (*beyond, rate) if x > start[1]), default=start[1])
        farther = min((x for x in angles if x > start[0]), default=start[0]), start[1]
        larger = [one for one in (faster, farther) if start[0] and one != start]
        less = not start[0] or any(other.may_begin(*one, limits) for one in larger)
        both = [other, first] if less else [first, other]
    return any(pushed.find_largest(*one) for pushed in both for one in tried)


class Lean(NamedTuple):
    """A V by its shape and digest, the loop with it, and the results of `falls`."""

    shape: Shape
    V: str
    motion: Blended
    tried: dict[Any, Falls]


class Pushed:
    """A loop under unmodelled torques and errors. RefusedError for a law outside the theorem."""

    def __init__(self, loop: Loop, against: Pushes, noisy: bool = False) -> None:
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
        self.even = law.lyapunov is not None and not any("q0" in m for m in loop.form(loop.lyapunov()).terms)
        against = against._replace(outside=max(outside, LEAST * self.stiffness))
        bounded = all(map(isfinite, against.numbers.values()))
        demand(bounded, "the wheels' friction has no bound, because their momentum has no limit")
        self.afresh()
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
        slow = sqrt(self.stiffness / float(np.linalg.eigvalsh(tensor(loop.loop.craft.inertia))[-1]))
        self.scales = {f"w{k}": slow for k in (1, 2, 3)} | {f"q{k}": 1.0 for k in (1, 2, 3)}
        self.shared = Shared()
        wired.claim = replace(wired.claim, evidence=Told("evidence", self.evidence))
        self.wired = wired
        self.usual = [Shape(float(f"{lean * slow:.4g}")) for lean in LEANS]

    def afresh(self) -> None:
        """Begin the search."""
        self.larger, self.beginnings = list[tuple[float, float, str]](), dict[tuple[Any, ...], tuple[list[Start], str]]()
        self.slow, self.known = dict[tuple[Any, ...], list[Chain]](), dict[Shape, Lean]()
        self.stuck = set[Shape]()

    def by_another(self) -> Pushed:
        """Return the search by a V with another potential than the law's own; it has not begun."""
        other = copy(self)
        other.even = False
        other.afresh()
        return other

    @cached_property
    def leans(self) -> list[Lean]:
        """Return V with the potential as it is, the locally best first, which is taken if it descends from the whole set."""
        return self.best_first(self.usual)

    @cached_property
    def slowest(self) -> list[Lean]:
        """Return those of them for which bounds that motions keep are looked for."""
        return self.best_first(self.usual[1:3])

    def best_first(self, shapes: Sequence[Shape]) -> list[Lean]:
        """Return V of some shapes, the locally best first."""
        leans = [self.sampled(shape) for shape in shapes]
        return sorted(leans, key=lambda lean: Chain(lean.motion, lean.V, 0.0, lean.tried).aim())

    def sampled(self, shape: Shape) -> Lean:
        """Return V and the loop."""
        if shape not in self.known:
            s = None if self.even else self.stiffness
            V = self.loop.crossed(s, shape.epsilon) if shape in self.usual else self.loop.softened(s, shape)
            motion = Blended(rewired(self.wired, self.numbers, Program.read(self.loop.by_digest[V])), self.shared)
            if self.radii:
                motion.sways(self.radii)
            motion.late = weighed(motion, self.scales)
            self.known[shape] = Lean(shape, V, motion, {})
        return self.known[shape]

    def claim(self, V: str, numbers: dict[str, Any], **evidence: Any) -> dict[str, Any]:
        """Return the claim with its numbers, and its evidence except that about noise."""
        return self.loop.claim(POINTS, self.words, V, **numbers) | {"evidence": self.evidence | evidence}

    def find_largest(self, angles: list[float], rate: float, limits: dict[str, float], beyond: list[float]) -> bool:
        """Find the claim from the largest possible angle, at the largest possible rate there; both decrease."""
        for angle, rates in self.starts(angles, rate, limits, beyond):
            for one in rates:
                if self.kept(self.find, angle, one, limits):
                    self.explain((angle, one))
                    return True
        return False

    def explain(self, start: tuple[float, float]) -> None:
        """Keep why there is no claim from the next larger start."""
        *_, nearest = min((one for one in self.larger if one[:2] > start), default=("",))
        self.loop.failed |= {POINTS: nearest} if nearest else {}

    def starts(
        self, angles: list[float], rate: float, limits: dict[str, float], beyond: list[float]
    ) -> Iterator[tuple[float, tuple[float, ...]]]:
        """Yield the rotations to begin from, the largest first, each with the rates to begin at there."""

        def may(angle: float, rate: float = rate) -> bool:
            return self.kept(self.may_begin, angle, rate, limits)

        def far_enough(angle: float) -> bool:
            return may(angle) or self.too_near((angle, rate, *limits.items()))

        # A start within a smaller set is also within the larger one. Where none begins, sets may be too small for their V.
        first = bisect_left(angles, True, key=may)
        if first == len(angles):
            first = bisect_left(angles, True, key=far_enough)
        faster = [one for one in beyond if one > rate > 0.0]

        def fastest(angle: float) -> tuple[float, ...]:
            place = bisect_left(faster, True, key=lambda one: may(angle, one))
            return *faster[place : place + 1], rate

        near = [angle for angle in angles[first:] if faster and angle >= WORTH * angles[first]]
        if near:
            # A somewhat smaller angle is worth a higher rate.
            slow, fast = fastest(near[0]), fastest(near[-1])
            if fast[0] > slow[0]:
                yield next(angle for angle in near[1:] if may(angle, fast[0])), fast
            yield near[0], slow
        for angle in angles[first + bool(near) :]:
            if self.too_near((angle, rate, *limits.items())):
                break
            yield angle, fastest(angle)

    def start(self, *begin: Any) -> tuple[float, float]:
        """Return the largest of the starts, zeros where there is none."""
        angle, rates = next(self.starts(*begin), (0.0, (0.0,)))
        return angle, rates[0]

    def may_begin(self, angle: float, rate: float, limits: dict[str, float]) -> bool:
        """Return whether there is a start set, which is looked for once."""
        key = angle, rate, *limits.items()
        if key not in self.beginnings:
            shapes = [(chain.shape, chain.slow) for chain in self.begun(angle, rate, limits)]
            self.beginnings[key] = shapes, "" if shapes else self.loop.failed[POINTS]
        shapes, why = self.beginnings[key]
        if not shapes:
            self.loop.failed[POINTS] = why
        return bool(shapes)

    def kept(self, tried: Callable[..., Any], angle: float, rate: float, limits: dict[str, float]) -> bool:
        """Return whether a start is taken, and keep why it is not."""
        if tried(angle, rate, limits):
            return True
        start = f"from {degrees(angle):.3g} deg at {degrees(rate):.3g} deg/s: "
        self.larger.append((angle, rate, start + self.loop.failed[POINTS]))
        return False

    def begun(self, angle: float, rate: float, limits: dict[str, float]) -> list[Chain]:
        """Return chains from a start set; none, and the reason in `failed`, where V does not decrease on the set or the
        torque exceeds its limits there. Within limits it is one, by the first V for which neither is so."""
        loop, numbers = self.loop, self.beginning(angle, rate, limits)
        loop.failed[POINTS] = "the torque exceeds its limit" if limits else RISES
        together = [] if limits else [self.chain(lean.shape, angle, rate) for lean in self.leans]
        slow, tried = list[Chain](), 0
        for first in together or self.within(angle, rate, limits):
            # Without limits larger sets may follow, on which disturbances matter less.
            tried += 1
            if not first.decreases(noticeably=bool(limits)):
                slow.append(first)
            elif begins(loop, first.motion, numbers | first.of_level(), first.scales):
                return together or [first]
        if 0 < tried == len(slow):
            self.slow[angle, rate, *limits.items()] = slow
        return []

    def too_near(self, start: tuple[Any, ...]) -> bool:
        """Return whether larger sets may do than those of a start on which V decreases too little; asked only where no start
        does, because it takes another level of each."""
        return any(one.wants_more() for one in self.slow.get(start, ()))

    def within(self, angle: float, rate: float, limits: dict[str, float]) -> Iterator[Chain]:
        """Yield chains to try within limits: of V with the potential as it is, with bounds that motions keep although the
        set holds states beyond; and of shapes whose set demands little torque."""
        for shape in [lean.shape for lean in self.slowest if lean.shape not in self.stuck]:
            whole = self.chain(shape, angle, rate)
            if slow := slowed(whole, angle, rate, limits):
                yield self.chain(shape, angle, rate, slow)
        for shape in soft(self.sampled(self.usual[0]).motion, limits, angle, rate, self.usual):
            yield self.chain(shape, angle, rate)

    def beginning(self, angle: float, rate: float, limits: dict[str, float]) -> dict[str, Any]:
        """Return the claim's numbers of a start, without its level."""
        begin = {"start.angle": angle, "start.rate": rate} if rate > 0.0 else {"angle": angle}
        return self.numbers | limits | begin

    def chain(self, shape: Shape, angle: float, rate: float, slow: Mapping[str, float] = MappingProxyType({})) -> Chain:
        """Return a chain from the least level set of V that holds a start. slow: the numbers of a bound of the rate."""
        _, V, motion, tried = self.sampled(shape)
        bounds = {name: Fraction(x) for name, x in slow.items()}
        motion.kinetic, motion.commands = bounds.get(KINETIC), commanded(motion, bounds)
        motion.late = begun_late(motion, sin(min(angle, pi) / 2.0), rate)
        level = largest_in(motion, angle, rate)
        level += float(motion.late.weight * motion.late.begun**2) if motion.late else 0.0
        level *= 1.0 + 1e-6
        motion.late = resting(motion, level)
        return Chain(motion, V, level, tried, shape, slow=dict(slow))

    def find(self, angle: float, rate: float = 0.0, limits: dict[str, float] | None = None) -> bool:
        """Find the pointing claim of the loop, and add it. The set contains rotations of up to `angle` (rad) at up to `rate`
        (rad/s); limits: of the torque about each axis (`limit`) or its norm (`limit.norm`), or of wheels."""
        loop, limits = self.loop, limits or {}
        begin = angle, rate, limits
        if not self.may_begin(*begin):
            return False
        numbers = self.beginning(angle, rate, limits)
        begun = [self.chain(shape, angle, rate, slow) for shape, slow in self.beginnings[angle, rate, *limits.items()][0]]
        for chain in begun:
            if chain.descend() < NEARLY * chain.aim() and chain.levels:
                break
        else:
            chain = min(begun, key=lambda one: float(Fraction(one.levels[-1]["end"])) if one.levels else inf)
        if not chain.levels:
            loop.failed[POINTS] = RISES
            return False
        motion, start, scales = chain.motion, Fraction(chain.level), chain.scales
        chain, (angle, fastest) = chain.nearest()
        numbers |= chain.of_level()
        numbers["highest"] = float(start + motion.h / 2 * motion.swing(motion.tube(motion.region(start)))) * MORE
        numbers |= {"end.angle": angle, "end.rate": fastest, "settling": float(motion.h * chain.samples) * MORE}
        if not isfinite(angle) or angle > NEARER * numbers.get("angle", numbers.get("start.angle", 0.0)):
            loop.failed[POINTS] = "motions do not come near the target"
            if not chain.slow:
                return False
            # This V does not descend further from any start.
            self.stuck.add(chain.shape)
            self.beginnings.clear()
            return self.find(*begin)
        claim = self.claim(chain.V, numbers, levels=chain.levels, ellipsoids=chain.ellipsoids, **chain.response)
        return loop.try_to_show(claim, scales, self.sampled(chain.shape).motion.points)
