"""The metrics of a body that turns, noted along its flight."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cache
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from starhold.algebra.quaternion import to_reference, vector_part
from starhold.algebra.rotation import rotation_vector
from starhold.algebra.scalar import absolute, both, either, less, less_equal, maximum, minimum, sqrt, where
from starhold.algebra.structure import chosen, places
from starhold.algebra.vector import ZERO, Vector, dot, scale, subtract
from starhold.algebra.words import number_of
from starhold.analysis.meter import (
    Array,
    Flown,
    Meter,
    Metrics,
    Window,
    is_on_limit,
    largest_since,
    most,
    outside,
    sampled,
    tail_start,
    within_since,
)
from starhold.analysis.metrics import ALMOST
from starhold.analysis.rigid_body import DECADES
from starhold.loop.closed_loop import ClosedLoop, Composition
from starhold.loop.kernels import Observer

EXTRAS = ("overshoot", "iterations")
"""Metrics that cost more than others in a kernel, and are noted where they are asked for."""


UNITS = {
    "settling_time": "s",
    "attitude_settling_time": "s",
    "rate_settling_time": "s",
    "peak_torque": "N m",
    "peak_torque_norm": "N m",
    "peak_rate": "rad/s",
    "effort": "N m s",
    "limit_share": "1",
    "chatter": "N m",
    "final_attitude_error": "rad",
    "final_rate_error": "rad/s",
    "drift": "rad/s",
}
"""The metrics that are always noted, with their units."""


class Cone(NamedTuple):
    """A body axis (unit, body axes) that is to stay away from a direction (unit, inertial axes)."""

    axis: Vector
    direction: Vector


class Told(NamedTuple):
    """The numbers of the notes: squares of the sine of half the attitude tolerance and of the rate tolerance ((rad/s)^2);
    the instant at which the last quarter begins, and the last; cones."""

    angle: float
    rate: float
    tail: float
    last: float
    cones: tuple[Cone, ...]


class Turning(NamedTuple):
    """Notes on overshoot: the first error as a rotation vector, whether the target was crossed, and the largest turn
    beyond it as a share of the first."""

    first: Vector
    crossed: float
    beyond: float


class Noted(NamedTuple):
    """Notes on a lane: the last instants outside the tolerances; peaks of torque (component), of rate (square) and of wheel
    momentum; sums of the torque's norm, of instants on the limit and, in the last quarter, of changes of torque; there the
    first and the last error, and the last torque; squares of the least distances of axes from the middles of cones; what
    extras need; and of a window the largest squares of half the angle's sine, of the rate error and of the torque."""

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


def make_meter(
    loop: ClosedLoop,
    steps: int,
    attitude_tolerance: float,
    rate_tolerance: float,
    cones: Mapping[str, Cone] = MappingProxyType({}),
    extras: Sequence[str] = (),
) -> Meter:
    """The meter of a loop for flights of so many control steps. Tolerances in rad and rad/s; cones: by the
    names of their metrics; extras: those of EXTRAS that
    are to be noted."""
    levels = (-1.0,) * len(DECADES) if "iterations" in extras else ()
    turning = Turning(ZERO, 0.0, 0.0) if "overshoot" in extras else ()
    begun: Any = (-1.0, -1.0, *(0.0,) * 6, ZERO, ZERO, ZERO, (4.0,) * len(cones), turning, levels, levels, 0.0, 0.0, 0.0)
    first = Noted(*begun)
    tail = tail_start(steps)
    angle = math.sin(0.5 * min(attitude_tolerance, math.pi)) ** 2
    told = Told(angle, rate_tolerance**2, float(tail), float(steps), tuple(cones.values()))
    rows = places(first)
    windows = {
        "attitude_error": Window(rows.window_angle, _angle, "angle to the target", "rad"),
        "rate_error": Window(rows.window_rate, np.sqrt, "rate relative to the target", "rad/s"),
        "torque": Window(rows.window_torque, np.sqrt, "norm of the torque applied", "N m"),
    }
    stages = (_note(loop.composition(), late, bool(turning), bool(levels)) for late in (False, True))
    before, last = (Observer(note, first, told) for note in stages)
    meter: Meter

    def finish(flown: Flown) -> Metrics:
        found = _metrics(flown, meter, loop.period, bool(loop.rotors))
        apart = zip(cones, flown.end.cones, strict=True)
        return found | {name: 2.0 * np.arcsin(0.5 * np.sqrt(square)) for name, square in apart}

    units = dict(UNITS)
    if "iterations" in extras:
        units |= {f"{prefix}iterations_1e-{k}": "1" for prefix in ("", "rate_") for k in DECADES}
    if "overshoot" in extras:
        units["overshoot"] = "1"
    if loop.rotors:
        units["peak_wheel_momentum"] = "N m s"
    units |= dict.fromkeys(cones, "rad")
    meter = Meter(first, (before, last), finish, units, windows, steps, loop.period, (tail,))
    return meter


@cache
def _note(parts: Composition, late: bool, overshoot: bool, iterations: bool) -> Any:
    """The equations of the notes, before the last quarter or in it; one function for loops that one kernel flies."""
    read, limit = sampled(parts), parts.limit
    # Of a target at rest the rate error is the rate; the arithmetic on its zeros is spared here, as in `observe`.
    still = parts.target is None or parts.target.flag("STILL")

    def note(seen: Noted, decided: Any, carry: Any, step: Any, setup: Any, told: Told) -> Noted:
        own, now = read(decided, step, setup), number_of(step)
        q, torque, command = (own[name] for name in ("attitude_error", "torque", "command"))
        rate = own["rate"] if still else own["rate_error"]
        angle_square = q[1] * q[1] + q[2] * q[2] + q[3] * q[3]
        rate_square, torque_square = dot(rate, rate), dot(torque, torque)
        size, chatter, tail = sqrt(torque_square), seen.chatter_sum, (seen.first_error, seen.error, seen.torque)
        if late:
            chatters, error = less(told.tail, now), scale(q[0], vector_part(q))
            tail = (chosen(chatters, seen.first_error, error), error, torque)
            change = subtract(torque, seen.torque)
            size = where(less(now, told.last), size, 0.0)
            chatter = chatter + where(chatters, sqrt(dot(change, change)), 0.0)
        bound, peak_wheel = is_on_limit(command, setup.limit, limit), seen.peak_wheel_momentum
        for momentum, asked, there in zip(*(own.get(name, ()) for name in WHEEL), strict=True):
            peak_wheel, asked = maximum(peak_wheel, absolute(momentum)), absolute(asked)
            bound = either(bound, both(less(0.0, asked), less_equal(there * ALMOST, asked)))
        return Noted(
            outside(seen.attitude_outside, angle_square, told.angle, now),
            outside(seen.rate_outside, rate_square, told.rate, now),
            maximum(seen.peak_torque, most(torque)),
            maximum(seen.peak_rate_square, dot(own["rate"], own["rate"])),
            peak_wheel,
            seen.torque_sum + size,
            seen.limited + where(bound, 1.0, 0.0),
            chatter,
            *tail,
            tuple(_nearest(least, cone, own["attitude"]) for least, cone in zip(seen.cones, told.cones, strict=True)),
            _turned(seen.turning, q, now) if overshoot else (),
            _levels(seen.attitude_levels, angle_square, now) if iterations else (),
            _levels(seen.rate_levels, rate_square, now) if iterations else (),
            maximum(seen.window_angle, angle_square),
            maximum(seen.window_rate, rate_square),
            maximum(seen.window_torque, torque_square),
        )

    return note


WHEEL = ("wheel_momentum", "wheel_command", "wheel_available")


def _nearest(least: Any, cone: Cone, attitude: Any) -> Any:
    """The square of the least distance between the ends of the axis and of the direction."""
    apart = subtract(to_reference(attitude, cone.axis), cone.direction)
    return minimum(least, dot(apart, apart))


def _turned(seen: Any, q: Any, now: Any) -> Turning:
    """Notes on overshoot, as `_overshoot` of a recording tells it."""
    turn, begins = rotation_vector(q), less(now, 0.5)
    first = chosen(begins, turn, seen.first)
    along = dot(turn, first) / maximum(dot(first, first), 1e-300)
    crossed = where(less(absolute(along), 0.5), 1.0, seen.crossed)
    return Turning(first, crossed, where(less(0.5, crossed), maximum(seen.beyond, -along), seen.beyond))


def _levels(seen: tuple[Any, ...], square: Any, now: Any) -> tuple[Any, ...]:
    """The last instants at which a square was above those of 10^-k."""
    return tuple(outside(then, square, 10.0 ** (-2 * k), now) for then, k in zip(seen, DECADES, strict=True))


def _metrics(flown: Flown, meter: Meter, period: float, wheels: bool) -> Metrics:
    noted, steps, tail, cuts = flown.end, meter.steps, meter.marks[-1], meter.cuts()
    times = [within_since(last, steps) for last in (noted.attitude_outside, noted.rate_outside)]
    found = {
        "settling_time": np.maximum(*times) * period,
        "attitude_settling_time": times[0] * period,
        "rate_settling_time": times[1] * period,
        "peak_torque": noted.peak_torque,
        "peak_torque_norm": np.sqrt(flown.windows["torque"].max(axis=0)),
        "peak_rate": np.sqrt(noted.peak_rate_square),
        "effort": noted.torque_sum * period,
        "limit_share": noted.limited / (steps + 1),
        "chatter": noted.chatter_sum / max(steps - tail, 1),
        "final_attitude_error": _angle(largest_since(tail, flown.windows["attitude_error"], cuts)),
        "final_rate_error": np.sqrt(largest_since(tail, flown.windows["rate_error"], cuts)),
        # Twice the difference of q0 times the vector part is that of the sines of the angles.
        "drift": 2.0 * _distance(noted.error, noted.first_error) / (max(steps - tail, 1) * period),
    }
    if wheels:
        found["peak_wheel_momentum"] = noted.peak_wheel_momentum
    if noted.turning:
        first: Any = noted.turning.first
        small = sum(np.asarray(component) ** 2 for component in first) < 1e-18
        found["overshoot"] = np.where(small, 0.0, np.maximum(noted.turning.beyond, 0.0))
    for prefix, levels in (("", noted.attitude_levels), ("rate_", noted.rate_levels)):
        if levels:
            pairs = zip(DECADES, levels, strict=True)
            found |= {f"{prefix}iterations_1e-{k}": within_since(np.asarray(last), steps) for k, last in pairs}
    return found


def _angle(square: Array) -> Array:
    """The angle (rad) of the square of its half's sine."""
    return 2.0 * np.arcsin(np.sqrt(np.minimum(square, 1.0)))


def _distance(a: Any, b: Any) -> Any:
    return np.sqrt(sum((np.asarray(x) - y) ** 2 for x, y in zip(a, b, strict=True)))
