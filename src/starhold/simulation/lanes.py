"""Flies many trajectories at once: blocks of lanes, blocks shared out over threads."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.structure import LANES, flatten, pack, unflatten, unpack
from starhold.loop.closed_loop import Carry, ClosedLoop, Phase
from starhold.loop.kernels import make_kernels
from starhold.loop.station import StationLoop
from starhold.models.libration import PointState
from starhold.models.rigid_body import State
from starhold.simulation.lane import Progress, fly

RATE = slice(4, 7)
"""The rows of the rate among the numbers of a state."""


@dataclass(frozen=True)
class Batch:
    """Where many trajectories ended. states: (numbers of a state, lanes), rows in the order of the loop's `start`; lost_at:
    (lanes,) control step at which the motion was lost, -1 where it was not."""

    states: NDArray[np.float64]
    lost_at: NDArray[np.float64]
    like: Any

    def state(self, lane: int) -> Any:
        """The state of a lane, a `State`, `WheeledState` or `PointState`."""
        return unflatten(self.states[:, lane], self.like)


def simulate_many(
    loop: ClosedLoop | StationLoop,
    starts: Sequence[State | PointState] | NDArray[np.float64],
    steps: int,
    gains: NDArray[np.float64] | None = None,
    first_run: int = 0,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Batch:
    """Fly `loop` from each of many states for `steps` control periods.

    starts: states, or an array (numbers of a state, lanes); gains: (numbers of the law's gains, lanes) where they differ
    between lanes; first_run: the run number of lane 0, which with the seed fixes its random numbers. The result is the same,
    bit for bit, for any number of threads, and equals that of `simulate` lane by lane.
    """
    start = np.asarray(starts if isinstance(starts, np.ndarray) else [flatten(s) for s in starts], dtype=float)
    start = start if isinstance(starts, np.ndarray) else start.T
    workers = os.cpu_count() or 1 if threads is None else threads
    if gains is not None and isinstance(loop, ClosedLoop) and loop.events:
        raise ValueError("gains of their own for each lane do not go with events that change gains")
    if isinstance(loop, ClosedLoop) and loop.law.card.compiled_only:
        return _one_by_one(loop, start, steps, gains, first_run, workers, progress)
    carries = _carries(loop, start)
    blocks = pack(carries)
    gain_blocks = None if gains is None else pack(gains)
    kernel, like, phases = make_kernels(loop.parts()).many, loop.carry(), loop.phases(steps)

    def work(block: int) -> None:
        run = first_run + block * LANES
        for now in phases:
            own = now.gains if gain_blocks is None else gain_blocks[block]
            count = now.last - now.first
            if isinstance(now, Phase):
                rate = blocks[block].reshape(-1, LANES)[RATE]
                rate[:] = now.rate_from(tuple(rate))
            numbers = own, now.gains, now.known, now.craft, now.setup, loop.substeps
            kernel(blocks[block], like, now.first, count, run, *numbers)

    _share_out(work, len(blocks), workers, progress)
    ends = unpack(blocks, start.shape[1])
    return Batch(ends[: len(start)], ends[-1], loop.start)


def _carries(loop: ClosedLoop | StationLoop, start: NDArray[np.float64]) -> NDArray[np.float64]:
    """What each lane starts with, one column a lane."""
    if isinstance(loop, StationLoop):
        columns = np.repeat(np.array(flatten(loop.carry()))[:, None], start.shape[1], axis=1)
        columns[: len(start)] = start
        return columns
    if isinstance(loop.target, str):
        return np.array([flatten(loop.carry(unflatten(column, loop.start))) for column in start.T]).T
    # Lanes differ in their state and in the side of the double cover they start on, and in nothing else.
    first = loop.carry()
    columns = np.repeat(np.array(flatten(first))[:, None], start.shape[1], axis=1)
    columns[: len(start)] = start
    goal = loop.target[0, :4] if isinstance(loop.target, np.ndarray) else np.array(loop.target)
    columns[len(start) + len(flatten((first.memory, first.goal)))] = np.where(goal @ start[:4] < 0.0, -1.0, 1.0)
    return columns


def _one_by_one(
    loop: ClosedLoop, start: Any, steps: int, gains: Any, first_run: int, workers: int, progress: Progress | None
) -> Batch:
    """For laws whose memory is not a handful of numbers: threads over single trajectories."""
    from dataclasses import replace

    carries: list[Carry | None] = [None] * start.shape[1]

    def work(lane: int) -> None:
        own = loop.gains if gains is None else unflatten(gains[:, lane], loop.gains)
        flown = replace(loop, start=unflatten(start[:, lane], loop.start), gains=own)
        carries[lane] = fly(flown, steps, max(steps, 1), first_run + lane)[1]

    _share_out(work, len(carries), workers, progress)
    ends = [carry for carry in carries if carry is not None]
    return Batch(np.array([flatten(c.state) for c in ends]).T, np.array([c.lost_at for c in ends]), loop.start)


def _share_out(work: Any, count: int, workers: int, progress: Progress | None) -> None:
    with ThreadPoolExecutor(max_workers=max(1, workers)) as pool:
        todo = {pool.submit(work, item) for item in range(count)}
        done = 0
        try:
            while todo:
                finished, todo = wait(todo, return_when=FIRST_COMPLETED)
                for future in finished:
                    future.result()
                done += len(finished)
                if progress is not None:
                    progress(done, count)
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
