"""Metrics as NumPy takes them of a whole recording: written apart from the notes that the package takes."""

import math

import numpy as np

from starhold.analysis.any_body import COMMAND
from starhold.analysis.libration_point import YEAR, CircleGoal
from starhold.analysis.meter import ALMOST, KEPT, LAST, on_limit, stays_within
from starhold.analysis.rigid_body import DECADES, error_angle


def too_late(index: float, count: int, kept: float = KEPT) -> bool:
    """Whether the sample of this index, of so many, lies within the last share of a run."""
    return index > (1.0 - kept) * (count - 1)


def of_rigid_body(run, attitude_tolerance, rate_tolerance):
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
        **_validity(run),
    }


def _validity(run):
    """The share of samples without a valid estimate, and the longest time from such a sample to the end of its row."""
    there = [values for name, values in run.arrays.items() if name.endswith("is_valid")]
    if not there:
        return {}
    bad, rows = there[-1] < 0.5, [0]
    for one in bad[:-1]:
        rows.append(rows[-1] + 1 if one else 0)
    return {"invalid_share": float(bad.mean()), "longest_invalid": max(rows) * float(run["time"][1])}


def _overshoot(q):
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


def _limit_share(run):
    """Share of the samples in which the command, which an actuator may lag behind, is on its limit, or a wheel's motor is
    asked for all that it can give: less as its momentum fills up, and nothing once it is lost."""
    bound = on_limit(run["command"], run.attrs["torque_limit"], run.attrs["limit"])
    if "wheel_command" in run.arrays:
        asked = np.abs(run["wheel_command"])
        bound |= ((asked > 0.0) & (asked >= run["wheel_available"] * ALMOST)).any(axis=1)
    return float(bound.mean())


def of_libration_point(run, units, goal, tolerance):
    """Metrics of a run as `simulate` gives it; `tolerance` (scaled) is the distance that counts as near. Times that
    are never reached are None, as are all final values of a motion that was lost; `diverged_at` (s) is None for one that
    was not; `cut_off` names a time that is None because it lies within the last quarter of the run."""
    position, control = run["position"], run["control"]
    lost = run.attrs.get("diverged_at")
    away = goal.distance(position)
    settled = None if lost is not None else stays_within(away, tolerance)
    # A quarter, because these motions oscillate slowly.
    cut_off = settled is not None and too_late(settled, len(away), LAST)
    settled = None if cut_off else settled
    half = slice(len(away) // 2, None)

    def kept(value, worth=units.length):
        return None if lost is not None else float(value) * worth

    found = {
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


def of_any_body(run):
    """Metrics of a run: for each recorded quantity its largest norm in the last quarter, and of the command the peak of its
    components and the integral of its norm. What is final is None for a motion that was lost, at `diverged_at`."""
    lost = run.attrs.get("diverged_at")
    found = {"diverged_at": lost, "cut_off": []}
    for name in _recorded(run):
        size = np.linalg.norm(np.reshape(run[name], (len(run[name]), -1)), axis=1)
        found[f"final_{name}"] = None if lost is not None else float(size[int(len(size) * (1.0 - LAST)) :].max())
        if name == COMMAND:
            found["peak_command"] = float(np.abs(run[name]).max())
            found["effort"] = float(np.sum(size[:-1] * np.diff(run["time"])))
    return found


def limit_share(u, limit, kind):
    """Share of the samples (n, 3) that are on their limit."""
    return float(on_limit(u, limit, kind).mean())


def _recorded(run):
    return [name for name, told in run.columns.items() if name in run.arrays and told.dimension != "quaternion"]
