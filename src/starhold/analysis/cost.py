"""The cost of a call of a law: its processor time when the compiled law is replayed on the states of a run."""

import time

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.structure import flatten
from starhold.loop.closed_loop import ClosedLoop
from starhold.loop.kernels import Arguments, Kernel, Numbers, make_kernel, numbers_of
from starhold.loop.programs import replay
from starhold.simulation.lane import Recording, recorded

CALLS = 50_000
"""Most calls timed, as many as for the published table."""
CHUNK = 1e-4
"""Intended duration of a timed chunk (s), long compared with its overhead; a slow law is timed with fewer calls."""
LONGEST = 1.0
"""The time (s) after which no further chunk is timed."""


class Replay:
    """Replays the compiled calls of a loop's law on states (number, numbers of a state): from the measured state to the
    saturated torque, including models that the law needs, each waiting for the previous one. The law's memory carries over
    from call to call."""

    def __init__(self, loop: ClosedLoop, states: NDArray[np.float64]) -> None:
        self._kernel, loop = compile_calls(loop)
        self._seed, arguments = loop.seed, Arguments(*Numbers.of(loop.phases(1)[0]))
        self._memories = {"states": np.ascontiguousarray(states), "shared": arguments.shared, "own": arguments.shared}
        self._memories |= {"tables": arguments.tables, "carry": np.array(numbers_of(loop.carry()))}

    def __call__(self, first: int, last: int) -> None:
        """Call the law on states first .. last-1."""
        self._kernel(self._memories, first, last - first, self._seed, 0)

    def timed(self, first: int, last: int) -> float:
        """Return the processor time (s) of these calls."""
        begun = time.thread_time()
        self(first, last)
        return time.thread_time() - begun


def compile_calls(loop: ClosedLoop) -> tuple[Kernel, ClosedLoop]:
    """Return the code that repeats the calls of a loop's law, and the loop reduced to the parts of a call."""
    # The simulation's noise is not part of a call, except that of readings which the call receives.
    needed = loop.estimating or getattr(loop.law.module, "WATCHES", False)
    loop = loop.without("random-torque") if needed else loop.without("random-torque", "sensor")
    return make_kernel(replay, loop.composition(), 1, loop.carry(), Numbers.of(loop.phases(1)[0]), passes=True), loop


def recorded_states(loop: ClosedLoop, recording: Recording) -> NDArray[np.float64]:
    """Return the loop's states (number, numbers of a state) at the samples of its recording, at most the first CALLS."""
    carry = loop.carry()
    columns = [recording[name][:CALLS] for name in type(carry.state)._fields]
    others = {name for name, _, _ in recorded(loop)} - {*type(carry.state)._fields}
    for state in carry.effectors:
        named = zip(state._fields, state, strict=True) if hasattr(state, "_fields") else [(None, state)]
        for name, value in named:
            matches = [run for key, run in recording.arrays.items() if name and key.endswith(name) and key in others]
            # A quantity that is not recorded, or has no name, keeps its initial value.
            start = np.tile(flatten((value,)), (len(columns[0]), 1))
            columns.append(np.reshape(matches[0][:CALLS], start.shape) if matches else start)
    return np.hstack(columns)


def call_costs(loop: ClosedLoop, states: NDArray[np.float64], calls: int = CALLS) -> dict[str, float]:
    """Return median and worst processor time (s) of a call, over chunks of calls that replay the states of a flight in
    order.

    The figures are latencies, see `Replay`."""
    repeat = Replay(loop, states)
    few = min(1000, len(states))
    repeat.timed(0, 1)
    overhead = _median([repeat.timed(0, 0) for _ in range(50)])
    single = max(min(repeat.timed(0, few) for _ in range(3)) - overhead, 1e-9) / few
    chunk = max(1, min(len(states), int(CHUNK / single)))
    costs: list[float] = []
    begun, first = time.thread_time(), 0
    while len(costs) * chunk < calls and time.thread_time() - begun < LONGEST:
        first = first if first + chunk <= len(states) else 0
        costs.append(max(repeat.timed(first, first + chunk) - overhead, 0.0) / chunk)
        first += chunk
    return {"cost_median": _median(costs), "cost_worst": max(costs)}


def _median(values: list[float]) -> float:
    # NumPy's loads its masked arrays first.
    ordered, half = sorted(values), len(values) // 2
    return 0.5 * (ordered[half] + ordered[~half])
