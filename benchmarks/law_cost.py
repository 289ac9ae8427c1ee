"""What one call of each law costs, beside the published table of 50 000 calls and beside plain NumPy.

The published experiment is flown once with each law. Then the states of that flight are shown to the law again, in
order and over and over, 50 000 times. Timed is everything from the measured state to the limited torque: the attitude
error, the gravity-gradient model where the law uses it, the double cover, the law and the torque limit; each call waits
for the torque of the one before, so these are latencies.

Total and mean are those of one replay of 50 000 calls (of cheap laws the fastest of several). Median and worst come
from `starhold.analysis.cost.call_costs`, which times a dear law call by call and a cheap one in chunks of some
microseconds; shown are the median of its medians over the rounds and the worst of all, which holds what the machine did
meanwhile. The predictive law solves harder problems at the start of a flight, so its mean lies far above its median.

The NumPy versions do the same work as a user would write it. They are checked against the compiled torque.

Run: python benchmarks/law_cost.py
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from common import EARTH, INERTIA, header, interleaved, show
from starhold.analysis.cost import CALLS, Replay, call_costs
from starhold.laws.catalogue import catalogue
from starhold.loop.closed_loop import ClosedLoop
from starhold.scenario.building import build
from starhold.scenario.reading import load
from starhold.simulation.lane import fly

PUBLISHED = {"lyapunov": 0.181, "sliding": 0.061, "mpc": 1184.0}
"""Seconds for 50 000 calls. The means printed with them are ten times larger than these totals allow."""
ROUNDS = 7
STATE, COMMAND, STATES = slice(0, 13), slice(16, 19), 16
"""Rows of a sample: attitude, rate and position with velocity; command."""
LIMIT = 0.01
J = np.diag(INERTIA)


def numpy_lyapunov(q: Any, w: Any, r: Any) -> Any:
    """The Lyapunov law with its gravity-gradient model."""
    away = (q[0] ** 2 - q[1:] @ q[1:]) * r + 2.0 * (q[1:] @ r) * q[1:] - 2.0 * q[0] * np.cross(q[1:], r)
    external = 3.0 * EARTH / np.linalg.norm(away) ** 5 * np.cross(away, J @ away)
    return np.clip(-0.09 * w - 0.009 * q[1:] + np.cross(w, J @ w) - external, -LIMIT, LIMIT)


def numpy_sliding(q: Any, w: Any, r: Any) -> Any:
    """The sliding-mode law, which needs no model of the external torque."""
    turning = 0.5 * (q[0] * w + np.cross(q[1:], w))
    equivalent = np.cross(w, J @ w) - J @ (0.08 * turning)
    return np.clip(equivalent - 5e-3 * np.sign(w + 0.08 * q[1:]), -LIMIT, LIMIT)


BY_HAND: dict[str, Callable[[Any, Any, Any], Any]] = {"lyapunov": numpy_lyapunov, "sliding": numpy_sliding}


def loops() -> dict[str, ClosedLoop]:
    """The published experiment under every law; the first example gains are the published ones where there are any."""
    scenario = load("three-laws")
    base = build(scenario, scenario.laws[0])
    found = {name: replace(base, law=law, gains=law.examples()[0]) for name, law in catalogue().items()}
    return found | {entry.name: build(scenario, entry) for entry in scenario.laws}


def whole(loop: ClosedLoop, samples: Any, calls: int = CALLS) -> Callable[[], Any]:
    """A replay of that many calls. With none it costs what entering compiled code does."""
    states = np.tile(states_in(samples), (-(-CALLS // samples.shape[1]), 1))[:CALLS]
    kernel = Replay(loop, states)
    return lambda: kernel(0, calls)


def states_in(samples: Any) -> Any:
    """The states of a flight, with which its samples begin."""
    return samples[:STATES].T


def by_hand(law: Callable[[Any, Any, Any], Any], samples: Any) -> Callable[[], Any]:
    """A NumPy law called for every state of the flight."""
    states = [(column[:4], column[4:7], column[7:10]) for column in samples[STATE].T.copy()]
    return lambda: [law(*state) for state in states]


def main() -> None:
    """Fly, time and print."""
    print(header())
    steps = load("three-laws").table.simulation.steps
    flown = {name: (loop, fly(loop, steps)[0]) for name, loop in loops().items()}
    for name, law in BY_HAND.items():
        samples = flown[name][1]
        worst = float(np.abs(np.array(by_hand(law, samples)()).T - samples[COMMAND]).max())
        print(f"{name}: NumPy and compiled torque differ by at most {worst:.1e} N m over {samples.shape[1]} states")
        assert worst < 1e-12
    print()

    cheap = {name: whole(*pair) for name, pair in flown.items() if name != "mpc"}
    hand = {f"{name} in NumPy": by_hand(law, flown[name][1]) for name, law in BY_HAND.items()}
    entered = {f"{name}, none": whole(*flown[name], calls=0) for name in cheap}
    times = interleaved(cheap | entered | hand, ROUNDS)
    totals = {name: times[name].work for name in hand}
    totals |= {name: times[name].work - times[f"{name}, none"].work for name in cheap}
    for name, (loop, samples) in flown.items():
        if name not in totals:
            # Compiled before the clock starts.
            whole(loop, samples, calls=1)()
            begun = time.process_time()
            whole(loop, samples)()
            totals[name] = time.process_time() - begun
    costs: dict[str, list[dict[str, float]]] = {name: [] for name in flown}
    for _ in range(ROUNDS):
        for name, (loop, samples) in flown.items():
            costs[name].append(call_costs(loop, states_in(samples)))

    rows: list[list[str]] = []
    for name, (_, samples) in flown.items():
        median = np.median([cost["cost_median"] for cost in costs[name]])
        worst = max(cost["cost_worst"] for cost in costs[name])
        printed = PUBLISHED.get(name)
        mean = totals[name] / CALLS
        cells = [name, f"{totals[name]:.3g}", f"{mean * 1e9:.1f}", f"{median * 1e9:.1f}", f"{worst * 1e9:.0f}"]
        cells += ["", "", ""] if printed is None else _against(printed, totals[name])
        slow = totals.get(f"{name} in NumPy")
        slow = None if slow is None else slow / samples.shape[1]
        cells += ["", ""] if slow is None else [f"{slow * 1e9:.0f}", f"{slow / mean:.0f}"]
        rows.append(cells)
    heads = ["law", "total s", "mean ns", "median ns", "worst ns"]
    heads += ["paper total s", "paper mean ns", "paper/ours", "NumPy mean ns", "NumPy/ours"]
    print(f"{CALLS} calls, {ROUNDS} rounds")
    show(heads, rows)
    ratio = totals["mpc"] / totals["lyapunov"]
    print(f"mpc against lyapunov: {ratio:.0f} here, {PUBLISHED['mpc'] / PUBLISHED['lyapunov']:.0f} in the paper")
    print(f"sliding against lyapunov: {totals['sliding'] / totals['lyapunov']:.2f} here, 0.34 in the paper")
    print("The paper's machine and language are unknown: its column dates the comparison, it does not rank machines.")


def _against(printed: float, total: float) -> list[str]:
    return [f"{printed:g}", f"{printed / CALLS * 1e9:.0f}", f"{printed / total:.0f}"]


if __name__ == "__main__":
    main()
