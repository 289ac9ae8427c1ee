"""Flies lanes on a GPU, metrics included: only numbers before and after a flight are copied."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.structure import places
from starhold.loop.closed_loop import ClosedLoop, Phase
from starhold.loop.kernels import Arguments, Numbers, Observer, make_program
from starhold.loop.programs import CHUNK, many
from starhold.simulation.batched import Flights, Metered, windows_of
from starhold.simulation.lanes import ThreadPool, numbered
from starhold.trace.device import Device, Rows

Array = NDArray[np.float64]
Pool: TypeAlias = ThreadPool | Device
"""A pool that flies blocks of runs: threads of this process, or a GPU."""


class DeviceBatch:
    """Lanes in flight on a GPU: the carry of each, and the observers' notes on it. Arguments as for `RunningBatch`."""

    def __init__(
        self, device: Device, loop: ClosedLoop, carries: Array, first_run: int | NDArray[np.int64], noted: Array
    ) -> None:
        self.device, self.loop, self.lanes = device, loop, carries.shape[1]
        self.first_run, self.runs = numbered(first_run)
        self.carry, self.noted = device.rows(carries), device.rows(noted)
        self._ready: dict[tuple[int, int], Any] = {}

    def fly(self, phase: Phase, first: int, count: int, observer: Observer) -> None:
        """Start to fly `count` control steps of a phase from `first` on."""
        program, memories = self._prepared(phase, observer)
        if phase.jumps and first == phase.first:
            rows = [*places(self.loop.carry()).state.rate]
            turned = phase.rate_from(tuple(self.carry.read()[rows]))  # pyright: ignore
            for row, rates in zip(rows, turned, strict=True):
                self.carry.fill(np.array([rates]), row)
        for step in range(first, first + count, CHUNK):
            counts = (step, min(CHUNK, first + count - step), 1, self.lanes, self.loop.seed, self.first_run)
            self.device.begin(program, memories, counts, self.lanes)

    def _prepared(self, phase: Phase, observer: Observer) -> tuple[Any, dict[str, Rows]]:
        key = (id(phase), id(observer))
        if key not in self._ready:
            loop, numbers = self.loop, Numbers.of(phase)
            arguments = Arguments(*numbers, observer.numbers, self.runs)
            program = make_program(many, loop.composition(), loop.carry(), numbers, loop.substeps, observer, self.runs, ())
            given = {"shared": arguments.shared, "tables": arguments.tables, "common": np.empty(0)}
            memories = {name: self.device.rows(values.reshape(-1, 1)) for name, values in given.items()}
            memories |= {"carry": self.carry, "noted": self.noted, "own": self.device.rows(arguments.rows(self.lanes))}
            # The objects in the key are kept alive, so that no others get their ids.
            self._ready[key] = (phase, observer), program, memories
        return self._ready[key][1:]


def begin_on_device(device: Device, flights: Flights) -> Callable[..., Metered]:
    """Start to fly lanes on a GPU; the results have the same bits as those of `begin_metered`."""
    loop, carries, phases, first_run, observers, noted, cuts, late, rows = flights
    batch = DeviceBatch(device, loop, carries, first_run, noted)
    lanes, size = batch.lanes, 8 * batch.lanes
    by_window = Rows(device, len(cuts) * len(rows), lanes)
    ends = Rows(device, *carries.shape)
    for window, (place, legs) in enumerate(windows_of(phases, cuts, late)):
        for phase, first, count in legs:
            batch.fly(phase, first, count, observers[place])
        if window == len(cuts) - 1:
            # The command of the last instant is noted but has no effect.
            device.call("cuMemcpyDtoD", ends.address, batch.carry.address, ends.size)
            batch.fly(phases[-1], phases[-1].last, 1, observers[1])
        for k, row in enumerate(rows):
            device.call("cuMemcpyDtoD", by_window.row(window * len(rows) + k), batch.noted.row(row), size)
            device.call("cuMemsetD32", batch.noted.row(row), 0, 2 * lanes)

    def finish(progress: Any = None) -> Metered:
        flown = Metered(ends.read(), batch.noted.read(), by_window.read().reshape(len(cuts), len(rows), lanes))
        if progress is not None:
            progress(1, 1)
        return flown

    return finish
