"""What it is worth that kernels compute once what all lanes share: the same flights with sharing, and without it.

Without it every number of the trace counts as one that differs between lanes, as if a campaign drew over all of them. Starts
differ in attitude and rate; orbit, epoch and craft are those of the file. Both must end with the same bits.

Run: python benchmarks/sharing.py
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

import steps
from common import header, interleaved, show
from starhold.algebra.operations import INDEX
from starhold.loop import kernels
from starhold.loop.closed_loop import ClosedLoop
from starhold.scenario.building import build
from starhold.scenario.reading import load
from starhold.simulation.lanes import RunningBatch, carry_columns
from starhold.trace import llvm
from starhold.trace.machine import widest
from starhold.trace.program import Function, Loop, Op, Program, Value, statements
from starhold.trace.sharing import differing

PROBLEMS = {"three-laws": ("lyapunov", 3000), "cubesat-nadir": ("lyapunov", 300)}
"""Built-in scenarios, the law, and control steps of a timed flight."""
LANES, REPEATS = 512, 15


def everything(program: Program, function: Function) -> set[Value]:
    """Return the names of all values but those that are read or counted for all lanes."""
    names = differing(program, function)
    for s in statements(function.body):
        if isinstance(s, Op) and INDEX not in s.operation.takes:
            names.add(s.ref)
        elif isinstance(s, Loop):
            names.update(name for slot in s.slots for name in (slot.name, slot.end))
    return names


def flown(loop: ClosedLoop, share: bool) -> tuple[RunningBatch, Any]:
    """Lanes with a compiled kernel, and the phase that it flies."""
    phase = loop.phases(1)[0]
    carries = carry_columns(loop, steps.starts(loop, LANES))
    batch = RunningBatch(loop, carries, 0, widest(len(carries)))
    if not share:
        batch.alike = ()
    kernels._KERNELS.clear()
    llvm.differing = differing if share else everything
    batch.prepare(phase)[1].ready
    return batch, phase


def main() -> None:
    """Measure and print."""
    print(header())
    rows: list[list[str]] = []
    for name, (law, count) in PROBLEMS.items():
        scenario = load(name)
        loop = replace(build(scenario, scenario.pick(law)), events=())
        batches = {share: flown(loop, share) for share in (False, True)}
        tasks: dict[str, Callable[[], Any]] = {
            str(share): lambda batch=batch, phase=phase: batch.fly(phase, range(batch.count), 0, count)
            for share, (batch, phase) in batches.items()
        }
        times = {key: spent.work / (count * LANES) for key, spent in interleaved(tasks, REPEATS).items()}
        ends = [batch.carries() for batch, _ in batches.values()]
        if not np.array_equal(*ends, equal_nan=True):
            raise SystemExit(f"{name}: sharing changes bits")
        before, after = times["False"], times["True"]
        rows.append([name, f"{before * 1e9:.1f}", f"{after * 1e9:.1f}", f"{before / after:.2f}"])
    show(["scenario, lanes on one core", "ns a step, nothing shared", "shared", "times as fast"], rows)


if __name__ == "__main__":
    main()
