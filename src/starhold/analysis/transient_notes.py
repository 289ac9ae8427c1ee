"""Notes on the end of a slew and on its peaks, of samples of a recording and of many lanes step by step."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from starhold.algebra.scalar import absolute, less, maximum, where
from starhold.algebra.structure import chosen
from starhold.algebra.vector import ZERO, Vector, dot, subtract
from starhold.analysis.meter import CROSSING, Metric


class Ends(NamedTuple):
    """The ends of a transient: the inverse of sin2(angle / 2), and of rate2 ((rad/s)^-2); and the time between notes (s)."""

    angle: float
    rate: float
    period: float

    @classmethod
    def of(cls, angle: float, rate: float, period: float) -> Ends:
        """Return the ends for an angle (rad) and a rate (rad/s)."""
        return cls(1.0 / math.sin(0.5 * angle) ** 2, 1.0 / rate**2, period)


class Watched(NamedTuple):
    """The notes of a transient: squares of the sine of half the error angle and of the relative rate, both over their ends,
    at the last instant; the instant, with its fraction, at which each was last above 1; the largest square of the body's
    rate (rad2/s2), and for each of its components the largest mean rate of change from instant to instant (rad/s2)."""

    angle: float
    rate: float
    angle_step: float
    rate_step: float
    peak_rate: float
    peak_acceleration: Vector


class Sampled(NamedTuple):
    """Notes on samples of a recording, and the body's rate (rad/s) at the last one."""

    watched: Watched
    rate: Vector


NOTHING = Watched(0.0, 0.0, 0.0, 0.0, 0.0, ZERO)
"""The notes before a flight."""


def watched(
    seen: Watched, error: Any, left: Vector, rate: Vector, moved: Vector, then: Any, now: Any, ends: Ends
) -> Watched:
    """Return the notes at the instant `now`: error, left: attitude and rate relative to the target; rate: the body's;
    moved: its change since the instant `then`, one earlier."""

    def last_above(last: Any, square: Any, before: Any) -> Any:
        # A fraction of the previous step, by linear interpolation of the two squares.
        crossing = then + (before - 1.0) / (before - square)
        return where(less(1.0, square), now, where(less(1.0, before), crossing, last))

    angle = ends.angle * (error[1] * error[1] + error[2] * error[2] + error[3] * error[3])
    square, most = ends.rate * dot(left, left), seen.peak_acceleration
    return Watched(
        angle,
        square,
        last_above(seen.angle_step, angle, seen.angle),
        last_above(seen.rate_step, square, seen.rate),
        maximum(seen.peak_rate, dot(rate, rate)),
        (
            maximum(most[0], absolute(moved[0]) / ends.period),
            maximum(most[1], absolute(moved[1]) / ends.period),
            maximum(most[2], absolute(moved[2]) / ends.period),
        ),
    )


def begun(wanted: bool) -> Any:
    """Return the notes of samples before the first; none where no transient is asked for."""
    return Sampled(NOTHING, ZERO) if wanted else ()


def noted(seen: Any, quantities: Mapping[str, Any], now: Any, ends: Any) -> Any:
    """Return the notes after a sample."""
    if not seen:
        return seen
    error, left, rate = (quantities[name] for name in ("attitude_error", "rate_error", "rate"))
    moved = chosen(less(now, 0.5), ZERO, subtract(rate, seen.rate))
    return Sampled(watched(seen.watched, error, left, rate, moved, now - 1.0, now, ends), rate)


def table(rows: Any, period: float, every: int) -> dict[str, Metric]:
    """Return the metrics of notes at these rows, of samples every so many control periods (s)."""
    if not rows:
        return {}
    seen = rows.watched
    return {
        "transient_time": Metric("s", CROSSING, seen[:4], (float(every), period)),
        "peak_rate": Metric("rad/s", "root", (seen.peak_rate,)),
        "peak_acceleration": Metric("rad/s^2", "most", seen.peak_acceleration),
    }
