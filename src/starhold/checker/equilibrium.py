"""The loop of a law with an equilibrium beside a libration point, read off the law's and the models' equations, and its X
axis under a limited control.

Along X with the others at rest, x'' = p x - clip(k x + c x', U). With s = sqrt(p), S = x + x'/s, K = c/s, D = (k - s c)/p,
b = U/p and time in units of 1/s this is

    S' = S - clip(K S + D x, b),    x' = S - x.

Everything below is a + b s > 0 for rationals a and b, which squares decide: no s is ever rounded, and k - s c, zero for the
gains that a design means but not for their floats, is what it is.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

from starhold.algebra.polynomial import Polynomial, constants, pieces
from starhold.algebra.vector import add
from starhold.checker.exact import ONE, ZERO, Interval, demand, hurwitz, intervals
from starhold.checker.subject import named, variables
from starhold.checker.symbols import expanded, in_symbols
from starhold.laws.catalogue import Law
from starhold.laws.point import PointMeasurement
from starhold.parts.actuators.limits import limit_axis
from starhold.parts.bodies.libration_point import Libration, linear


@dataclass(frozen=True)
class EquilibriumLoop:
    """Law, gains, plant and motion of a loop, all numbers exact."""

    law: Law
    gains: Any
    plant: Libration
    full: bool

    @property
    def place(self) -> tuple[Any, Any, Any]:
        """Where the law puts the equilibrium."""
        return (ZERO, self.gains.y, self.gains.z)

    def flies(self) -> str:
        """The acceleration that is flown is the linear one and the law's feedback."""
        demand(not self.full or self.gains.model == 1, "the law undoes the linear model, and the full problem is flown")
        demand(self.full or self.gains.model == 0, "the law undoes what the linear model does not have")
        demand(_flies(self.law.module, self.full), "the law does more than its feedback")
        return "the acceleration flown is the linear one and the feedback"

    @cached_property
    def axes(self) -> list[tuple[Any, Any]]:
        """k and c of each axis: x'' = -k (x - place) - c x', and nothing else in it."""
        measurement: Any = PointMeasurement(variables(named("x")), variables(named("v")), *variables(("period", "limit")))
        gains, plant = constants(self.gains), constants(self.plant)
        accelerations: Any = add(
            linear(measurement.position, measurement.velocity, plant), self.law.module.feedback(measurement, gains, plant)
        )
        found: list[tuple[Any, Any]] = []
        for acceleration, x, v, place in zip(accelerations, named("x"), named("v"), self.place, strict=True):
            k, c = (-acceleration.terms.get((name,), ZERO) for name in (x, v))
            alone = -k * (Polynomial.variable(x) - place) - c * Polynomial.variable(v)
            demand(not (acceleration - alone).terms, "an axis depends on the others, or has its equilibrium elsewhere")
            found.append((k, c))
        return found

    def form(self) -> str:
        """Each axis moves on its own and by constant coefficients."""
        flown = self.flies()
        self.axes  # noqa: B018
        return f"{flown}: three oscillators"

    @property
    def stable(self) -> list[bool]:
        """Whether each axis returns, by Routh's array of r^2 + c r + k."""
        return [hurwitz([k, c, ONE]) for k, c in self.axes]

    def returns(self) -> str:
        """Both roots of every axis are on the left."""
        demand(all(self.stable), "an axis does not return")
        return "Routh's array of each axis has one sign"


@cache
def _flies(law: Any, full: bool) -> bool:
    """Whether, for all states and numbers, the command is the feedback and, in the full problem, takes off what the linear
    model leaves out; but for the centres of the bodies, where neither is a number."""
    loop = in_symbols(law, {"model": int(full)}, ("k_velocity",))
    meant = add(loop.natural, law.feedback(loop.measurement, loop.gains, loop.plant))
    return all(expanded(have - want) == 0 for have, want in zip(loop.flown(law, full), meant, strict=True))


# --- the X axis with limited control ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class LimitedAxis:
    """x'' = p x - clip(k x + c x', U)."""

    p: Any
    k: Any
    c: Any
    limit: Any

    @classmethod
    def of(cls, loop: EquilibriumLoop, limit: Any) -> LimitedAxis:
        """That of a loop in the linear model, with the others at rest, as model, law and limit make it piece by piece."""
        # The full problem would spend control on what the linear model leaves out.
        demand(not loop.full, "the limited control is read for the linear model alone")
        loop.flies()
        x, v = variables(("x1", "v1"))
        still = Polynomial({})
        speed: Any = (v, still, still)
        measurement: Any = PointMeasurement((x, *constants(loop.place[1:])), speed, *variables(("period", "limit")))  # pyright: ignore
        gains, plant = constants(loop.gains), constants(loop.plant)
        pull: Any = linear(measurement.position, measurement.velocity, plant)[0]
        command: Any = loop.law.module.feedback(measurement, gains, plant)
        p, k, c = pull.terms.get(("x1",), ZERO), -command[0].terms.get(("x1",), ZERO), -command[0].terms.get(("v1",), ZERO)
        asked = k * x + c * v
        demand(p > 0, "the point does not repel along X")
        demand(not (pull - p * x).terms and not (command[0] + asked).terms, "the axis depends on more than x and x'")
        acts: Any = limit_axis(command, constants(limit))[0]
        expected: dict[Interval, Polynomial] = {
            (None, -limit): pull + limit,
            (-limit, limit): pull - asked,
            (limit, None): pull - limit,
        }
        found: set[Interval] = set()
        for case in pieces(acts):
            within = intervals(case.truths, [asked])
            if within is not None:
                wanted = expected.get(within[0])
                demand(wanted is not None, "the control is limited in another way")
                demand(not (pull + case.value - wanted).terms, "the control is limited in another way")
                found.add(within[0])
        demand(found == set(expected), "the control is limited in another way")
        return cls(p, k, c, limit)

    def above(self, a: Any, b: Any) -> bool:
        """Whether a + b s > 0."""
        larger = a * a - b * b * self.p
        if a >= 0 and b >= 0:
            return bool(a > 0 or b > 0)
        if a <= 0 and b <= 0:
            return False
        return bool(larger > 0 if a > 0 else larger < 0)

    def stays(self, width: Any, reach: Any) -> str:
        """M = max(|S|/width, |x|/reach) falls, at least in proportion, wherever 0 < M <= 1.

        Where M = m is |S|/width, |x| <= m reach, and |S|' = |S| - clip(..) sign(S) is at most m times the larger of
        width - b (as m <= 1) and width - K width + |D| reach; where it is |x|/reach, |x|' <= m (width - reach). All three
        are negative. So motions leave no smaller copy of the set either, and M goes to zero exponentially.
        """
        p, k, c = self.p, self.k, self.c
        demand(0 < width < reach, "the reach is not beyond the width")
        demand(p * width < self.limit, "the limit is too low to turn motions round at the width")
        for side in (1, -1):
            demand(
                self.above(-p * width - side * k * reach, c * (width + side * reach)),
                "the feedback is too weak to turn motions round at the width",
            )
        return "max(|x + x'/s|/width, |x|/reach) falls wherever it is at most 1"

    def strict(self, width: Any, reach: Any, mu: Any) -> str:
        """So does (S^2 + mu x^2)/2, which the witness tells of, by region of the clipped control.

        Where it is not clipped, minus the derivative is (K - 1) S^2 + (D - mu) S x + mu x^2. Where it is, on the side of S,
        b |S| >= (b/width) S^2 makes it at least (b/width - 1) S^2 - mu S x + mu x^2. Where it is on the other side, which
        takes |D x| >= b + K |S|, it is at least (K - 1) S^2 - (|D| + mu) |S x| + mu x^2.
        """
        p, k, c = self.p, self.k, self.c
        self.stays(width, reach)
        demand(mu > 0, "mu is not positive")
        demand(self._outweighs(mu, -1), "the function may rise where the control is not clipped")
        demand(4 * (self.limit - p * width) > mu * p * width, "the function may rise where the control is clipped")
        for side in (1, -1):
            # |D| reach > b for that sign of D; then |D| + mu = side D + mu.
            if self.above(side * k * reach - self.limit, -side * c * reach):
                demand(self._outweighs(mu, side), "the function may rise where the control is clipped the wrong way")
        return "(S^2 + mu x^2)/2 falls in each region of the clipped control"

    def _outweighs(self, mu: Any, side: int) -> bool:
        """Whether 4 mu (K - 1) > (side D + mu)^2."""
        p, k, c = self.p, self.k, self.c
        # Times p^2; p (side D + mu) = a + b s.
        a, b = side * k + mu * p, -side * c
        return self.above(-4 * mu * p * p - a * a - b * b * p, 4 * mu * p * c - 2 * a * b)

    def beyond(self, boundary: Any) -> str:
        """Where |S| >= boundary, |S|' >= |S| - b is not negative whatever the control does within its limit: |S| stays
        above, and it would be zero at rest."""
        demand(boundary > 0 and boundary * self.p >= self.limit, "some motions return from beyond the boundary")
        return "beyond it the limit is at most what pulls away"
