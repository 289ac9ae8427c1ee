"""A kernel that flies many lanes and notes how long a turn takes, and how fast the body gets on the way."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

from starhold.algebra.quaternion import relative, to_body
from starhold.algebra.scalar import absolute, equation, less, maximum, where
from starhold.algebra.structure import LANES, load, store
from starhold.algebra.vector import ZERO, Vector, dot, subtract
from starhold.loop.closed_loop import Parts
from starhold.loop.kernels import compiled, make_step


class Ends(NamedTuple):
    """When a transient counts as over: one over sin2(angle / 2) and one over rate2 ((rad/s)^-2)."""

    angle: float
    rate: float


class Watched(NamedTuple):
    """What is noted of a transient: squares of the error angle's half sine and of the relative rate, both over their ends,
    at the last instant; the control step, with its fraction, at which each was last above 1; the largest square of the
    body's rate (rad2/s2), and of each of its components the largest mean rate of change over a control step (rad/s2)."""

    angle: float
    rate: float
    angle_step: float
    rate_step: float
    peak_rate: float
    peak_acceleration: Vector


@cache
def make_watch(parts: Parts) -> Callable[..., Any]:
    """A kernel that flies many lanes as `many` does, and notes a `Watched` of each."""
    _, decide, hold, check, _ = make_step(parts)
    target = parts.target

    @equation
    def last_above(then, now, before, step):
        # A fraction of the step before, by a line through the two squares.
        crossing = step - 1.0 + (before - 1.0) / (before - now)
        return where(less(1.0, now), 1.0 * step, where(less(1.0, before), crossing, then))

    @equation
    def note(seen, before, carry, step, ends, setup):
        """What is seen once step `step` is reached; `before` is the body's rate a control step ago."""
        s = carry.state
        goal = target(setup.target, s.position, s.velocity, step, carry.goal)
        error = relative(goal.attitude, s.attitude)
        left = subtract(s.rate, to_body(error, goal.rate))
        angle = ends.angle * (error[1] * error[1] + error[2] * error[2] + error[3] * error[3])
        rate = ends.rate * dot(left, left)
        moved, most = subtract(s.rate, before), seen.peak_acceleration
        return Watched(
            angle,
            rate,
            last_above(seen.angle_step, angle, seen.angle, step),
            last_above(seen.rate_step, rate, seen.rate, step),
            maximum(seen.peak_rate, dot(s.rate, s.rate)),
            (
                maximum(most[0], absolute(moved[0]) / setup.period),
                maximum(most[1], absolute(moved[1]) / setup.period),
                maximum(most[2], absolute(moved[2]) / setup.period),
            ),
        )

    def watch(x, like, first, count, run, gains, like_gains, known, craft, setup, substeps, ends, seen, like_seen, rates):
        """Fly control steps first .. first+count-1 of every lane of the block x, in place, and go on noting in the block
        `seen`; `rates` is a block of three for the kernel's own use. The rest is as in `many`."""
        for step in range(first, first + count):
            for k in range(LANES):
                c = check(load(x, k, like), step, setup)
                store(rates, k, c.state.rate)
                store(x, k, decide(c, step, run + k, load(gains, k, like_gains), known, setup))
            for _ in range(substeps):
                for k in range(LANES):
                    store(x, k, hold(load(x, k, like), craft, setup))
            for k in range(LANES):
                now = note(load(seen, k, like_seen), load(rates, k, ZERO), load(x, k, like), step + 1, ends, setup)
                store(seen, k, now)
        for k in range(LANES):
            store(x, k, check(load(x, k, like), first + count, setup))

    return compiled(watch, parts)
