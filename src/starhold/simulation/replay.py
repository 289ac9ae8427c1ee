"""Replays external readings through a loop's estimator and law."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.structure import flatten
from starhold.loop.closed_loop import ClosedLoop
from starhold.loop.kernels import Arguments, Numbers, make_kernel, make_step, numbers_of, state_of
from starhold.loop.programs import Given, replaying
from starhold.simulation.lane import Recording, label
from starhold.simulation.stepper import sensed_of


def given_like(loop: ClosedLoop) -> Given:
    """Return the row of a loop at a control instant, with the initial values."""
    carry = loop.carry()
    return Given(sensed_of(loop)[1], carry.state, carry.effectors, carry.command)


def replay(loop: ClosedLoop, given: NDArray[np.float64], first: int = 0) -> Recording:
    """Return the recording of a loop's estimates and commands, one sample per control step from `first` on, for rows
    (steps, numbers) shaped as `given_like`, whose readings are finite."""
    carry, like, step = loop.carry(), given_like(loop), make_step(loop.composition())
    samples = np.full((len(given), len(flatten(step.sample(carry, 0, loop.setup())))), np.nan)
    numbers, last = np.array(numbers_of(carry)), first + len(given)
    for phase in loop.phases(last):
        begin = max(first, phase.first)
        if begin >= phase.last:
            continue
        if begin == phase.first:
            numbers = np.array(numbers_of(phase.entered(state_of(numbers, carry))))
        every = Numbers.of(phase)
        kernel = make_kernel(replaying, loop.composition(), 1, carry, every, loop.substeps, like)
        arguments, rows = Arguments(*every), slice(begin - first, phase.last - first)
        memories = {"carry": numbers, "record": samples[rows], "given": np.ascontiguousarray(given[rows])}
        memories |= {"shared": arguments.shared, "own": arguments.shared, "tables": arguments.tables}
        kernel(memories, begin, phase.last - begin, loop.seed, loop.run)
    run = label(loop, samples.T, carry, 1)
    return replace(run, arrays=run.arrays | {"time": run["time"] + first * loop.period})
