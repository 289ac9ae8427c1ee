"""Metrics of station keeping at a point or on a circle near a libration point, all in SI units."""

import math
from collections.abc import Mapping
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.scalar import absolute, less, maximum, minimum, sqrt, where
from starhold.algebra.structure import places
from starhold.algebra.vector import ZERO, Vector, dot, subtract
from starhold.analysis.meter import INSTANT, LAST, Meter, Metric, Window, is_on_limit, middle, outside, tail_start
from starhold.analysis.ranking import COSTS, Measure, MetricSet
from starhold.parts.bodies.libration_point import Units
from starhold.simulation.lane import Recording

DAY, YEAR = 86_400.0, 365.25 * 86_400.0
"""Day and year in seconds."""


class CircleGoal(NamedTuple):
    """A circle around the X axis through the libration point, followed at a rate; scaled."""

    radius: float
    rate: float

    def at(self, phase: float) -> tuple[Vector, Vector]:
        """Return position and velocity on the circle at a phase from Y towards Z (rad)."""
        y, z = self.radius * math.cos(phase), self.radius * math.sin(phase)
        return (0.0, y, z), (0.0, -self.rate * z, self.rate * y)

    def distance(self, position: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the distance of each position (n, 3) from the goal."""
        return np.hypot(np.hypot(position[:, 1], position[:, 2]) - self.radius, position[:, 0])


class EquilibriumGoal(NamedTuple):
    """An equilibrium; scaled."""

    place: Vector

    def at(self, phase: float) -> tuple[Vector, Vector]:
        """Return its position and zero velocity, for any phase."""
        return self.place, ZERO

    def distance(self, position: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the distance of each position (n, 3) from the goal."""
        return np.linalg.norm(position - np.array(self.place), axis=1)


def goal_of(gains: Any) -> CircleGoal | EquilibriumGoal:
    """Return a law's target from its gains: a circle if they have radius and rate, else an equilibrium at their y and z, or
    at the libration point."""
    if hasattr(gains, "radius") and hasattr(gains, "rate"):
        return CircleGoal(gains.radius, gains.rate)
    return EquilibriumGoal((0.0, getattr(gains, "y", 0.0), getattr(gains, "z", 0.0)))


MEASURES: dict[str, Measure] = {
    "settling_time": Measure(
        "settling", "days", "time from which it stays near its target, at least for the last quarter", 1.0 / DAY
    ),
    "deviation": Measure("off circle", "km", "largest error of the distance from the X axis, second half", 1e-3),
    "deviation_overall": Measure("off, overall", "km", "the same over the whole run", 1e-3),
    "largest_x": Measure("|x|", "km", "largest distance from the plane of the circle or equilibrium, second half", 1e-3),
    "final_distance": Measure("final distance", "km", "largest distance from the equilibrium, last quarter", 1e-3),
    "limit_share": Measure("on limit", "%", "share of the time with the control on its limit", 100.0),
    "peak_control": Measure("peak control", "µm/s²", "largest norm of the control", 1e6),
    "peak_ratio": Measure(
        "peak / limit", "%", "the largest norm, or component if each axis is limited, over the limit", 100.0
    ),
    "effort_per_year": Measure("delta-v a year", "m/s", "integral of |u|, for a year of 365.25 days"),
}
"""The metrics a comparison shows; in each, less is better."""


class Goal(NamedTuple):
    """Arguments of the notes, scaled: the radius of the circle or the equilibrium, the distance that counts as near, and
    the last instant."""

    radius: float
    place: Vector
    near: float
    last: float


class Noted(NamedTuple):
    """Notes on a lane: the last instant not near; sums of the control's norm and of instants on the limit; the least and
    the largest radius in the second half; and per window the largest squared distance, radius error, |x|, and squared
    control."""

    outside: float
    total: float
    limited: float
    radius_least: float
    radius_most: float
    window_away: float
    window_off: float
    window_x: float
    window_control: float


def make_meter(
    steps: int, period: float, limit: str, units: Units, goal: CircleGoal | EquilibriumGoal, tolerance: float
) -> Meter:
    """Return the meter of flights of `steps` control periods (scaled), or of as many samples at such intervals, in SI.

    limit: how the control is limited; tolerance: scaled distance that counts as near."""
    circle = isinstance(goal, CircleGoal)
    given = Goal(*((goal.radius, ZERO) if circle else (0.0, goal.place)), tolerance, float(steps))
    first = Noted(-1.0, 0.0, 0.0, math.inf, 0.0, 0.0, 0.0, 0.0, 0.0)
    half, tail, rows = middle(steps), tail_start(steps), places(first)
    length, push = units.length, units.acceleration
    windows = {
        "distance": Window(rows.window_away, lambda x: np.sqrt(x) * length, "distance from the target", "m"),
        "off_circle": Window(rows.window_off, lambda x: x * length, "error of the distance from the X axis", "m"),
        "x": Window(rows.window_x, lambda x: x * length, "distance from the plane of the circle or equilibrium", "m"),
        "control": Window(rows.window_control, lambda x: np.sqrt(x) * push, "norm of the control", "m/s^2"),
    }
    of_place = {"final_distance": Metric("m", "root", (rows.window_away,), (length,), since="tail", final=True)}
    of_circle = {
        "deviation": Metric("m", "number", (rows.window_off,), (length,), since="half", final=True),
        "deviation_overall": Metric("m", "number", (rows.window_off,), (length,), since="start", final=True),
        "radius_least": Metric("m", "number", (rows.radius_least,), (length,), final=True),
        "radius_most": Metric("m", "number", (rows.radius_most,), (length,), final=True),
    }
    table = {
        # A quarter, because these motions oscillate slowly.
        "settling_time": Metric("s", INSTANT, (rows.outside,), (period * units.time,), kept=LAST),
        **(of_circle if circle else of_place),
        "largest_x": Metric("m", "number", (rows.window_x,), (length,), since="half", final=True),
        "limit_share": Metric("1", "number", (rows.limited,), over=("samples", 1.0)),
        "peak_control": Metric("m/s^2", "root", (rows.window_control,), (push,), since="start"),
        "effort": Metric("m/s", "number", (rows.total,), (period * units.velocity,)),
    }
    flown = steps * period * units.time
    yearly = (period * units.velocity, YEAR / flown if flown > 0.0 else math.nan)
    table["effort_per_year"] = Metric("m/s", "number", (rows.total,), yearly)
    # The radius, noted in the second half, matters only for circles, which have no later mark.
    marks = (half,) if circle else (half, tail)
    early, late = (_note(limit, circle, since) for since in (False, True))
    return Meter(first, given, (early, late), table, windows, steps, period * units.time, marks)


def measure(run: Recording, units: Units, goal: CircleGoal | EquilibriumGoal, tolerance: float) -> dict[str, Any]:
    """Return the metrics of a run of `simulate`; `tolerance` (scaled) is the distance that counts as settled. Times that
    are never reached are None, as are all final values of a motion that diverged; `diverged_at` (s) is None for a motion
    that did not; `cut_off` names a time that is None because it lies within the last quarter of the run."""
    limit, kind = float(run.attrs["control_limit"]), run.attrs["limit"]
    period = run.attrs["control_period"] * run.attrs["record_every"]
    metrics = make_meter(len(run["time"]) - 1, period, kind, units, goal, tolerance).of_recording(run, limit)
    lost, control = metrics["diverged_at"], run["control"]
    size = np.abs(control).max(axis=1) if kind == "axis" else np.linalg.norm(control, axis=1)
    ratio = float(size.max()) / limit if math.isfinite(limit) else None
    return metrics | {"diverged_at": None if lost is None else lost * units.time, "peak_ratio": ratio}


@cache
def _note(limit: str, circle: bool, late: bool) -> Any:
    """Return the equation of the notes, before the last mark or from it on; the same for all loops of one kernel."""

    def note(seen: Noted, quantities: Mapping[str, Any], now: Any, most_command: Any, goal: Goal) -> Noted:
        position, control, command = quantities["position"], quantities["control"], quantities["command"]
        x, y, z = position
        radius = sqrt(y * y + z * z)
        off = radius - goal.radius
        apart = subtract(position, goal.place)
        away = off * off + x * x if circle else dot(apart, apart)
        square = dot(control, control)
        bound = is_on_limit(command, most_command, limit)
        return Noted(
            outside(seen.outside, away, goal.near * goal.near, now),
            seen.total + where(less(now, goal.last), sqrt(square), 0.0),
            seen.limited + where(bound, 1.0, 0.0),
            minimum(seen.radius_least, radius) if late else seen.radius_least,
            maximum(seen.radius_most, radius) if late else seen.radius_most,
            maximum(seen.window_away, away),
            maximum(seen.window_off, absolute(off)),
            maximum(seen.window_x, absolute(x)),
            maximum(seen.window_control, square),
        )

    return note


def _units() -> dict[str, str]:
    """Return the SI units of the metrics."""
    goals = CircleGoal(0.0, 0.0), EquilibriumGoal(ZERO)
    units = {"diverged_at": "s", "peak_ratio": "1", **COSTS}
    for goal in goals:
        units |= make_meter(0, 1.0, "none", Units(1.0, 1.0), goal, 0.0).units
    return units


METRICS = MetricSet(MEASURES, ("deviation", "settling_time", "effort_per_year"), "days", DAY, _units())
