"""The duration of a slew and its peak rate and acceleration, for one run or many lanes."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.quaternion import relative, to_body
from starhold.algebra.structure import unflatten
from starhold.algebra.vector import dot, subtract
from starhold.algebra.words import number_of
from starhold.analysis.rigid_body import acceleration
from starhold.analysis.transient_notes import Ends, Watched, noted
from starhold.loop.closed_loop import ClosedLoop, Composition
from starhold.loop.kernels import Observer
from starhold.simulation.lane import Recording
from starhold.simulation.lanes import RunningBatch, ThreadPool, carry_columns
from starhold.trace.machine import widest


@cache
def watch(parts: Composition) -> Any:
    """Return the `note` of an `Observer` that keeps a `Watched`; its numbers are `Ends`."""
    target = parts.target
    assert target is not None

    def note(seen: Watched, decided: Any, carry: Any, step: Any, setup: Any, ends: Ends) -> Watched:
        s = carry.state
        mode = (carry.memory.mode,) if target.flag("BY_MODE") else ()
        goal = target.module.goal(setup.target, s, step + 1, carry.memories.followed, *mode)
        error = relative(goal.attitude, s.attitude)
        left = subtract(s.rate, to_body(error, goal.rate))
        quantities = {"attitude_error": error, "rate_error": left, "rate": s.rate}
        return noted(seen, quantities, number_of(step + 1), ends)

    return note


Array: TypeAlias = NDArray[np.float64]

LEG = 0.5
"""Time of motion (s) between checks of which lanes are still worth flying."""


class Limits(NamedTuple):
    """Limits on the norm of the body's rate (rad/s), and on each component of its derivative (rad/s2)."""

    rate: float
    acceleration: float


@dataclass(frozen=True)
class Transient:
    """The time (s) from which on angle and relative rate stay within their ends, interpolated between control steps, or
    None; the largest norm of the body's rate (rad/s); the largest mean over a control step of each component of its
    derivative (rad/s2)."""

    time: float | None
    peak_rate: float
    peak_acceleration: tuple[float, float, float]

    def keeps(self, limits: Limits) -> bool:
        """Return whether the motion stays within limits."""
        return self.peak_rate <= limits.rate and max(self.peak_acceleration) <= limits.acceleration


@dataclass(frozen=True)
class Transients:
    """Transients of many lanes: time (lanes,), NaN for never; peak_rate (lanes,); peak_acceleration (3, lanes)."""

    time: Array
    peak_rate: Array
    peak_acceleration: Array

    def within(self, limits: Limits) -> NDArray[np.bool_]:
        """Return a mask (lanes,) of the lanes that stay within limits."""
        return (self.peak_rate <= limits.rate) & (self.peak_acceleration.max(axis=0) <= limits.acceleration)

    def __getitem__(self, lane: int) -> Transient:
        time, peak = float(self.time[lane]), self.peak_acceleration[:, lane].tolist()
        return Transient(None if math.isnan(time) else time, float(self.peak_rate[lane]), tuple(peak))


def against_limits(run: Recording, limits: Limits, metrics: Mapping[str, Any]) -> dict[str, Any]:
    """Return the metrics of a run, including peaks in SI units, extended by those for limits: the limits (None for none),
    the peak of each component of the acceleration, and whether the limits are kept."""
    peaks = np.abs(acceleration(run)).max(axis=0, initial=0.0).tolist()
    flown = Transient(None, metrics["peak_rate"], tuple(peaks))
    return {
        **metrics,
        "peak_accelerations": peaks,
        "rate_limit": limits.rate if math.isfinite(limits.rate) else None,
        "acceleration_limit": limits.acceleration if math.isfinite(limits.acceleration) else None,
        "limits_kept": flown.keeps(limits),
    }


class Flown(NamedTuple):
    """Lanes after some control steps: their number, the notes (numbers of `Watched`, lanes), and which lanes diverged
    (lanes,)."""

    steps: int
    seen: Array
    lost: NDArray[np.bool_]

    @property
    def outside(self) -> NDArray[np.bool_]:
        """A mask (lanes,) of the lanes that are now outside their ends."""
        return (self.seen[0] > 1.0) | (self.seen[1] > 1.0) | self.lost

    def transients(self, period: float) -> Transients:
        """Return the transients of the lanes so far."""
        time = np.where(self.outside, np.nan, self.seen[2:4].max(axis=0) * period)
        return Transients(time, np.sqrt(self.seen[4]), self.seen[5:8])


class Watcher:
    """Flies a loop without its events on many lanes and notes their transients."""

    def __init__(self, loop: ClosedLoop, angle_end: float, rate_end: float) -> None:
        self.loop, self.ends = replace(loop, events=()), Ends.of(angle_end, rate_end, loop.period)
        self._leg = max(1, round(LEG / loop.period))

    def fly(self, starts: Array, gains: Any, steps: int, threads: int | None = None) -> Transients:
        """Return the lanes after `steps` control steps. starts: (numbers of a state, lanes); gains: the law's, with an
        array (lanes,) in place of every number that differs between lanes."""
        batch, phase = self._batch(starts, gains, steps)
        batch.prepare(phase)
        with ThreadPool(threads) as pool:
            pool.share(lambda piece: batch.fly(phase, piece), batch.count)()
        return self._flown(batch, steps).transients(self.loop.period)

    def search(self, starts: Array, gains: Any, steps: int, enough: Callable[[Flown], bool]) -> Transients:
        """Return the same as `fly`, on this thread, stopping early once `enough` is true. Lanes that are then still outside
        their ends have no time."""
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
        noted = np.array([angle, self.ends.rate * square, none, none, square, none, none, none, *state.rate])
        observer = Observer(watch(self.loop.composition()), Watched(), self.ends)
        (phase,) = self.loop.phases(max(steps, 1))
        phase = phase._replace(last=steps, gains=gains)
        carries = carry_columns(self.loop, starts, phase)
        return RunningBatch(self.loop, carries, 0, widest(len(carries)), observer, noted), phase

    def _flown(self, batch: RunningBatch, steps: int) -> Flown:
        return Flown(steps, batch.notes(), batch.carries()[batch.rows.lost_at] >= 0.0)
