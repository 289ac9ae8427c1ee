"""The loop of a craft near a libration point, wired from programs by the kernel.

x are places and v velocities in axes that turn with the two bodies: x' = v, v' = field(x, v) + u, with the law's control u.
Roots and quotients by the state become variables, the same wherever the same is asked for, so that what the law takes off
the field cancels.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

from .loops import read, wired
from .numbers import demand
from .polynomials import Poly, dot, multiple, total, var, variables
from .programs import Case, Condition, Exactly, Guards, Piecewise, single
from .reading import Claim

STATE = ("x1", "x2", "x3", "v1", "v2", "v3")


class Asking(Exactly):
    """A program is read over polynomials in which roots n >= 0 and inverses s are variables, named by what they are of."""

    def __init__(self) -> None:
        self.roots, self.inverses = dict[Condition, str](), dict[Condition, str]()
        self.divisors: list[Poly] = []
        """What is divided by where no guard says that it is positive."""

    def cases(self, guards: Guards, operation: str, x: list[Any]) -> Piecewise:
        """Return the cases of a value; a comparison that the guards decide has one."""
        if operation == "sqrt" and x[0].names:
            return [Case(guards, self._named(self.roots, "n", x[0]))]
        if operation == "divide" and x[1].names:
            if positive(guards, x[1]) is not True:
                self.divisors.append(x[1])
            return [Case(guards, x[0] * self._named(self.inverses, "s", x[1]))]
        if operation in ("less", "less_equal"):
            strict = operation == "less"
            told = positive(guards, x[1] - x[0] if strict else x[0] - x[1])
            if told is not None:
                return [Case(guards, told == strict)]
        return super().cases(guards, operation, x)

    def _named(self, found: dict[Condition, str], letter: str, p: Poly) -> Poly:
        return var(found.setdefault(tuple(sorted(p.terms.items())), f"{letter}{len(found)}"))


def positive(guards: Guards, p: Poly) -> bool | None:
    """Tell whether p > 0 where guards hold, as far as one of them alone decides it: None where none does."""
    for condition, above in guards if p.names else ():
        g = Poly(dict(condition))
        factor, offset = multiple(p, g if above else -g)
        if factor > 0 and (offset > 0 or (above and offset == 0)):
            return True
        if factor < 0 and offset <= 0:
            return False
    return None


@dataclass(frozen=True)
class Side:
    """The control where guards hold."""

    guards: Guards
    u: list[Poly]

    @property
    def known(self) -> list[Poly]:
        """Return what is not negative there."""
        return [Poly(dict(condition)) * (1 if above else -1) for condition, above in sorted(self.guards)]


class PointLoop:
    """A craft near a libration point under a law; `sides` are the cases of the law, which together are all states."""

    def __init__(self, claim: Claim) -> None:
        self.claim, self.ring, self.x, self.v = claim, Asking(), variables("x"), variables("v")
        told = {"position": self.x, "velocity": self.v}
        self.told = {
            name: p
            for word, value in told.items()
            for at in ("", "measurement.")
            for name, p in wired(at + word, value).items()
        }
        self.field = self.single("field", 3)
        demand(not claim.taken.content, "the loop is taken with nothing")

    def single(self, role: str, count: int) -> list[Poly]:
        """Return the outputs of a program that does not switch."""
        return [single(cases) for cases in read(self.claim, role, count, self.ring, self.told)]

    @cached_property
    def sides(self) -> list[Side]:
        """Return the cases of the law's three outputs together."""
        found: list[Side] = []
        for cases in product(*read(self.claim, "law", 3, self.ring, self.told)):
            guards = frozenset(guard for case in cases for guard in case.guards)
            if not any((p, not above) in guards for p, above in guards):
                found.append(Side(guards, [case.value for case in cases]))
        return found

    def acceleration(self, side: Side) -> list[Poly]:
        """Return v'."""
        return [a + u for a, u in zip(self.field, side.u, strict=True)]

    def along(self, p: Poly, acceleration: list[Poly]) -> Poly:
        """Return the derivative of a function of the state along the motion."""
        return total(p.slope(name) * rate for name, rate in zip(STATE, (*self.v, *acceleration), strict=True))

    @property
    def linear(self) -> bool:
        """Return whether the field is linear in the state."""
        return all(len(m) <= 1 and {*m} <= {*STATE} for p in self.field for m in p.terms)

    def relay(self, wrong: list[Poly]) -> tuple[str, str]:
        """Return the names of |wrong| and of its inverse; of none that is asked for where none is."""
        size = self.ring.roots.get(tuple(sorted(dot(wrong, wrong).terms.items())), "")
        return size, self.ring.inverses.get((((size,), var(size).terms[size,]),), "")
