"""Where motions end under a bounded torque from outside, once they are near the target: within ever smaller ellipsoids.

There x = (w, q) has x' = Ax + (J^-1 (m + g), n): the unknown torque m, what is quadratic in the rate, g, and what the
kinematics leave out of q' = w/2, n = ((q0 - 1) w + q x w)/2, of which |n|2 <= lost |w|2/2, lost being the most of 1 - q0.
With |m + g| <= push, x.Sx falls where it exceeds 1 if, for some a and c,

    A'S + SA + a S + (push2/a) S_w J^-2 S_w' + c S_q S_q' + (lost/2c) (1 over w) < 0.

But for the last two terms the best S for a given a is the inverse of the solution of a Lyapunov equation, and a is one
number to search (Abedor, Nagpal and Poolla, 1996). As the inequality is strict, motions that only come near a bound of rate
and attitude end in the ellipsoid all the same.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from typing import Any

import numpy as np
from flint import fmpq
from numpy.typing import NDArray

from starhold.algebra.polynomial import Polynomial, exact
from starhold.certification.gyroscopic import GyroscopicTorque, gyroscopic_torque
from starhold.certification.matrices import (
    Rows,
    block,
    definite,
    floats,
    greatest,
    identity,
    inverse,
    matmul,
    number,
    plus,
    root_above,
    root_below,
    times,
    transpose,
)
from starhold.certification.motion import AXES, RATE, Motion, ShapeError, at_rest

Array = NDArray[np.float64]
GAIN = 0.98
"""A step that leaves more than this share of the bounds is the last."""
STEPS, ROUNDS = 8, 40
RATES, TURNS = slice(0, 3), slice(3, 6)
HELD = 1.0 + 1e-7
"""A part more torque than there is in the guess of an ellipsoid, so that rounding does not spoil it."""


@dataclass(frozen=True)
class ShrinkingStep:
    """x.Sx falls where it exceeds 1, with a the `decay` and c the `spread`."""

    S: Rows
    decay: Any
    spread: Any


@dataclass(frozen=True)
class Nearby:
    """The motion near the equilibrium on target, of a torque from outside up to `torque`; bounds: |w| and |q|."""

    motion: Motion
    torque: Any

    @cached_property
    def accelerations(self) -> list[Polynomial]:
        """Those of the piece that holds around the equilibrium; ShapeError where they have other terms than told above."""
        found = [at_rest(component)[1] for component in self.motion.acceleration]
        kinds = {"".join(name[0] for name in m) for component in found for m in component.terms}
        if kinds - {"q", "w", "ww", "e", "m"} or any("q0" in component.variables() for component in found):
            raise ShapeError(f"the acceleration has other terms: {', '.join(sorted(kinds))}")
        return found

    @cached_property
    def linear(self) -> Rows:
        """A."""
        names = (*RATE, *AXES)
        upper = [[part.terms.get((name,), fmpq(0)) for name in names] for part in self.accelerations]
        return upper + [[*half, *still] for half, still in zip(identity(3, fmpq(1, 2)), identity(3, 0), strict=True)]

    @cached_property
    def turned(self) -> Rows:
        """J^-2."""
        found = inverse(self.motion.subject.inertia)
        return matmul(found, found)

    @cached_property
    def gyroscopic_torque(self) -> GyroscopicTorque:
        """The bound of |g| over |w|2."""
        J, zero = self.motion.subject.inertia, Polynomial.constant(0)
        turned = [sum((c * part for c, part in zip(row, self.accelerations, strict=True)), zero) for row in J]
        return gyroscopic_torque(turned, identity(3))

    def outside(self, rate: Any, turn: Any) -> tuple[Any, Any]:
        """Bounds of |m + g| and 1 - q0."""
        return self.torque + self.gyroscopic_torque.most * rate * rate, 1 - root_below(1 - turn * turn)

    def holds(self, step: ShrinkingStep, rate: Any, turn: Any) -> bool:
        """Whether the step's inequality does."""
        push, lost = self.outside(rate, turn)
        S, a, c = step.S, step.decay, step.spread
        fed = block(times(push * push / a, self.turned), identity(3, 0), identity(3, c))
        swept = block(identity(3, lost / (2 * c)), identity(3, 0), identity(3, 0))
        total = plus(matmul(transpose(self.linear), S), matmul(S, self.linear))
        for more in (times(a, S), matmul(matmul(S, fed), S), swept):
            total = plus(total, more)
        return definite(S) and definite(times(-1, total))

    def steps(self, rate: Any, turn: Any) -> tuple[list[ShrinkingStep], Any, Any]:
        """Steps from bounds of |w| and |q|, and those that they leave."""
        A, turned = floats(self.linear), floats(self.turned)
        found: list[ShrinkingStep] = []

        def shrink(place: slice) -> None:
            nonlocal rate, turn
            push, lost = (number(x) * HELD for x in self.outside(rate, turn))
            try:
                with warnings.catch_warnings():
                    # SciPy warns of what is near singular; whether a step holds is shown in rationals.
                    warnings.simplefilter("ignore", RuntimeWarning)
                    step = _guess(A, push * push * turned, lost, place)
            except ValueError:
                # A matrix is singular or not finite in floats.
                step = None
            if step is not None and self.holds(step, rate, turn):
                inner = inverse(step.S)
                sizes = [root_above(greatest([row[i : i + 3] for row in inner[i : i + 3]])) for i in (0, 3)]
                if sizes[0] < rate or sizes[1] < turn:
                    rate, turn = min(rate, sizes[0]), min(turn, sizes[1])
                    found.append(step)

        for _ in range(STEPS):
            before = rate, turn
            if self.gyroscopic_torque.most != 0:
                # Else the rate is no part of what the next step needs.
                shrink(RATES)
            shrink(TURNS)
            if rate > exact(GAIN) * before[0] and turn > exact(GAIN) * before[1]:
                break
        shrink(RATES)
        return found, rate, turn


def _guess(A: Array, pushed: Array, lost: float, place: slice) -> ShrinkingStep | None:
    """An ellipsoid with a small bound of a part of x, in floats; None where none was found."""
    most = -2.0 * float(np.linalg.eigvals(A).real.max())
    if most <= 0.0:
        return None
    fed = np.zeros((6, 6))
    # SciPy takes a while to load, and not every command certifies.
    solve: Callable[..., Array] = import_module("scipy.linalg").solve_continuous_lyapunov

    def inner(a: float, rounds: int) -> tuple[float, float, Array]:
        """The largest |w|2 or |q|2 in the ellipsoid, c, and the inverse of S, by iteration."""
        moved, c = A + 0.5 * a * np.eye(6), 1.0
        fed[:3, :3], fed[3:, 3:] = pushed / a, 0.0
        inside = solve(moved, -fed)
        size = first = _size(inside, place)
        for _ in range(rounds):
            c = math.sqrt(0.5 * lost * _size(inside, RATES) * _size(inside, TURNS))
            fed[3:, 3:] = c * np.eye(3)
            inside = solve(moved, -fed - lost / (2.0 * c) * inside[:, RATES] @ inside[RATES])
            last, size = size, _size(inside, place)
            if not size < 100.0 * first:
                return math.inf, c, inside
            if abs(size - last) < 1e-9 * size:
                break
        return size, c, inside

    # What is lost hardly moves the best a, unless it is much.
    best = min(np.linspace(0.02, 0.98, 25), key=lambda share: inner(float(share) * most, 0)[0])
    for less in (1.0, 0.8, 0.6):
        a = float(best) * most * less
        size, c, X = inner(a, ROUNDS)
        if math.isfinite(size):
            S = np.linalg.inv(X)
            return ShrinkingStep([[exact(float(x)) for x in row] for row in 0.5 * (S + S.T)], exact(a), exact(c))
    return None


def _size(X: Array, place: slice) -> float:
    return max(float(np.linalg.eigvalsh(X[place, place])[-1]), 1e-300) if np.isfinite(X).all() else math.inf
