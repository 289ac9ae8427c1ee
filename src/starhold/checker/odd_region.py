"""The set of a V that is not the same at q and -q, V = w.Pw/2 + s (1 - q0)."""

from __future__ import annotations

from collections.abc import Collection
from functools import cached_property
from typing import Any

from flint import arb, fmpq, fmpq_mat

from starhold.checker.exact import (
    ZERO,
    Obligation,
    Rows,
    block,
    definite,
    demand,
    determinant,
    down,
    identity,
    inverse,
    plus,
    saddle,
    symmetric_part,
    times,
    transpose,
    up,
)
from starhold.checker.frame import Crossed, OddFrame, crossed, odd_frame
from starhold.checker.loop import TURN, letters
from starhold.checker.region import LASALLE, ROOTS, SIGN, Region
from starhold.checker.well import ODD, Well


class OddRegion(Region[OddFrame]):
    """Rest on target is at q0 = 1 alone, and a full turn leads back to it."""

    @property
    def around(self) -> Any:
        return 2 * arb.pi()

    @property
    def highest(self) -> Any:
        return 2 * self.frame.s

    @cached_property
    def crossed(self) -> Crossed:
        """The parts of the cross term."""
        return crossed(self.loop)

    def read(self) -> OddFrame:
        return odd_frame(self.loop)

    def well(self) -> tuple[Any, Well]:
        return self.frame.s, ODD

    def holds_turn(self, turn: Any) -> bool:
        # What grows with the turn up to a full one.
        return turn <= down(self.around) and up(arb(self.frame.s) * 2 * (arb(turn) / 4).sin() ** 2) <= self.start

    def positive(self) -> str:
        demand(definite(self.frame.P) and self.frame.s > 0, "V is not positive")
        return "the minors of P are positive, so is s"

    def descent(self) -> str:
        """On the level set V, or V + epsilon C, falls."""
        loop, frame = self.loop, self.frame
        self.positive()
        if self.epsilon == 0:
            damping = self.damping()
            demand(identity(3, ZERO) == frame.E, "V' mixes rate and attitude")
            if len(loop.pieces) > 1:
                demand(loop.falls, "V' may be positive on a piece of the law")
            else:
                demand(definite(damping), "V' may be positive")
            return "definite by its minors"
        demand(self.epsilon > 0, "epsilon is negative")
        demand(definite(self.fall()), "V + epsilon C may rise")
        return "definite by its minors"

    def fall(self) -> Rows:
        """Q of (V + epsilon C)' <= -(w, q).Q(w, q) on the level set."""
        loop, frame, cross = self.loop, self.frame, self.crossed
        if len(loop.pieces) > 1 and loop.reach is not None:
            demand(self.bound is not None and self.bound <= loop.reach, "the law clips within the level set")
        damping = plus(self.damping(), identity(3, self.epsilon * cross.sigma), -1)
        mixing = times(fmpq(1, 2), plus(times(self.epsilon, transpose(cross.B)), frame.E, -1))
        return block(damping, mixing, times(self.epsilon, symmetric_part(cross.A)))

    def settles(self) -> Obligation:
        if self.epsilon == 0:
            return "only equilibrium", LASALLE, self.only_equilibrium
        return "strict", SIGN, self.strict

    def strict(self) -> str:
        """(1 - rho) V <= V + epsilon C <= (1 + rho) V, and what follows for the start."""
        if self.epsilon == 0:
            demand(self.rho == 0 and self.start == self.level, "without a cross term start and level are the same")
            return "start and level are the same"
        frame, J = self.frame, self.loop.inertia
        demand(0 < self.rho < 1, "rho is not between 0 and 1")
        P, s = times(self.rho, frame.P), identity(3, self.rho * frame.s)
        kept = definite(block(P, times(self.epsilon, transpose(J)), s))
        demand(kept, "C exceeds its share of V")
        demand((self.start is None) == (self.level is None), "level and start do not belong together")
        if self.level is not None:
            demand(self.start * (1 + self.rho) <= self.level * (1 - self.rho), "the motion may leave the level set")
        return "definite by its minors"

    def only_equilibrium(self) -> str:
        """Staying at w = 0 takes a torque of zero, thus q = 0."""
        self.strict()
        torque = self.loop.resting()[1]
        rows: list[list[Any]] = []
        # A plant of any inertia turns by a torque, whatever it is; a moving target needs the accelerations.
        for found in torque.values() if self.loop.still else self.loop.accelerations(torque):
            own = found.only(lambda m: not set(letters(m)) & set("wem"))
            demand(all(letters(m) == "q" for m in own.terms), "the torque at rest is not linear in the attitude")
            rows.append([own.terms.get((name,), ZERO) for name in TURN])
        demand(determinant(rows) != 0, "another attitude is an equilibrium")
        return "the stiffness has a determinant other than zero"

    def cover(self, said: Collection[str], how: str = ROOTS) -> Obligation:
        cover, level = self.loop.subject.sign_policy, self.level
        if cover == "hysteresis":
            return "jumps lower V", SIGN, self.jumps
        # Of a law without s, to be found when it is verified, the name does not matter.
        s = self.loop.lyapunov.value.terms.get((), ZERO)
        if cover == "shortest" or (level is not None and level < 2 * s):
            return "single equilibrium in the set", SIGN, self.single
        # Whatever momentum wheels store is in that motion, so there is no one polynomial.
        always = how != ROOTS or self.loop.subject.wheels is not None
        return "other equilibrium repels", SIGN if always else ROOTS, self.repels_always if always else self.repels

    def single(self) -> str:
        """The other equilibrium and, for the shorter way, half turns, where the feedback switches, are outside the set."""
        highest = self.frame.s * (1 if self.loop.subject.sign_policy == "shortest" else 2)
        demand(self.level is not None and self.level < highest, "the level set reaches too far")
        return "the level is below that of the other equilibrium and of a switch"

    def jumps(self) -> str:
        """Jumps lower V + epsilon C: V by 2 s width at least, and |epsilon C| <= rho V after them; and they do not end at
        the other equilibrium."""
        width, s = self.loop.subject.width, self.frame.s
        demand(0 < width < 1, "the width of the hysteresis is not between 0 and 1")
        if self.epsilon != 0:
            demand(self.level is not None and self.rho * self.level <= (1 + self.rho) * s * width, "a jump may raise V")
        return "a jump lowers V by 2 s times the width at least"

    def repels(self) -> str:
        """The linear motion around the other equilibrium has no imaginary root and some with a positive real part."""
        rate, attitude = self.loop.linear(-1)
        J_inverse = fmpq_mat(inverse(self.loop.subject.inertia))
        pull = [fmpq_mat(gain) for gain in (rate, attitude)]
        matrix = block((-J_inverse * pull[0]).tolist(), (-J_inverse * pull[1]).tolist(), identity(3, ZERO))
        matrix[3:] = [[*row, *zeros] for row, zeros in zip(identity(3, fmpq(-1, 2)), identity(3, ZERO), strict=True)]
        demand(saddle(fmpq_mat(matrix).charpoly().coeffs()), "the other equilibrium may attract")
        return "by Routh's array, and no root common to both halves of the polynomial"

    def repels_always(self) -> str:
        """The other equilibrium repels, for every inertia and wheel momentum. Where V + epsilon C falls strictly around it
        it is indefinite there, so by Lyapunov's equation no root is imaginary and as many are on the right as it has
        negative eigenvalues. Without a cross term V' = -w.Dw: what an imaginary root moves would stay at w = 0, so q = 0."""
        self.descent()
        if self.epsilon == 0:
            self.only_equilibrium()
        return "V, or V + epsilon C, falls there and is indefinite"
