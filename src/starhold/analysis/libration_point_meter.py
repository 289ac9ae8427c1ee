"""The metrics of a craft that holds a place or a circle near a libration point, noted along its flight."""

from __future__ import annotations

import math
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from starhold.algebra.scalar import absolute, less, maximum, minimum, sqrt, where
from starhold.algebra.structure import places
from starhold.algebra.vector import ZERO, Vector, dot, subtract
from starhold.algebra.words import number_of
from starhold.analysis.libration_point import YEAR, CircleGoal, EquilibriumGoal
from starhold.analysis.meter import (
    Flown,
    Meter,
    Metrics,
    Window,
    is_on_limit,
    largest_since,
    outside,
    sampled,
    tail_start,
    within_since,
)
from starhold.analysis.metrics import LAST
from starhold.loop.closed_loop import ClosedLoop, Composition
from starhold.loop.kernels import Observer

if TYPE_CHECKING:
    from starhold.parts.bodies.libration_point import Units


class Told(NamedTuple):
    """The numbers of the notes, scaled: the radius of the circle or the place of rest, the distance that counts as near, and
    the last instant."""

    radius: float
    place: Vector
    near: float
    last: float


class Noted(NamedTuple):
    """Notes on a lane: the last instant not near; sums of the control's norm and of
    instants on the limit; the least and the largest radius since the middle; and of a window the largest square of the
    distance, error of the radius, |x|, and square of the control."""

    outside: float
    total: float
    limited: float
    radius_least: float
    radius_most: float
    window_away: float
    window_off: float
    window_x: float
    window_control: float


def make_meter(loop: ClosedLoop, steps: int, units: Units, goal: CircleGoal | EquilibriumGoal, tolerance: float) -> Meter:
    """The meter of a loop for flights of so many control steps, in SI; tolerance: scaled distance that counts as near."""
    circle = isinstance(goal, CircleGoal)
    told = Told(goal.radius, ZERO, tolerance, float(steps)) if circle else Told(0.0, goal.place, tolerance, float(steps))
    first = Noted(-1.0, 0.0, 0.0, math.inf, 0.0, 0.0, 0.0, 0.0, 0.0)
    half, tail, rows = (steps + 1) // 2, tail_start(steps), places(first)
    length, push = units.length, units.acceleration
    windows = {
        "distance": Window(rows.window_away, lambda x: np.sqrt(x) * length, "distance from what is held", "m"),
        "off_circle": Window(rows.window_off, lambda x: x * length, "error of the distance from the X axis", "m"),
        "x": Window(rows.window_x, lambda x: x * length, "distance from the plane of the circle or rest", "m"),
        "control": Window(rows.window_control, lambda x: np.sqrt(x) * push, "norm of the control", "m/s^2"),
    }
    meter: Meter

    def finish(flown: Flown) -> Metrics:
        noted, cuts, seen = flown.end, meter.cuts(), flown.windows
        effort = noted.total * (loop.period * units.velocity)
        since = within_since(noted.outside, steps, LAST)
        found = {
            "settling_time": since * (loop.period * units.time),
            "largest_x": largest_since(half, seen["x"], cuts) * length,
            "limit_share": noted.limited / (steps + 1),
            "peak_control": np.sqrt(seen["control"].max(axis=0)) * push,
            "effort": effort,
            "effort_per_year": effort * (YEAR / (steps * loop.period * units.time)),
        }
        if circle:
            return found | {
                "deviation": largest_since(half, seen["off_circle"], cuts) * length,
                "deviation_overall": seen["off_circle"].max(axis=0) * length,
                "radius_least": noted.radius_least * length,
                "radius_most": noted.radius_most * length,
            }
        return found | {"final_distance": np.sqrt(largest_since(tail, seen["distance"], cuts)) * length}

    units_of = dict.fromkeys(("largest_x", *(CIRCLE if circle else ("final_distance",))), "m")
    units_of |= {
        "settling_time": "s",
        "limit_share": "1",
        "peak_control": "m/s^2",
        "effort": "m/s",
        "effort_per_year": "m/s",
    }
    early, late = (Observer(_note(loop.composition(), circle, since), first, told) for since in (False, True))
    # What is noted late, the radius, is asked of circles alone, which have no later mark.
    marks = (half,) if circle else (half, tail)
    meter = Meter(first, (early, late), finish, units_of, windows, steps, loop.period * units.time, marks)
    return meter


CIRCLE = ("deviation", "deviation_overall", "radius_least", "radius_most")


@cache
def _note(parts: Composition, circle: bool, late: bool) -> Any:
    """The equations of the notes, before the middle or from it on; one function for loops that one kernel flies."""
    read, kind = sampled(parts), parts.limit

    def note(seen: Noted, decided: Any, carry: Any, step: Any, setup: Any, told: Told) -> Noted:
        own, now = read(decided, step, setup), number_of(step)
        position, control, command = own["position"], own["control"], own["command"]
        x, y, z = position
        radius = sqrt(y * y + z * z)
        off = radius - told.radius
        apart = subtract(position, told.place)
        away = off * off + x * x if circle else dot(apart, apart)
        square = dot(control, control)
        bound = is_on_limit(command, setup.limit, kind)
        return Noted(
            outside(seen.outside, away, told.near * told.near, now),
            seen.total + where(less(now, told.last), sqrt(square), 0.0),
            seen.limited + where(bound, 1.0, 0.0),
            minimum(seen.radius_least, radius) if late else seen.radius_least,
            maximum(seen.radius_most, radius) if late else seen.radius_most,
            maximum(seen.window_away, away),
            maximum(seen.window_off, absolute(off)),
            maximum(seen.window_x, absolute(x)),
            maximum(seen.window_control, square),
        )

    return note
