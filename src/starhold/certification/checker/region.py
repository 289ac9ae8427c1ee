"""A set that motions do not leave and in which they come to rest on target. Nothing here is shared with the certifier."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeAlias

from flint import arb, fmpq, fmpq_mat

from starhold.certification.checker.exact import (
    ZERO,
    CheckError,
    Obligation,
    bordered,
    definite,
    demand,
    determinant,
    down,
    even,
    greatest,
    inverted,
    plus,
    rational,
    root_up,
    saddle,
    times,
    turned,
    unit,
    up,
)
from starhold.certification.checker.loop import TURN, Loop, letters

Numbers: TypeAlias = Mapping[str, Any]
EXACT, SIGN, BALLS, LASALLE, ROOTS = "exact identity", "exact inequality", "ball arithmetic", "LaSalle", "certified roots"


def optional(x: Any) -> Any | None:
    """The exact value of a number that may be left out."""
    return None if x is None else rational(x)


class Region:
    """{V <= start}, from which motions stay in {V <= level} (None: everything), and the witness of that: V + epsilon C falls
    where |w| <= bound, and differs from V by rho V at most."""

    def __init__(self, loop: Loop, level: Any | None, start: Any | None, witness: Numbers) -> None:
        self.loop, self.level, self.start = loop, optional(level), optional(start)
        self.epsilon, self.rho = rational(witness["epsilon"]), rational(witness["rho"])
        self.given = optional(witness.get("rate_bound"))

    @property
    def bound(self) -> Any | None:
        """What |w| does not exceed on the level set: as the witness says, else as the least eigenvalue of P tells."""
        if self.given is not None or self.level is None or self.loop.shifted:
            return self.given
        return root_up(2 * self.level / -greatest(times(-1, self.loop.frame.P)))

    def form(self) -> str:
        """V and V' have the terms of a frame and no others."""
        self.loop.frame  # noqa: B018
        return "V and V' have no other terms"

    def positive(self) -> str:
        """V is positive but at rest on target."""
        demand(definite(self.loop.frame.P) and self.loop.frame.s > 0, "V is not positive")
        return "the minors of P are positive, so is s"

    def descent(self, q_rate: Any = ZERO, q_attitude: Any = ZERO) -> str:
        """On the level set V, or V + epsilon C, falls, the latter by q_rate |w|2 + q_attitude |q|2 at least."""
        loop, frame, bound = self.loop, self.loop.frame, self.bound
        self.positive()
        demand(bound is None or bound > 0, "the bound of the rate is not positive")
        demand(frame.kappa == 0 or bound is not None, "V' has a cubic term and the rate no bound")
        cubic = ZERO if bound is None else frame.kappa * bound
        if self.epsilon == 0:
            demand(unit(3, ZERO) == frame.E, "V' mixes rate and attitude")
            if len(loop.pieces) > 1:
                demand(loop.falls, "V' may be positive on a piece of the law")
            else:
                demand(definite(plus(even(frame.D), unit(3, cubic), -1)), "V' may be positive")
        else:
            demand(self.epsilon > 0, "epsilon is negative")
            if len(loop.pieces) > 1 and loop.reach is not None:
                demand(bound is not None and bound <= loop.reach, "the law clips within the level set")
            cross = loop.crossed
            damping = plus(even(frame.D), unit(3, self.epsilon * cross.sigma + cubic + q_rate), -1)
            mixing = times(fmpq(1, 2), plus(times(self.epsilon, turned(cross.B)), frame.E, -1))
            stiffness = plus(times(self.epsilon, even(cross.A)), unit(3, q_attitude), -1)
            demand(definite(bordered(damping, mixing, stiffness)), "V + epsilon C may rise")
        demand(self.level is not None or bound is None, "without a level there is no bound of the rate")
        if self.level is not None and bound is not None:
            demand(self.level > 0, "the level is not positive")
            # |w| <= bound wherever V <= level.
            held = plus(frame.P, unit(3, 2 * self.level / bound**2), -1)
            demand(definite(held, strictly=False), "the rate may exceed its bound on the level set")
        return "definite by its minors"

    def target(self) -> str:
        """How the target moves drops out of the motion relative to it."""
        for _, torque in self.loop.pieces:
            for found in (*self.loop.accelerations(torque), self.loop.slope(torque)):
                demand(not any(set(letters(m)) & set("ra") for m in found.terms), "the target's motion does not drop out")
        return "no term with the target's rate or acceleration"

    def strict(self) -> str:
        """(1 - rho) V <= V + epsilon C <= (1 + rho) V, and what follows for the start."""
        if self.epsilon == 0:
            demand(self.rho == 0 and self.start == self.level, "without a cross term start and level are the same")
            return "start and level are the same"
        frame, J = self.loop.frame, self.loop.inertia
        demand(0 < self.rho < 1, "rho is not between 0 and 1")
        if self.loop.shifted:
            # rho P = rho g J > 0 leaves rho s - epsilon2 J/(rho g) > 0 of the whole, the same J in V and C.
            room = unit(3, (self.rho * frame.P[0][0] / J[0][0]) ** 2 * frame.s)
            kept = all(definite(plus(room, top, -(self.epsilon**2))) for top in frame.tops)
        else:
            P, s = times(self.rho, frame.P), unit(3, self.rho * frame.s)
            kept = definite(bordered(P, times(self.epsilon, turned(J)), s))
        demand(kept, "C exceeds its share of V")
        demand((self.start is None) == (self.level is None), "level and start do not belong together")
        if self.level is not None:
            demand(self.start * (1 + self.rho) <= self.level * (1 - self.rho), "the motion may leave the level set")
        return "definite by its minors"

    def only_rest(self) -> str:
        """Staying at w = 0 takes a torque of zero, thus q = 0."""
        self.strict()
        torque = self.loop.resting()[1]
        rows: list[list[Any]] = []
        # A plant of any inertia turns by a torque, whatever it is; a moving target needs the accelerations.
        for found in torque.values() if self.loop.still else self.loop.accelerations(torque):
            own = found.only(lambda m: not set(letters(m)) & set("wem"))
            demand(all(letters(m) == "q" for m in own.terms), "the torque at rest is not linear in the attitude")
            rows.append([own.terms.get((name,), ZERO) for name in TURN])
        demand(determinant(rows) != 0, "another attitude is at rest")
        return "the stiffness has a determinant other than zero"

    def cover(self, how: str = ROOTS) -> Obligation:
        """The part that the double cover plays; `how` the rest on the other quaternion is shown to repel."""
        cover, level = self.loop.subject.cover, self.level
        if cover == "hysteresis":
            return "jumps lower V", SIGN, self.jumps
        # Of a law without s, to be found when it is verified, the name does not matter.
        s = self.loop.lyapunov.value.terms.get((), ZERO)
        if cover == "shortest" or (level is not None and level < 2 * s):
            return "single rest in the set", SIGN, self.single
        return "other rest repels", how, self.repels if how == ROOTS else self.repels_always

    def single(self) -> str:
        """The other rest, and for the shorter way the half turn where the feedback switches, are outside the level set."""
        highest = self.loop.frame.s * (1 if self.loop.subject.cover == "shortest" else 2)
        demand(self.level is not None and self.level < highest, "the level set reaches too far")
        return "the level is below that of the other rest and of a switch"

    def jumps(self) -> str:
        """Jumps lower V + epsilon C: V by 2 s width at least, and |epsilon C| <= rho V after them; and they do not end at
        the other rest."""
        width, s = self.loop.subject.width, self.loop.frame.s
        demand(0 < width < 1, "the width of the hysteresis is not between 0 and 1")
        if self.epsilon != 0:
            demand(self.level is not None and self.rho * self.level <= (1 + self.rho) * s * width, "a jump may raise V")
        return "a jump lowers V by 2 s times the width at least"

    def repels(self) -> str:
        """Of the linear motion around the other rest no root is imaginary and some have a positive real part."""
        rate, attitude = self.loop.linear(-1)
        inverse = fmpq_mat(inverted(self.loop.subject.inertia))
        pull = [fmpq_mat(gain) for gain in (rate, attitude)]
        matrix = bordered((-inverse * pull[0]).tolist(), (-inverse * pull[1]).tolist(), unit(3, ZERO))
        matrix[3:] = [[*row, *zeros] for row, zeros in zip(unit(3, fmpq(-1, 2)), unit(3, ZERO), strict=True)]
        demand(saddle(fmpq_mat(matrix).charpoly().coeffs()), "the other rest may attract")
        return "by Routh's array, and no root common to both halves of the polynomial"

    def repels_always(self) -> str:
        """The same for every inertia. Where V + epsilon C falls strictly around the other rest it is indefinite there, so by
        Lyapunov's equation no root is imaginary and as many are on the right as it has negative eigenvalues. Without a cross
        term J x2 + K_rate x - K_attitude/2 has no imaginary root if K_attitude is symmetric."""
        self.descent()
        if self.epsilon == 0:
            attitude = self.loop.linear(-1)[1]
            demand(attitude == turned(attitude) and definite(attitude), "the stiffness is not symmetric and definite")
        return "V, or V + epsilon C, falls there and is indefinite"

    def contents(
        self, turn: Any, rate: Any | None, everywhere: Any | None, everything: bool, any_inertia: bool = False
    ) -> str:
        """What is said to be in {V <= start} is."""
        tops, s, start = self.loop.frame.tops, self.loop.frame.s, self.start
        demand(everything == (self.level is None) == (start is None), "the level set is everything only without a level")
        turn, rate, everywhere = rational(turn), optional(rate), optional(everywhere)
        demand(0 <= turn <= up(2 * arb.pi() * (1 + arb(10) ** -15)), "the turn is not between 0 and a full one")
        if start is None:
            demand(rate is None and everywhere is None, "everything has no largest rate")
            return "everything is in it"
        if rate is None:
            raise CheckError("the rate has no bound")
        demand(start > 0 and rate >= 0, "there is no start, or the rate is negative")
        high = start >= 2 * s
        # What grows with the turn up to a full one.
        low = turn <= down(2 * arb.pi()) and up(arb(s) * (1 - (arb(turn) / 2).cos())) <= start
        demand(high or low, "the turn is not in it")
        if any_inertia:
            demand(rate == 0 and everywhere is None, "any inertia leaves no rate")
        for P in tops:
            demand(definite(plus(unit(3, 2 * start), times(rate**2, P), -1), strictly=False), "the rate is not in it")
            if everywhere is not None:
                left = plus(unit(3, 2 * (start - 2 * s)), times(everywhere**2, P), -1)
                held = high and everywhere >= 0 and definite(left, strictly=False)
                demand(held, "the rate at every attitude is not in it")
        return "turn and rates are in {V <= start}"
