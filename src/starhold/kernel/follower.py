"""A loop whose applied torque lags the command. Docs/kernel.md, section 10."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import NamedTuple

from .loops import AXES
from .near import Near
from .numbers import Rows, added, beside, demand, norm, plus, reach, root, scalar, times, transpose, up
from .polynomials import Poly, apply, minus, most, var
from .reader import Reader
from .reading import Numbers
from .regions import (
    AMISS,
    ANGLE,
    AT_REST,
    COMMANDED,
    PULL,
    RATE,
    SPEED,
    STATE,
    TURN,
    Behind,
    Radii,
    Region,
    Sizes,
    Tube,
    felt,
    stretch,
    widened,
    with_momentum,
)
from .sentences import above, below

ZERO = Fraction(0)
FIRST, REST = "|e", "|e rest"
"""The names of the sizes of a and b, the two parts of a late torque's error e."""
SPENT, SPARE = Fraction(1, 4), Fraction(1, 8)
"""The share of the decay of weight a^2 that pays for the work of the late torque, and the share that is held in reserve."""
LATE = "late.torque."
"""The prefix of its numbers' names."""
KNOWN = "kept", "mean", "moment"
"""The numbers of a torque whose components all approach the command alike: the share of its error that is left at the end of
a period, in its mean, and in the mean weighted by the remaining time."""
WITHIN = f"{LATE}most"
"""The largest error of the applied torque for which its numbers hold."""


@dataclass(frozen=True)
class Late:
    """A torque that lags the command, with an error e: a period later |e| is at most kept |e| plus the change of the
    command, and in the mean of a period it is at most mean |e|. |e| <= a + b, with sets of V + weight a^2; at the start |e|
    <= begun and b <= rest."""

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
        """Held torques, at the beginning and at the end of a period, with at least its effect for |e| = 1."""
        return min(2 * self.mean, Fraction(1)), self.mean

    @property
    def moved(self) -> Fraction:
        """The held torque that moves the rates evenly and has at least its effect through them, for |e| = 1."""
        return min(3 * self.mean, Fraction(1))


@dataclass(frozen=True)
class Change:
    """The change of a late torque's error in a period: |Mx| + rest, and the share `kept` of |e|, including its effect on
    itself. So a becomes kept a + |Mx|, and b becomes kept b + rest."""

    M: Rows
    rest: Fraction
    kept: Fraction

    @property
    def settled(self) -> Fraction:
        """Return the limit that b approaches."""
        demand(self.kept < 1, "what is late is not forgotten")
        return up(self.rest / (1 - self.kept))


class Costs(NamedTuple):
    """The costs of a late torque: its additions to V in a period, for each unit of its mean, of the torque that moves the
    rates, and of their product. far: how far the latter moves the rates, for each unit. works: F for such a displacement;
    the mean torque then does work of at most `more` |Fx|, for each unit."""

    mean: Fraction
    moved: Fraction
    both: Fraction
    far: Fraction
    works: Callable[[Fraction], Rows]
    more: Fraction


class Follower(Reader):
    """A loop whose applied torque may lag the command."""

    near: Near
    h: Fraction
    N: Rows
    light: Fraction
    widths: list[Fraction]
    pull: list[Poly]
    bend: list[Poly]
    speeding: list[Poly]
    heeded: list[Poly]
    beside: list[Poly]
    leaning: list[Poly]
    odd: list[Poly]
    rigid: dict[str, list[Poly]]
    last_sizes: tuple[Rows | None, Sizes, tuple[Sizes, list[Fraction], Fraction] | None] = None, {}, None
    apart: Radii
    swayed: Radii
    leant: Radii
    late: Late | None

    def sways(self, radii: list[Fraction]) -> None:
        """Take the bounds of what noise adds near the target to the rate, to the turn and, if it lags, to the applied
        torque; then of what momentum adds to these."""
        count = len(self.near.A) // 3
        (w, q, *torque), (faster, farther, *more) = radii[:count], radii[count:] or [ZERO] * count
        self.swayed, self.apart = (w, q), (faster, farther)
        self.drawn = (torque[0], more[0]) if torque else AT_REST

    @property
    def away(self) -> Radii:
        """Return how far motions are from the linear one, because of noise and of the offset at which the slow torque holds
        the body."""
        return self.swayed[0] + self.leant[0], self.swayed[1] + self.leant[1]

    def follow(self, numbers: Numbers) -> Late | None:
        """Read how late the torque is, if it is."""
        # For a lag that is alike in all components, how exactly it is known. What noise adds to the applied torque, and what
        # momentum adds to that; the size of the linear motion's torque, and that of its error at the start.
        self.inexact, self.drawn, self.applied, self.unsettled = list[Fraction](), AT_REST, ZERO, ZERO
        if f"{LATE}mean" not in numbers:
            return None
        late = Late(*(numbers[LATE + name] for name in ("kept", "mean", "weight", "begun", "rest")))
        demand(late.kept < 1 and 0 < late.mean <= 1 and late.weight > 0, "what is late never comes")
        self.step = plus(self.near.A, scalar(1, 6), -1)
        self.demanded = times(self.near.torque, self.step)
        if f"{LATE}moment" in numbers:
            most, least = ([numbers[f"{LATE}{name}{end}"] for name in KNOWN] for end in ("", ".least"))
            self.inexact = [x - y for x, y in zip(most, least, strict=True)]
            demand(min(self.inexact) >= 0, "a torque is late otherwise than it is")
            self.near, self.shares = self.near.lagging(self.h, *most), (most, least)
        # The law's torque minus its linear part near the target.
        spun = [with_momentum(p - g) for p, g in zip(self.pull, self.bend, strict=True)]
        self.gyrating = spun, minus(self.speeding, spun)
        self.beyond = minus(self.loop.u, apply(self.near.torque, [var(name) for name in STATE]))
        self.bare = minus(self.beyond, self.heeded)
        return late

    @property
    def alike_in_words(self) -> str:
        """How all components approach the command, if they do so alike, in words."""
        if not self.inexact:
            return ""
        (*_, moment), (kept, mean, least) = self.shares
        return (
            f", in all components alike, and by no less than {above(mean)} and {above(kept)} times, and by {above(least)} to"
            f" {below(moment)} times in the mean by the time that is left"
        )

    def of_level(self, c: Fraction) -> Sizes:
        """Return bounds of the torque's error where V + weight a^2 is at most c."""
        return {FIRST: root(up(c / self.late.weight)), REST: self.late.rest} if self.late else {}

    @cached_property
    def alone(self) -> list[Poly]:
        """Return what the law asks for because of the state and of the wheels' momentum, with nothing else from outside."""
        absent = {name: 0 for name in self.others if name[0] != "h"}
        return [p.at(absent) for p in self.loop.u]

    @cached_property
    def besides(self) -> list[Poly]:
        """Return the acceleration that is commanded besides that."""
        return minus(self.pull, apply(self.N, self.alone))

    def command_sizes(self, region: Region) -> tuple[Sizes, list[Fraction], Fraction]:
        """Return bounds of the acceleration that is commanded, of that at the sample, and of the torque due to external
        quantities, if what is told is true. They do not depend on errors, which are bounded again and again in a region."""
        sizes = {name: x for name, x in region.sizes.items() if name not in (FIRST, REST, *AMISS)}
        near = sizes | {"v": 1 - region.least}
        X, of, known = self.last_sizes
        if known is None or X is not region.X or of != near:
            # In an ellipsoid c.x is at most the root of c.Xc.
            even = [root(times(times([row], region.X), transpose([row]))[0][0]) for row in self.near.rates]
            even = [min(x, sizes.get(PULL, x)) for x in even]
            odd = [most(p, near) for p in self.odd]
            asks = {f"u{k + 1}": min(most(self.pull[k], sizes), even[k] + odd[k]) for k in AXES}
            pulled = [x + most(p, near) for x, p in zip(even, self.speeding, strict=True)]
            for k, name in enumerate(COMMANDED if COMMANDED[0] in sizes else ()):
                u, bent = sizes[name] + most(self.besides[k], sizes), most(self.bend[k], sizes)
                asks[f"u{k + 1}"], pulled[k] = min(asks[f"u{k + 1}"], u), min(pulled[k], u + bent)
            rigid = sum((felt(parts, x, sizes) * self.size(x) for x, parts in self.rigid.items()), ZERO)
            known = asks, pulled, rigid
            self.last_sizes = region.X, near, known
        return known

    def behind(self, sizes: Sizes, rest: bool = False) -> Behind:
        """Return bounds of the late torque's error, or of its part b alone."""
        if self.late is None:
            return Behind(ZERO, ZERO, ZERO)
        size = sizes[REST] if rest else sizes[FIRST] + sizes[REST]
        return Behind(size, self.late.mean * size, self.late.moved * size)

    def change_in(self, tube: Tube) -> Change | None:
        """Return the change of e in a period, on sets of V."""
        if (late := self.late) is None:
            return None
        sizes, h, u, least = tube.sizes, self.h, self.loop.u, tube.region.least
        near = tube.region.sizes | {"v": 1 - least}
        bent, curved = (felt(self.beyond, letter, sizes) for letter in "wq")
        # The rates change by terms linear in the state and, with momentum, in the rate; by nonlinear ones; by the late
        # torque; and by what these changes do to the gyroscopic acceleration.
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
        # The command changes as rates and turn depart from their linear motion, and as they follow it.
        linear, turn = (stretch([row[part] for row in self.near.torque]) for part in (RATE, TURN))
        turned = turn + curved
        off = linear + turned * h / 2
        grown = off * back * more + bent * more
        rest = 2 * self.mistaken(tube) + self.renewed(sizes, u)
        rest += (off + grown) * drift + turned * aside
        rows = [(Fraction(1), self.demanded), (curved, Aq), (grown, Aw), ((off + grown) * gyrating, w)]
        M = together(rows, [near[x] for x in STATE])
        return Change(M, rest, late.kept + (off + grown) * h * self.light * late.mean)

    def mistaken(self, tube: Tube) -> Fraction:
        """Return a bound of the command's error, including the effect of measurement errors."""
        pushed = self.pushed(tube.sizes)
        return self.misread(tube.region)[0] + pushed["both"] - pushed["outside"]

    def asks(self, radii: Radii) -> Fraction:
        """Return a bound of the law's linear torque for w and q of these sizes."""
        return added([stretch([row[k] for row in self.near.torque]) * x for k, x in zip((RATE, TURN), radii, strict=True)])

    def nears(self, tube: Tube) -> None:
        """Begin the linear motion near the target, with the torque commanded at one of its states."""
        if not self.inexact:
            return
        sizes, heeded, (turned, rated) = tube.sizes, felt(self.heeded, "w", tube.sizes), self.noise
        z = sizes[SPEED] + self.away[0], sizes[ANGLE] + self.away[1]
        self.applied = self.asks(z) + heeded * z[0]
        noisy = self.asks(self.swayed) + self.asks((rated, turned / 2)) + self.drawn[0]
        self.unsettled = 4 * (self.applied + noisy + heeded * (z[0] + rated))

    def entered(self, tube: Tube) -> Rows:
        """Return the matrix of an ellipsoid that contains the linear motion in a tube's region as it begins."""
        X = widened(tube.region.X, self.away)
        if not self.inexact:
            return X
        none, torque = scalar(0), scalar(2 * self.applied**2)
        return beside(plus(X, X), none + none) + beside(beside(none, none), torque)

    def lateness(self, tube: Tube) -> tuple[Fraction, Fraction]:
        """Return bounds of the late torque's error near the target, once that of larger sets is forgotten: the part within
        the linear motion, and the rest."""
        assert self.late is not None
        sizes, drift, turned = tube.sizes, norm(tube.end), tube.turned
        pace, errors, changed = 1 / (1 - self.late.kept), 2 * self.mistaken(tube), self.renewed(sizes, self.loop.u)
        linear = self.asks((drift, turned))
        if not self.inexact:
            curved = felt(self.beyond, "w", sizes) * drift + felt(self.beyond, "q", sizes) * turned
            return ZERO, up((linear + curved + changed + errors) * pace)
        # The linear command, and what momentum adds per unit of rate, change within the motion; errors that are filtered
        # remain errors.
        curved = felt(self.bare, "w", sizes) * drift + felt(self.bare, "q", sizes) * turned
        spun, slow = (felt(self.heeded, "w", sizes) * drift, [with_momentum(p, "r") for p in self.loop.u])
        rest = curved + self.renewed(sizes, minus(self.loop.u, slow)) + self.renewed(sizes, self.leaning)
        rest += self.inexact[0] * tube.late.most
        if any(self.apart):
            rest += 2 * self.changes(sizes)["h"] / self.size("h") * self.drawn[1]
        return up((linear + spun + self.renewed(sizes, slow)) * pace + errors), up(rest * pace)

    def spun_late(self, tube: Tube, fast: Fraction) -> Fraction:
        """Return a bound of the lag error of the torque that the law commands for momentum times a rate of up to `fast`, and
        for momentum times noise: at most twice that torque, and at most its change."""
        if not (self.inexact and self.late):
            return ZERO
        changed = norm(tube.end) / (1 - self.late.kept) + 2 * self.swayed[0]
        return felt(self.heeded, "w", tube.sizes) * (min(2 * fast, changed) + 2 * self.apart[0])

    def spun_on(self, tube: Tube, spun: Fraction, fast: Fraction) -> Fraction:
        """Return a bound of the torque, in the mean of a period, by which the drift of the rates differs from that of the
        linear motion, because the command for momentum and a rate lags: A contains what is applied, and samples contain all
        of it. spun: the result of `spun_late`."""
        if not (self.inexact and self.late):
            return ZERO
        rate = self.swayed[0] if fast else tube.region.sizes[SPEED]
        return self.late.mean * (spun + felt(self.heeded, "w", tube.sizes) * rate)

    def paced(self, tube: Tube, pulled: Fraction, torque: Fraction | None = None) -> Fraction:
        """Return a bound of the acceleration, in the mean of a period, of a linear motion whose command gives an
        acceleration of up to `pulled`, and whose applied torque is at most `torque`, by default the tube's."""
        if not (self.inexact and pulled and self.late):
            return pulled
        acts = tube.region.sizes[REST] + stretch(self.loop.given) * pulled if torque is None else torque
        return (1 - self.late.mean) * pulled + self.late.mean * self.light * acts

    def ends(self, tube: Tube) -> tuple[list[Fraction], Fraction, Fraction]:
        """Return torques at the beginning and at the end of a period, and a turn, that near the target have at least the
        effect of a late torque; and a held torque that moves the rates evenly and has at least its effect."""
        if (late := self.late) is None:
            return [ZERO, ZERO], ZERO, ZERO
        rest, e = tube.region.sizes[REST], tube.late.most
        if not self.inexact:
            return [e * x for x in late.ends], ZERO, tube.late.moved
        (_, mean, moment), (*_, least) = self.shares
        _, uneven, further = self.inexact
        # The rates follow the mean, except for a part that is zero at both ends and concave between them.
        curved = 4 * moment - 2 * mean + 3 * uneven
        torques = [uneven * e + 2 * rest * x for x in (moment, mean - least)]
        return torques, self.h**2 / 2 * self.light * (further + uneven / 2) * e, curved * e + late.moved * rest

    def paid(self, late: Late, change: Change, form: Rows, costs: Costs) -> tuple[Rows, Fraction, Fraction]:
        """Return what is left of a form once the decay of weight a^2 has paid for the late torque, what this adds to V
        besides, and the share of the sum that is in reserve."""
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
    """Return a matrix M with |Mx| >= the sum of c |Rx|, tightest where |x_i| is of these sizes: the square of the sum is at
    most the sum of (c |Rx|)^2 / s, with shares s that add up to 1."""
    weights = [c * norm(reach(R, sizes)) for c, R in parts]
    whole = sum(weights, ZERO)
    scales = [c * root(whole / weight) if weight else ZERO for (c, _), weight in zip(parts, weights, strict=True)]
    return [[c * x for x in row] for c, (_, R) in zip(scales, parts, strict=True) if c for row in R]
