"""A loop in which something comes late: the torque that the law asks for, or the attitude or the rate that it is told.
Docs/kernel.md, section 10."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import NamedTuple

from .near import Near
from .numbers import Rows, beside, demand, norm, plus, reach, root, scalar, shortened, times, transpose, up
from .polynomials import Poly, apply, minus, most, var
from .reader import Reader
from .reading import Numbers
from .regions import (
    ANGLE,
    AT_REST,
    RATE,
    SPEED,
    STATE,
    TURN,
    Behind,
    Radii,
    Sizes,
    Tube,
    as_told,
    felt,
    stretch,
    with_momentum,
)
from .sentences import below

ZERO = Fraction(0)
SPENT, SPARE = Fraction(1, 4), Fraction(1, 8)
"""The share of what is forgotten that pays for the work of what is late, and that which does for nothing."""
PLACES, ROUNDS = 80, 40
"""Binary places of the part of what is late that is linear in the state, and how often it is made more exact."""
KINDS = "torque", "attitude", "rate"
WITHIN = "late.torque.most"
"""How far the torque that acts may be off, of one that follows otherwise beyond."""


@dataclass(frozen=True)
class Late:
    """Something that is late, of which |e| is how far it is off: at most kept |e| + how much it changes a period later. In a
    period the torque is off by at most mean |e|, in the mean, for each unit of what is late; by no more than |e| if that is
    larger. |e| <= a + b, with sets of V + the sum of weight a^2; in the beginning |e| <= begun, and b <= rest."""

    kind: str
    kept: Fraction
    mean: Fraction
    weight: Fraction
    begun: Fraction
    rest: Fraction

    @property
    def sizes(self) -> tuple[str, str]:
        """The names of a and b among sizes."""
        return f"|late {self.kind}", f"|late {self.kind} rest"

    @property
    def most(self) -> Fraction:
        """By how much of |e| the torque is off at any time."""
        return max(Fraction(1), self.mean)

    def in_words(self, unit: str) -> str:
        """Return how late it is, in words."""
        share = f"{below(self.mean)} times that in the mean"
        return f"off by up to {below(self.begun)} {unit} at first, {share} and {below(self.kept)} times that after a period"

    @property
    def ends(self) -> tuple[Fraction, Fraction]:
        """Torques that are held and do no less at the beginning and at the end of a period, for |e| = 1."""
        return min(2 * self.mean, self.most), self.mean

    @property
    def moved(self) -> Fraction:
        """One that is held moves the rates evenly, and does no less through them, for |e| = 1."""
        return min(3 * self.mean, self.most)


@dataclass(frozen=True)
class Change:
    """How much something that is late changes in a period: |Mx| + rest; what is kept of |e|, with what it does to that
    itself; and by how much the torque is off for each unit of e. So a becomes kept a + |Mx|, and b kept b + rest."""

    late: Late
    M: Rows
    rest: Fraction
    kept: Fraction
    share: Fraction

    def settled(self, tube: Tube, whole: bool, leant: Radii = AT_REST) -> Fraction:
        """Return what b comes down to in a tube's region, or a + b."""
        demand(self.kept < 1, "what is late is not forgotten")
        if not whole:
            return up(self.rest / (1 - self.kept))
        return up((reached(self.M, tube, leant) + self.rest) / (1 - self.kept))


@dataclass(frozen=True)
class Steady:
    """A torque that is late by e = f - Sx: f becomes kept f + |Mx| and what else changes, of which what is not linear in w
    and q counts `off` times."""

    S: Rows
    M: Rows
    off: list[Fraction]
    kept: Fraction


class Costs(NamedTuple):
    """The costs of a torque that is late: what it does to V in a period, for each unit of its mean, of that which moves the
    rates, and of the product of both; works: `more` times its mean |Fx|, with F for how far its mean moves the rates, by
    `far` for each unit of what moves them."""

    mean: Fraction
    moved: Fraction
    both: Fraction
    far: Fraction
    works: Callable[[Fraction], Rows]
    more: Fraction


class Follower(Reader):
    """A loop in which something comes late."""

    near: Near
    h: Fraction
    light: Fraction
    widths: list[Fraction]
    pull: list[Poly]
    bend: list[Poly]
    speeding: list[Poly]
    slow: list[Poly]
    soft: Fraction
    leant: Radii
    lates: list[Late]

    def follow(self, numbers: Numbers) -> list[Late]:
        """Read what comes late."""
        names = ("kept", "mean", "weight", "begun", "rest")
        lates = [
            Late(kind, *(numbers[f"late.{kind}.{name}"] for name in names))
            for kind in KINDS
            if f"late.{kind}.mean" in numbers
        ]
        demand(all(one.kept < 1 and min(one.weight, one.mean) > 0 for one in lates), "what is late never comes")
        self.step = plus(self.near.A, scalar(1, 6), -1)
        self.demanded = times(self.near.torque, self.step)
        least = [numbers.get(f"late.torque.{name}.least") for name in ("kept", "mean")] if lates else []
        self.steady: Steady | None = None
        if least and least[0] is not None and least[1] is not None:
            late = lates[0]
            demand(least[0] <= late.kept and least[1] <= late.mean, "a torque is late otherwise than it is")
            self.near, self.steady = steadied(self.near, self.h, late.kept, late.mean)
            self.inexact = late.kept - least[0], late.mean - least[1]
            self.alike = least[1], least[0]
        # What the law's torque has beside that near its target.
        spun = [with_momentum(p - g) for p, g in zip(self.pull, self.bend, strict=True)] if lates else []
        self.gyrating = spun, minus(self.speeding, spun) if lates else []
        self.beyond: list[Poly] = minus(self.loop.u, apply(self.near.torque, [var(name) for name in STATE])) if lates else []
        return lates

    def steady_part(self, tube: Tube) -> Fraction:
        """Return how large the part of e is at most that is linear in the state."""
        return reached(self.steady.S, tube, self.leant) if self.steady else ZERO

    def of_level(self, c: Fraction) -> Sizes:
        """Return how far off what is late is where V + the sum of weight a^2 is no more than c."""
        sizes = ((late.sizes, (root(up(c / late.weight)), late.rest)) for late in self.lates)
        return {name: x for names, values in sizes for name, x in zip(names, values, strict=True)}

    def share(self, late: Late, known: Sizes) -> Fraction:
        """Return by how much the torque is off for each unit of what is late, of a law that is told what has these sizes."""
        u, r, a = self.loop.u, self.size("r"), self.size("a")
        if late.kind == "torque":
            return Fraction(1)
        if late.kind == "rate":
            return felt(u, "w", known) + felt(u, "h", known) * stretch(self.loop.given)
        turned = (felt(u, "w", known) + felt(u, "r", known)) * r + felt(u, "a", known) * a
        turned += felt(u, "e", known) * self.change[1] if self.change else ZERO
        return felt(u, "q", known) + 2 * turned

    def behind(self, sizes: Sizes, kinds: tuple[str, ...] = KINDS, rest: bool = False) -> Behind:
        """Return by how much the torque is off at most, by all that is late, or by the b of it."""
        known, sums = as_told(self.lately(sizes), self.wrong), [ZERO] * 3
        for one in self.lates:
            size = self.share(one, known) * sum(sizes[x] for x in one.sizes[rest:]) * (one.kind in kinds)
            sums = [x + y * size for x, y in zip(sums, (one.most, one.mean, one.moved), strict=True)]
        return Behind(*sums)

    def changes_in(self, tube: Tube, whole: bool = False) -> list[Change]:
        """Return how much in a period changes that is late; whole: of e in place of its parts a and b, of a torque of what e
        has beside its part that is linear in the state."""
        if not self.lates:
            return []
        sizes, h, u, least = tube.sizes, self.h, self.loop.u, tube.region.least
        near, known = tube.region.sizes | {"v": 1 - least}, as_told(self.lately(sizes), self.wrong)
        (wide, turn), (bent, curved) = (
            (stretch([row[part] for row in self.near.torque]) for part in (RATE, TURN)),
            (felt(self.beyond, letter, sizes) for letter in "wq"),
        )
        # The rates change by what is linear in the state and in the rate, with momentum; by what is not; by what is late;
        # and by how that changes the gyroscopic acceleration.
        spun, left = self.gyrating
        (Aw, Aq), w, gyrating = (
            (self.step[RATE], self.step[TURN]),
            beside(scalar(1), scalar(0))[:3],
            h * felt(spun, "w", near),
        )
        drift = h * norm(most(p, near) + tube.push * n for p, n in zip(left, self.widths, strict=True))
        demand((back := h * stretch(tube.bent)) < 1, "the period is too long for the rates")
        more = 1 / (1 - back)
        aside = h / 2 * sizes[SPEED] * root(2 * (1 - least + tube.turned))
        pushed, error = self.pushed(sizes), self.misread(tube.region)[0]
        beside_law = 2 * (error + pushed["both"] - pushed["outside"] + self.stale(sizes, u))
        ahead, lates = h * self.light, list[Change]()
        for late in self.lates:
            # How much it changes with how far rates and turn are from where they go linearly, and with where they go.
            off, by, turned, rows = {
                "torque": (
                    wide + (turn + curved) * h / 2,
                    bent,
                    turn + curved,
                    [(Fraction(1), self.demanded), (curved, Aq)],
                ),
                "attitude": (h / 2, ZERO, Fraction(1), [(Fraction(1), Aq)]),
                "rate": (ZERO, Fraction(1), ZERO, []),
            }[late.kind]
            kept, steady = late.kept, self.steady if whole and late.kind == "torque" else None
            if steady:
                off, turned = steady.off[0] + (steady.off[1] + curved) * h / 2, steady.off[1] + curved
                rows[0] = Fraction(1), steady.M
            grown = off * back * more + by * more
            share = self.share(late, known)
            alone = share * late.most * sum(sizes[x] for x in late.sizes)
            # What is late beside the torque is in what is asked for.
            rest = {
                "torque": beside_law + 2 * (tube.late.most - alone),
                "attitude": h / 2 * self.size("r"),
                "rate": 2 * self.changes(sizes)["r"],
            }[late.kind]
            rest += (off + grown) * drift + turned * aside
            behind = (off + grown) * ahead
            if steady:
                # The linear part of the motion has what e does to it, up to what is not known of that.
                e = tube.late
                rest += self.inexact[0] * e.most + (off * self.inexact[1] + grown * late.mean) * ahead * e.most
                # What is curved is not in that part at all: e turns the body by up to h^2 / 2.
                rest += (steady.off[1] + 4 * curved) * h * ahead / 8 * late.mean * e.most
                # It is linear in x less where the slow torque holds the body, which moves by twice what it does in the mean.
                rest += stretch([row[TURN] for row in steady.S]) * 2 * self.soft * self.stale(sizes, self.slow)
                kept, behind = steady.kept, ZERO
            M = together([*rows, (grown, Aw), ((off + grown) * gyrating, w)], [near[x] for x in STATE])
            lates.append(Change(late, M, rest, kept + behind * share * late.mean, share))
        return lates

    def ends(self, tube: Tube) -> tuple[list[Fraction], Fraction]:
        """Return torques at the beginning and at the end of a period, and a turn, that do no less near the target than what
        is late."""
        sizes, torques, along = tube.region.sizes, [ZERO, ZERO], ZERO
        known = as_told(self.lately(sizes), self.wrong)
        for one in self.lates:
            share, (linear, rest) = self.share(one, known), (sizes[x] for x in one.sizes)
            at_ends = one.ends
            if one.kind == "torque" and self.steady:
                # Its linear part is in the motion, but for how early it acts; of the rest that alone is not known.
                along += self.h * self.h * self.light / 8 * one.mean * (linear + rest)
                torques = [x + self.inexact[1] * linear for x in torques]
                linear, at_ends = ZERO, (one.mean * 3 / 2, one.mean / 2)
            torques = [x + share * (linear + rest) * y for x, y in zip(torques, at_ends, strict=True)]
        return torques, along

    def paid(self, lates: list[Change], form: Rows, costs: Costs) -> tuple[Rows, Fraction, Fraction]:
        """Return what is left of a form where the fall of weight a^2 pays for what is late, what beside that adds to V, and
        the share of the sum that is to spare."""
        rest, spare = ZERO, Fraction(1)
        for one in lates:
            late, forgotten = one.late, 1 - one.kept
            demand(forgotten > 0, "what is late is not forgotten")
            falls, rises, torque = (
                late.weight * forgotten / self.h,
                late.weight / (self.h * forgotten),
                one.share * late.mean,
            )
            F = costs.works(costs.far * late.moved / late.mean)
            form = plus(form, times(transpose(F), F), -((torque * costs.more) ** 2) / (4 * SPENT * falls))
            form = plus(form, times(transpose(one.M), one.M), -rises)
            left = (1 - SPENT - SPARE) * falls - 3 * len(lates) * torque * torque * costs.both
            demand(left > 0, "what is late does too much to itself")
            rest += (torque * costs.mean + one.share * late.moved * costs.moved) ** 2 / (4 * left)
            spare = min(spare, SPARE * forgotten)
        return form, rest, spare


def together(parts: list[tuple[Fraction, Rows]], sizes: Sequence[Fraction]) -> Rows:
    """Return a matrix that makes a state no shorter than the sum of c |Rx|, best where |x_i| is of these sizes: its square
    is no more than the sum of (c |Rx|)^2 / s, with shares s that are 1 together."""
    weights = [c * norm(reach(R, sizes)) for c, R in parts]
    return [
        [c * root(sum(weights, ZERO) / weight) * x for x in row]
        for (c, R), weight in zip(parts, weights, strict=True)
        if weight
        for row in R
    ]


def steadied(near: Near, h: Fraction, kept: Fraction, mean: Fraction) -> tuple[Near, Steady]:
    """Return the linear motion near the target with the part of e in it that is linear in the state, of a torque that nears
    what is asked for alike in all components; and what is left of e."""
    T, begun = near.torque, plus(near.A, scalar(1, 6), -1)
    by = [[c * x for x in row] for c in (h * mean, 3 * h * h / 8 * mean) for row in near.inverse]
    part, step, left = [[ZERO] * 6] * 3, begun, times(T, begun)
    for _ in range(ROUNDS):
        # Towards an S with which M vanishes, as it does of a motion in which e follows the state.
        part = shortened(plus(part, [[x / (1 - kept) for x in row] for row in left], -1), PLACES)
        step = plus(begun, times(by, part), -1)
        left = plus([[(1 - kept) * x for x in row] for row in part], times(plus(part, T, -1), step))
    beyond = plus(part, T, -1)
    off = [stretch([row[part] for row in beyond]) for part in (RATE, TURN)]
    return near._replace(A=plus(step, scalar(1, 6))), Steady(part, left, off, kept + stretch(times(beyond, by)))


def reached(M: Rows, tube: Tube, leant: Radii) -> Fraction:
    """Return a bound of |Mx| in a tube's region, and where x is no further from it than told."""
    sizes, X = tube.region.sizes, tube.region.X
    # In three rows each: no eigenvalue of MXM' exceeds the largest sum of a row.
    grams = (times(times(rows, X), transpose(rows)) for rows in (M[k : k + 3] for k in range(0, len(M), 3)))
    by_ellipsoid = root(sum((max(sum(map(abs, row), ZERO) for row in gram) for gram in grams), ZERO))
    parts = [stretch([row[k] for row in M]) for k in (RATE, TURN)]
    by_sizes = sum((part * sizes[x] for part, x in zip(parts, (SPEED, ANGLE), strict=True)), ZERO)
    return min(by_ellipsoid, by_sizes) + sum((part * x for part, x in zip(parts, leant, strict=True)), ZERO)
