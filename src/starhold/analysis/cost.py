"""What one call of a law costs: the states of a run are shown to the compiled law again, and timed."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.loop.closed_loop import ClosedLoop
from starhold.loop.kernels import make_replay

CALLS = 50_000
"""Calls timed at most, as many as the published table timed."""
CHUNK = 2e-5
"""Seconds that a timed chunk should last; a slow law is timed call by call."""


def call_costs(loop: ClosedLoop, samples: NDArray[np.float64], calls: int = CALLS, seconds: float = 1.0) -> dict[str, float]:
    """Median and worst time (s) of a call, over chunks of calls that replay the samples of `simulate.fly` in order.

    Each call waits for the one before it, so the figures are latencies. The worst holds what the machine did meanwhile.
    """
    watch = make_replay(loop.parts())
    seen = watch.see(samples, loop.carry(), loop.craft, loop.setup())
    memory = loop.carry().memory
    args = (loop.gains, loop.craft, memory)
    watch.call(seen, 0, 1, *args)
    overhead = min(_timed(watch.call, seen, 0, 0, args) for _ in range(50))
    single = max(_timed(watch.call, seen, 0, 20, args) - overhead, 1e-9) / 20
    chunk = max(1, min(seen.shape[1], int(CHUNK / single)))
    costs: list[float] = []
    begun, first = time.perf_counter(), 0
    while len(costs) * chunk < calls and time.perf_counter() - begun < seconds:
        first = first if first + chunk <= seen.shape[1] else 0
        costs.append(max(_timed(watch.call, seen, first, first + chunk, args) - overhead, 0.0) / chunk)
        first += chunk
    return {"cost_median": float(np.median(costs)), "cost_worst": float(np.max(costs))}


def _timed(call: Any, seen: Any, first: int, last: int, args: Any) -> float:
    begun = time.perf_counter()
    call(seen, first, last, *args)
    return time.perf_counter() - begun
