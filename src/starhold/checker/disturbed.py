"""Bounds where motions end that a torque from outside, bounded in norm, keeps from equilibrium."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

from flint import arb, fmpq

from starhold.algebra.polynomial import Polynomial
from starhold.checker.exact import (
    ONE,
    ZERO,
    Rows,
    block,
    definite,
    demand,
    down,
    greatest,
    identity,
    inverse,
    matmul,
    plus,
    rational,
    replaced,
    root_above,
    times,
    transpose,
)
from starhold.checker.gyroscopic import gyroscopic_bound
from starhold.checker.loop import RATE, TURN, letters
from starhold.checker.odd_region import OddRegion
from starhold.checker.region import Numbers, optional
from starhold.checker.shapes import STEP, shaped
from starhold.checker.subject import LoopSubject, named, variables


class Disturbed:
    """A torque m does work m.(W'w + epsilon q) on V + epsilon C, of which the square is x.Rx, x = (w, q): at most
    tau x.Rx + m2/(4 tau). So V + epsilon C falls outside {x.(Q - tau R)x <= m2/(4 tau)}, the ball."""

    def __init__(self, subject: LoopSubject, region: OddRegion, numbers: Numbers, witness: Numbers) -> None:
        self.subject, self.region, self.numbers, self.witness = subject, region, numbers, witness
        self.torque, self.tau, self.beta = (rational(x) for x in (numbers["torque"], witness["tau"], witness["beta"]))

    @cached_property
    def left(self) -> Rows:
        """Q - tau R."""
        epsilon, W = self.region.epsilon, self.region.frame.W
        pushed = block(matmul(W, transpose(W)), times(epsilon, W), identity(3, epsilon**2))
        return plus(self.region.fall(), pushed, -self.tau)

    @cached_property
    def turn(self) -> Any:
        """A bound of |q| in the ball."""
        demand(self.tau > 0, "tau is not positive")
        return root_above(self.torque**2 / (4 * self.tau) * greatest([row[3:] for row in inverse(self.left)[3:]]))

    def descent(self) -> str:
        """V + epsilon C falls outside the ball."""
        self.region.positive()
        self.region.target()
        demand(self.tau > 0 and self.beta > 0 and self.region.epsilon > 0, "tau, beta or epsilon is not positive")
        demand(definite(self.left), "V + epsilon C may rise far away")
        return "definite by its minors"

    def start(self) -> str:
        """The level set holds one ball only."""
        region, s, cover = self.region, self.region.frame.s, self.subject.sign_policy
        region.strict()
        if cover == "shortest":
            region.single()
        elif cover == "hysteresis":
            region.jumps()
            demand(self.turn**2 < 1 - self.subject.width**2, "the ball around the other equilibrium may be reached")
        else:
            # Near the other equilibrium, |q| <= turn and q0 < 0, V is at least s (1 + sqrt(1 - turn2)).
            demand(region.level is not None and region.level < s * (2 - self.turn**2), "the other ball may be met")
        return "the level set holds one ball only"

    def end(self) -> str:
        """From the start set motions come to where rate and angle are as told."""
        felt = self.subject.disturbance + self.subject.modelled_norm * max(self.region.frame.felt, self.region.crossed.felt)
        demand(self.torque >= felt, "the torque from outside may be larger")
        rate, turn = self._ball()
        for step in self.witness["steps"]:
            shaped(step, STEP, "a step")
            rate, turn = self._step(step, rate, turn)
        told_angle, told_rate = rational(self.numbers["angle"]), rational(self.numbers["rate"])
        demand(0 <= told_angle <= down(arb.pi()), "the angle is not between 0 and a half turn")
        demand(down((arb(told_angle) / 2).sin()) >= turn, "the angle may end larger")
        demand(told_rate >= rate, "the rate may end larger")
        return "V + epsilon C, then forms x.Sx fall outside sets that are within the end"

    def _ball(self) -> tuple[Any, Any]:
        """Bounds of |w| and |q| where V + epsilon C is no larger than in the ball; there q0 > 0."""
        region, s, J, epsilon = self.region, self.region.frame.s, self.region.loop.inertia, self.region.epsilon
        P = region.frame.P
        demand(self.turn < 1, "the ball reaches every attitude")
        # In the ball s (1 - q0) = s q2/(1 + q0), q0 being at least the root of 1 - turn2.
        spring = s / (1 + down(arb(1 - self.turn**2).sqrt()))
        whole = block(times(fmpq(1, 2), P), times(epsilon / 2, transpose(J)), identity(3, spring))
        demand(definite(plus(self.left, whole, -self.beta), strictly=False), "V + epsilon C may be larger in the ball")
        end = self.torque**2 / (4 * self.tau * self.beta)
        demand(region.start is not None and end < (1 + region.rho) * region.start, "the end is no lower than the start")
        # Over every w V + epsilon C is at least held (1 - q0), and over every q at least w.(lean)w/2, as q2 <= 2 (1 - q0).
        held = s - epsilon**2 * greatest(matmul(matmul(J, inverse(P)), transpose(J)))
        lean = plus(P, times(epsilon**2 / s, matmul(transpose(J), J)), -1)
        demand(end < held and definite(lean), "the end reaches half a turn, or has no bound")
        return root_above(2 * end * greatest(inverse(lean))), root_above(1 - (1 - end / held) ** 2)

    def _step(self, step: Mapping[str, Any], rate: Any, turn: Any) -> tuple[Any, Any]:
        """The smaller bounds that a form S leaves: with x' = Ax + (J^-1 (m + g), n), |m + g| <= push and n the rest of the
        kinematics, |n|2 <= (1 - q0)|w|2/2, x.Sx falls where it exceeds 1."""
        S: Rows = [[rational(x) for x in row] for row in step["form"]]
        demand(transpose(S) == S and definite(S), "a form is not symmetric or not positive")
        decay, spread = rational(step["decay"]), rational(step["spread"])
        demand(decay > 0 and spread > 0, "decay or spread is not positive")
        A, J_inverse, gamma = self._nearby
        push, lost = self.torque + gamma * rate**2, 1 - down(arb(1 - turn**2).sqrt())
        fed = block(times(push**2 / decay, matmul(J_inverse, transpose(J_inverse))), identity(3, ZERO), identity(3, spread))
        swept = block(identity(3, lost / (2 * spread)), identity(3, ZERO), identity(3, ZERO))
        rising = matmul(transpose(A), S)
        for more in (transpose(rising), times(decay, S), matmul(matmul(S, fed), S), swept):
            rising = plus(rising, more)
        demand(definite(times(-ONE, rising)), "x.Sx may rise where it exceeds 1")
        inner = inverse(S)
        sizes = [root_above(greatest([row[k : k + 3] for row in inner[k : k + 3]])) for k in (0, 3)]
        return min(rate, sizes[0]), min(turn, sizes[1])

    @cached_property
    def _nearby(self) -> tuple[Rows, Rows, Any]:
        """A, J^-1 and what |g| does not exceed over |w|2, of the piece around the equilibrium."""
        loop, J = self.region.loop, self.region.loop.inertia
        found = loop.accelerations(loop.resting()[1])
        kinds = {letters(m) for part in found for m in part.terms}
        demand(not kinds - {"q", "w", "ww", "e", "m"}, f"the acceleration has the terms {', '.join(sorted(kinds))}")
        J_inverse = inverse(J)
        known, unknown = ([part.only(lambda m, k=kind: letters(m) == k) for part in found] for kind in "em")
        acts = [[part.terms.get((name,), ZERO) for name in named("m")] for part in unknown]
        demand(acts == J_inverse, "torque from outside acts on the rate in another way")
        as_unknown = [replaced(part, dict(zip(named("e"), variables(named("m")), strict=True))) for part in known]
        felt, pairs = self.region.frame.felt, list(zip(as_unknown, unknown, strict=True))
        same = any(not any((one - share * other).terms for one, other in pairs) for share in (felt, -felt))
        demand(same, "the modelled torque acts on the rate in another way than on V")
        upper = [[part.terms.get((name,), ZERO) for name in (*RATE, *TURN)] for part in found]
        lower = [[*half, *none] for half, none in zip(identity(3, fmpq(1, 2)), identity(3, ZERO), strict=True)]
        torques = [sum((c * part for c, part in zip(row, found, strict=True)), Polynomial({})) for row in J]
        return upper + lower, J_inverse, gyroscopic_bound(torques, identity(3), optional(self.witness["shift"]))
