"""Metrics of a craft that holds a place or a circle near a libration point, all in SI units."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.vector import ZERO, Vector
from starhold.analysis.metrics import LAST, limit_share, stays_within, too_late
from starhold.analysis.ranking import Measure, MetricSet

if TYPE_CHECKING:
    from starhold.parts.bodies.libration_point import Units
    from starhold.simulation.lane import Recording

DAY, YEAR = 86_400.0, 365.25 * 86_400.0
"""Seconds."""


class CircleGoal(NamedTuple):
    """A circle round the X axis through the libration point, run through at a rate; scaled."""

    radius: float
    rate: float

    def at(self, phase: float) -> tuple[Vector, Vector]:
        """Position and velocity on it at a phase from Y towards Z (rad)."""
        y, z = self.radius * math.cos(phase), self.radius * math.sin(phase)
        return (0.0, y, z), (0.0, -self.rate * z, self.rate * y)

    def distance(self, position: NDArray[np.float64]) -> NDArray[np.float64]:
        """How far away each position (n, 3) is."""
        return np.hypot(np.hypot(position[:, 1], position[:, 2]) - self.radius, position[:, 0])


class EquilibriumGoal(NamedTuple):
    """A place of rest; scaled."""

    place: Vector

    def at(self, phase: float) -> tuple[Vector, Vector]:
        """Position and velocity there, whatever the phase."""
        return self.place, ZERO

    def distance(self, position: NDArray[np.float64]) -> NDArray[np.float64]:
        """How far away each position (n, 3) is."""
        return np.linalg.norm(position - np.array(self.place), axis=1)


def goal_of(gains: Any) -> CircleGoal | EquilibriumGoal:
    """Tell from its gains what a law makes for: a circle of this radius and rate, else rest at this y and z, or at the
    libration point."""
    if hasattr(gains, "radius") and hasattr(gains, "rate"):
        return CircleGoal(gains.radius, gains.rate)
    return EquilibriumGoal((0.0, getattr(gains, "y", 0.0), getattr(gains, "z", 0.0)))


MEASURES: dict[str, Measure] = {
    "settling_time": Measure(
        "settling", "days", "time from which it stays near what is held, the last quarter at least", 1.0 / DAY
    ),
    "deviation": Measure("off circle", "km", "largest error of the distance from the X axis, second half", 1e-3),
    "deviation_overall": Measure("off, overall", "km", "the same over the whole run", 1e-3),
    "largest_x": Measure("|x|", "km", "largest distance from the plane of the circle or rest, second half", 1e-3),
    "final_distance": Measure("final distance", "km", "largest distance from the place of rest, last quarter", 1e-3),
    "limit_share": Measure("on limit", "%", "share of the time with the control on its limit", 100.0),
    "peak_control": Measure("peak control", "µm/s²", "largest norm of the control", 1e6),
    "peak_ratio": Measure(
        "peak / limit", "%", "the largest norm, or component where each axis has the limit, over it", 100.0
    ),
    "effort_per_year": Measure("delta-v a year", "m/s", "integral of |u|, for a year of 365.25 days"),
}
"""The metrics a comparison shows; in each, less is better."""

METRICS = MetricSet(MEASURES, ("deviation", "settling_time", "effort_per_year"), "days", DAY)


def measure(run: Recording, units: Units, goal: CircleGoal | EquilibriumGoal, tolerance: float) -> dict[str, Any]:
    """Metrics of a run as `simulate` gives it; `tolerance` (scaled) is the distance that counts as near. Times that
    are never reached are None, as are all final values of a motion that was lost; `diverged_at` (s) is None for one that
    was not; `cut_off` names a time that is None because it lies within the last quarter of the run."""
    position, control = run["position"], run["control"]
    lost = run.attrs.get("diverged_at")
    away = goal.distance(position)
    settled = None if lost is not None else stays_within(away, tolerance)
    # A quarter, for these motions go to and fro slowly.
    cut_off = settled is not None and too_late(settled, len(away), LAST)
    settled = None if cut_off else settled
    half = slice(len(away) // 2, None)

    def kept(value: Any, worth: float = units.length) -> float | None:
        return None if lost is not None else float(value) * worth

    found: dict[str, Any] = {
        "diverged_at": None if lost is None else lost * units.time,
        "cut_off": ["settling_time"] if cut_off else [],
        "settling_time": None if settled is None else float(run["time"][settled]) * units.time,
    }
    if isinstance(goal, CircleGoal):
        radius = np.hypot(position[:, 1], position[:, 2])
        off = np.abs(radius - goal.radius)
        found |= {
            "deviation": kept(off[half].max()),
            "deviation_overall": kept(off.max()),
            "radius_least": kept(radius[half].min()),
            "radius_most": kept(radius[half].max()),
        }
    else:
        found["final_distance"] = kept(away[int(len(away) * (1.0 - LAST)) :].max())
    size = np.linalg.norm(control, axis=1)
    limit, kind = float(run.attrs["control_limit"]), run.attrs["limit"]
    most = float((np.abs(control).max(axis=1) if kind == "axis" else size).max())
    effort = float(np.sum(size[:-1] * np.diff(run["time"]))) * units.velocity
    flown = float(run["time"][-1]) * units.time
    return found | {
        "largest_x": kept(np.abs(position[half, 0]).max()),
        "limit_share": limit_share(run["command"], limit, kind),
        "peak_control": float(size.max()) * units.acceleration,
        "peak_ratio": most / limit if math.isfinite(limit) else None,
        "effort": effort,
        "effort_per_year": effort * YEAR / flown if flown > 0.0 else None,
    }
