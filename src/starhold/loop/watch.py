"""The duration of a slew and the peaks of rate and acceleration are recorded along a flight."""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

from starhold.algebra.quaternion import relative, to_body
from starhold.algebra.scalar import absolute, less, maximum, where
from starhold.algebra.vector import Vector, dot, subtract
from starhold.algebra.words import number_of
from starhold.loop.closed_loop import Composition


class Ends(NamedTuple):
    """The ends of a transient: the inverse of sin2(angle / 2), and of rate2 ((rad/s)^-2)."""

    angle: float
    rate: float


class Watched(NamedTuple):
    """A transient has these notes: squares of the error angle's half sine and of the relative rate, both over their ends,
    at the last instant; the control step, with its fraction, at which each was last above 1; the largest square of the
    body's rate (rad2/s2), and for each of its components the largest mean rate of change over a control step (rad/s2)."""

    angle: float
    rate: float
    angle_step: float
    rate_step: float
    peak_rate: float
    peak_acceleration: Vector


@cache
def watch(parts: Composition) -> Any:
    """The `note` of an `Observer` that keeps a `Watched`; its numbers are `Ends`."""
    target = parts.target
    assert target is not None

    def last_above(then: Any, now: Any, before: Any, step: Any) -> Any:
        # A fraction of the step before, by a line through the two squares.
        crossing = number_of(step) + (before - 1.0) / (before - now)
        return where(less(1.0, now), number_of(step + 1), where(less(1.0, before), crossing, then))

    def note(seen: Watched, decided: Any, carry: Any, step: Any, setup: Any, ends: Ends) -> Watched:
        s = carry.state
        mode = (carry.memory.mode,) if target.flag("BY_MODE") else ()
        goal = target.module.goal(setup.target, s, step + 1, carry.memories.followed, *mode)
        error = relative(goal.attitude, s.attitude)
        left = subtract(s.rate, to_body(error, goal.rate))
        angle = ends.angle * (error[1] * error[1] + error[2] * error[2] + error[3] * error[3])
        rate = ends.rate * dot(left, left)
        moved, most = subtract(s.rate, decided.state.rate), seen.peak_acceleration
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

    return note
