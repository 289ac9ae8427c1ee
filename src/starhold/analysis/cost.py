"""What one call of a law costs: the states of a run are shown to the compiled law again, and timed."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.structure import flatten
from starhold.loop.closed_loop import ClosedLoop
from starhold.loop.kernels import make_replay
from starhold.models.sensor import exact, no_disturbance

CALLS = 50_000
"""Calls timed at most, as many as the published table timed."""
CHUNK = 1e-4
"""Seconds that a timed chunk should last, long beside what it takes to start one; a slow law is timed by fewer calls."""


def call_costs(loop: ClosedLoop, samples: NDArray[np.float64], calls: int = CALLS, seconds: float = 1.0) -> dict[str, float]:
    """Median and worst processor time (s) of a call, over chunks of calls that replay the samples of a flight in order.

    A call goes from the measured state to the limited torque, models the law needs included, and waits for the call
    before it, so the figures are latencies.
    """
    # The noise of the simulation is no part of a call.
    quiet = loop.parts()._replace(sense=exact, disturb=no_disturbance)
    replay, setup = make_replay(quiet), loop.setup()
    carry = loop.carry()
    end = np.empty((len(flatten(carry)), 1))
    few = min(1000, samples.shape[1])

    def timed(first: int, last: int) -> float:
        begun = time.thread_time()
        replay(samples, first, last, carry, loop.gains, loop.craft, setup, end)
        return time.thread_time() - begun

    timed(0, 1)
    overhead = float(np.median([timed(0, 0) for _ in range(50)]))
    single = max(min(timed(0, few) for _ in range(3)) - overhead, 1e-9) / few
    chunk = max(1, min(samples.shape[1], int(CHUNK / single)))
    costs: list[float] = []
    begun, first = time.thread_time(), 0
    while len(costs) * chunk < calls and time.thread_time() - begun < seconds:
        first = first if first + chunk <= samples.shape[1] else 0
        costs.append(max(timed(first, first + chunk) - overhead, 0.0) / chunk)
        first += chunk
    return {"cost_median": float(np.median(costs)), "cost_worst": float(np.max(costs))}
