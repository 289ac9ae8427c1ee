"""The built-in scenario cubesat-nadir beside Basilisk with the same models: one trajectory, and many on one core.

First the models alone, under Basilisk's own feedback on the true state: both fly the same equations, and the script stops
where they do not end in the same state. Then everything at once: starhold with gyro, star tracker, Kalman filter and noise;
Basilisk with its own sensors and their noise, but without a filter, for it has none of that kind, so that it does less.
Step, integrator and what is held for a control period are the same; the wheel that is lost costs nothing and is left out.

Last, what a step of starhold is made of: the operations by which it grows with each part.

Run: python benchmarks/cubesat.py
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

import peak
import steps
from basilisk_cubesat import in_basilisk
from basilisk_software import POINTING, as_in_basilisk, under, without
from common import gap, header, interleaved, show, verdict
from starhold.laws.pd import Gains
from starhold.loop.closed_loop import ClosedLoop
from starhold.scenario.building import build
from starhold.scenario.reading import load
from starhold.simulation.lane import fly
from starhold.simulation.lanes import RunningBatch, carry_columns
from starhold.trace.machine import widest

GOALS = {"models": (50, 343), "everything": (40, 343)}
"""How many times as fast as Basilisk one lane, and many lanes with one orbit on one core, are meant to be. Before lanes
shared their step this script gave 34 and 184 (models), 27 and 141 (everything): half as fast again, and 2.5 times 137.
Then the lanes' times were differences that counted making a batch ready too, which is 3 to 4 ns of a step of a lane here."""
LANES, TOGETHER, ALONE, BASILISK = 2048, 300, 20_000, 1000
"""Lanes of a batch and its steps; steps of the timed runs of one lane and of Basilisk."""
CHECKED, ATTITUDE = 1200, 1e-7
"""Steps after which the end states are compared, and how far apart they may be (rad)."""
REPEATS = 9
FILTERED = ("gyro", "star-tracker", "mekf")


def main() -> None:
    """Measure and print."""
    print(header("bsk"))
    scenario = load("cubesat-nadir")
    whole = replace(build(scenario, scenario.pick("lyapunov")), events=())
    # Basilisk's feedback on Rodrigues parameters with the same stiffness near the target.
    gains = Gains(whole.gains.k_rate, 2.0 * whole.gains.k_attitude)
    everything = under(whole, POINTING, gains)
    models = as_in_basilisk(without(everything, *FILTERED))
    check(models)
    problems = {"models": (models, models), "everything": (everything, without(everything, "estimator"))}
    tasks: dict[str, Callable[[], Any]] = {}
    for name, (ours, theirs) in problems.items():
        vehicle = in_basilisk(theirs, gains)
        tasks[f"{name} alone"] = lambda loop=ours: fly(loop, ALONE, ALONE)
        tasks[f"{name} many"] = together(ours)
        tasks[f"{name} Basilisk"] = lambda fly=vehicle.fly: fly(BASILISK)
    times = {name: spent.work for name, spent in interleaved(tasks, REPEATS).items()}
    rows: list[list[str]] = []
    for name in problems:
        theirs = times[f"{name} Basilisk"] / BASILISK
        alone = times[f"{name} alone"] / ALONE
        many = times[f"{name} many"] / (TOGETHER * LANES)
        rows += [
            [f"{name}: Basilisk", f"{theirs * 1e9:.0f}", "1", ""],
            [f"{name}: starhold, one lane", f"{alone * 1e9:.0f}", *judged(theirs / alone, GOALS[name][0])],
            [f"{name}: starhold, {LANES} lanes, one core", f"{many * 1e9:.0f}", *judged(theirs / many, GOALS[name][1])],
        ]
    show(["cubesat-nadir", "ns per step", "times as fast", "goal"], rows)
    show(["a step of starhold", "operations", "of all"], list(operations(everything)))


def together(loop: ClosedLoop) -> Callable[[], None]:
    """A flight of many lanes on one core, each time from where they are; made ready before, for that takes longer."""
    carries = carry_columns(loop, steps.starts(loop, LANES))
    batch, (phase,) = RunningBatch(loop, carries, 0, widest(len(carries))), loop.phases(TOGETHER)
    batch.prepare(phase)
    return lambda: batch.fly(phase, range(batch.count))


def check(loop: ClosedLoop) -> None:
    """Fly the models in both and compare where they end."""
    reached = fly(loop, CHECKED, CHECKED)[1]
    vehicle = in_basilisk(loop, loop.gains)
    vehicle.fly(CHECKED)
    attitude, rate, _ = gap(reached.state, vehicle.state())
    momentum = float(np.abs(np.array(reached.effectors[0].momentum) - vehicle.momenta()).max())
    print(f"After {CHECKED} steps the models are {attitude:.1e} rad, {rate:.1e} rad/s and {momentum:.1e} N m s apart.")
    if not attitude < ATTITUDE:
        raise SystemExit("starhold and Basilisk fly different motions: there is nothing to compare")


def judged(ratio: float, goal: int) -> list[str]:
    """The ratio, and whether it is what it is meant to be."""
    return [f"{ratio:.0f}", verdict(ratio >= goal, goal, wide=True)]


def operations(loop: ClosedLoop) -> list[list[str]]:
    """Additions, multiplications, divisions and roots of a step, those of them that many lanes share, and what it would have
    less without each part."""

    def counted(loop: ClosedLoop) -> int:
        return sum(part.arithmetic for part in peak.operations(loop))

    total, shared = counted(loop), peak.operations(loop)[0].arithmetic
    removed = {
        "the Kalman filter": ("mekf",),
        "star tracker and filter": ("star-tracker", "mekf"),
        "magnetometer and unloading": ("magnetometer", "magnetic-unloading"),
        "residual dipole": ("residual-dipole",),
        "solar pressure": ("solar-pressure",),
        "drag": ("drag",),
        "gravity gradient": ("gravity-gradient",),
        "oblateness": ("oblateness",),
    }
    rows = [["all", str(total), "1.00"], ["computed once for all lanes", str(shared), f"{shared / total:.2f}"]]
    for name, parts in removed.items():
        spared = total - counted(without(loop, *parts))
        rows.append([name, str(spared), f"{spared / total:.2f}"])
    return rows


if __name__ == "__main__":
    main()
