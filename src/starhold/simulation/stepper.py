"""Flies a closed loop control step by control step, with commands of its own law or external ones."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from starhold.algebra.structure import flatten, unflatten
from starhold.loop.closed_loop import ClosedLoop, Phase
from starhold.loop.kernels import Arguments, Kernel, Numbers, make_kernel, make_step, numbers_of, state_of
from starhold.loop.programs import stepping
from starhold.simulation.lane import Recording, label
from starhold.simulation.lanes import RunningBatch, carry_columns
from starhold.trace.machine import widest, word

if TYPE_CHECKING:
    import xarray as xr

LAST = 1 << 40
"""A control step that no flight reaches."""


@dataclass(frozen=True)
class Readings:
    """The numbers that flight software reads at a control instant, in SI units, or arrays (lanes,) of many flights."""

    time: float
    """Time since the start (s)."""
    numbers: NDArray[np.float64]
    """All readings after the time in a row, (numbers,) or (numbers, lanes)."""
    like: Any
    names: tuple[str, ...]

    @cached_property
    def measurement(self) -> Any:
        """The inputs of the loop's own law: errors of attitude and rate, and the target's motion."""
        return self._part(0)

    @cached_property
    def sensors(self) -> dict[str, Any]:
        """The reading of each sensor by its name; empty for a loop without sensors."""
        return dict(zip(self.names, self._part(1), strict=True))

    @cached_property
    def estimate(self) -> Any:
        """The estimate of the loop's own estimator; () without one."""
        return self._part(2)

    def _part(self, place: int) -> Any:
        begin = len(flatten(self.like[:place]))
        return _shaped(self.numbers[begin : begin + len(flatten(self.like[place]))], self.like[place])


def sensed_of(loop: ClosedLoop) -> tuple[Any, Any, Any]:
    """Return the inputs of a loop's law at the start: its measurement, the readings of the sensors, the estimate."""
    first = loop.phases(1)[0]
    step = make_step(loop.composition())
    return step.sense(loop.carry(), 0, (loop.seed, loop.run), first.gains, first.nominal, first.setup)[:3]


def _shaped(numbers: NDArray[np.float64], like: Any) -> Any:
    """Return numbers, or rows of lanes, in the shape of `like`."""
    return unflatten(list(numbers) if numbers.ndim > 1 else numbers, like)


class Stepper:
    """One flight of a closed loop, or many at once, one control step per call. A flight with commands of its own law has the
    bits of `simulate`."""

    def __init__(self, loop: ClosedLoop, lanes: int | None = None, record: bool = True) -> None:
        """lanes: the number of flights, None for one flight without an axis of lanes; record: whether samples are kept."""
        self.loop, self.lanes, self.record = loop, lanes, record
        self._step, self._like = make_step(loop.composition()), loop.carry()
        self._phases = loop.phases(LAST)
        self._sensed_like = sensed_of(loop)
        self._names = tuple(fitted.called for fitted in loop.used("sensor"))
        self._sample = len(flatten(self._step.sample(self._like, 0, self._phases[0].setup)))
        self._kernels: dict[tuple[int, bool], tuple[Kernel, Arguments]] = {}
        self.reset()

    def reset(self, seed: int | None = None, run: int | None = None, start: Any = None) -> Readings:
        """Begin again, and return the initial readings. seed, run: of the random numbers, the scenario's if None; many
        flights have the runs from `run` on; start: another state of the body, like `state`, whose numbers may be arrays
        (lanes,). Raise ValueError for another shape and for numbers that are not finite."""
        loop, lanes = self.loop, self.lanes or 1
        self.seed, self.run = loop.seed if seed is None else seed, loop.run if run is None else run
        given = flatten(loop.start if start is None else start)
        if len(given) != len(flatten(loop.start)) or any(np.shape(x) not in ((), (lanes,)) for x in given):
            raise ValueError(f"start: found {start}; allowed: a state such as {loop.start}")
        begin = np.array([np.broadcast_to(x, (lanes,)) for x in given], dtype=float)
        if not np.isfinite(begin).all():
            raise ValueError(f"start: found {start}; allowed: finite numbers")
        columns = carry_columns(loop, begin)
        width = 1 if self.lanes is None else widest(len(columns))
        self._hold(RunningBatch(loop, columns, self.run, width))
        self.steps, self._phase = 0, 0
        self._rows: list[NDArray[np.float64]] = []
        self._ending: NDArray[np.float64] | None = None
        self._closed = True
        return self._fly(0, False)

    def _hold(self, batch: RunningBatch) -> None:
        """Take over the carries of flights, and allocate the memories of kernels."""
        room = {"record": self._sample, "sensed": self.size, "given": len(self._like.command)}
        self._batch = batch
        self._memories = {name: batch.room(size) for name, size in room.items()} | {"carry": batch.x}
        self._calls: dict[tuple[int, bool], Any] = {}

    @property
    def size(self) -> int:
        """The number of numbers in readings."""
        return len(flatten(self._sensed_like))

    @property
    def time(self) -> float:
        """The time since the start (s)."""
        return self.steps * self.loop.period

    @property
    def state(self) -> Any:
        """The present true state of the body: numbers, or arrays (lanes,)."""
        return _shaped(self._read("carry")[: len(flatten(self._like.state))], self._like.state)

    @property
    def truth(self) -> NDArray[np.float64]:
        """The numbers of the true states of body and effectors in a row, (numbers,) or (numbers, lanes)."""
        return self._read("carry")[: len(flatten((self._like.state, self._like.effectors)))]

    @property
    def setup(self) -> Any:
        """The present numbers of the parts."""
        return self._phases[self._phase].setup

    @property
    def diverged(self) -> Any:
        """Whether the motion has diverged: not finite, too fast for the integration, or beyond the divergence bound."""
        return self._read("carry")[self._batch.rows.lost_at] >= 0.0

    def step(self, command: ArrayLike | None = None) -> Readings:
        """Fly one control period, and return the readings at its end. command: held over the period, (3,) or (lanes, 3), and
        saturated like the law's own (N m, or the body's unit); None: the command of the loop's own law. Raise ValueError for
        a command that is not finite or of another shape."""
        if command is not None:
            wanted = np.asarray(command, dtype=float)
            shape = (3,) if self.lanes is None else (self.lanes, 3)
            if wanted.shape != shape or not np.isfinite(wanted).all():
                raise ValueError(f"command: found {wanted.tolist()}; allowed: finite numbers {shape}")
            if self.lanes is None:
                self._memories["given"][0, :, 0] = wanted
            else:
                self._batch.fill(self._memories["given"], wanted.T)
        self._enter()
        readings = self._fly(1, command is not None)
        if self.record:
            self._rows.append(self._memories["record"].copy())
        self._closed, self._ending = command is None, None
        return readings

    def prepare(self) -> None:
        """Compile the kernels for steps with external commands, so that no step waits for the compiler."""
        for phase in self._phases:
            self._made(phase, True)

    def close(self, command: ArrayLike | None = None) -> None:
        """Record this instant with the command that would be given now, without a step. Raise ValueError as in `step`."""
        ahead = self.copy()
        ahead.step(command)
        self._ending = ahead._rows[-1] if self.record else None

    def copy(self) -> Self:
        """Return a copy of the flight, which continues independently from here."""
        other = copy(self)
        other._hold(self._batch.copy())
        other._rows = list(self._rows)
        return other

    def samples(self, record_every: int = 1, lane: int = 0) -> tuple[NDArray[np.float64], Any]:
        """Return the samples (number, sample) since the start, and the final carry, like `fly`; without the last instant if
        its command would have been external. Raise ValueError if nothing was recorded."""
        if self._closed and self._ending is None:
            self.close()
        rows = self._rows if self._ending is None else [*self._rows, self._ending]
        if not rows:
            raise ValueError("recording: found no sample; allowed: a stepper that records, after a step")
        samples = np.array([self._batch.unpacked(row)[:, lane] for row in rows[::record_every]])
        carry = state_of(self._batch.carries()[:, lane], self._like)
        if carry.lost_at >= 0.0:
            samples = samples[: max(1, int(np.ceil(carry.lost_at / record_every)))]
        return samples.reshape(len(samples), self._sample).T, carry

    def recording(self, lane: int = 0) -> Recording:
        """Return the flight since the start, as `simulate` records it."""
        return label(self.loop, *self.samples(lane=lane), 1)

    def dataset(self, lane: int = 0) -> xr.Dataset:
        """Return the recording as a Dataset with units, like `simulate`."""
        return self.recording(lane).dataset()

    def _read(self, name: str) -> NDArray[np.float64]:
        """Return a copy of the contents of a memory, (numbers,) or (numbers, lanes)."""
        blocks = self._memories[name]
        return blocks[0, :, 0].copy() if self.lanes is None else self._batch.unpacked(blocks)

    def _enter(self) -> None:
        """Begin the phase of this step, if one begins."""
        if self.steps != self._phases[self._phase].last:
            return
        self._phase += 1
        entered = self._phases[self._phase]
        if entered.jumps:
            columns = self._batch.carries()
            for column in columns.T:
                column[:] = numbers_of(entered.entered(state_of(column, self._like)))
            self._batch.fill(self._batch.x, columns)

    def _fly(self, count: int, outside: bool) -> Readings:
        key = (self._phase, outside)
        if key not in self._calls:
            self._calls[key] = self._made(self._phases[self._phase], outside)
        batch = self._batch
        self._calls[key](self.steps, count, batch.count, batch.width, word(self.seed), word(self.run))
        self.steps += count
        return Readings(self.time, self._read("sensed"), self._sensed_like, self._names)

    def _made(self, phase: Phase, outside: bool) -> Any:
        """Return the kernel of a phase on the memories of this stepper."""
        key = (phase.first, outside)
        if key not in self._kernels:
            numbers, more = Numbers.of(phase), (self.loop.substeps, outside)
            kernel = make_kernel(stepping, self.loop.composition(), self._batch.width, self._like, numbers, *more)
            self._kernels[key] = kernel, Arguments(*numbers)
        kernel, arguments = self._kernels[key]
        memories = {"shared": arguments.shared, "own": arguments.shared, "tables": arguments.tables} | self._memories
        call = kernel.on(memories)
        # The kernel keeps the memories alive whose addresses it has.
        return lambda *counts, kept=memories: call(*counts)
