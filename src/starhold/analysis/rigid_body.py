"""Metrics of a body that turns, all in SI units."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from starhold.analysis.metrics import ALMOST, LAST, on_limit, stays_within, too_late
from starhold.analysis.ranking import Measure, MetricSet

if TYPE_CHECKING:
    from starhold.simulation.lane import Recording

DECADES = range(1, 7)
"""The k of the accuracies 10^-k whose iterations are counted."""

MEASURES: dict[str, Measure] = {
    "settling_time": Measure(
        "settling",
        "s",
        "time after which attitude and rate stay within their tolerances, the last tenth at least",
    ),
    "iterations_1e-3": Measure("steps to 1e-3", "", "control steps after which |q| stays within 10^-3, likewise"),
    "overshoot": Measure("overshoot", "%", "largest turn beyond the target, of the initial angle", 100.0),
    "transient_time": Measure("transient", "s", "time after which angle and rate stay within the ends of [transient]"),
    "peak_rate": Measure("peak rate", "deg/s", "largest norm of the body's rate", 180.0 / np.pi),
    "peak_acceleration": Measure("peak accel.", "deg/s²", "largest component of the rate's derivative", 180.0 / np.pi),
    "peak_torque": Measure("peak torque", "N m", "largest torque component"),
    "effort": Measure("effort", "N m s", "integral of |u| over the run"),
    "limit_share": Measure("on limit", "%", "share of the time with the command, or a wheel's motor, on its limit", 100.0),
    "chatter": Measure("chatter", "N m", "mean change of torque between samples, last quarter of the run"),
    "final_attitude_error": Measure("final angle", "mdeg", "largest angle to the target, last quarter", 180e3 / np.pi),
    "final_rate_error": Measure("final rate", "mdeg/s", "largest relative rate, last quarter", 180e3 / np.pi),
    "cost_median": Measure("call", "ns", "processor time of one call of the law, median", 1e9),
    "cost_worst": Measure("worst call", "ns", "processor time of one call of the law, worst", 1e9),
}
"""The metrics a comparison shows; in each, less is better."""

METRICS = MetricSet(MEASURES, ("settling_time", "final_attitude_error", "effort"))
"""Settled before unsettled, then sooner, then more accurate, then more sparing."""


def error_angle(q: Any) -> NDArray[np.float64]:
    """Angle (rad, 0..pi) of each quaternion in an array (..., 4), accurate for small angles too."""
    q = np.asarray(q, dtype=float)
    return 2.0 * np.arctan2(np.linalg.norm(q[..., 1:], axis=-1), np.abs(q[..., 0]))


def acceleration(run: Recording) -> NDArray[np.float64]:
    """Derivative of the body's rate (rad/s2), (n, 3): its mean from each sample to the next, the last repeated."""
    rate = run["rate"]
    mean = np.diff(rate, axis=0) / (run.attrs["control_period"] * run.attrs["record_every"])
    return np.concatenate([mean, mean[-1:]]) if len(mean) else np.zeros_like(rate)


def measure(run: Recording, attitude_tolerance: float, rate_tolerance: float) -> dict[str, Any]:
    """Metrics of a run as `label` gives it. Times that are never reached are None, as are all final values and times of
    a run that diverged; `diverged_at` (s) is None for one that did not. So are times within the last tenth of the run, whose
    names `cut_off` lists."""
    times = run["time"]
    q, w, u = (run[name] for name in ("attitude_error", "rate_error", "torque"))
    angle, speed = error_angle(q), np.linalg.norm(w, axis=1)
    lost = run.attrs.get("diverged_at")
    turned, slowed = stays_within(angle, attitude_tolerance), stays_within(speed, rate_tolerance)
    both = None if turned is None or slowed is None else max(turned, slowed)
    reached = {"settling_time": both, "attitude_settling_time": turned, "rate_settling_time": slowed}
    steps, deviation = int(run.attrs["record_every"]), np.linalg.norm(q[:, 1:], axis=1)
    for k in DECADES:
        for name, values in (("", deviation), ("rate_", speed)):
            reached[f"{name}iterations_1e-{k}"] = stays_within(values, 10.0**-k)
    if lost is not None:
        reached = dict.fromkeys(reached)
    cut_off = [name for name, index in reached.items() if index is not None and too_late(index, len(times))]
    reached |= dict.fromkeys(cut_off)
    tail = slice(int(len(times) * (1.0 - LAST)), None)
    return {
        "diverged_at": lost,
        "cut_off": cut_off,
        **{
            name: None if index is None else index * steps if "iterations" in name else float(times[index])
            for name, index in reached.items()
        },
        "overshoot": _overshoot(q),
        "peak_torque": float(np.abs(u).max()),
        "peak_torque_norm": float(np.linalg.norm(u, axis=1).max()),
        "effort": float(np.sum(np.linalg.norm(u[:-1], axis=1) * np.diff(times))),
        "limit_share": _limit_share(run),
        "chatter": float(np.linalg.norm(np.diff(u[tail], axis=0), axis=1).mean()) if len(u[tail]) > 1 else 0.0,
        "final_attitude_error": None if lost is not None else float(angle[tail].max()),
        "final_rate_error": None if lost is not None else float(speed[tail].max()),
    }


def _overshoot(q: NDArray[np.float64]) -> float:
    """Largest turn against the direction of the first error, as a share of that error; 0 for a start on target."""
    turn = np.where(q[:, :1] < 0.0, -1.0, 1.0) * q[:, 1:]
    vectors = turn * (error_angle(q) / np.maximum(np.linalg.norm(turn, axis=1), 1e-300))[:, None]
    start = float(np.linalg.norm(vectors[0]))
    if start < 1e-9:
        return 0.0
    along = vectors @ vectors[0] / start**2
    # A body that starts near a half turn may pass it first; what counts is what follows the first crossing of the target.
    crossed = np.flatnonzero(np.abs(along) < 0.5)
    return max(0.0, float(-along[crossed[0] :].min())) if crossed.size else 0.0


def _limit_share(run: Recording) -> float:
    """Share of the samples in which the command, which an actuator may lag behind, is on its limit, or a wheel's motor is
    asked for all that it can give: less as its momentum fills up, and nothing once it is lost."""
    bound = on_limit(run["command"], run.attrs["torque_limit"], run.attrs["limit"])
    if "wheel_command" in run.arrays:
        asked = np.abs(run["wheel_command"])
        bound |= ((asked > 0.0) & (asked >= run["wheel_available"] * ALMOST)).any(axis=1)
    return float(bound.mean())
