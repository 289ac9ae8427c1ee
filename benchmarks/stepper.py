"""A step of a loop that Python asks for one by one: starhold's stepper beside Basilisk, on the problem of common.py.

Both are asked for one control period under a constant torque; with `state` the true state is read after each. A step of
starhold's gives the readings too, and one with `measurement` has them as the law's. The processor's time is counted,
the fastest of several rounds; the ratios are of one run.

Run: python benchmarks/stepper.py    (Basilisk is left out where `bsk` is not installed)
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from typing import Any

import starhold as sh
from common import STEADY_LOOP, STEADY_TORQUE, header, in_basilisk, interleaved, show
from starhold.simulation.stepper import Stepper

STEPS = 2_000
GOAL = 10.0
"""Microseconds that a step may take."""


def main() -> None:
    """Print the table."""
    print(header("bsk"))
    single, mission = Stepper(STEADY_LOOP, record=False), sh.stepper("cubesat-mission", record=False)
    lanes = Stepper(STEADY_LOOP, lanes=1024, record=False)
    tasks: dict[str, tuple[int, Callable[[], Any]]] = {
        "starhold, its own law": (STEPS, lambda: [single.step() for _ in range(STEPS)]),
        "starhold, a command": (STEPS, lambda: [single.step(STEADY_TORQUE) for _ in range(STEPS)]),
        "starhold, a command, state": (STEPS, lambda: [(single.step(STEADY_TORQUE), single.state) for _ in range(STEPS)]),
        "starhold, a command, measurement": (STEPS, lambda: [single.step(STEADY_TORQUE).measurement for _ in range(STEPS)]),
        "starhold, cubesat-mission": (STEPS, lambda: [mission.step() for _ in range(STEPS)]),
        "starhold, 1024 lanes, a lane": (1024 * 100, lambda: [lanes.step() for _ in range(100)]),
    }
    if importlib.util.find_spec("Basilisk"):
        fly = in_basilisk("steady")
        tasks["Basilisk, a constant torque, state"] = (STEPS, lambda: [fly(1) for _ in range(STEPS)])
    spent = interleaved({name: task for name, (_, task) in tasks.items()})
    micro = {name: 1e6 * spent[name].work / count for name, (count, _) in tasks.items()}
    peer = micro.get("Basilisk, a constant torque, state")
    rows = [[name, f"{x:.2f}", "" if peer is None else f"{peer / x:.1f}"] for name, x in micro.items()]
    show(["a step asked for from Python", "us", "x Basilisk"], rows)
    least = micro["starhold, a command"]
    print(f"{'meets' if least <= GOAL else 'MISSES'} the goal of {GOAL:g} us a step: {least:.2f}")


if __name__ == "__main__":
    main()
