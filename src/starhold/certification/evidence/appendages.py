"""Finds the claim about a loop with appendages near its target: modal coordinates, and rounds of their bounds."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from fractions import Fraction
from functools import cache, cached_property
from math import cos, isfinite, radians
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.exponential import exponential
from starhold.algebra.polynomial import exact
from starhold.certification.appendages import appendages
from starhold.certification.evidence.attitude import Loop
from starhold.certification.evidence.finding import concluded, read
from starhold.certification.evidence.recorded import sign_words
from starhold.certification.evidence.responses import powers, weighed
from starhold.certification.matrices import floats
from starhold.certification.subject import above
from starhold.certification.unmodelled import pushes
from starhold.kernel.appended import Appended, Box, Column, Period, after, combined, follow, image
from starhold.kernel.loops import TOLD_TORQUE, AttitudeLoop
from starhold.kernel.numbers import WORK, RefusedError, norm
from starhold.kernel.polynomials import most, var
from starhold.kernel.theorems.appendages import FOLLOWED, KINDS, inner, responds, settled, sized
from starhold.kernel.theorems.response import MOST, PARTS, Response

APPENDED = "points with appendages"
Array = NDArray[np.float64]
TURNS = (12.0, 8.0, 5.0, 4.0, 3.0, 2.5, 2.0, 1.5, 1.2, 1.0, 0.8, 0.6, 0.5, 0.4, 0.3, 0.2, 0.15, 0.1, 0.05, 0.02, 0.01)
"""Turns (deg) at which starts are tried."""
SWUNG = 0.1
"""How far appendages may move at the start, as a share of how far the body's start moves them."""
LEAST = 1e-6
"""The least torque from outside that is allowed for, as a share of the stiffness."""
MORE, MARGIN, ROOM, TRIES, DIGITS = 1.0 + 1e-9, 1.001, 1.01, 30, 26
"""The margins of numbers, of bounds and of boxes; how often a box is widened; binary digits of modal coordinates."""
FIRST = (1, 1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024)
"""The periods of the first rounds."""
MOST_ROUNDS, NEARER, SHRUNK, STILL, LONGEST, LEFT, SHARE = 24, 0.95, 0.25, 0.98, 2**22, 1e-3, 27
"""The most rounds; how much nearer each later one must lead; the share of bounds that is to be left before it; the ratio at
which they hardly shrink; the most periods until then; the share of a response that is left as it ends; and the work of a
check per sample of a response for n states, n (n + 12), where samples take a fifth of it."""
Found: TypeAlias = "tuple[dict[str, Any], list[Round], Column, Period]"
"""The numbers of a start, rounds, bounds of samples as the last begins, and its period."""


def find_appended(loop: Loop) -> bool:
    """Find the pointing bound of a loop with appendages, from the largest start near its target at which the torque keeps
    its limits."""
    if not appendages(loop.loop):
        return False
    try:
        with np.errstate(all="ignore"):
            return Swinging(loop).find()
    except (RefusedError, ArithmeticError, ValueError, np.linalg.LinAlgError) as reason:
        loop.failed[APPENDED] = str(reason)
    return False


class Round(NamedTuple):
    """Bounds of states and of the torque between samples, of modes at samples, and the periods until the next round."""

    state: Column
    torque: Column
    radii: Column
    periods: int = 0

    @property
    def written(self) -> dict[str, Any]:
        """Return it as evidence."""
        names = ("sizes", "torques", "radii")
        return {name: list(map(str, part)) for name, part in zip(names, self[:3], strict=True)} | {"periods": self.periods}


class Swinging:
    """A loop with appendages, and its motion in modal coordinates. RefusedError for one outside the theorem."""

    def __init__(self, loop: Loop) -> None:
        self.loop, words = loop, sign_words(loop.loop)
        if loop.known.moving:
            raise RefusedError("the target moves")
        if any(loop.known.modelled) and loop.is_told(TOLD_TORQUE):
            raise RefusedError("the law is told a torque from outside")
        if any(f.part.flag("ACTS") for f in loop.loop.used("effector")):
            raise RefusedError("an effector takes the command")
        against = pushes(loop.loop, loop.known.envelope(False)).steady
        outside = float(exact(against.outside) + exact(above(loop.known.modelled_norm)) + exact(loop.known.disturbance))
        self.numbers: dict[str, Any] = {"period": loop.loop.period}
        self.numbers |= {name: x for name, x in against.numbers.items() if x or name in ("outside", "error")}
        self.words, self.limits = words, {k: x for k, x in loop.limits.items() if k.startswith("limit")}
        motion = self.read(None)
        K = floats(motion.K)[:, 3:6]
        stiffness = float(np.trace(K)) / 3.0
        if not stiffness > 0.0:
            raise RefusedError("the law does not rotate the body to its target")
        self.numbers["outside"] = max(above(exact(outside)), LEAST * stiffness)
        if not all(map(isfinite, self.numbers.values())):
            raise RefusedError("what acts on the loop has no bound")
        self.V, self.stiffness = loop.lyapunov(stiffness), stiffness
        self.motion = self.read(self.V)
        self.modes, self.blocks = modes_of(self.motion)
        self.motion.take([[Fraction(x) for x in row] for row in self.modes], self.blocks)

    def read(self, V: str | None, **numbers: Any) -> Appended:
        """Return the loop of a claim."""
        claim = self.loop.claim(APPENDED, self.words, V, **self.numbers, **numbers)
        return Appended(AttitudeLoop(read(claim, self.loop.by_digest)))

    def find(self) -> bool:
        """Find the claim from the largest start, and add it."""
        kept = cache(self.from_turn)
        place = bisect_left(TURNS, True, key=lambda turn: kept(turn) is not None)
        bounded = kept(TURNS[place]) if place < len(TURNS) else None
        if bounded is None:
            self.loop.failed[APPENDED] = "no bounds near the target were found that motions keep"
            return False
        numbers, rounds, begun, period = bounded
        end = self.end(rounds[-1], period)
        while len(rounds) < MOST_ROUNDS:
            one, (begun, periods) = rounds[-1], self.lasting(period, begun)
            begun = list(map(min, begun, one.radii))
            another = self.round(begun, 0, period)
            later = another and self.end(*another)
            if another is None or later is None or not later[1] < NEARER * end[1]:
                break
            rounds, period, end = [*rounds[:-1], one._replace(periods=periods), another[0]], another[1], later
        return self.show(numbers, rounds, *end)

    @cached_property
    def response(self) -> tuple[dict[str, Any], Response] | None:
        """Return the evidence about the response, and what it shows; None if it lasts too long."""
        A, ways = floats(self.motion.sampled), list(map(floats, self.motion.ways))
        # So that the whole claim is checked within the work that it may take.
        most = min(MOST, WORK // (SHARE * self.motion.n * (self.motion.n + 12)))
        rows = powers(np.vstack([np.eye(self.motion.n)[:6], floats(self.motion.pull)]), A, most)
        sizes = np.abs(rows[:, :6]).max(axis=2)
        (gone,) = np.nonzero((sizes < LEFT * sizes.max(axis=0)).all(axis=1))
        if not len(gone):
            return None
        evidence = weighed(rows[: gone[0]], PARTS, ways, KINDS)
        return evidence, concluded(responds(self.motion, *evidence.values()))

    def end(self, one: Round, period: Period) -> tuple[Fraction, Fraction, int]:
        """Return bounds of |w| and |q| from so many samples of the last round on."""
        if self.response is None:
            return norm(one.state[:3]), norm(one.state[3:6]), 0
        box = Box(one.state, one.torque, combined(one.state, self.motion.misread))
        return *settled(self.motion, self.response[1], period, box, one.radii), self.response[1].count

    def show(self, numbers: dict[str, Any], rounds: list[Round], wide: Fraction, turned: Fraction, last: int) -> bool:
        """Add the claim with its evidence, and with bounds of |w| and |q| from so many samples of the last round on."""
        loop = self.loop
        half = float(turned) * MORE
        for _ in range(60):
            half = float(turned) * MORE + half**3 / 6.0
        form = loop.form(self.V).at({"q0": 1 - var("v")})
        numbers = self.numbers | numbers
        highest = max(float(most(form, sized(one.state))) for one in rounds)
        samples = sum(one.periods for one in rounds) + last
        numbers |= {"highest": highest * MORE, "settling": float(self.motion.h * samples) * MORE}
        numbers |= {"end.angle": 2.0 * half * MORE, "end.rate": float(wide) * MORE}
        claim = loop.claim(APPENDED, self.words, self.V, **numbers)
        claim["evidence"] = {"modes": exactly(self.modes), "blocks": self.blocks, "rounds": [one.written for one in rounds]}
        claim["evidence"] |= {"response": self.response[0]} if self.response else {}
        return loop.try_to_show(claim, {f"q{k}": numbers["angle"] / 2.0 for k in (1, 2, 3)})

    def from_turn(self, turn: float) -> Found | None:
        """Return the rounds from a start that holds rest at this turn (deg); None where none were found."""
        angle = radians(turn)
        level = 4.0 * self.stiffness * (1.0 - cos(angle / 2.0)) * (1.0 + 1e-6)
        X = inner(self.motion.loop, Fraction(level))
        moved = image(self.motion.start, self.motion.begun(X, [Fraction(0)] * self.motion.count))[6:]
        swung = [float(f"{SWUNG * float(x):.4g}") for x in moved]
        begun, rounds, bounded = self.motion.begun(X, list(map(Fraction, swung))), list[Round](), None
        for periods in FIRST:
            bounded = self.round(begun, periods, bounded and bounded[1])
            if bounded is None or not self.keeps_limits(*bounded):
                return None
            rounds, begun = [*rounds, bounded[0]], follow(bounded[1], begun, periods)[1]
        if bounded is None or (bounded := self.round(begun, 0, bounded[1])) is None:
            return None
        rounds, period = [*rounds, bounded[0]], bounded[1]
        numbers = {"level": level, "angle": angle} | self.limits
        return numbers | {f"begun.{k}": x for k, x in enumerate(swung)}, rounds, begun, period

    def keeps_limits(self, one: Round, period: Period) -> bool:
        """Return whether the law asks for no more than its limits."""
        commanded = combined(image(period.torque, one.radii), period.commanded)
        sizes = {"limit": max(commanded), "limit.norm": norm(commanded)}
        return all(float(sizes[name]) < x for name, x in self.limits.items())

    def round(self, begun: Column, periods: int, like: Period | None) -> tuple[Round, Period] | None:
        """Return bounds for so many periods (0: for ever) of motions that begin within bounds, and what follows from them;
        None where none were found. like: the period of an earlier round."""
        motion, radii = self.motion, [float(x) * MARGIN for x in begun]
        reached = self.reached(radii, like)
        for _ in range(TRIES):
            # No entry may be zero.
            state, torque = ([Fraction(float(x) * ROOM + 1e-9 * float(max(part))) for x in part] for part in reached)
            try:
                period = motion.period(Box(state, torque, combined(state, motion.misread)))
            except RefusedError:
                return None
            kept = kept_for(periods, *(np.array(x, dtype=np.float64) for x in (period.grown, period.more, begun)))
            if kept is None:
                return None
            reached = self.reached(kept, period)
            if all(x < y for new, old in zip(reached, (state, torque), strict=True) for x, y in zip(new, old, strict=True)):
                return Round(state, torque, list(map(Fraction, kept)), periods), period
            radii = [max(x, y) for x, y in zip(kept, radii, strict=True)]
        return None

    def lasting(self, period: Period, begun: Column) -> tuple[Column, int]:
        """Return bounds after the periods in which states or turns become much smaller, or shrink no further, and the number
        of these."""
        periods, last, (far, turned) = FOLLOWED, 1.0, self.extent(begun)
        while True:
            later = after(period, begun, periods)
            share = min(float(new / old) for new, old in zip(self.extent(later), (far, turned), strict=True))
            if share < SHRUNK or periods >= LONGEST or last > share > STILL * last:
                return later, periods
            periods, last = 2 * periods, share

    def extent(self, radii: Column) -> tuple[Fraction, Fraction]:
        """Return bounds of states, and of turns among them."""
        state = image(self.motion.start, radii)
        return norm(state), norm(state[3:6])

    def reached(self, radii: Sequence[float], period: Period | None) -> tuple[Column, Column]:
        """Return how large states and torques become with these bounds of samples."""
        r = list(map(Fraction, radii))
        if period is None:
            outside = [Fraction(self.numbers["outside"])] * 3
            return image(self.motion.spans, r), combined(image(self.motion.feedback, r), outside)
        return combined(image(period.between, r), period.far), combined(image(period.torque, r), period.pushed)


def modes_of(motion: Appended) -> tuple[Array, list[int]]:
    """Return modal coordinates of the linear motion from sample to sample, short ones, and the sizes of their blocks."""
    A, B, K = map(floats, (motion.A, motion.B, motion.K))
    n, h = motion.n, float(motion.h)
    moved = exponential(np.block([[A, B], [np.zeros((3, n + 3))]]) * h)
    values, vectors = np.linalg.eig(moved[:n, :n] - moved[:n, n:] @ K)
    if not np.abs(values).max() < 1.0:
        raise RefusedError("the linear loop with its appendages is not stable")
    columns, blocks = list[Array](), list[int]()
    for value, vector in sorted(zip(values, vectors.T, strict=True), key=lambda pair: -abs(pair[0])):
        if value.imag >= 0.0:
            pair = [vector.real, vector.imag] if value.imag > 0.0 else [vector.real]
            columns += pair
            blocks.append(len(pair))
    inverse = np.linalg.inv(np.array(columns, dtype=np.float64).T)
    # The rows of a block have one scale.
    sizes = np.repeat([np.abs(part).max() for part in np.split(inverse, np.cumsum(blocks)[:-1])], blocks)
    scale: Array = 2.0 ** np.ceil(np.log2(sizes[:, None]))
    rows: Array = np.round(inverse / scale * 2.0**DIGITS) / 2.0**DIGITS
    return rows, blocks


def kept_for(periods: int, grown: Array, more: Array, begun: Array) -> list[float] | None:
    """Return slightly more than the least bounds, over so many periods (0: for ever) of r+ <= grown r + more, of what begins
    within bounds; None where there are none."""
    most = begun
    if periods:
        for _ in range(periods - 1):
            begun = grown @ begun + more
            most = np.maximum(most, begun)
        return [float(x) for x in most * MARGIN] if most.max() < 1.0 else None
    gap = 1.0 - float(np.abs(np.linalg.eigvals(grown)).max())
    if gap <= 0.0:
        return None
    more = more * MARGIN + 1e-9 * gap * begun.max()
    least, free = begun * MARGIN, np.zeros(len(begun), dtype=bool)
    kept = least
    # Those that grow are the solution of r = grown r + more.
    while (grows := ~free & (grown @ kept + more > kept * (1.0 - 1e-13))).any():
        free |= grows
        kept = least.copy()
        rest = grown[np.ix_(free, ~free)] @ least[~free] + more[free]
        kept[free] = np.linalg.solve(np.eye(free.sum()) - grown[np.ix_(free, free)], rest)
    return [float(x) for x in kept * (1.0 + 1e-12)]


def exactly(rows: Array) -> list[list[str]]:
    """Return a matrix as evidence."""
    return [[str(Fraction(float(x))) for x in row] for row in rows]
