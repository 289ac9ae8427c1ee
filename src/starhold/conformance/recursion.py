"""Checks that small errors of estimates are driven as the estimator's `recursion` says."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.quaternion import Quaternion, multiply, normalise, to_body
from starhold.algebra.structure import unflatten
from starhold.algebra.vector import ZERO, Matrix, Vector, add, norm, scale, subtract
from starhold.certification.measured import estimated
from starhold.conformance.bench import loop_with, turned
from starhold.conformance.directions import inertial_directions, turn_between
from starhold.conformance.verdicts import NotApplicableError, require
from starhold.parts.contract import NO_ERRORS, Noise, Recursion
from starhold.parts.part import Fitted, Part
from starhold.parts.vectors import KINDS

Array = NDArray[np.float64]
PERIOD, EVERY, SETTLED, STEPS, NEAR = 1.0, 2, 2000, 160, 0.05
"""A control period (s) and so many between attitudes; the steps after which estimates count as settled, those of a flight
with errors after that, and the share by which errors may differ from what is said."""
TURN, RATE, WALK, SPEEDING = 1e-6, 3e-7, 1e-9, (1e-5, 2e-5, -1e-5)
"""Deviations of attitudes (rad), readings of the rate and steps of its bias (rad/s), and an acceleration (rad/s2), so small
that errors are linear in them."""
ROOT: Matrix = ((TURN, 0.2 * TURN, 0.0), (0.0, 0.7 * TURN, 0.1 * TURN), (0.0, 0.0, 1.3 * TURN))
SPIN: Vector = (0.01, -0.02, 0.015)


def errs_as_it_says(part: Part) -> None:
    """Small errors of readings, and the body's acceleration, make errors of the estimate as its `recursion` says."""
    tell: Any = part.hook("recursion")
    if tell is None:
        raise NotApplicableError("it does not say how noise drives its errors")
    known = False
    for params in part.examples():
        fitted, more = Fitted(part, params), len(getattr(params, "more_trackers", ()))
        for walk in (WALK, 0.0):
            noise = Noise(ROOT, EVERY, RATE, walk, more=(ROOT,) * more)
            recursion: Recursion | None = tell(params, noise, PERIOD, SPIN)
            if recursion is not None:
                known = True
                _follows(fitted, recursion, tell, noise)
                break
    if not known:
        raise NotApplicableError("its examples are not linear")


def _follows(fitted: Fitted, recursion: Recursion, tell: Any, noise: Noise) -> None:
    """Check an estimate with small errors of its readings against the recursion, and one on a body that speeds up."""
    random, count = np.random.default_rng(5), recursion.noises
    drawn: Array = random.normal(size=(STEPS, count, 3))
    fly = _flight(fitted, noise, len(noise.more))
    quiet, noisy, hurried = fly(np.zeros_like(drawn), ZERO), fly(drawn, ZERO), fly(np.zeros_like(drawn), SPEEDING)
    made = [np.subtract(a, b) for a, b in zip(noisy, quiet, strict=True)]
    # A step of the bias between two readings counts with the one before or the one after.
    apart = [
        [float(np.abs(a - b)[STEPS // 2 :].max()) for a, b in zip(made, expected, strict=True)]
        for expected in (_expected(recursion, drawn, shift) for shift in (0, 1))
    ]
    for k, name in enumerate(("attitude", "rate")):
        size = float(np.abs(made[k][STEPS // 2 :]).max())
        off = min(one[k] for one in apart)
        require(off <= NEAR * max(size, 1e-3 * TURN), f"errors of the {name} of {size:g} are off by {off:g}")
    given = fitted.params, PERIOD, SPIN
    bound = estimated(recursion, tell, given, noise, [NO_ERRORS], [NO_ERRORS] * (1 + len(noise.more)))
    if bound is not None:
        for name, late, most in zip(
            ("attitude", "rate"), hurried, (bound.attitude_per_acceleration, bound.rate_per_acceleration), strict=True
        ):
            size, most = float(np.linalg.norm(late, axis=1).max()), most * norm(SPEEDING)
            require(
                size <= most * (1.0 + NEAR) + 1e-8, f"of a body that speeds up the {name} is off by {size:g}, not {most:g}"
            )


def _expected(recursion: Recursion, drawn: Array, shift: int) -> tuple[Array, Array]:
    """Return the errors of attitude and rate at each step that the recursion gives, with walks of so many steps before."""
    errors, amiss = (ZERO,) * recursion.size, list[tuple[Vector, Vector]]()
    walks = np.roll(drawn[:, 1], shift, axis=0)
    for step, (random, walk) in enumerate(zip(drawn, walks, strict=True)):
        move = recursion.carried if step % recursion.every else recursion.corrected
        vectors = [unflatten(x, ZERO) for x in random]
        vectors[1] = unflatten(walk, ZERO)
        errors, attitude, rate = move(errors, tuple(vectors))
        amiss.append((attitude, rate))
    attitudes, rates = zip(*amiss, strict=True)
    return np.array(attitudes), np.array(rates)


def _flight(fitted: Fitted, noise: Noise, more: int) -> Callable[[Array, Vector], tuple[Array, Array]]:
    """Return a function of errors of readings (steps, vectors, 3) and of an acceleration (rad/s2) that flies a settled
    estimator and gives the errors of its attitude and rate at each step, (steps, 3) each."""
    loop, module, numbers = loop_with(fitted.part, fitted.params), fitted.part.module, fitted.prepared(PERIOD)
    begun, state = fitted.remembered(numbers, loop.start), _state(loop.start.attitude, SPIN, ZERO)
    shown = _directions(fitted, loop.start.position)

    def estimate(memory: Any, attitude: Quaternion, rate: Vector, errors: Any, step: int) -> tuple[Any, Any]:
        measured = [normalise(multiply(attitude, (1.0, *scale(0.5, one)))) for one in errors[1:]]
        new = float(step % noise.every == 0)
        read = [
            SimpleNamespace(attitude=one, attitude_is_new=new, rate=add(rate, errors[0]), **shown(one, new, step))
            for one in measured
        ]
        if more:
            read[0].every = tuple(SimpleNamespace(**vars(one)) for one in read)
        return module.estimate(read[0], memory, numbers, loop.craft, PERIOD)

    exact = (ZERO,) * (2 + more)
    # Directions give an attitude anew each time.
    settled = SETTLED if fitted.part.hook("combined") is None else EVERY
    for step in range(settled):
        attitude, rate = next(state)
        _, begun = estimate(begun, attitude, rate, exact, step)
    last = next(state)

    def fly(drawn: Array, speeding: Vector) -> tuple[Array, Array]:
        memory, bias, amiss = begun, ZERO, list[tuple[Vector, Vector]]()
        moved = _state(*last, speeding)
        for step, random in enumerate(drawn):
            attitude, rate = next(moved)
            first, walk, *turns = (unflatten(x, ZERO) for x in random)
            roots = (noise.attitude, *noise.more)
            off = [unflatten(np.array(root) @ turn, ZERO) for root, turn in zip(roots, turns, strict=True)]
            after, memory = estimate(memory, attitude, rate, (add(scale(noise.rate, first), bias), *off), settled + step)
            bias = add(bias, scale(noise.walk, walk))
            amiss.append((turn_between(attitude, after.attitude), subtract(after.rate, rate)))
        attitudes, rates = zip(*amiss, strict=True)
        return np.array(attitudes), np.array(rates)

    return fly


def _directions(fitted: Fitted, position: Vector) -> Callable[[Quaternion, float, int], dict[str, Any]]:
    """Return what an estimator of directions reads on a craft with an attitude at a step, with flags of what is new; of
    another one, nothing."""
    if fitted.part.hook("combined") is None:
        return lambda attitude, new, step: {}

    def shown(attitude: Quaternion, new: float, step: int) -> dict[str, Any]:
        there = inertial_directions(fitted.params, position, step * PERIOD)
        seen = {KINDS[kind][0]: to_body(attitude, there[kind]) for kind in KINDS}
        seen["magnetic_field"] = scale(there["strength"], seen["magnetic_field"])
        flags = ("sun_is_seen", "nadir_is_seen", "magnetic_field_is_new")
        return {**seen, **dict.fromkeys(flags, new), "position": position}

    return shown


def _state(attitude: Quaternion, rate: Vector, speeding: Vector) -> Iterator[tuple[Quaternion, Vector]]:
    """Yield attitude and rate of a body at each step, which speeds up."""
    while True:
        yield attitude, rate
        after = add(rate, scale(PERIOD, speeding))
        attitude, rate = turned(attitude, rate, after, PERIOD), after
