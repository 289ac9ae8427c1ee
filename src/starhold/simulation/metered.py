"""Many lanes fly with notes taken at every control instant, the last one included, and for each window of time apart."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from starhold.loop.closed_loop import ClosedLoop, Phase
from starhold.loop.kernels import Observer
from starhold.simulation.lane import Progress
from starhold.simulation.lanes import RunningBatch, ThreadPool
from starhold.trace.machine import widest

Array = NDArray[np.float64]


PIECES = 2
"""Pieces of a batch for each thread; few, for each is called once a window."""


class Metered(NamedTuple):
    """The results of flights: where each lane ended (numbers, lanes), its notes (numbers, lanes), and the noted numbers
    of windows (windows, quantities, lanes)."""

    ends: Array
    notes: Array
    windows: Array


def begin_metered(
    loop: ClosedLoop,
    carries: Array,
    phases: Sequence[Phase],
    first_run: int | NDArray[np.int64],
    observers: tuple[Observer, Observer],
    noted: Array,
    cuts: Sequence[int],
    late: int,
    rows: Sequence[int],
    pool: ThreadPool,
) -> Callable[..., Metered]:
    """Begin to fly lanes through phases, and note the instant after the last step too, at which a command is decided
    and not flown. Returns a function that waits for the end and reports progress.

    carries: (numbers, lanes), see `carry_columns`; observers: one before the control step `late` and one from it on;
    noted: notes before the flight (numbers, lanes); cuts: control steps at which windows end, `late` among them unless
    it is 0, the last, which takes the last instant in, at the end of the flight or after it; rows: noted numbers that
    begin anew in each window, at 0.
    """
    batch = RunningBatch(loop, carries, first_run, widest(len(carries), len(noted)), observers[0], noted)
    for phase in phases:
        for observer in observers:
            batch.prepare(phase, observer)
    by_window = np.empty((len(cuts), len(rows), batch.count, batch.width))
    end, kept = phases[-1].last, list(rows)

    def work(piece: range) -> None:
        span, done = slice(piece.start, piece.stop), 0
        for window, cut in enumerate(cuts):
            observer = observers[done >= late]
            for phase in phases:
                first, last = max(done, phase.first), min(cut, phase.last)
                if first < last:
                    batch.fly(phase, piece, first, last - first, observer)
            done = cut
            if window == len(cuts) - 1:
                carried = batch.x[span].copy()
                batch.fly(phases[-1], piece, end, 1, observers[1])
                batch.x[span] = carried
            seen = batch.noted[span]
            by_window[window, :, span] = seen[:, kept].swapaxes(0, 1)
            seen[:, kept] = 0.0

    wait = pool.share(work, batch.count, PIECES)

    def finish(progress: Progress | None = None) -> Metered:
        wait(progress)
        windows = by_window.reshape(len(cuts), len(rows), -1)[:, :, : carries.shape[1]]
        return Metered(batch.carries(), batch.notes(), windows)

    return finish
