"""A loop in which the torque that acts comes later than the law asks for it. Docs/kernel.md, section 10."""

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
from .regions import ANGLE, AT_REST, RATE, SPEED, STATE, TURN, Behind, Radii, Sizes, Tube, felt, stretch, with_momentum
from .sentences import below

ZERO = Fraction(0)
FIRST, REST = "|e", "|e rest"
"""Under which the sizes have those of a and b, into which e is divided of a torque that is late."""
SPENT, SPARE = Fraction(1, 4), Fraction(1, 8)
"""The share of what is forgotten that pays for the work of what is late, and that which does for nothing."""
PLACES, ROUNDS = 80, 40
"""Binary places of the part of what is late that is linear in the state, and how often it is made more exact."""
LATE = "late.torque."
"""How the names of its numbers begin."""
WITHIN = f"{LATE}most"
"""How far the torque that acts may be off, of one that follows otherwise beyond."""


@dataclass(frozen=True)
class Late:
    """A torque that is late, off by e: |e| is at most kept |e| + how much what is asked for changes, a period later. In the
    mean of a period it is off by at most mean |e|. |e| <= a + b, with sets of V + weight a^2; in the beginning |e| <= begun,
    and b <= rest."""

    kept: Fraction
    mean: Fraction
    weight: Fraction
    begun: Fraction
    rest: Fraction

    @property
    def in_words(self) -> str:
        """How late it is, in words."""
        share = f"{below(self.mean)} times that in the mean"
        return f"off by up to {below(self.begun)} N m at first, {share} and {below(self.kept)} times that after a period"

    @property
    def ends(self) -> tuple[Fraction, Fraction]:
        """Torques that are held and do no less at the beginning and at the end of a period, for |e| = 1."""
        return min(2 * self.mean, Fraction(1)), self.mean

    @property
    def moved(self) -> Fraction:
        """One that is held moves the rates evenly, and does no less through them, for |e| = 1."""
        return min(3 * self.mean, Fraction(1))


@dataclass(frozen=True)
class Change:
    """How much a torque that is late changes in a period: |Mx| + rest; and what is kept of |e|, with what it does to that
    itself. So a becomes kept a + |Mx|, and b kept b + rest."""

    M: Rows
    rest: Fraction
    kept: Fraction

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
    """A loop in which the torque may come late."""

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
    late: Late | None

    def follow(self, numbers: Numbers) -> Late | None:
        """Read how late the torque is, if it is."""
        self.steady: Steady | None = None
        if f"{LATE}mean" not in numbers:
            return None
        late = Late(*(numbers[LATE + name] for name in ("kept", "mean", "weight", "begun", "rest")))
        demand(late.kept < 1 and 0 < late.mean <= 1 and late.weight > 0, "what is late never comes")
        self.step = plus(self.near.A, scalar(1, 6), -1)
        self.demanded = times(self.near.torque, self.step)
        kept, mean = (numbers.get(f"{LATE}{name}.least") for name in ("kept", "mean"))
        if kept is not None and mean is not None:
            demand(kept <= late.kept and mean <= late.mean, "a torque is late otherwise than it is")
            self.near, self.steady = steadied(self.near, self.h, late.kept, late.mean)
            self.inexact = late.kept - kept, late.mean - mean
            self.alike = mean, kept
        # What the law's torque has beside that near its target.
        spun = [with_momentum(p - g) for p, g in zip(self.pull, self.bend, strict=True)]
        self.gyrating = spun, minus(self.speeding, spun)
        self.beyond: list[Poly] = minus(self.loop.u, apply(self.near.torque, [var(name) for name in STATE]))
        return late

    def steady_part(self, tube: Tube) -> Fraction:
        """Return how large the part of e is at most that is linear in the state."""
        return reached(self.steady.S, tube, self.leant) if self.steady else ZERO

    def of_level(self, c: Fraction) -> Sizes:
        """Return how far off the torque is where V + weight a^2 is no more than c."""
        return {FIRST: root(up(c / self.late.weight)), REST: self.late.rest} if self.late else {}

    def behind(self, sizes: Sizes, rest: bool = False) -> Behind:
        """Return by how much the torque is off at most as it is late, or by the b of it."""
        if self.late is None:
            return Behind(ZERO, ZERO, ZERO)
        size = sizes[REST] if rest else sizes[FIRST] + sizes[REST]
        return Behind(size, self.late.mean * size, self.late.moved * size)

    def change_in(self, tube: Tube, whole: bool = False) -> Change | None:
        """Return how much e changes in a period; whole: of e in place of a and b, less what is linear in the state."""
        if (late := self.late) is None:
            return None
        sizes, h, u, least = tube.sizes, self.h, self.loop.u, tube.region.least
        near, steady = tube.region.sizes | {"v": 1 - least}, self.steady if whole else None
        bent, curved = (felt(self.beyond, letter, sizes) for letter in "wq")
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
        ahead = h * self.light
        # How much it changes with how far rates and turn are from where they go linearly, and with where they go.
        linear, turn = steady.off if steady else [stretch([row[part] for row in self.near.torque]) for part in (RATE, TURN)]
        turned = turn + curved
        off = linear + turned * h / 2
        grown = off * back * more + bent * more
        rest = 2 * (error + pushed["both"] - pushed["outside"] + self.stale(sizes, u))
        rest += (off + grown) * drift + turned * aside
        kept, behind = late.kept, (off + grown) * ahead
        if steady:
            # The linear part of the motion has what e does to it, up to what is not known of that.
            e = tube.late.most
            rest += self.inexact[0] * e + (off * self.inexact[1] + grown * late.mean) * ahead * e
            # What is curved is not in that part at all: e turns the body by up to h^2 / 2.
            rest += (turn + 4 * curved) * h * ahead / 8 * late.mean * e
            # It is linear in x less where the slow torque holds the body, which moves by twice what it does in the mean.
            rest += stretch([row[TURN] for row in steady.S]) * 2 * self.soft * self.stale(sizes, self.slow)
            kept, behind = steady.kept, ZERO
        rows = [(Fraction(1), steady.M if steady else self.demanded), (curved, Aq)]
        M = together([*rows, (grown, Aw), ((off + grown) * gyrating, w)], [near[x] for x in STATE])
        return Change(M, rest, kept + behind * late.mean)

    def ends(self, tube: Tube) -> tuple[list[Fraction], Fraction]:
        """Return torques at the beginning and at the end of a period, and a turn, that do no less near the target than a
        torque that is late."""
        if (late := self.late) is None:
            return [ZERO, ZERO], ZERO
        linear, rest = (tube.region.sizes[x] for x in (FIRST, REST))
        if not self.steady:
            return [(linear + rest) * x for x in late.ends], ZERO
        # Its linear part is in the motion, but for how early it acts; of the rest that alone is not known.
        along = self.h * self.h * self.light / 8 * late.mean * (linear + rest)
        return [self.inexact[1] * linear + rest * late.mean * x for x in (Fraction(3, 2), Fraction(1, 2))], along

    def paid(self, late: Late, change: Change, form: Rows, costs: Costs) -> tuple[Rows, Fraction, Fraction]:
        """Return what is left of a form where the fall of weight a^2 pays for what is late, what beside that adds to V, and
        the share of the sum that is to spare."""
        forgotten = 1 - change.kept
        demand(forgotten > 0, "what is late is not forgotten")
        falls, rises = late.weight * forgotten / self.h, late.weight / (self.h * forgotten)
        F = costs.works(costs.far * late.moved / late.mean)
        form = plus(form, times(transpose(F), F), -((late.mean * costs.more) ** 2) / (4 * SPENT * falls))
        form = plus(form, times(transpose(change.M), change.M), -rises)
        left = (1 - SPENT - SPARE) * falls - 3 * late.mean * late.mean * costs.both
        demand(left > 0, "what is late does too much to itself")
        return form, (late.mean * costs.mean + late.moved * costs.moved) ** 2 / (4 * left), SPARE * forgotten


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
