"""Metrics of a rotating body, all in SI units."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.quaternion import to_reference, vector_part
from starhold.algebra.rotation import rotation_vector
from starhold.algebra.scalar import absolute, both, either, less, less_equal, maximum, minimum, sqrt, where
from starhold.algebra.structure import chosen, places
from starhold.algebra.vector import ZERO, Vector, dot, most, scale, subtract
from starhold.analysis import mode_notes, premise_notes, transient_notes, validity_notes
from starhold.analysis.meter import ALMOST, INSTANT, KINDS, Meter, Metric, Window, is_on_limit, outside, tail_start
from starhold.analysis.mode_notes import PEAKS, Modal, Span, Wanted
from starhold.analysis.ranking import COSTS, Measure, MetricSet
from starhold.simulation.lane import Recording

DECADES = range(1, 7)
"""Exponents k of the accuracies 10^-k for which control steps are counted."""
EXTRAS = ("overshoot", "iterations", *PEAKS)
"""Metrics that campaigns and requirements measure on request; the first two cost more in a kernel."""
OF_CAMPAIGNS = ("peak_rate", "drift", "peak_wheel_momentum", *PEAKS)
"""Metrics of a recorded run that only requirements use, and that its page draws."""
WHEEL = ("wheel_momentum", "wheel_command", "wheel_available")

MEASURES: dict[str, Measure] = {
    "settling_time": Measure(
        "settling", "s", "time after which attitude and rate stay within their tolerances, for at least the last tenth"
    ),
    "iterations_1e-3": Measure("steps to 1e-3", "", "control steps after which |q| stays within 10^-3, likewise"),
    "overshoot": Measure("overshoot", "%", "largest rotation beyond the target, as a share of the initial angle", 100.0),
    "transient_time": Measure("transient", "s", "time after which angle and rate stay within the ends of [transient]"),
    "peak_rate": Measure("peak rate", "deg/s", "largest norm of the body's rate", 180.0 / np.pi),
    "peak_acceleration": Measure("peak accel.", "deg/s²", "largest component of the rate's derivative", 180.0 / np.pi),
    "peak_torque": Measure("peak torque", "N m", "largest torque component"),
    "effort": Measure("effort", "N m s", "integral of |u| over the run"),
    "limit_share": Measure("on limit", "%", "share of the time with the command, or a wheel's motor, on its limit", 100.0),
    "invalid_share": Measure("not valid", "%", "share of the time without a valid estimate", 100.0, False),
    "chatter": Measure("chatter", "N m", "mean change of torque between samples, last quarter of the run"),
    "final_attitude_error": Measure("final angle", "mdeg", "largest angle to the target, last quarter", 180e3 / np.pi),
    "final_rate_error": Measure("final rate", "mdeg/s", "largest relative rate, last quarter", 180e3 / np.pi),
    "cost_median": Measure("call", "ns", "processor time of one call of the law, median", 1e9),
    "cost_worst": Measure("worst call", "ns", "processor time of one call of the law, worst", 1e9),
}
"""The metrics a comparison shows; in each, less is better."""


def error_angle(q: Any) -> NDArray[np.float64]:
    """Return the angle (rad, 0..pi) of each quaternion in an array (..., 4), accurate for small angles too."""
    q = np.asarray(q, dtype=float)
    return 2.0 * np.arctan2(np.linalg.norm(q[..., 1:], axis=-1), np.abs(q[..., 0]))


def acceleration(run: Recording) -> NDArray[np.float64]:
    """Return the body's angular acceleration (rad/s2), (n, 3): its mean from each sample to the next, the last repeated."""
    rate = run["rate"]
    mean = np.diff(rate, axis=0) / (run.attrs["control_period"] * run.attrs["record_every"])
    return np.concatenate([mean, mean[-1:]]) if len(mean) else np.zeros_like(rate)


class Cone(NamedTuple):
    """A body axis (unit, body axes) that must avoid a direction (unit, inertial axes)."""

    axis: Vector
    direction: Vector


class Bounds(NamedTuple):
    """Arguments of the notes: squares of the sine of half the attitude tolerance and of the rate tolerance ((rad/s)^2); the
    first instant of the last quarter, and the last; cones; arguments of the notes on modes and on premises."""

    angle: float
    rate: float
    tail: float
    last: float
    cones: tuple[Cone, ...]
    modal: Wanted
    transient: transient_notes.Ends | tuple[()]
    masses: Any = ()


class Turning(NamedTuple):
    """Notes on overshoot: the initial error as a rotation vector, whether the target was crossed, and the largest rotation
    beyond it as a share of the initial one."""

    first: Vector
    crossed: float
    beyond: float


class Noted(NamedTuple):
    """Notes on a lane: the last instants outside the tolerances; peaks of torque (component), of rate (square) and of wheel
    momentum; sums of the torque's norm, of instants on the limit and, in the last quarter, of changes of torque; the first
    and the last error there, and the last torque; squared least distances of axes from the centres of cones; notes for
    extras; per window the largest squares of the sine of half the angle, of the rate error and of the torque; and notes on
    modes, on the validity of the estimate, and on premises of claims."""

    attitude_outside: float
    rate_outside: float
    peak_torque: float
    peak_rate_square: float
    peak_wheel_momentum: float
    torque_sum: float
    limited: float
    chatter_sum: float
    first_error: Vector
    error: Vector
    torque: Vector
    cones: tuple[float, ...]
    turning: Turning | tuple[()]
    attitude_levels: tuple[float, ...]
    rate_levels: tuple[float, ...]
    window_angle: float
    window_rate: float
    window_torque: float
    modal: Modal | tuple[()]
    validity: Any
    transient: Any
    premises: Any = ()


def make_meter(
    steps: int,
    period: float,
    limit: str,
    tolerances: tuple[float, float],
    extras: Sequence[str] = (),
    cones: Mapping[str, Cone] = MappingProxyType({}),
    *,
    every: int = 1,
    still: bool = False,
    wheels: bool = False,
    estimated: bool = False,
    begins: Mapping[str, int] = MappingProxyType({}),
    fault: tuple[float, ...] = (),
    spans: Mapping[str, tuple[str, Span]] = MappingProxyType({}),
    transient: tuple[float, float] | tuple[()] = (),
    masses: premise_notes.Masses | None = None,
) -> Meter:
    """Return the meter of flights of `steps` control periods (s), or of as many samples at such intervals.

    limit: how the command is limited; tolerances: of attitude (rad) and rate (rad/s); extras: the EXTRAS to note; cones: by
    the names of their metrics; every: control steps in a period; still: the target is at rest; wheels: the body has wheels;
    estimated: an estimator states its validity; begins: modes whose first begin is noted, counted from 1, by the names of
    their metrics; fault: the instant of the first fault, as in `Wanted`; spans: parts of a flight in which one of PEAKS is
    noted, by the names of their metrics; transient: the angle (rad) and the rate (rad/s) at which it ends, () for none;
    masses: for windows of the premises of claims."""
    iterations, turns = "iterations" in extras, "overshoot" in extras
    levels = (-1.0,) * len(DECADES) if iterations else ()
    turning = Turning(ZERO, 0.0, 0.0) if turns else ()
    parts = (tuple(part for of, part in spans.values() if of == peak) for peak in PEAKS)
    wanted = Wanted(tuple(map(float, begins.values())), fault, *parts)
    modal = mode_notes.begun(wanted)
    begun: Any = (
        -1.0,
        -1.0,
        *(0.0,) * 6,
        ZERO,
        ZERO,
        ZERO,
        (4.0,) * len(cones),
        turning,
        levels,
        levels,
        0.0,
        0.0,
        0.0,
        modal,
        validity_notes.begun(estimated),
        transient_notes.Watched() if transient else (),
        premise_notes.begun(masses),
    )
    first, tail = Noted(*begun), tail_start(steps)
    angle = math.sin(0.5 * min(tolerances[0], math.pi)) ** 2
    ends = transient_notes.Ends.of(*transient, period) if transient else ()
    limits = tolerances[1] ** 2, float(tail), float(steps)
    bounds = Bounds(angle, *limits, tuple(cones.values()), wanted, ends, masses or ())
    rows: Any = places(first)
    windows = {
        "attitude_error": Window(rows.window_angle, KINDS["angle"], "angle to the target", "rad"),
        "rate_error": Window(rows.window_rate, np.sqrt, "rate relative to the target", "rad/s"),
        "torque": Window(rows.window_torque, np.sqrt, "norm of the torque applied", "N m"),
        **premise_notes.windows(rows.premises),
    }
    early, late = (_note(limit, still, stage, turns, iterations) for stage in (False, True))
    table = (
        _table(rows, period, every, wheels)
        | mode_notes.table(tuple(begins), spans, rows.modal, wanted, period)
        | validity_notes.table(rows.validity, period)
        | {name: Metric("rad", "apart", (row,)) for name, row in zip(cones, rows.cones, strict=True)}
    )
    for name, row, unit in zip(PEAKS, (rows.window_angle, rows.window_rate), ("rad", "rad/s"), strict=True):
        table |= {name: Metric(unit, PEAKS[name], (row,), since="start")} if name in extras else {}
    return Meter(first, bounds, (early, late), table, windows, steps, period, (tail,))


def _table(rows: Any, period: float, every: int, wheels: bool) -> dict[str, Metric]:
    """Return the metrics of notes at these rows."""
    last = rows.attitude_outside, rows.rate_outside
    table = {
        "settling_time": Metric("s", INSTANT, last, (period,)),
        "attitude_settling_time": Metric("s", INSTANT, last[:1], (period,)),
        "rate_settling_time": Metric("s", INSTANT, last[1:], (period,)),
    }
    for k, *levels in zip(DECADES, rows.attitude_levels, rows.rate_levels, strict=False):
        for prefix, row in zip(("", "rate_"), levels, strict=True):
            table[f"{prefix}iterations_1e-{k}"] = Metric("1", INSTANT, (row,), (float(every),))
    if rows.turning:
        table["overshoot"] = Metric("1", "overshoot", (*rows.turning.first, rows.turning.beyond))
    table |= {
        "peak_torque": Metric("N m", "number", (rows.peak_torque,)),
        "peak_torque_norm": Metric("N m", "root", (rows.window_torque,), since="start"),
        "peak_rate": Metric("rad/s", "root", (rows.peak_rate_square,)),
        "effort": Metric("N m s", "number", (rows.torque_sum,), (period,)),
        "limit_share": Metric("1", "number", (rows.limited,), over=("samples", 1.0)),
        "chatter": Metric("N m", "number", (rows.chatter_sum,), over=("tail", 1.0)),
        "final_attitude_error": Metric("rad", "angle", (rows.window_angle,), since="tail", final=True),
        "final_rate_error": Metric("rad/s", "root", (rows.window_rate,), since="tail", final=True),
        # The difference of 2 q0 times the vector part is that of the sines of the angles.
        "drift": Metric("rad/s", "distance", (*rows.error, *rows.first_error), (2.0,), ("tail", period), final=True),
    }
    return table | ({"peak_wheel_momentum": Metric("N m s", "number", (rows.peak_wheel_momentum,))} if wheels else {})


def recorded_meter(
    steps: int,
    period: float,
    every: int,
    limit: str,
    attitude_tolerance: float,
    rate_tolerance: float,
    cones: Mapping[str, Cone] | None = None,
    wheels: bool = False,
    estimated: bool = False,
    transient: tuple[float, float] | tuple[()] = (),
) -> Meter:
    """Return the meter of a recording of `steps` + 1 samples, at intervals of `every` control periods (s); with cones, even
    an empty mapping, it is the meter for requirements."""
    tolerances = attitude_tolerance, rate_tolerance
    there: Any = {"every": every, "wheels": wheels, "estimated": estimated, "transient": transient}
    meter = make_meter(steps, period * every, limit, tolerances, EXTRAS, cones or {}, **there)
    table = {name: metric for name, metric in meter.table.items() if cones is not None or name not in OF_CAMPAIGNS}
    table |= transient_notes.table(places(meter.first).transient, period, every)
    # Notes for the last quarter are not read before it, so one kernel serves all samples.
    return replace(meter, table=table, notes=(meter.notes[1],) * 2)


def measure(
    run: Recording,
    attitude_tolerance: float,
    rate_tolerance: float,
    cones: Mapping[str, Cone] | None = None,
    transient: tuple[float, float] | tuple[()] = (),
) -> dict[str, Any]:
    """Return the metrics of a recording from `label`. Times that are never reached are None, as are all final values and
    times of a run that diverged, and times within the last tenth of the run, whose names `cut_off` lists; `diverged_at` (s)
    is None for a run that did not diverge. cones: those of requirements, whose metrics are added; None without
    requirements. transient: the angle (rad) and the rate (rad/s) at which a transient ends, whose metrics are added."""
    attrs = run.attrs
    given = attrs["control_period"], int(attrs["record_every"]), attrs["limit"]
    more = cones, "wheel_momentum" in run.arrays, validity_notes.column_of(run.arrays, run.attrs) is not None
    meter = recorded_meter(len(run["time"]) - 1, *given, attitude_tolerance, rate_tolerance, *more, transient)
    return meter.of_recording(run, float(attrs["torque_limit"]))


@cache
def _note(limit: str, still: bool, late: bool, overshoot: bool, iterations: bool) -> Any:
    """Return the equation of the notes, before the last quarter or in it; the same for all loops of one kernel."""

    def note(seen: Noted, quantities: Mapping[str, Any], now: Any, most_command: Any, bounds: Bounds) -> Noted:
        q, torque, command = (quantities[name] for name in ("attitude_error", "torque", "command"))
        # For a target at rest the rate error is the rate; this avoids arithmetic on the target's zeros, as in `observe`.
        rate = quantities["rate" if still else "rate_error"]
        # A recording may lack the body's own rate, which no metric of a recording needs.
        turning = quantities.get("rate", rate)
        angle_square = q[1] * q[1] + q[2] * q[2] + q[3] * q[3]
        rate_square, torque_square = dot(rate, rate), dot(torque, torque)
        size, chatter, tail = sqrt(torque_square), seen.chatter_sum, (seen.first_error, seen.error, seen.torque)
        if late:
            chatters, error = less(bounds.tail, now), scale(q[0], vector_part(q))
            tail = (chosen(chatters, seen.first_error, error), error, torque)
            change = subtract(torque, seen.torque)
            size = where(less(now, bounds.last), size, 0.0)
            chatter = chatter + where(chatters, sqrt(dot(change, change)), 0.0)
        bound, peak_wheel = is_on_limit(command, most_command, limit), seen.peak_wheel_momentum
        # A motor is on its limit if the command is its largest available torque: less near its momentum limit, zero once it
        # is lost.
        for momentum, wanted, there in zip(*(quantities.get(name, ()) for name in WHEEL), strict=True):
            peak_wheel, wanted = maximum(peak_wheel, absolute(momentum)), absolute(wanted)
            bound = either(bound, both(less(0.0, wanted), less_equal(there * ALMOST, wanted)))
        return Noted(
            outside(seen.attitude_outside, angle_square, bounds.angle, now),
            outside(seen.rate_outside, rate_square, bounds.rate, now),
            maximum(seen.peak_torque, most(torque)),
            maximum(seen.peak_rate_square, dot(turning, turning)),
            peak_wheel,
            seen.torque_sum + size,
            seen.limited + where(bound, 1.0, 0.0),
            chatter,
            *tail,
            tuple(
                _nearest(least, cone, quantities["attitude"]) for least, cone in zip(seen.cones, bounds.cones, strict=True)
            ),
            _turned(seen.turning, q, now) if overshoot else (),
            _levels(seen.attitude_levels, angle_square, now) if iterations else (),
            _levels(seen.rate_levels, rate_square, now) if iterations else (),
            maximum(seen.window_angle, angle_square),
            maximum(seen.window_rate, rate_square),
            maximum(seen.window_torque, torque_square),
            mode_notes.noted(seen.modal, quantities, now, bounds.modal, angle_square, rate_square),
            validity_notes.noted(seen.validity, quantities, now, bounds.last),
            transient_notes.noted(seen.transient, quantities, now, bounds.transient),
            premise_notes.noted(seen.premises, quantities, bounds.masses),
        )

    return note


def _nearest(least: Any, cone: Cone, attitude: Any) -> Any:
    """Return the squared least distance so far between the ends of the axis and of the direction."""
    apart = subtract(to_reference(attitude, cone.axis), cone.direction)
    return minimum(least, dot(apart, apart))


def _turned(seen: Any, q: Any, now: Any) -> Turning:
    """Return the notes on overshoot after an instant. A body that starts near a half turn may pass it first, so only motion
    after the first crossing of the target counts."""
    turn, begins = rotation_vector(q), less(now, 0.5)
    first = chosen(begins, turn, seen.first)
    along = dot(turn, first) / maximum(dot(first, first), 1e-300)
    crossed = where(less(absolute(along), 0.5), 1.0, seen.crossed)
    return Turning(first, crossed, where(less(0.5, crossed), maximum(seen.beyond, -along), seen.beyond))


def _levels(seen: tuple[Any, ...], square: Any, now: Any) -> tuple[Any, ...]:
    """Return the last instants at which a square exceeded those of 10^-k."""
    return tuple(outside(then, square, 10.0 ** (-2 * k), now) for then, k in zip(seen, DECADES, strict=True))


AGAINST_LIMITS = {
    "transient_time": "s",
    "rate_limit": "rad/s",
    **dict.fromkeys(("peak_acceleration", "peak_accelerations", "acceleration_limit"), "rad/s^2"),
}
"""Further metrics of a transient, with their units."""
_ALL = make_meter(0, 1.0, "none", (0.0, 0.0), EXTRAS, wheels=True, estimated=True)
UNITS = {"diverged_at": "s", **_ALL.units, **AGAINST_LIMITS, **COSTS}
"""The SI units of the metrics."""
METRICS = MetricSet(MEASURES, ("settling_time", "final_attitude_error", "effort"), units=UNITS)
"""Ranking: settled before unsettled, then by settling time, accuracy and effort."""
