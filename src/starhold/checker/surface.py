"""Shows that a law with a surface reaches it against torque from outside, and ends on target or near it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from flint import arb

from starhold.algebra.polynomial import Polynomial
from starhold.checker.exact import (
    ZERO,
    CheckError,
    Interval,
    Rows,
    definite,
    demand,
    down,
    dual,
    greatest,
    identity,
    intervals,
    least,
    matmul,
    plus,
    rational,
    replaced,
    root_above,
    symmetric_part,
    times,
    transpose,
    up,
)
from starhold.checker.loop import TURN, ExactLoop, W
from starhold.checker.subject import LoopSubject, named, variables


class Sliding:
    """The proof for one subject: s = w + Kq, J s' = (torque from outside) - T, T_i = reach_i where s_i >= width_i, minus
    that where s_i <= -width_i, in between proportional to s_i."""

    def __init__(self, subject: LoopSubject, numbers: Mapping[str, Any]) -> None:
        self.subject, self.told = subject, numbers
        self.torque = [rational(x) for x in numbers["torque"]]
        self.size, self.angle, self.rate = (rational(numbers[key]) for key in ("surface", "angle", "rate"))
        self.K: Rows = []
        self.reach: list[Any] = []
        self.width: list[Any] = []
        self._read(ExactLoop(subject))

    def _read(self, loop: ExactLoop) -> None:
        surface = getattr(self.subject.law.module, "surface", None)
        demand(surface is not None, "the law has no surface")
        s: Any = surface(loop.measurement, self.subject.gains)  # pyright: ignore
        slopes: Any = surface(loop.moving, dual(self.subject.gains))  # pyright: ignore
        for own, w in zip(s, W, strict=True):
            rest = own - w
            demand(all(len(m) == 1 and m[0] in TURN for m in rest.terms), "the surface is not w + Kq")
            self.K.append([rest.terms.get((name,), ZERO) for name in TURN])
        outside = [e + m for e, m in zip(variables(named("e")), variables(named("m")), strict=True)]
        found: list[list[tuple[Interval, Polynomial]]] = [[], [], []]
        for truths, torque in loop.pieces:
            held = intervals(truths, s)
            if held is None:
                continue
            rates = [replaced(component.slope, torque) for component in slopes]
            for k, row in enumerate(self.subject.inertia):
                momentum = row[0] * rates[0] + row[1] * rates[1] + row[2] * rates[2]
                found[k].append((held[k], outside[k] - momentum))
        for own, pieces in zip(s, found, strict=True):
            self._switch(own, pieces)

    def _switch(self, s: Polynomial, pieces: list[tuple[Interval, Polynomial]]) -> None:
        """Read the switching torque of an axis from its pieces."""
        sides: dict[int, set[Any]] = {1: set(), -1: set()}
        inside: list[tuple[Interval, Any]] = []
        for (low, high), T in pieces:
            value = T.value
            if value is not None and value != 0:
                sign = 1 if value > 0 else -1
                border, free = (low, high) if sign > 0 else (high, low)
                if border is None or free is not None or sign * border < 0:
                    raise CheckError("an axis pushes to the wrong side")
                sides[sign].add((abs(value), sign * border))
            else:
                first = next(iter(s.terms))
                share = T.terms.get(first, ZERO) / s.terms[first]
                demand(not (T - share * s).terms, "J s' has terms it must not have")
                inside.append(((low, high), share))
        demand(len(sides[1]) == 1 and sides[1] == sides[-1], "an axis does not switch alike on both sides")
        reach, width = next(iter(sides[1]))
        for held, share in inside:
            fits = held == (-width, width) and (width == 0 or share * width == reach)
            demand(fits, "within the layer the torque does not lead from one side to the other")
        self.reach.append(reach)
        self.width.append(width)

    def layered(self) -> bool:
        """Whether there is a layer for a torque to push into."""
        return any(self.width) and any(self.torque)

    def form(self) -> str:
        """Shown by reading it."""
        return "J s' is the torque from outside less a switching torque of each axis's own s"

    def reaches(self) -> str:
        """s.Js falls outside the layer."""
        subject = self.subject
        for torque, modelled in zip(self.torque, subject.modelled, strict=True):
            demand(torque >= modelled + subject.disturbance, "the torque from outside may be larger")
        margin = rational(self.told["margin"])
        most = min(g - m for g, m in zip(self.reach, self.torque, strict=True))
        demand(0 < margin <= most, "the switching torque has no such margin")
        return "the switching torque exceeds that from outside on each axis"

    def holds(self) -> str:
        """On the surface the derivative of 2 (1 - q0) is -q.Kq."""
        demand(definite(symmetric_part(self.K)), "the surface does not lead to the target")
        return "the minors of the symmetric part of K are positive"

    def layer(self) -> str:
        """Where s.Js may rise, every |s_i| is so small that on a level set of s.Js around them |s| <= size."""
        axes = list(zip(self.torque, self.reach, self.width, strict=True))
        # What all axes can add is at most this; where one takes more, s.Js falls.
        added = sum((width * m**2 / (4 * g) for m, g, width in axes), ZERO)
        square = ZERO
        for m, g, width in axes:
            inside = width > 0 and added <= (g - m) * width
            far = width * (m + root_above(m**2 + 4 * g * added / width)) / (2 * g) if inside else added / (g - m)
            square += far**2
        moments = greatest(self.subject.inertia), least(self.subject.inertia)
        demand(self.size >= 0 and self.size**2 * moments[1] >= moments[0] * square, "|s| may stay larger")
        thin = definite(plus(symmetric_part(self.K), identity(3, self.size), -1))
        demand(thin, "the layer is too thick for the surface's slope")
        return "s.Js falls but where every |s_i| is small"

    def least(self) -> Any:
        """A rational not above the least eigenvalue of the symmetric part of K."""
        return least(symmetric_part(self.K))

    def ends(self) -> str:
        """|q| <= |s|/K_min in the end, as the derivative of 2 (1 - q0) is at most |q| (|s| - K_min |q|); and w = s - Kq."""
        demand(self.size >= 0 and 0 <= self.angle <= down(arb.pi()) and self.rate >= self.size, "an end is out of range")
        if self.size > 0:
            turn = self.size / self.least()
            demand(turn < 1 and down((arb(self.angle) / 2).sin()) >= turn, "the angle may end larger")
            square = matmul(transpose(self.K), self.K)
            within = plus(identity(3, (self.rate - self.size) ** 2), times(turn**2, square), -1)
            demand(definite(within, strictly=False), "the rate may end larger")
        return "angle and rate follow from the bound of |s|"

    def cover(self) -> str:
        """As published, q0 = -1 repels on the surface. Else |s| < K_min on the whole way, so that q0 = 0 is never passed:
        there 2 q0' = q.Kq - s.q > 0."""
        told, turn = self.told, rational(self.told["slew_angle"])
        if self.subject.sign_policy == "as_published":
            demand(told["everything"] and told["start"] is None and told["rate_start"] is None, "everything has no bounds")
            demand(0 <= turn <= up(2 * arb.pi() * (1 + arb(10) ** -15)), "the turn is more than a full one")
            self.holds()
            return "the derivative of 1 - q0 is negative beside it"
        demand(not told["everything"] and told["start"] is not None and told["rate_start"] is not None, "there is no start")
        start, rate, J = rational(told["start"]), rational(told["rate_start"]), self.subject.inertia
        slowest = least(J) * self.least() ** 2
        demand(self.least() > 0 and 0 < 2 * start < slowest, "the quaternion sign may switch on the way")
        thin = definite(plus(symmetric_part(self.K), identity(3, self.size), -1))
        demand(thin, "the layer lets the quaternion sign switch")
        demand(rate >= 0 and 0 <= turn <= down(arb.pi()), "turn or rate is out of range")
        demand(definite(plus(identity(3, 2 * start), times(rate**2, J), -1), strictly=False), "the rate is not in it")
        sine = up((arb(turn) / 2).sin() ** 2)
        most = greatest(J) * greatest(matmul(transpose(self.K), self.K)) * sine
        demand(most <= 2 * start, "the turn is not in it")
        return "|s| stays below the least slope of the surface"
