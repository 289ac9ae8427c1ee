"""Notes on the end of a slew and on its peaks, for samples of a recording or for many lanes step by step."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from starhold.algebra.scalar import absolute, less, maximum, where
from starhold.algebra.structure import chosen
from starhold.algebra.vector import ZERO, Vector, dot, subtract
from starhold.analysis.meter import CROSSING, Metric


class Ends(NamedTuple):
    """The ends of a transient: inverses of sin^2(angle / 2) and of rate^2 ((rad/s)^-2); and the time between notes (s)."""

    angle: float
    rate: float
    period: float

    @classmethod
    def of(cls, angle: float, rate: float, period: float) -> Ends:
        """Return the ends for an angle (rad) and a rate (rad/s)."""
        return cls(1.0 / math.sin(0.5 * angle) ** 2, 1.0 / rate**2, period)


class Watched(NamedTuple):
    """The notes of a transient: squares of the sine of half the error angle and of the relative rate, both over their ends,
    at the last instant; the fractional instant at which each was last above 1; the largest square of the body's rate
    (rad2/s2); for each of its components the largest mean rate of change from instant to instant (rad/s2); and the last
    rate (rad/s)."""

    angle: Any = 0.0
    off_rate: Any = 0.0
    angle_step: Any = 0.0
    rate_step: Any = 0.0
    peak_rate: Any = 0.0
    peak_acceleration: Vector = ZERO
    rate: Vector = ZERO


def noted(seen: Any, quantities: Mapping[str, Any], now: Any, ends: Any) -> Any:
    """Return the notes after an instant; nothing if no transient is measured."""
    if not seen:
        return seen
    q, left, rate = (quantities[name] for name in ("attitude_error", "rate_error", "rate"))

    def last_above(last: Any, square: Any, before: Any) -> Any:
        # A fraction of the previous step, by linear interpolation of the two squares.
        crossing = now - 1.0 + (before - 1.0) / (before - square)
        return where(less(1.0, square), now, where(less(1.0, before), crossing, last))

    angle, off = ends.angle * (q[1] * q[1] + q[2] * q[2] + q[3] * q[3]), ends.rate * dot(left, left)
    moved: Any = chosen(less(now, 0.5), ZERO, subtract(rate, seen.rate))
    peaks: Any = tuple(
        maximum(most, absolute(change) / ends.period) for most, change in zip(seen.peak_acceleration, moved, strict=True)
    )
    steps = last_above(seen.angle_step, angle, seen.angle), last_above(seen.rate_step, off, seen.off_rate)
    return Watched(angle, off, *steps, maximum(seen.peak_rate, dot(rate, rate)), peaks, rate)


def table(seen: Any, period: float, every: int) -> dict[str, Metric]:
    """Return the metrics of notes at these rows, for samples at intervals of `every` control periods (s)."""
    if not seen:
        return {}
    peaks = Metric("rad/s", "root", (seen.peak_rate,)), Metric("rad/s^2", "most", seen.peak_acceleration)
    time = Metric("s", CROSSING, seen[:4], (float(every), period))
    return {"transient_time": time, "peak_rate": peaks[0], "peak_acceleration": peaks[1]}
