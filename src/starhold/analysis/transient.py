"""The duration of a slew and its peak rate and acceleration, of one run or of many lanes."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.quaternion import relative, to_body
from starhold.algebra.scalar import absolute, less, maximum, where
from starhold.algebra.structure import unflatten
from starhold.algebra.vector import ZERO, Vector, dot, subtract
from starhold.algebra.words import number_of
from starhold.analysis.meter import too_late
from starhold.analysis.rigid_body import acceleration
from starhold.loop.closed_loop import ClosedLoop, Composition
from starhold.loop.kernels import Observer
from starhold.simulation.lane import Recording
from starhold.simulation.lanes import RunningBatch, ThreadPool, carry_columns
from starhold.trace.machine import widest


class Ends(NamedTuple):
    """The ends of a transient: the inverse of sin2(angle / 2), and of rate2 ((rad/s)^-2)."""

    angle: float
    rate: float


class Watched(NamedTuple):
    """The notes of a transient: squares of the sine of half the error angle and of the relative rate, both over their ends,
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
        # A fraction of the previous step, by linear interpolation of the two squares.
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


Array: TypeAlias = NDArray[np.float64]

LEG = 0.5
"""Seconds of motion between two checks which lanes are still worth flying."""


class Limits(NamedTuple):
    """Limits of the body's rate, its norm (rad/s), and of each component of its derivative (rad/s2)."""

    rate: float
    acceleration: float


@dataclass(frozen=True)
class Transient:
    """The time (s) from which angle and relative rate stay within their ends, interpolated between control steps, or None;
    the largest norm of the body's rate (rad/s); of each component of its derivative the largest mean over a control step
    (rad/s2)."""

    time: float | None
    peak_rate: float
    peak_acceleration: tuple[float, float, float]

    def keeps(self, limits: Limits) -> bool:
        """Whether the motion stays within limits."""
        return self.peak_rate <= limits.rate and max(self.peak_acceleration) <= limits.acceleration


@dataclass(frozen=True)
class Transients:
    """Transients of many lanes: time (lanes,), NaN for never; peak_rate (lanes,); peak_acceleration (3, lanes)."""

    time: Array
    peak_rate: Array
    peak_acceleration: Array

    def within(self, limits: Limits) -> NDArray[np.bool_]:
        """A mask (lanes,) of the lanes that stay within limits."""
        return (self.peak_rate <= limits.rate) & (self.peak_acceleration.max(axis=0) <= limits.acceleration)

    def __getitem__(self, lane: int) -> Transient:
        time, peak = float(self.time[lane]), self.peak_acceleration[:, lane].tolist()
        return Transient(None if math.isnan(time) else time, float(self.peak_rate[lane]), tuple(peak))


def of_run(run: Recording, angle_end: float, rate_end: float) -> Transient:
    """Return the transient of a recorded run, with the bits of a `Watcher` where every control step is recorded; fewer
    samples give only what they contain. angle_end: rad; rate_end: rad/s. The time is None also for a run that diverged.
    """
    ends, step = _ends(angle_end, rate_end), run.attrs["control_period"]
    squares = ends.angle * _square(run["attitude_error"][:, 1:]), ends.rate * _square(run["rate_error"])
    over = [_last_above(values) for values in squares]
    lost = "diverged_at" in run.attrs or None in over
    time = None if lost else max(x for x in over if x is not None) * run.attrs["record_every"] * step
    x, y, z = np.abs(acceleration(run)).max(axis=0, initial=0.0).tolist()
    return Transient(time, math.sqrt(_square(run["rate"]).max(initial=0.0)), (x, y, z))


def against_limits(
    run: Recording, limits: Limits, angle_end: float, rate_end: float, cut_off: Sequence[str] = ()
) -> dict[str, Any]:
    """Return metrics of a run against limits, SI units: its time (None where it does not end), its peaks, also of each
    component of the acceleration, the limits (None for none), and whether they are kept. A time within the last tenth of the
    run is None, and joins the names of such times, `cut_off`."""
    flown = of_run(run, angle_end, rate_end)
    step = run.attrs["control_period"] * run.attrs["record_every"]
    late = flown.time is not None and too_late(flown.time / step, len(run["time"]))
    return {
        "cut_off": [*cut_off, "transient_time"] if late else list(cut_off),
        "transient_time": None if late else flown.time,
        "peak_rate": flown.peak_rate,
        "peak_acceleration": max(flown.peak_acceleration),
        "peak_accelerations": list(flown.peak_acceleration),
        "rate_limit": limits.rate if math.isfinite(limits.rate) else None,
        "acceleration_limit": limits.acceleration if math.isfinite(limits.acceleration) else None,
        "limits_kept": flown.keeps(limits),
    }


def _square(vectors: Array) -> Array:
    # Summed in the order of `dot`, for the same bits.
    return vectors[:, 0] ** 2 + vectors[:, 1] ** 2 + vectors[:, 2] ** 2


def _last_above(values: Array) -> float | None:
    """Return the index, with its fraction, at which values (n,) were last above 1; None where they are at the end."""
    above = np.flatnonzero(~(values <= 1.0))
    if not len(above):
        return 0.0
    last = int(above[-1])
    if last + 1 == len(values):
        return None
    return last + float((values[last] - 1.0) / (values[last] - values[last + 1]))


def _ends(angle: float, rate: float) -> Ends:
    return Ends(1.0 / math.sin(0.5 * angle) ** 2, 1.0 / rate**2)


class Flown(NamedTuple):
    """Lanes after some control steps: their number, the notes (numbers of `Watched`, lanes), and which lanes diverged
    (lanes,)."""

    steps: int
    seen: Array
    lost: NDArray[np.bool_]

    @property
    def outside(self) -> NDArray[np.bool_]:
        """A mask (lanes,) of the lanes outside their ends now."""
        return (self.seen[0] > 1.0) | (self.seen[1] > 1.0) | self.lost

    def transients(self, period: float) -> Transients:
        """The transients of the lanes so far."""
        time = np.where(self.outside, np.nan, self.seen[2:4].max(axis=0) * period)
        return Transients(time, np.sqrt(self.seen[4]), self.seen[5:8])


class Watcher:
    """Flies a loop on many lanes and notes their transients. The loop is unchanged, but without events."""

    def __init__(self, loop: ClosedLoop, angle_end: float, rate_end: float) -> None:
        self.loop, self.ends = replace(loop, events=()), _ends(angle_end, rate_end)
        self._leg = max(1, round(LEG / loop.period))

    def fly(self, starts: Array, gains: Any, steps: int, threads: int | None = None) -> Transients:
        """starts: (numbers of a state, lanes); gains: the law's, with an array (lanes,) in place of every number that
        differs between lanes; steps: control steps."""
        batch, phase = self._batch(starts, gains, steps)
        batch.prepare(phase)
        with ThreadPool(threads) as pool:
            pool.share(lambda piece: batch.fly(phase, piece), batch.count)()
        return self._flown(batch, steps).transients(self.loop.period)

    def search(self, starts: Array, gains: Any, steps: int, enough: Callable[[Flown], bool]) -> Transients:
        """Do the same on this thread, and stop early once `enough` is true. Lanes that are then still outside their end have
        no time."""
        batch, phase = self._batch(starts, gains, steps)
        flown = self._flown(batch, 0)
        while flown.steps < steps and not enough(flown):
            leg = min(self._leg, steps - flown.steps)
            batch.fly(phase, range(batch.count), flown.steps, leg)
            flown = self._flown(batch, flown.steps + leg)
        return flown.transients(self.loop.period)

    def _batch(self, starts: Array, gains: Any, steps: int) -> tuple[RunningBatch, Any]:
        state, target = unflatten(list(starts), self.loop.start), self.loop.target
        if not target.part.flag("STILL"):
            raise ValueError("transients are noted only for a target at rest")
        error, none = relative(self.loop.first_attitude(), state.attitude), np.zeros(starts.shape[1])
        angle, square = self.ends.angle * dot(error[1:], error[1:]), dot(state.rate, state.rate)
        noted = np.array([angle, self.ends.rate * square, none, none, square, none, none, none])
        observer = Observer(watch(self.loop.composition()), Watched(0.0, 0.0, 0.0, 0.0, 0.0, ZERO), self.ends)
        (phase,) = self.loop.phases(max(steps, 1))
        phase = phase._replace(last=steps, gains=gains)
        carries = carry_columns(self.loop, starts, phase)
        return RunningBatch(self.loop, carries, 0, widest(len(carries)), observer, noted), phase

    def _flown(self, batch: RunningBatch, steps: int) -> Flown:
        return Flown(steps, batch.notes(), batch.carries()[batch.rows.lost_at] >= 0.0)
