"""Flies many trajectories at once: blocks of lanes, divided among threads."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.structure import flatten, leaves, mapped, places, rebuild, unflatten
from starhold.algebra.structured import Buffer
from starhold.loop.closed_loop import ClosedLoop, Phase
from starhold.loop.kernels import Arguments, Numbers, Observer, numbers_of
from starhold.loop.programs import CHUNK, make_halves
from starhold.simulation.lane import Progress
from starhold.trace.machine import aligned, widest

if TYPE_CHECKING:
    from concurrent.futures import Future

PIECES = 4
"""Pieces of a batch per thread; between them progress is reported and an interrupt takes effect. Each piece also computes
the numbers common to all lanes."""


class ThreadPool:
    """A pool of threads for a `with` block; work that has not begun at its end is dropped."""

    def __init__(self, threads: int | None = None) -> None:
        from concurrent.futures import ThreadPoolExecutor

        self.threads = max(1, os.cpu_count() or 1 if threads is None else threads)
        self._pool = ThreadPoolExecutor(self.threads)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._pool.shutdown(cancel_futures=True)

    def share(self, work: Callable[[range], None], count: int, pieces_each: int = PIECES) -> Callable[..., None]:
        """Call work(piece) on `count` blocks, divided into `pieces_each` pieces per thread. Return a function that waits
        for the end and reports progress."""
        size = max(1, -(-count // (self.threads * pieces_each)))
        begun: list[Future[None]] = [
            self._pool.submit(work, range(at, min(at + size, count))) for at in range(0, count, size)
        ]

        def wait(progress: Progress | None = None) -> None:
            for done, piece in enumerate(begun, 1):
                piece.result()
                if progress is not None:
                    progress(done, len(begun))

        return wait


@dataclass(frozen=True)
class Batch:
    """The final states of many trajectories. states: (numbers of a state, lanes), rows in the order of the loop's `start`
    and then of its effectors; lost_at: (lanes,) control step at which the motion diverged, -1 if it did not."""

    states: NDArray[np.float64]
    lost_at: NDArray[np.float64]
    like: Any

    def state(self, lane: int) -> Any:
        """Return the state of the body in a lane."""
        return unflatten(self.states[:, lane], self.like)


def simulate_many(
    loop: ClosedLoop,
    starts: Sequence[Any] | NDArray[np.float64],
    steps: int,
    first_run: int = 0,
    threads: int | None = None,
    progress: Progress | None = None,
    phases: Sequence[Phase] | None = None,
    width: int | None = None,
) -> Batch:
    """Fly `loop` from each of many states for `steps` control periods.

    starts: states of the body, or an array (numbers of a state, lanes), with or without those of the effectors below;
    first_run: the run number of lane 0, which with the seed determines its random numbers; phases: those of the loop,
    `loop.phases(steps)`, with an array (lanes,) in place of every number that differs between lanes, except integers, see
    `stacked`; width: simultaneous lanes on a core.

    Return the final states. They are the same, bit for bit, for any number of threads and any width, and equal those of
    `fly` lane by lane until the motion diverges."""
    start = np.asarray(starts if isinstance(starts, np.ndarray) else [flatten(s) for s in starts], dtype=float)
    start = start if isinstance(starts, np.ndarray) else start.T
    cut = list(loop.phases(steps) if phases is None else phases)
    carries = carry_columns(loop, start, cut[0] if cut else None)
    batch = RunningBatch(loop, carries, first_run, width or widest(len(carries)))
    for phase in cut:
        batch.prepare(phase)

    def work(piece: range) -> None:
        for now in cut:
            batch.fly(now, piece)

    with ThreadPool(threads) as pool:
        pool.share(work, batch.count)(progress)
    ends = batch.carries()
    moving = len(flatten((batch.like.state, batch.like.effectors)))
    return Batch(ends[:moving], ends[batch.rows.lost_at], loop.start)


class RunningBatch:
    """A batch of lanes in flight: the carry of each, in blocks of `width` lanes, and the observer's notes on it. `alike`
    are the indices of the carry's numbers that are equal in all lanes, bit for bit, and stay so: they are computed once for
    all.

    carries: (numbers, lanes), see `carry_columns`; first_run: the run number of lane 0, or those of all lanes (lanes,);
    noted: (numbers, lanes)."""

    def __init__(
        self,
        loop: ClosedLoop,
        carries: NDArray[np.float64],
        first_run: int | NDArray[np.int64],
        width: int,
        observer: Observer | None = None,
        noted: NDArray[np.float64] | None = None,
    ) -> None:
        self.loop, self.width, self.observer = loop, width, observer
        self.first_run, self.runs = numbered(first_run)
        self.lanes = carries.shape[1]
        self.count = -(-self.lanes // width)
        self.like = loop.carry()
        self.rows = places(self.like)
        bits = np.ascontiguousarray(carries[: len(flatten(self.like))]).view(np.int64)
        self.alike = tuple(np.flatnonzero((bits == bits[:, :1]).all(axis=1)).tolist())
        self.x = self._packed(carries)
        self.noted = self._packed(np.empty((0, self.lanes)) if noted is None else noted)
        self._ready: dict[tuple[int, int], Any] = {}

    def room(self, numbers: int) -> NDArray[np.float64]:
        """Return blocks (blocks, numbers, width) of zeros."""
        return aligned(self.count, numbers, self.width)

    def fill(self, blocks: NDArray[np.float64], rows: NDArray[np.float64]) -> None:
        """Copy rows (numbers, lanes) into blocks; the last block is filled up with copies of the last lane."""
        short = self.count * self.width - self.lanes
        padded = np.pad(rows, ((0, 0), (0, short)), mode="edge") if short else rows
        blocks[:] = padded.reshape(len(rows), self.count, self.width).swapaxes(0, 1)

    def _packed(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return blocks of rows (numbers, lanes)."""
        blocks = self.room(len(rows))
        self.fill(blocks, rows)
        return blocks

    def copy(self) -> Self:
        """Return a batch that continues independently."""
        other = copy(self)
        other.x, other.noted, other._ready = self.room(self.x.shape[1]), self.room(self.noted.shape[1]), {}
        other.x[:], other.noted[:] = self.x, self.noted
        return other

    def unpacked(self, blocks: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return rows (numbers, lanes) of blocks (blocks, numbers, width)."""
        return np.ascontiguousarray(blocks.swapaxes(0, 1).reshape(blocks.shape[1], -1)[:, : self.lanes])

    def carries(self) -> NDArray[np.float64]:
        """Return the numbers that each lane carries now, (numbers, lanes)."""
        return self.unpacked(self.x)

    def notes(self) -> NDArray[np.float64]:
        """Return the notes of each lane, (numbers, lanes)."""
        return self.unpacked(self.noted)

    def fly(
        self,
        phase: Phase,
        piece: range,
        first: int | None = None,
        count: int | None = None,
        observer: Observer | None = None,
    ) -> None:
        """Fly the blocks of a piece through a phase, or through `count` control steps of it from `first` on. observer:
        replaces the batch's, with notes of the same shape."""
        _, halves, alike, arguments, varying, turn = self.prepare(phase, observer)
        part = self.x[piece.start : piece.stop]
        if turn is not None and first in (None, phase.first):
            rows = list(self.rows.state.rate)
            rates = part[:, rows].swapaxes(0, 1).reshape(len(rows), -1)
            turned = np.array(turn(tuple(rates), piece))
            part[:, rows] = turned.reshape(len(rows), len(piece), self.width).swapaxes(0, 1)
        begin = phase.first if first is None else first
        end = phase.last if count is None else begin + count
        memories = {memory.name: np.empty(memory.size or 0) for memory in halves[0].program.memories}
        memories |= {"carry": part, "noted": self.noted[piece.start : piece.stop], "own": varying[piece.start : piece.stop]}
        memories |= {"shared": arguments.shared, "tables": arguments.tables}
        run = self.first_run + piece.start * self.width
        # Lanes are observed even without a step.
        for step in range(begin, max(end, begin + 1), CHUNK):
            memories["common"] = np.ascontiguousarray(part[0, alike, 0])
            for half in halves:
                half(memories, step, min(CHUNK, end - step), len(piece), self.width, self.loop.seed, run)

    def prepare(self, phase: Phase, observer: Observer | None = None) -> Any:
        """Compile the kernel of a phase once, before threads use it; call it for phases in the order of flight."""
        observer = observer or self.observer
        key = (id(phase), id(observer))
        if key not in self._ready:
            numbers = Numbers.of(phase)
            arguments = Arguments(*numbers, () if observer is None else observer.numbers, self.runs)
            turn = self._turned(phase) if phase.jumps else None
            if turn is not None:
                self.alike = tuple(row for row in self.alike if row not in self.rows.state.rate)
            more = (self.like, numbers, self.loop.substeps, observer, self.runs)
            halves, self.alike = make_halves(self.loop.composition(), self.width, self.alike, *more)
            # The objects in the key are kept alive, so that no others get their ids.
            kept = (phase, observer)
            self._ready[key] = (kept, halves, list(self.alike), arguments, self._packed(arguments.rows(self.lanes)), turn)
        return self._ready[key]

    def _turned(self, phase: Phase) -> Any:
        """Return a function that returns the body's rates in the lanes of a piece at the start of a phase."""
        size = self.count * self.width

        def whole(leaf: Any) -> Any:
            return np.pad(leaf, (0, size - self.lanes), mode="edge") if isinstance(leaf, np.ndarray) else leaf

        craft, before = mapped(phase.craft, whole), mapped(phase.before, whole)

        def turn(rates: Any, piece: range) -> Any:
            span = slice(piece.start * self.width, piece.stop * self.width)

            def cut(leaf: Any) -> Any:
                return leaf[span] if isinstance(leaf, np.ndarray) else leaf

            return phase._replace(craft=mapped(craft, cut), before=mapped(before, cut)).rate_from(rates)

        return turn


def numbered(first_run: int | NDArray[np.int64]) -> tuple[int, NDArray[np.float64] | tuple[()]]:
    """Return the run number of lane 0 if the others follow it, or 0 and the numbers of all lanes."""
    return (first_run, ()) if isinstance(first_run, int) else (0, np.asarray(first_run, dtype=float))


def carry_columns(loop: ClosedLoop, start: NDArray[np.float64], phase: Any = None) -> NDArray[np.float64]:
    """Return the initial carry, one column for each lane, from its state (numbers of a state, lanes). phase: the first, if
    numbers of it differ between lanes."""
    lanes = start.shape[1]
    varies = phase is not None and any(isinstance(leaf, np.ndarray) for leaf in leaves((phase.gains, phase.nominal)))
    first = loop.carry()
    rows = places(first)
    moving = len(flatten((first.state, first.effectors)))
    if _differ(loop) or (varies and loop.remembers):
        given = (None, None, loop.setup()) if phase is None else (phase.gains, phase.nominal, phase.setup)
        carries = (
            loop.carry(unflatten(start[:, lane], loop.start), *(_of_lane(value, lane) for value in given))
            for lane in range(lanes)
        )
        columns = np.array([numbers_of(carry) for carry in carries]).T
    else:
        columns = np.repeat(np.array(numbers_of(first))[:, None], lanes, axis=1)
    # Besides their state, lanes differ in the initial sign of the quaternion policy.
    columns[: min(len(start), moving)] = start
    if loop.aims and not _differ(loop):
        goal = loop.first_attitude()
        columns[rows.h] = np.where(np.array(goal) @ start[list(rows.state.attitude)] < 0.0, -1.0, 1.0)
    return columns


def _differ(loop: ClosedLoop) -> bool:
    """Return whether the initial memories of a loop depend on the body's initial state."""
    starting = [f.part for f in (*loop.used("sensor"), *loop.estimating) if f.part.hook("remember")]
    return bool(starting or loop.carry().memories.readings or loop.carry().memories.estimate) or (
        loop.aims and loop.target.part.flag("FOLLOWS")
    )


def stacked(values: Sequence[Any]) -> Any:
    """Return the structures of many lanes stacked into one: numbers that differ become arrays (lanes,). Raise ValueError if
    more than numbers differ: the form, integers, tables."""
    first = values[0]
    if isinstance(first, (tuple, list)):
        if any(type(value) is not type(first) or len(value) != len(first) for value in values):
            raise ValueError("lanes differ in more than numbers")
        parts: list[Any] = [stacked(parts) for parts in zip(*values, strict=True)]
        return parts if isinstance(first, list) else rebuild(first, parts)
    if isinstance(first, float):
        return first if len(set(values)) == 1 else np.array(values)
    constants = [(x.cells, x.base, x.size) if isinstance(x, Buffer) else x for x in values]
    if any(not (x is constants[0] or (type(x) is type(constants[0]) and x == constants[0])) for x in constants):
        raise ValueError(f"lanes differ in a constant of their kernel: {first} and others")
    return first


def _of_lane(value: Any, lane: int) -> Any:
    return mapped(value, lambda leaf: float(leaf[lane]) if isinstance(leaf, np.ndarray) else leaf)
