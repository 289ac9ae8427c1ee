"""The set of a V that is the same at q and -q, V = w.Pw/2 + q.Nq."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

from flint import arb

from starhold.algebra.polynomial import Polynomial
from starhold.algebra.vector import add, apply, cross, scale
from starhold.checker.exact import (
    Obligation,
    definite,
    demand,
    down,
    greatest,
    identity,
    matmul,
    plus,
    times,
    up,
)
from starhold.checker.frame import EvenFrame, even_frame
from starhold.checker.loop import ATTITUDE, letters
from starhold.checker.region import LASALLE, ROOTS, SIGN, Region
from starhold.checker.subject import variables
from starhold.checker.well import EVEN, Well

SINGLE = "single equilibrium in the set"


class EvenRegion(Region[EvenFrame]):
    """Both quaternions of the target are equilibria; half a turn is the largest, an equilibrium too about axes of N."""

    @property
    def around(self) -> Any:
        return arb.pi()

    @property
    def highest(self) -> Any:
        return greatest(self.frame.N)

    def read(self) -> EvenFrame:
        demand(len(self.loop.pieces) == 1, "V is even in q, but the law has several pieces")
        torque = self.loop.resting()[1]
        turns = [sum(name in ATTITUDE for name in m) for part in torque.values() for m in part.terms]
        demand(not any(count % 2 for count in turns), "V is even in q, but the torque is not")
        return even_frame(self.loop)

    def well(self) -> tuple[Any, Well]:
        s = self.frame.N[0][0]
        demand(identity(3, s) == self.frame.N, "the stiffness is not the same about every axis")
        return s, EVEN

    def holds_turn(self, turn: Any) -> bool:
        square = up((arb(turn) / 2).sin() ** 2)
        left = plus(identity(3, self.start), times(square, self.frame.N), -1)
        return turn <= down(self.around) and definite(left, strictly=False)

    def positive(self) -> str:
        demand(definite(self.frame.P) and definite(self.frame.N), "V is not positive")
        return "the minors of P and N are positive"

    def descent(self) -> str:
        self.positive()
        demand(definite(self.damping()), "V' may be positive")
        return "definite by its minors"

    def settles(self) -> Obligation:
        return "only equilibrium", LASALLE, self.only_equilibrium

    def only_equilibrium(self) -> str:
        """Staying at w = 0 takes P J^-1 (torque) = -(q0 Nq + Nq x q) to be zero: its product with Nq is -q0 |Nq|2, so that
        q = 0, or q0 = 0 and q is an eigenvector of N."""
        demand(self.epsilon == 0 and self.rho == 0, "a V even in q takes no cross term")
        demand(self.start == self.level, "without a cross term start and level are the same")
        loop, P = self.loop, self.frame.P
        torque = loop.resting()[1]
        pulls = matmul(P, [[part] for part in loop.accelerations(torque)])
        N: Any = tuple(map(tuple, self.frame.N))
        q0, *vector = variables(ATTITUDE)
        spring: Any = apply(N, tuple(vector))  # pyright: ignore
        wanted: Any = add(scale(q0, spring), cross(spring, tuple(vector)))  # pyright: ignore
        for (pull,), part in zip(pulls, wanted, strict=True):
            still: Polynomial = Polynomial(pull.terms).only(lambda m: not set(letters(m)) & set("wem"))
            demand(not (still + part).terms, "the torque at rest is not that of V")
        return "at rest the torque is that of V, zero only on target and at half turns"

    def cover(self, said: Collection[str], how: str = ROOTS) -> Obligation:
        if SINGLE in said:
            return SINGLE, SIGN, self.single
        return "half turns repel", SIGN, self.repels

    def single(self) -> str:
        """V is larger at every half turn than on the level set."""
        demand(self.level is not None, "without a level there are half turns in the set")
        demand(definite(plus(self.frame.N, identity(3, self.level), -1)), "the level set reaches half turns")
        return "the level is below the least eigenvalue of N"

    def repels(self) -> str:
        """Around a half turn V falls towards q0 = 1, and stays the same only along other equilibria. As w.Dw > 0, no root
        but those along them is imaginary, and as many are on the right as directions in which V falls (inertia theorem)."""
        self.descent()
        self.only_equilibrium()
        return "V falls there and is indefinite"
