"""A loop with its torque held between samples: how V changes in a period, and the linear motion, from sets of states.

J w' = u + d - w x Jw, where u is the law's torque at the last sample plus an error. The effects of errors and of external
torques d are bounded by their sizes. Terms of higher order in the period, and nonlinear ones, are bounded by the size of the
set. So are the terms of a moving target, of wheels and of an external torque that the law knows, in the law's torque and in
the motion, and the effects of their changes. Docs/kernel.md, 10.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from functools import cached_property
from typing import Any

from .follower import Costs, Follower
from .loops import AXES, MOMENTA, NONE, AttitudeLoop
from .near import CHANGE, between, form_of, near_target
from .norms import Norms
from .numbers import Rows, added, beside, definite, demand, inverse, norm, plus, reach, root, scalar, times, transpose, up
from .plans import PLANNED, Plan
from .polynomials import Poly, apply, cross, derivatives, dot, fastest, largest, minus, most, total, var, variables
from .regions import (
    AMISS,
    ANGLE,
    AT_REST,
    LOAD,
    RATE,
    SPEED,
    STATE,
    TURN,
    Factored,
    Radii,
    Region,
    Sizes,
    Tube,
    as_told,
    beyond,
    factored,
    felt,
    first,
    growing,
    least_form,
    lengths,
    named,
    outweighed,
    settled,
    stretch,
    with_momentum,
)  # fmt: skip

WEIGHT, ZERO = Fraction(8), Fraction(0)
NEARER = Fraction(17, 16)
"""Errors that grow with the motion count as settled within this factor of their limit."""


class Held(Follower):
    """A loop with its torque held for a period, and V = s (1 - q0) + x.Gx."""

    def __init__(self, loop: AttitudeLoop, plan: Plan | None = None) -> None:
        numbers, x = loop.claim.numbers, [var(name) for name in STATE]
        self.loop, self.h = loop, numbers["period"]
        self.plan = plan or (Plan(loop) if loop.claim.taken.get(PLANNED) else None)
        # What `mean_rate` returned.
        self.rates = dict[Any, tuple[Poly, Norms, Poly, Fraction]]()
        # What noise adds near the target, and what momentum adds to that.
        self.swayed = self.apart = AT_REST
        self.random = numbers.get("noise.torque") or ZERO
        more = {"outside": self.random, "error": norm([loop.added or ZERO] * 3)}
        self.constant = {name: numbers[name] + x for name, x in more.items()}
        self.per_rate = {name: numbers.get(f"{name}.per.rate") or Fraction(0) for name in ("outside", "error")}
        self.noise, errors = (
            [numbers.get(f"{kind}.{name}") or Fraction(0) for name in ("attitude", "rate")] for kind in ("noise", "error")
        )
        self.turned, self.rated = (x + y for x, y in zip(self.noise, errors, strict=True))
        # How much measurement errors grow per unit of rate and acceleration, over what time, and the share left then.
        of = ("rate", "acceleration")
        self.moving = [[numbers.get(f"error.{name}.per.{x}") or ZERO for x in of] for name in ("attitude", "rate")]
        self.ago, self.held_back = (numbers.get(f"error.{name}") or ZERO for name in ("ago", "kept"))
        demand(self.held_back < 1, "errors are not forgotten")
        self.off = loop.off if "tolerance" in numbers else ZERO
        self.kinetic: Fraction | None = None  # A bound of w.Jw, where a theorem shows one,
        self.commands = Sizes()  # and bounds of the acceleration that is commanded.
        self.led, self.hurried = (numbers.get(f"error.target.{name}") or Fraction(0) for name in ("rate", "acceleration"))
        demand(self.h > 0 and min(self.per_rate.values()) >= 0, "a number is not positive")
        given = {"e": loop.outside, "r": loop.moving, "a": loop.moving, "h": loop.wheels}
        names = {"r": "target.rate", "a": "target.acceleration", "h": "momentum"}
        each = {"e": [f"outside.{k}" for k in AXES]} | {letter: [name] * 3 for letter, name in names.items()}
        self.others: Sizes = {
            f"{letter}{k + 1}": numbers[name]
            for letter, keys in each.items()
            if given[letter]
            for k, name in enumerate(keys)
        }
        alone = dict.fromkeys(self.others, 0)
        self.u, free = ([p.at(alone) for p in parts] for parts in (loop.u, loop.balance(NONE)))
        loop.autonomous(self.u)
        loop.autonomous(loop.u, kept="".join(letter for letter in given if given[letter]))
        self.bounded = {name: numbers[name] for letter, keys in each.items() if given[letter] for name in keys}
        self.change = [numbers.get(name) or Fraction(0) for name in CHANGE] if CHANGE[0] in numbers else None
        self.bounded |= dict(zip(CHANGE, self.change or [], strict=False))
        self.beside = minus(loop.balance(NONE), free)
        # The part that vanishes with the state enters V' as it is, because the momentum of wheels does no work.
        commanded, turning = minus(loop.u, self.u), growing(self.beside)
        self.more = growing(commanded)
        left = [p + q for p, q in zip(minus(commanded, self.more), minus(self.beside, turning), strict=True)]
        # Of the rest, momentum times the target's rate is slow, and other terms are bounded by their first external factor.
        self.slow, self.leaning = ([with_momentum(p, "r") for p in of] for of in (left, minus(self.beside, turning)))
        self.rigid = {x: [first(p, x) for p in minus(left, self.slow)] for x in ("e", "a", "h", "r")}
        self.near = near_target(loop, self.h)
        self.N, h = inverse(loop.given), self.h
        self.widths, self.light = [norm(row) for row in self.N], stretch(self.N)
        demand(self.off * self.light < 1, "the inertia is known too badly")
        # The size of the slow torque, and how far a lasting torque, and this one, turns the body.
        self.lasting = felt(self.slow, "h", self.others) * self.size("h")
        self.soft = stretch(inverse([[-x for x in row[TURN]] for row in self.near.torque])) if self.lasting else ZERO
        self.leant: Radii = Fraction(0), self.soft * self.lasting
        self.gyroscopic = [-p - q for p, q in zip(free, turning, strict=True)]
        self.pull = apply(self.N, [p + q for p, q in zip(self.u, self.more, strict=True)])
        self.bend = apply(self.N, self.gyroscopic)
        self.bent = [[p.slope(name) for name in STATE[RATE]] for p in self.bend]
        self.commanded = {f"u{k + 1}": p for k, p in enumerate(self.pull)}
        # The law's torque minus its linear part near the target.
        on, linear = {"q0": 1 - var("v")}, apply(self.near.torque, x)
        self.heeded, self.spun = ([with_momentum(p) for p in of] for of in (loop.u, self.gyroscopic))
        self.unlike = [p.at(on) for p in minus(minus(loop.u, linear), self.heeded)]
        self.tumbled = minus(self.gyroscopic, self.spun)
        # What wheels' momentum adds per unit of rate, as far as the law's torque does not cancel it.
        self.turning = [with_momentum(p - g) for p, g in zip(self.more, self.gyroscopic, strict=True)]
        # The acceleration at samples, the factors of the rates in V', and their linear part.
        rates = apply(self.near.rates, x)
        self.odd = [p.at(on) for p in minus(self.pull, rates)]
        self.speeding = [(p - g - rate).at(on) for p, g, rate in zip(self.pull, self.bend, rates, strict=True)]
        parts = zip(self.u, self.more, linear, self.gyroscopic, self.turning, strict=True)
        self.left = [(p + more - near - g - turning).at(on) for p, more, near, g, turning in parts]
        self.parted = minus(self.beside, turning), turning
        self.late = self.follow(numbers)
        # The effects of torques at the beginning and at the end of a period, half of each if held, and those of turns.
        ways = [[[c * x for x in row] for c in (h / 2, turn) for row in self.N] for turn in (h * h / 4, ZERO)]
        ways.append(scalar(0) + scalar(1))
        self.ways = [rows + [[ZERO] * 3] * (len(self.near.A) - len(STATE)) for rows in ways]
        self.measure(loop)

    def measure(self, loop: AttitudeLoop) -> None:
        """Take V from a loop that is otherwise the same."""
        self.loop, x, on = loop, [var(name) for name in STATE], {"q0": 1 - var("v")}
        self.rate = loop.slopes_along(loop.lyapunov, self.accelerated)
        steep = [self.rate.slope(name).at(self.commanded).at(on) for name in STATE[RATE]]
        self.curvature = {x: [self.rate.slope(x).slope(y) for y in ("q0", *STATE, *MOMENTA)] for x in STATE[RATE]}
        at = dict.fromkeys((*STATE, "v", *self.others), 0)
        self.steepness = [[p.slope(name).at(at).number for name in STATE] for p in steep]
        self.steep = minus(steep, apply(self.steepness, x))
        # Without s, V is even in q, and motions stay where q0 > 0.
        self.s, self.G = form_of(loop)
        self.even = self.s == 0
        # The effect of a torque on V: felt x.
        self.felt = times(self.N, [[2 * entry for entry in row] for row in self.G[RATE]])
        self.worked = [[dot(apply(self.felt, x), parts)] for parts in self.parted]
        # 2 (1 - q0) >= |q|^2: this ellipsoid contains {V <= 1}.
        under = self.form(self.s / 2)
        demand(definite(under), "V is not least on target")
        self.around = inverse(under)
        # Over all w, the least V is s (1 - q0) + q.Sq, with S >= stiff.
        (ww, wq), (_, qq) = ([[row[b] for row in self.G[a]] for b in (RATE, TURN)] for a in (RATE, TURN))
        S = plus(qq, times(transpose(wq), times(inverse(ww), wq)), -1)
        self.stiff = min(S[i][i] + abs(S[i][i]) - sum(map(abs, S[i])) for i in AXES)

    @property
    def accelerated(self) -> list[Poly]:
        """Return the acceleration while that at the sample is held."""
        return [u - g for u, g in zip(variables("u"), self.bend, strict=True)]

    @cached_property
    def motion(self) -> tuple[Factored, Poly, Fraction]:
        """Return the mean of -V' over a period without disturbances, up to a derivative of V', then that derivative, and its
        share in the mean: the law's torque is held, and wheels' momentum turns against the body."""
        rates, shares, last = derivatives(self.rate, self.further, self.h)
        return factored(-self.by_law(rates, shares)), rates[-1], last

    def along(self, p: Poly) -> Poly:
        """Return the derivative of an expression of the state and of wheels' momentum in a period."""
        loop = self.loop
        carried = dict(zip(MOMENTA, cross(loop.H, loop.w), strict=True)) if loop.wheels else {}
        return loop.slopes_along(p, self.accelerated) + total(p.slope(name) * x for name, x in carried.items())

    def further(self, rates: list[Poly]) -> Poly:
        """Return the derivative of V' that follows some others, V' being the first."""
        return self.along(rates[-1])

    def by_law(self, rates: list[Poly], shares: list[Fraction]) -> Poly:
        """Return the sum of shares of V' and its derivatives, with the law's torque."""
        return dot(shares, rates).at(self.commanded)

    def form(self, c: Fraction) -> Rows:
        """Return the matrix of x.Gx + c |q|^2."""
        return [[entry + c * (i == k > 2) for k, entry in enumerate(row)] for i, row in enumerate(self.G)]

    def region(self, c: Fraction) -> Region:
        """Return a region that contains {V <= c}; without s, the part of it with q0 > 0."""
        stiff, lean = self.stiff, max(ZERO, -self.stiff)
        demand((self.s > 2 * lean or (self.even and stiff > 0)) and c >= 0, "V is not least on target")
        least = 1 - up(c / stiff if self.even else c / (self.s - 2 * lean))
        demand(least > -(not self.even), "a level holds the other quaternion of the target")
        if self.even:
            # The root of a number below 1 is not below that number.
            least = max(least, least / root(least))
        turn = root(1 - least * least) if least > 0 else Fraction(1)
        X = [[c * x for x in row] for row in self.around]
        sizes = {name: root(X[i][i]) for i, name in enumerate(STATE)}
        sizes |= lengths(X)
        if self.kinetic is not None:
            sizes |= {k: min(sizes[k], root(self.kinetic * self.N[i][i])) for i, k in enumerate(STATE[RATE])}
            sizes[SPEED] = min(sizes[SPEED], root(self.kinetic * self.light))
        sizes |= {"q0": Fraction(1)} | {x: min(sizes[x], turn) for x in (*STATE[TURN], ANGLE)} | self.of_level(c)
        return Region(X, sizes | self.others | self.commands, least)

    def planned(self, sizes: Sizes) -> Fraction:
        """Return a bound of the torque's distance from the moves of a plan, if there is one."""
        return self.plan.error(as_told(sizes, self.wrong(sizes))) if self.plan else ZERO

    def pushed(self, sizes: Sizes) -> dict[str, Fraction]:
        """Return bounds, in a tube, of the external torque, and of that torque together with the command's error, for a
        turning target too."""
        outside, error = (x + self.per_rate[name] * (sizes[SPEED] + self.size("r")) for name, x in self.constant.items())
        return {"outside": outside + sizes[LOAD], "both": outside + error + sizes[LOAD] + self.planned(sizes)}

    def speeds(self, sizes: Sizes) -> Sizes:
        """Return bounds of the variables' rates of change without disturbances."""
        w = sizes[SPEED]
        speeds = dict.fromkeys(("q0", *STATE[TURN]), w / 2) | dict.fromkeys(MOMENTA, w * self.size("h"))
        return speeds | {x: sizes[f"u{k + 1}"] + most(self.bend[k], sizes) for k, x in enumerate(STATE[RATE])}

    def tube(self, region: Region, amiss: list[Fraction] | None = None) -> Tube:
        """Return a set that motions from a region do not leave for a period. amiss: additional errors of measured attitude
        and rate due to the motion, by default slightly more than after a motion that did not leave the tube."""
        sizes = region.sizes
        asks, pulled, rigid = self.command_sizes(region)
        rigid, late = rigid + self.lasting, self.behind(sizes)

        def within(bounds: list[Fraction]) -> Sizes:
            (*wide, load), off = bounds[:4], bounds[4:]
            more = {SPEED: sizes[SPEED] + norm(beyond(wide, sizes)), LOAD: load}
            return sizes | named(STATE[RATE], wide) | more | named(AMISS, off)

        def misread(bounds: list[Fraction]) -> tuple[Region, list[Fraction]]:
            where = replace(region, sizes=sizes | named(AMISS, bounds[4:]))
            steady = [x + rigid for x in self.misread(where)]
            return where, list(map(up, steady)) if self.grows else steady

        begun, bound = amiss or [ZERO, ZERO], amiss or not self.grows
        read = misread([ZERO] * 4 + begun)

        def reached(bounds: list[Fraction]) -> list[Fraction]:
            within_tube, wide = within(bounds), bounds[:3]
            steady = (read if bound else misread(bounds))[1][0]
            stale = self.stale(within_tube, self.beside)
            push = steady + self.pushed(within_tube)["both"] + stale + late.mean
            slopes = largest(self.bent, within_tube)
            columns = zip(pulled, reach(slopes, beyond(wide, sizes)), self.widths, strict=True)
            faster = [u + more + push * n for u, more, n in columns]
            wide = [sizes[x] + self.h * more for x, more in zip(STATE[RATE], faster, strict=True)]
            fastest = norm(faster) + (stale + late.most - late.mean) * self.light
            off = begun if bound else [NEARER * x for x in self.misleads(within_tube, fastest)]
            return [*wide, self.load(within_tube, fastest), *off]

        bounds = settled(reached, [*(sizes[name] for name in STATE[RATE]), ZERO, *begun])
        region, (steady, uneven) = misread(bounds) if self.grows else (region, read[1])
        far, wide = within(bounds), bounds[:3]
        turned = self.h / 2 * far[SPEED]
        far |= {"q0": Fraction(1)} | {name: min(sizes[name] + turned, Fraction(1)) for name in (*STATE[TURN], ANGLE)} | asks
        demand(not self.even or region.least > turned, "motions pass a half turn")
        demand(not self.grows or turned + self.h / 2 * self.size("r") < 1, "the body turns too far in a period")
        pushed, stale = self.pushed(far)["both"], self.stale(far, self.beside)
        bent = largest(self.bent, far)
        end = beyond(wide, sizes)
        drift = [x + self.h * (late.moved - late.mean) * n for x, n in zip(end, self.widths, strict=True)]
        return Tube(region, far, drift, turned, steady, pushed, stale, uneven, bent, late, end)

    def fall(self, tube: Tube) -> tuple[Rows, Rows, Rows, Fraction, Fraction, Fraction]:
        """Return Q, H, F, p, r and f: V changes in a period by at most h (p |Fx| + r - x.Qx), and V <= x.Hx. With a late
        torque this is true of V + weight |e|^2, and f is the share of that sum in reserve."""
        h, region, L, (falling, last, share) = self.h, tube.region, self.rate, self.motion
        near = region.sizes | {"v": 1 - region.least}
        change, late = self.change_in(tube), self.behind(region.sizes, rest=True)
        push = tube.steady + tube.pushed + late.mean
        demand(push > 0, "nothing pushes")
        moved_by, calm = self.mover(tube)
        away = moved_by(push + calm + late.moved - late.mean)
        slope = {name: most(L.slope(name), tube.sizes) for name in ("q0", *STATE)}
        moved = [*tube.drift, *[tube.turned] * 3, *[h * tube.sizes[SPEED] * self.size("h")] * 3]
        # The effect on V of changes of momentum, which is smaller than that of their torques on the body.
        still, worse = self.unlike_body(tube.sizes, self.worked)
        curved = dict(zip(self.curvature, largest([*self.curvature.values()], tube.sizes), strict=True))
        steep = {
            name: most(p, near) + reach([curved[name]], [tube.turned, *moved])[0]
            for name, p in zip(curved, self.steep, strict=True)
        }

        def shaken(away: list[Fraction]) -> Fraction:
            # The terms of V' in the rates, which disturbances change.
            changed = sum((d / 2 * x for d, x in zip(away, steep.values(), strict=True)), worse * norm(away))
            return changed + h / 12 * norm(away) * norm(slope[name] for name in ("q0", *STATE[TURN]))

        rest = still + shaken(away) + share * fastest(last, tube.sizes, self.speeds(tube.sizes))
        # The effect of disturbances on V grows as the state changes in the period: linearly, and by a remainder.
        drift = self.astray(tube, tube.late.moved - late.moved)
        # Of the acceleration that an inertia resists, the part linear in the state is no disturbance.
        sudden = (tube.stale + tube.late.most) * self.light
        kept = push - tube.sizes[LOAD] + self.load(tube.sizes, norm(drift) / h + sudden)
        turned = h / 2 * (tube.sizes[SPEED] * root(2 * (1 - region.least + tube.turned)) + norm(tube.drift) / 2)
        left = norm(reach(self.felt, [*drift, *[turned] * 3]))
        rest += push / 2 * left
        onward = times(self.felt, self.near.rates + beside(scalar(Fraction(1, 2)), scalar(0)))
        # |a| + |b| + |c| <= sqrt(1 + 2/w) |(a, wb, wc)| with w = sqrt(WEIGHT).
        more = root(1 + 2 / WEIGHT)

        def worked(displaced: Fraction) -> Rows:
            growing = [[h / 2 * y for y in row] for row in onward] + [
                [displaced / 2 * y for y in row] for row in self.steepness
            ]
            return self.felt + [[root(WEIGHT) * y for y in row] for row in growing]

        F = worked(norm(away) / kept)
        # q0 >= least: s (1 - q0) <= s |q|^2 / (1 + least).
        over = self.form(self.s / (1 + region.least))
        form, spare = outweighed(least_form(falling, region), self.off * more, F, self.near.rates), Fraction(1)
        if self.late and change:
            # The effect of a late torque, for each unit of it.
            alone = moved_by(Fraction(1))
            even = norm(reach(self.felt, [h * n for n in self.widths] + [ZERO] * 3))
            costs = Costs(left / 2, push / 2 * even + shaken(alone), even / 2, norm(alone), worked, more)
            form, paid, spare = self.paid(self.late, change, form, costs)
            rest += paid
        return form, over, F, kept * more, rest, spare

    def swing(self, tube: Tube) -> Fraction:
        """Return a bound of |V'| between samples."""
        sizes = tube.sizes
        return most(self.rate, sizes) + (tube.push + tube.stale + tube.late.most) * norm(
            reach(self.felt, [sizes[name] for name in STATE])
        )

    def astray(self, tube: Tube, lasting: Fraction = ZERO) -> list[Fraction]:
        """Return how far the rates depart, in a period, from where the acceleration linear in the sample and that of a
        torque `lasting` take them."""
        sizes = tube.region.sizes | {"v": 1 - tube.region.least}
        left = [most(p, sizes) for p in self.speeding]
        columns = zip(left, reach(tube.bent, tube.drift), self.N, strict=True)
        return [self.h * (a + b + (tube.push + tube.late.moved - lasting) * norm(n)) for a, b, n in columns]

    def corners(self) -> list[Rows]:
        """Return matrices between which A lies, for samples followed by Ax, with any momentum that the wheels may have."""
        return between(self.near, self.loop, self.size("h")) if self.loop.wheels else [self.near.A]

    def pulled(self, radii: Radii) -> Fraction:
        """Return a bound of the linear acceleration for these |w| and |q|."""
        rows = self.near.rates
        return added([stretch([row[k] for row in rows]) * x for k, x in zip((RATE, TURN), radii, strict=True)])

    def linear(
        self, tube: Tube, fast: Fraction = Fraction(0), pulled: Fraction = Fraction(0)
    ) -> list[tuple[Rows, Fraction]]:
        """Return pairs B, b: samples in the tube's region are followed by x+ = Ax + the sum of B v, |v| <= b, with A between
        those of `corners`. x excludes what noise and a random torque add, and the offset at which the slow torque alone
        would hold the body. fast, pulled: |w|, and the result of `pulled`, of motions to whose A momentum adds nothing."""
        h, region, wide, turn = self.h, tube.region, tube.sizes[SPEED], tube.sizes[ANGLE]
        demand(region.least > 0 and turn < 1, "a region is not near the target")
        # As q0 > 0 at all times, 1 - q0 <= |q|^2.
        near = region.sizes | {"v": turn * turn}
        odd = norm(most(p, near) for p in self.left) + felt(self.turning, "w", near) * (fast + self.apart[0])
        spun = self.spun_late(tube, fast)
        odd += spun
        # What noise adds includes the effect of momentum on it to first order, not to second.
        noisy = felt(self.heeded, "w", near) * self.noise[1] * self.light
        at_ends, along, uneven = self.ends(tube)
        drift = norm(self.astray(tube, self.lasting + tube.steady - tube.uneven + tube.late.moved - uneven))
        drift += h * (self.paced(tube, pulled) + self.paced(tube, self.pulled(self.apart), self.drawn[1]) + noisy)
        drift += h * self.light * self.spun_on(tube, spun, fast)
        growing = "rh" + "e" * (self.gradual(tube.sizes) < 2 * self.size("e"))
        late = self.stale(tube.sizes, self.beside, letters=growing)
        steady = tube.uneven - self.lasting + tube.pushed - self.random + odd + tube.stale - late
        # A contains the rest of the drift in what momentum adds per unit of rate.
        grown = (
            felt(self.spun, "w", tube.sizes) * drift + felt(self.tumbled, "w", tube.sizes) * norm(tube.drift)
        ) / 6 + late / 3
        # Over a whole period momentum and target change by twice their mean change.
        moved = 2 * self.soft * self.stale(tube.sizes, self.slow)
        rolled = h / 2 * wide * turn * root(1 / (1 - turn * turn / 2))
        # As momentum changes, so does its effect on what noise adds.
        if any(self.apart):
            change = 2 * self.changes(tube.sizes)["h"] / self.size("h")
            steady += change * self.apart[0] * stretch(self.loop.given) / h
            moved += change * (self.apart[1] + h / 4 * self.apart[0])
        sizes = steady + 2 * grown + at_ends[0], steady + 4 * grown + at_ends[1], rolled + moved + along
        return list(zip(self.ways, sizes, strict=True))

    def bend_between(self, tube: Tube) -> Fraction:
        """Return the largest distance of q, between two samples, from the chord between them."""
        fastest, sizes = norm(tube.drift) / self.h + (tube.stale + tube.late.most - tube.late.moved) * self.light, tube.sizes
        return self.h * self.h / 16 * (fastest + sizes[SPEED] ** 2 / 2 * sizes[ANGLE])
