"""Flies loops that differ only in numbers as batches, a vector of lanes at a time; each is recorded as by `fly`."""

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.structure import buffers, flatten, mapped, places
from starhold.loop.closed_loop import ClosedLoop, Phase
from starhold.loop.kernels import Arguments, Kernel, Numbers, Observer, form, make_kernel, make_step, numbers_of, state_of
from starhold.loop.programs import one
from starhold.simulation.lane import Progress, fly
from starhold.simulation.lanes import RunningBatch, ThreadPool, stacked
from starhold.trace.machine import aligned, widest

FEW = 3
"""Up to this many loops fly one by one, which is faster than compiling a kernel for lanes."""
MOST = 2**26
"""Most numbers in the samples of a vector of lanes; longer flights fly one by one."""


class Flying(NamedTuple):
    """A loop, its number of control steps, and the control steps per sample."""

    loop: ClosedLoop
    steps: int
    record_every: int


def fly_batched(
    flights: Sequence[Flying],
    use: Callable[[int, NDArray[np.float64], Any], Any],
    threads: int | None = None,
    progress: Progress | None = None,
) -> list[Any]:
    """Return the results of `use(number, samples, carry)` for each flight, in order, with the samples (number, sample) and
    carry of `fly`, bit for bit. Loops of the same form fly together; the others one by one."""
    groups: dict[Any, list[int]] = {}
    for number, flight in enumerate(flights):
        groups.setdefault(kernel_key(flight), []).append(number)
    jobs: list[Callable[[], list[tuple[int, Any]]]] = []
    for numbers in groups.values():
        group = [flights[number] for number in numbers]
        jobs += (_together if len(group) > FEW else _one_by_one)(group, numbers, use)
    outputs: list[Any] = [None] * len(flights)
    done = 0
    with ThreadPoolExecutor(max_workers=threads or os.cpu_count() or 1) as pool:
        try:
            for results in pool.map(lambda job: job(), jobs):
                for number, result in results:
                    outputs[number] = result
                done += len(results)
                if progress is not None:
                    progress(done, len(flights))
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    return outputs


def kernel_key(flight: Flying) -> Any:
    """Return a key that is equal for flights that one kernel serves with the same tables."""
    loop, cut = flight.loop, flight.loop.phases(flight.steps)
    phases = [(p.first, p.last, form(Numbers.of(p))) for p in cut]
    tables = [np.array(table.cells).tobytes() for phase in cut for table in buffers(phase.setup)]
    return (
        loop.composition(),
        loop.substeps,
        loop.seed,
        loop.run,
        form(loop.carry()),
        tuple(phases),
        tuple(tables),
        *flight[1:],
    )


def _one_by_one(group: Sequence[Flying], numbers: Sequence[int], use: Callable[..., Any]) -> list[Callable[[], Any]]:
    def alone(flight: Flying, number: int) -> list[tuple[int, Any]]:
        return [(number, use(number, *fly(*flight)))]

    return [partial(alone, *pair) for pair in zip(group, numbers, strict=True)]


def _together(group: Sequence[Flying], numbers: Sequence[int], use: Callable[..., Any]) -> list[Callable[[], Any]]:
    loop, steps, every = group[0]
    size = len(flatten(make_step(loop.composition()).sample(loop.carry(), 0, loop.setup())))
    width = widest(len(numbers_of(loop.carry())))
    if (steps // every + 1) * size * width > MOST:
        return _one_by_one(group, numbers, use)
    phases = [flight.loop.phases(steps) for flight in group]
    # The form is that of all lanes, so one kernel flies every block.
    whole = [Numbers.of(phase) for phase in stacked(phases)]
    kernels = [make_kernel(one, loop.composition(), width, loop.carry(), values, loop.substeps) for values in whole]

    def block(first: int) -> list[tuple[int, Any]]:
        lanes = [min(first + k, len(group) - 1) for k in range(width)]
        vector = _Vector([group[lane] for lane in lanes], [phases[lane] for lane in lanes], kernels, size)
        values = [mapped(part, lambda leaf: leaf[lanes] if isinstance(leaf, np.ndarray) else leaf) for part in whole]
        flown = vector.fly([Numbers(*part) for part in values])
        return [(numbers[first + k], use(numbers[first + k], *flown(k))) for k in range(min(width, len(group) - first))]

    return [partial(block, first) for first in range(0, len(group), width)]


class _Vector:
    """A vector of lanes in flight."""

    def __init__(self, flights: Sequence[Flying], phases: Sequence[Any], kernels: Sequence[Kernel], size: int) -> None:
        self.phases, self.kernels, self.size, self.width = phases, kernels, size, len(flights)
        loop, self.steps, self.every = flights[0]
        self.seed, self.run, self.like, self.step = loop.seed, loop.run, loop.carry(), make_step(loop.composition())
        self.begun: list[Any] = [flight.loop.carry() for flight in flights]
        self.setups = [flight.loop.setup() for flight in flights]
        self.carry = aligned(len(numbers_of(self.like)), self.width)
        for lane, carry in enumerate(self.begun):
            self.carry[:, lane] = numbers_of(carry)
        self.samples = aligned((self.steps // self.every + 1) * size, self.width)
        self.samples[:] = np.nan
        self.lost_row = places(self.like).lost_at

    def fly(self, numbers: Sequence[Numbers]) -> Callable[[int], tuple[NDArray[np.float64], Any]]:
        """Fly to the end; return a function that returns the samples and the carry of a lane."""
        for place, values in enumerate(numbers):
            now = self.phases[0][place]
            for lane in range(self.width):
                if not self.carry[self.lost_row, lane] >= 0.0:
                    entered = self.phases[lane][place].entered(state_of(self.carry[:, lane], self.begun[lane]))
                    self.carry[:, lane] = numbers_of(entered)
            memories = self._memories(values)
            done = now.first
            while done < now.last:
                done += self._some(self.kernels[place], memories, done, now.last - done)
        ends = self.carry.copy()
        if self.steps % self.every == 0 and numbers:
            self._some(self.kernels[-1], self._memories(numbers[-1]), self.steps, 1)
        table = self.samples.reshape(-1, self.size, self.width)

        def of_lane(lane: int) -> tuple[NDArray[np.float64], Any]:
            carry = state_of(ends[:, lane], self.begun[lane])
            rows, lost_at = np.ascontiguousarray(table[:, :, lane]), carry.lost_at
            if lost_at == 0.0:
                rows[0] = flatten(self.step.sample(self.begun[lane], 0, self.setups[lane]))
            if lost_at >= 0.0:
                rows = rows[: max(1, int(np.ceil(lost_at / self.every)))]
            return rows.T, carry

        return of_lane

    def _memories(self, numbers: Numbers) -> dict[str, NDArray[np.float64]]:
        arguments = Arguments(*numbers)
        varying = aligned(len(arguments.varying), self.width)
        varying[:] = arguments.rows(self.width)
        memories = {"carry": self.carry, "record": self.samples, "own": varying}
        return memories | {"shared": arguments.shared, "tables": arguments.tables}

    def _some(self, kernel: Kernel, memories: Any, first: int, count: int) -> int:
        """Fly up to `count` control steps from `first` on, to the next sample or by whole groups; return their number."""
        into = first % self.every
        if into or count < self.every:
            groups, each, place = 1, min(count, self.every - into), 0 if into == 0 else -1
        else:
            groups, each, place = count // self.every, self.every, 0
        kernel(memories, first, groups, each, place, -(-first // self.every), self.seed, self.run)
        return groups * each


Array = NDArray[np.float64]


PIECES = 2
"""Pieces of a batch per thread; few, because each is called once per window."""


class Metered(NamedTuple):
    """Results of flights: the final states of the lanes (numbers, lanes), their notes (numbers, lanes), and the notes of
    windows (windows, quantities, lanes)."""

    ends: Array
    notes: Array
    windows: Array


def windows_of(
    phases: Sequence[Phase], cuts: Sequence[int], late: int
) -> Iterator[tuple[int, list[tuple[Phase, int, int]]]]:
    """Yield for each window, which ends at a cut, the index of its observer, and for each phase in it the first control
    step and the number of steps."""
    done = 0
    for cut in cuts:
        spans = ((phase, max(done, phase.first), min(cut, phase.last)) for phase in phases)
        yield int(done >= late), [(phase, first, last - first) for phase, first, last in spans if first < last]
        done = cut


class Flights(NamedTuple):
    """Lanes that fly through phases, from `carries` (numbers, lanes), see `carry_columns`, and the notes to take.

    observers: one before the control step `late` and one from it on; noted: notes before the flight (numbers, lanes); cuts:
    control steps at which windows end, including `late` unless it is 0; the last window includes the last instant, and ends
    with the flight or after it; rows: notes that restart at 0 in each window."""

    loop: ClosedLoop
    carries: Array
    phases: Sequence[Phase]
    first_run: int | NDArray[np.int64]
    observers: tuple[Observer, Observer]
    noted: Array
    cuts: Sequence[int]
    late: int
    rows: Sequence[int]


def begin_metered(pool: ThreadPool, flights: Flights) -> Callable[..., Metered]:
    """Start to fly lanes, and note also the instant after the last step, whose command has no effect. Return a function
    that waits for the end and reports progress."""
    loop, carries, phases, first_run, observers, noted, cuts, late, rows = flights
    batch = RunningBatch(loop, carries, first_run, widest(len(carries), len(noted)), observers[0], noted)
    for phase in phases:
        for observer in observers:
            batch.prepare(phase, observer)
    by_window = np.empty((len(cuts), len(rows), batch.count, batch.width))
    end, kept = phases[-1].last, list(rows)

    def work(piece: range) -> None:
        span = slice(piece.start, piece.stop)
        for window, (place, legs) in enumerate(windows_of(phases, cuts, late)):
            for phase, first, count in legs:
                batch.fly(phase, piece, first, count, observers[place])
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
