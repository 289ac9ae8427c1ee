"""Closed-loop steps a second: starhold on one lane and on many, Basilisk and SciPy.

First the same problem in every engine (see common.py): rigid body, two-body orbit, gravity gradient, feedback
recomputed and held every 0.1 s. Basilisk runs its own flight software in C, or none at all and a constant torque, which
is the least it can be asked to do; starhold flies the same constant torque through its whole loop. SciPy's solve_ivp
restarts at each control instant, with the right-hand side in NumPy. For each the state reached is compared with
starhold's: they solve one problem.

Then starhold alone, for its laws with a full inertia matrix, hysteresis and noise.

The tasks take turns, round after round, and the fastest round counts; the ratios are of one run. On one thread the
processor's time is counted, on all threads the time by the clock. A step is one control period of one spacecraft. Times
of many lanes are those of `simulate_many` less those of the same call for no steps, which stand below the table.

Run: python benchmarks/steps.py    (Basilisk is left out where `bsk` is not installed)
"""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

import common
from common import EARTH, FEEDBACK_GAINS, INERTIA, PERIOD, Spent, header, interleaved, show, verdict
from starhold.algebra.structure import flatten
from starhold.algebra.vector import ZERO
from starhold.laws.catalogue import catalogue
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.bodies.rigid_body import State
from starhold.parts.craft import make_craft
from starhold.simulation.lane import fly
from starhold.simulation.lanes import simulate_many

LANES, TOGETHER = 2048, 6000
"""Lanes of a batch and steps of each."""
ALONE, BASILISK, SCIPY = 50_000, 2000, 100
"""Steps of a timed run."""
CHECKED = 1000
REPEATS = 5
GOAL_ALONE, GOAL_MANY = 70, 700
"""How many times faster than Basilisk one lane, and many lanes on one core, are meant to be."""
FULL = make_craft([[2.0, 0.1, -0.2], [0.1, 3.0, 0.15], [-0.2, 0.15, 4.0]], torque_limit=0.01)
J = np.diag(INERTIA)


def starts(loop: ClosedLoop, lanes: int = LANES) -> Any:
    """The loop's start with other attitudes and rates, one a lane; lane 0 is the start itself."""
    random = np.random.default_rng(1)
    states = np.repeat(np.array(flatten(loop.start))[:, None], lanes, axis=1)
    attitudes = random.normal(size=(4, lanes - 1))
    states[:4, 1:] = attitudes / np.linalg.norm(attitudes, axis=0)
    states[4:7, 1:] = random.normal(scale=0.03, size=(3, lanes - 1))
    return states


def in_scipy(method: str, rtol: float, steps: int) -> State:
    """The feedback problem with solve_ivp, restarted at each control instant."""
    start = common.START
    y = np.array([*start.attitude, *start.rate, *start.position, *start.velocity])
    inverse = np.linalg.inv(J)

    def slope(t: float, y: Any, torque: Any) -> Any:
        q0, q, w, r = y[0], y[1:4], y[4:7], y[7:10]
        away = (q0 * q0 - q @ q) * r + 2.0 * (q @ r) * q - 2.0 * q0 * np.cross(q, r)
        pull = 3.0 * EARTH / np.linalg.norm(r) ** 5 * np.cross(away, J @ away)
        turn = 0.5 * (q0 * w + np.cross(q, w))
        spin = inverse @ (torque + pull - np.cross(w, J @ w))
        return np.concatenate([[-0.5 * (w @ q)], turn, spin, y[10:13], -EARTH / np.linalg.norm(r) ** 3 * r])

    for _ in range(steps):
        shown = y[:4] if y[0] >= 0.0 else -y[:4]
        torque = -FEEDBACK_GAINS.k_attitude * shown[1:] / (1.0 + shown[0]) - FEEDBACK_GAINS.k_rate * y[4:7]
        flown = solve_ivp(slope, (0.0, PERIOD), y, method, rtol=rtol, atol=1e-12, args=(torque,))
        y = flown.y[:, -1]
        y[:4] /= np.linalg.norm(y[:4])
    v = y.tolist()
    return State((v[0], v[1], v[2], v[3]), (v[4], v[5], v[6]), (v[7], v[8], v[9]), (v[10], v[11], v[12]), ZERO)


SCIPY_METHODS = {"RK45": 1e-8, "DOP853": 1e-10}
"""Relative tolerances at which the error is of the order of the other engines', or below."""


class Batch:
    """One loop on many lanes, timed by what more steps cost."""

    def __init__(self, loop: ClosedLoop, threads: int) -> None:
        self.loop, self.states, self.threads = loop, starts(loop), threads

    def tasks(self, name: str) -> dict[str, Callable[[], Any]]:
        """A run, and one of no steps."""
        return {name: lambda: self.run(TOGETHER), f"{name}, none": lambda: self.run(0)}

    def run(self, steps: int) -> Any:
        """Fly all lanes."""
        return simulate_many(self.loop, self.states, steps, threads=self.threads)


def per_core(times: dict[str, Spent], name: str) -> float:
    """Processor seconds of a step of one lane."""
    return (times[name].work - times[f"{name}, none"].work) / (TOGETHER * LANES)


def per_machine(times: dict[str, Spent], name: str) -> float:
    """Seconds of a step of one lane with all threads at work."""
    return (times[name].wall - times[f"{name}, none"].wall) / (TOGETHER * LANES)


def engines() -> None:
    """The same problem in every engine."""
    threads = os.cpu_count() or 1
    loops = {"feedback": common.FEEDBACK_LOOP, "steady": common.STEADY_LOOP}
    basilisk = importlib.util.find_spec("Basilisk") is not None
    tasks: dict[str, Callable[[], Any]] = {}
    for name, loop in loops.items():
        tasks[f"{name} alone"] = lambda loop=loop: fly(loop, ALONE, ALONE)
        tasks |= Batch(loop, 1).tasks(f"{name} core") | Batch(loop, threads).tasks(f"{name} all")
        if basilisk:
            flying = common.in_basilisk(name)
            tasks[f"{name} basilisk"] = lambda flying=flying: flying(BASILISK)
    for method, rtol in SCIPY_METHODS.items():
        tasks[method] = lambda method=method, rtol=rtol: in_scipy(method, rtol, SCIPY)
    times = interleaved(tasks, REPEATS)

    ends = {name: fly(loop, CHECKED, CHECKED)[1].state for name, loop in loops.items()}
    rows: list[list[str]] = []
    cost: dict[str, float] = {}
    for name in loops:
        one = cost[f"{name} alone"] = times[f"{name} alone"].work / ALONE
        core = cost[f"{name} core"] = per_core(times, f"{name} core")
        both = per_machine(times, f"{name} all")
        same = simulate_many(loops[name], starts(loops[name], 200), CHECKED).state(0) == ends[name]
        rows.append([f"starhold, {name}, one lane", _ns(one), "1", "reference"])
        equal = "equal, bit for bit" if same else "DIFFERENT"
        rows.append([f"starhold, {name}, {LANES} lanes, 1 thread", _ns(core), f"{core / one:.3f}", equal])
        rows.append([f"starhold, {name}, {LANES} lanes, {threads} threads", _ns(both), f"{both / one:.3f}", equal])
        if basilisk:
            slow = cost[f"{name} basilisk"] = times[f"{name} basilisk"].work / BASILISK
            rows.append([f"Basilisk, {name}", _ns(slow), f"{slow / one:.0f}", _gap(ends[name], _basilisk_end(name))])
    for method, rtol in SCIPY_METHODS.items():
        slow = times[method].work / SCIPY
        apart = _gap(fly(loops["feedback"], SCIPY, SCIPY)[1].state, in_scipy(method, rtol, SCIPY))
        rows.append([f"SciPy {method}, feedback", _ns(slow), f"{slow / cost['feedback alone']:.0f}", apart])
    print(f"Attitude and rate are compared after {CHECKED} steps, SciPy's after {SCIPY}.")
    show(["engine, problem", "ns per step", "of one lane", "end state: rad, rad/s apart"], rows)
    for name in loops if basilisk else []:
        alone, core = (cost[f"{name} basilisk"] / cost[f"{name} {way}"] for way in ("alone", "core"))
        print(f"Basilisk / starhold, {name}: one lane {alone:.0f} ({verdict(alone >= GOAL_ALONE, GOAL_ALONE)}), ", end="")
        print(f"many lanes per core {core:.0f} ({verdict(core >= GOAL_MANY, GOAL_MANY)})")
    setting_up = times["feedback core, none"].work / LANES
    worth = setting_up / cost["feedback core"]
    print(f"Setting up a batch: {setting_up * 1e6:.1f} us a lane, once: {worth:.0f} steps\n")


def _ns(seconds: float) -> str:
    return f"{seconds * 1e9:.1f}"


def _gap(one: State, other: State) -> str:
    angle, rate, _ = common.gap(one, other)
    return f"{angle:.1e}, {rate:.1e}"


def _basilisk_end(name: str) -> State:
    return common.in_basilisk(name)(CHECKED)


def variants(loop: ClosedLoop) -> dict[str, ClosedLoop]:
    """A loop plain and with what costs more."""
    return {
        "plain": loop,
        "hysteresis": replace(loop, sign_policy="hysteresis"),
        "full inertia": replace(loop, craft=FULL),
        "noise": loop.with_parts(*common.NOISE),
        "all three": replace(loop, craft=FULL, sign_policy="hysteresis").with_parts(*common.NOISE),
    }


def laws() -> None:
    """starhold's laws under the published limit, plain and with extras."""
    threads = os.cpu_count() or 1
    rows: list[list[str]] = []
    for name in ("lyapunov", "sliding", "pd"):
        law = catalogue()[name]
        plain = common.problem(law, law.examples()[0], common.PUBLISHED, torque_limit=0.01, limit="axis")
        tasks: dict[str, Callable[[], Any]] = {}
        for extra, loop in variants(plain).items():
            tasks[f"{extra} alone"] = lambda loop=loop: fly(loop, ALONE, ALONE)
            tasks |= Batch(loop, 1).tasks(f"{extra} core") | Batch(loop, threads).tasks(f"{extra} all")
        times = interleaved(tasks, REPEATS)
        first = per_core(times, "plain core")
        for extra in variants(plain):
            one, core = times[f"{extra} alone"].work / ALONE, per_core(times, f"{extra} core")
            both = per_machine(times, f"{extra} all")
            row = [f"{name}, {extra}", _ns(one), _ns(core), _ns(both), f"{one / core:.1f}", f"{core / first:.2f}"]
            rows.append([*row, f"{1e-6 / both:.0f}"])
    heads = ["law, setting", "one lane ns", "many, 1 thread ns", f"many, {threads} threads ns"]
    show([*heads, "one / many", "of plain", "million steps/s"], rows)


def main() -> None:
    """Measure and print."""
    print(header("bsk", "scipy"))
    engines()
    laws()


if __name__ == "__main__":
    main()
