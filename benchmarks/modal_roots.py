"""The search for the modal roots that turn fastest within limits, against SciPy.

    python benchmarks/modal_roots.py

Ours is the built-in problem `landing-limits`: 35 angles, 3000 roots each, with the torque held for 10 ms. SciPy integrates
the closed loop in continuous time, with no more steps than accuracy asks for: Dormand and Prince's method, the loosest
relative tolerance that tells the transient time to 0.01 s, and steps so short that no peak slips through. It ends a
transient at the first limit exceeded and at the best time so far, and tries every thirtieth root at three of the angles:
what a transient costs on average is the same. Around our best roots it tries every root, and has to find the same ones, but
for what the held torque changes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from common import header, interleaved, show, verdict
from starhold.analysis.roots import Found, search
from starhold.analysis.transient import Limits
from starhold.scenario.reading import load
from starhold.studies.modal_roots import pick_modal, problem_of

SCENARIO = load("landing-limits")
TABLE: Any = SCENARIO.table.transient
LIMITS = Limits(TABLE.rate_limit, TABLE.acceleration_limit)
ANGLES = (math.radians(10.0), math.radians(90.0), math.radians(180.0))
SPARSE = 30
"""SciPy tries every so many roots."""
NEAR = 0.01
"""Around the best root it tries every root (1/s)."""
TOLERANCE = 1e-4
LONGEST = 0.2
"""SciPy's longest step (s): in longer ones peaks beyond a limit slip through between two looks at the events."""
SAME = 5e-3
"""What the held torque may change the root and the time by, relative to them."""
GOAL = 10.0
"""Seconds for the whole search."""


def slope(a: float, b: float) -> Callable[[float, Any], list[float]]:
    """The closed loop, whatever the inertia: the rates of (q0, q, w)."""
    k_turn, k_side = 2.0 * a * (1.0 - 2.0 * a * b), 0.5 * (1.0 - 8.0 * a * b)

    def rates(t: float, x: Any) -> list[float]:
        # Plain numbers, for arrays of three cost SciPy several times as much.
        q0, q1, q2, q3, w1, w2, w3 = x.tolist()
        along = q1 * w1 + q2 * w2 + q3 * w3
        share = 1.0 / (1.0 + q1 * q1 + q2 * q2 + q3 * q3)
        k = (k_turn * (q0 - 1.0) + k_side * along + b * q0 * (w1 * w1 + w2 * w2 + w3 * w3)) * share
        c1, c2, c3 = q2 * w3 - q3 * w2, q3 * w1 - q1 * w3, q1 * w2 - q2 * w1
        straight = 2.0 * a * a
        return [
            -0.5 * along,
            0.5 * (q0 * w1 + c1),
            0.5 * (q0 * w2 + c2),
            0.5 * (q0 * w3 + c3),
            2.0 * a * w1 - straight * q1 + k * (w1 - c1 + along * q1),
            2.0 * a * w2 - straight * q2 + k * (w2 - c2 + along * q2),
            2.0 * a * w3 - straight * q3 + k * (w3 - c3 + along * q3),
        ]

    return rates


def transient(angle: float, a: float, longest: float, tolerance: float = TOLERANCE) -> float:
    """How long one takes (s); infinite beyond a limit or beyond `longest`."""
    rates = slope(a, -0.01)
    size = math.hypot(*TABLE.axis)
    begun = [math.cos(0.5 * angle), *(math.sin(0.5 * angle) * x / size for x in TABLE.axis), *TABLE.start_rate]
    sine, slow = math.sin(0.5 * TABLE.angle_end), TABLE.rate_end

    def turned(t: float, x: Any) -> float:
        return x[1] * x[1] + x[2] * x[2] + x[3] * x[3] - sine * sine

    def turning(t: float, x: Any) -> float:
        return x[4] * x[4] + x[5] * x[5] + x[6] * x[6] - slow * slow

    def too_fast(t: float, x: Any) -> float:
        return x[4] * x[4] + x[5] * x[5] + x[6] * x[6] - LIMITS.rate**2

    def too_sharp(t: float, x: Any) -> float:
        return max(map(abs, rates(t, x)[4:])) - LIMITS.acceleration

    events: list[Any] = [turned, turning, too_fast, too_sharp]
    for event in events[2:]:
        event.terminal = True
    first = np.array(begun)
    if max(too_fast(0.0, first), too_sharp(0.0, first)) > 0.0:
        return math.inf
    run = solve_ivp(rates, (0.0, longest), first, rtol=tolerance, atol=1e-2 * tolerance, events=events, max_step=LONGEST)
    last = run.y[:, -1]
    if run.status == 1 or max(turned(0.0, last), turning(0.0, last)) > 0.0:
        return math.inf
    return max(float(times[-1]) if len(times) else 0.0 for times in run.t_events[:2])


def by_scipy(angle: float, roots: Sequence[float]) -> tuple[float, float]:
    """The best of some roots, increasing, and its time (s)."""
    best, least = math.nan, SCENARIO.table.simulation.duration
    for a in roots:
        time = transient(angle, a, least)
        if time < least:
            best, least = a, time
    return best, least


def check(found: Sequence[Found]) -> None:
    """Print both searches around our best roots; AssertionError where they differ."""
    rows: list[list[str]] = []
    for item in found:
        assert item.hard is not None
        ours, time = item.hard.root, item.hard.time
        root, theirs = by_scipy(item.angle, [a for a in TABLE.roots if abs(a - ours) < NEAR])
        # Of a root that keeps clear of the limits.
        loose, exact = (transient(item.angle, ours + NEAR, 2.0 * time, tolerance) for tolerance in (TOLERANCE, 1e-10))
        assert abs(loose - exact) < 0.01, "the tolerance is too loose"
        assert abs(root - ours) <= SAME * abs(ours), "the roots differ"
        assert abs(theirs - time) <= SAME * time, "the times differ"
        rows.append([f"{math.degrees(item.angle):.0f}", f"{ours:.3f}", f"{root:.3f}", f"{time:.3f}", f"{theirs:.3f}"])
    show(["angle, deg", "root, 1/s", "SciPy's", "time, s", "SciPy's"], rows)


def main() -> None:
    """Measure and print."""
    print(header("scipy"))
    problem = problem_of(SCENARIO, pick_modal(SCENARIO, None))

    def ours(angles: Sequence[float], threads: int | None) -> list[Found]:
        return search(problem, angles, TABLE.roots, LIMITS, LIMITS, threads=threads)

    check(ours(ANGLES, None))
    sparse = TABLE.roots[::SPARSE]
    tasks: dict[str, Callable[[], Any]] = {
        "all angles, all threads": lambda: ours(TABLE.angles, None),
        "three angles, one thread": lambda: ours(ANGLES, 1),
        "three angles, SciPy": lambda: [by_scipy(angle, sparse) for angle in ANGLES],
    }
    times = interleaved(tasks, 3)
    counts = [len(TABLE.angles) * len(TABLE.roots), len(ANGLES) * len(TABLE.roots), len(ANGLES) * len(sparse)]
    rows: list[list[str]] = []
    for (name, spent), count in zip(times.items(), counts, strict=True):
        rows.append([name, f"{count}", f"{spent.wall:.2f}", f"{spent.work:.2f}", f"{1e6 * spent.work / count:.1f}"])
    show(["search", "transients", "s", "s of processors", "µs each"], rows)
    spent = [each.work / count for each, count in zip(times.values(), counts, strict=True)]
    print(f"A transient costs SciPy {spent[2] / spent[1]:.0f} times as much as a lane of one thread.")
    whole = times["all angles, all threads"].wall
    print(f"The whole search: {whole:.1f} s, {verdict(whole <= GOAL, GOAL)} s.")


if __name__ == "__main__":
    main()
