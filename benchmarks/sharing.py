"""What sharing is worth: the same flights, with what all lanes share computed once, and computed in every lane.

Starts differ in attitude and rate; orbit, epoch and craft are those of the file. Both must end with the same bits.

Run: python benchmarks/sharing.py
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

import steps
from common import header, interleaved, show
from starhold.loop.closed_loop import ClosedLoop
from starhold.loop.kernels import Arguments, Numbers, make_kernel
from starhold.loop.programs import many
from starhold.scenario.building import build
from starhold.scenario.reading import load
from starhold.simulation.lanes import RunningBatch, carry_columns
from starhold.trace.machine import widest

PROBLEMS = {"three-laws": ("lyapunov", 3000), "cubesat-nadir": ("lyapunov", 300)}
"""Built-in scenarios, the law, and control steps of a timed flight."""
LANES, REPEATS = 512, 15


def batch_of(loop: ClosedLoop, noted: int) -> RunningBatch:
    """Lanes that start apart, as wide as those of which so many numbers are noted."""
    carries = carry_columns(loop, steps.starts(loop, LANES))
    return RunningBatch(loop, carries, 0, widest(len(carries), noted))


def together(loop: ClosedLoop, batch: RunningBatch, count: int) -> Callable[[], Any]:
    """A flight with what lanes share computed once."""
    (phase,) = loop.phases(count)
    batch.prepare(phase)
    return lambda: batch.fly(phase, range(batch.count))


def apart(loop: ClosedLoop, batch: RunningBatch, count: int) -> Callable[[], Any]:
    """The flight in which each lane computes everything itself."""
    numbers = Numbers.of(loop.phases(count)[0])
    kernel = make_kernel(many, loop.composition(), batch.width, loop.carry(), numbers, loop.substeps, None)
    arguments, nothing = Arguments(*numbers, ()), np.empty(0)
    memories = {"carry": batch.x, "common": nothing, "noted": batch.noted, "own": nothing}
    memories |= {"shared": arguments.shared, "tables": arguments.tables}
    return lambda: kernel(memories, 0, count, batch.count, batch.width, loop.seed, 0)


def main() -> None:
    """Measure and print."""
    print(header())
    rows: list[list[str]] = []
    for name, (law, count) in PROBLEMS.items():
        scenario = load(name)
        loop = replace(build(scenario, scenario.pick(law)), events=())
        for noted in (0, 1):
            batches = batch_of(loop, noted), batch_of(loop, noted)
            tasks = {"apart": apart(loop, batches[0], count), "together": together(loop, batches[1], count)}
            times = {key: 1e9 * spent.work / (count * LANES) for key, spent in interleaved(tasks, REPEATS).items()}
            if not np.array_equal(batches[0].carries(), batches[1].carries(), equal_nan=True):
                raise SystemExit(f"{name}: sharing changes bits")
            ratio = times["apart"] / times["together"]
            label = f"{name}, {batches[0].width} at once"
            rows.append([label, f"{times['apart']:.1f}", f"{times['together']:.1f}", f"{ratio:.2f}"])
    show(["scenario, lanes on one core", "ns a step, each lane apart", "shared", "times as fast"], rows)


if __name__ == "__main__":
    main()
