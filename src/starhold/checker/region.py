"""A set that motions do not leave and in which they come to rest on target: what does not depend on whether V is even
in q."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping
from functools import cached_property
from typing import Any, Generic, TypeAlias, TypeVar

from flint import arb

from starhold.checker.exact import (
    ZERO,
    CheckError,
    Obligation,
    Rows,
    definite,
    demand,
    identity,
    least,
    plus,
    rational,
    root_above,
    symmetric_part,
    times,
    up,
)
from starhold.checker.frame import CommonFrame
from starhold.checker.loop import ExactLoop, letters
from starhold.checker.well import Well

Numbers: TypeAlias = Mapping[str, Any]
EXACT, SIGN, BALLS, LASALLE, ROOTS = "exact identity", "exact inequality", "ball arithmetic", "LaSalle", "certified roots"
F = TypeVar("F", bound=CommonFrame)


def optional(x: Any) -> Any | None:
    """The exact value of a number that may be left out."""
    return None if x is None else rational(x)


class Region(ABC, Generic[F]):
    """{V <= start}, from which motions stay in {V <= level} (None: everything), and the witness of that: V + epsilon C falls
    where |w| <= bound, and differs from V by rho V at most."""

    around: Any
    """The largest turn there is, from one equilibrium to the same."""

    def __init__(self, loop: ExactLoop, level: Any | None, start: Any | None, witness: Numbers) -> None:
        self.loop, self.level, self.start = loop, optional(level), optional(start)
        self.epsilon, self.rho = rational(witness["epsilon"]), rational(witness["rho"])
        self.given = optional(witness.get("rate_bound"))

    @abstractmethod
    def read(self) -> F:
        """The parts of V and V'; a CheckError where they have others."""

    @abstractmethod
    def positive(self) -> str:
        """V is positive but at rest on target."""

    @abstractmethod
    def descent(self) -> str:
        """On the level set V, or V + epsilon C, falls."""

    @abstractmethod
    def settles(self) -> Obligation:
        """Why what falls ends at rest."""

    @abstractmethod
    def cover(self, said: Collection[str], how: str = ROOTS) -> Obligation:
        """The part that equilibria other than q = 0, q0 = 1 play, under the one of its names that is said; `how` the one on
        the other quaternion is shown to repel."""

    @abstractmethod
    def well(self) -> tuple[Any, Well]:
        """The attitude's part of V as a multiple of a known function, for bounds on the level set."""

    @property
    @abstractmethod
    def highest(self) -> Any:
        """A bound of V at rest, whatever the attitude."""

    @abstractmethod
    def holds_turn(self, turn: Any) -> bool:
        """Whether every state at rest turned up to this is in {V <= start}."""

    @cached_property
    def frame(self) -> F:
        """The parts of V and V'."""
        return self.read()

    @property
    def bound(self) -> Any | None:
        """A bound of |w| on the level set: as the witness says, else as the least eigenvalue of P tells."""
        if self.given is not None or self.level is None:
            return self.given
        return root_above(2 * self.level / least(self.frame.P))

    def form(self) -> str:
        """V and V' have the terms of a frame and no others."""
        self.frame  # noqa: B018
        return "V and V' have no other terms"

    def damping(self) -> Rows:
        """D less the cubic term, for the rates of the level set."""
        frame, bound = self.frame, self.bound
        demand(bound is None or bound > 0, "the bound of the rate is not positive")
        demand(frame.kappa == 0 or bound is not None, "V' has a cubic term and the rate no bound")
        demand(self.level is not None or bound is None, "without a level there is no bound of the rate")
        if self.level is not None and bound is not None:
            demand(self.level > 0, "the level is not positive")
            # |w| <= bound wherever V <= level.
            held = plus(frame.P, identity(3, 2 * self.level / bound**2), -1)
            demand(definite(held, strictly=False), "the rate may exceed its bound on the level set")
        return plus(symmetric_part(frame.D), identity(3, ZERO if bound is None else frame.kappa * bound), -1)

    def target(self, bounded: bool = False) -> str:
        """How the target moves drops out of the motion relative to it; if it moves, so does the momentum of the wheels.
        Where this is left it must be bounded: a torque from outside that the law cancels may pile it up, and so slow the
        motion down that it never ends on target."""
        loop = self.loop
        for _, torque in loop.pieces:
            motion = {letter for found in loop.accelerations(torque) for m in found.terms for letter in letters(m)}
            energy = {letter for m in loop.slope(torque).terms for letter in letters(m)}
            demand(not (motion | energy) & set("ra"), "the target's motion does not drop out")
            demand("h" not in energy, "V' depends on the momentum of the wheels")
            demand(loop.still or "h" not in motion, "the momentum of the wheels does not drop out")
        piled = loop.swayed and any(loop.subject.modelled) and not self.frame.felt
        demand(bounded or not piled, "the momentum of the wheels may grow without end")
        return "no term with the target's rate or acceleration"

    def contents(self, turn: Any, rate: Any | None, everywhere: Any | None, everything: bool) -> str:
        """Turn and rates that are said to be in {V <= start} are in it."""
        P, start = self.frame.P, self.start
        demand(everything == (self.level is None) == (start is None), "the level set is everything only without a level")
        turn, rate, everywhere = rational(turn), optional(rate), optional(everywhere)
        demand(0 <= turn <= up(self.around * (1 + arb(10) ** -15)), "the turn is not between 0 and the largest there is")
        if start is None:
            demand(rate is None and everywhere is None, "everything has no largest rate")
            return "everything is in it"
        if rate is None:
            raise CheckError("the rate has no bound")
        demand(start > 0 and rate >= 0, "there is no start, or the rate is negative")
        high = start >= self.highest
        demand(high or self.holds_turn(turn), "the turn is not in it")
        demand(definite(plus(identity(3, 2 * start), times(rate**2, P), -1), strictly=False), "the rate is not in it")
        if everywhere is not None:
            left = plus(identity(3, 2 * (start - self.highest)), times(everywhere**2, P), -1)
            held = high and everywhere >= 0 and definite(left, strictly=False)
            demand(held, "the rate at every attitude is not in it")
        return "turn and rates are in {V <= start}"
