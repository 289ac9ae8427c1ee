"""What reaction wheels cost: a step of a lane with three and four wheels, beside the same loop without wheels."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

import common
import steps
from common import header, interleaved, show, verdict
from starhold.laws.catalogue import catalogue
from starhold.parts.catalogue import find
from starhold.parts.effectors.layouts import pyramid, three_orthogonal
from starhold.parts.effectors.wheels import ALLOCATIONS, make_wheels
from starhold.parts.part import Fitted

GOAL = 2.5
"""A loop with four wheels costs at most this many times the loop without."""


class WheelBatch(steps.Batch):
    """A loop with wheels on many lanes; the rotors start at rest."""

    def __init__(self, loop: Any, threads: int) -> None:
        self.loop, self.threads = loop, threads
        plain = steps.starts(loop)
        self.states = np.vstack([plain, np.zeros((len(loop.wheels.axes), plain.shape[1]))])


def main() -> None:
    """Measure and print."""
    print(header())
    law = catalogue()["wheel"]
    plain = common.problem(law, law.examples()[0], common.PUBLISHED, limit="none")
    batches: dict[str, steps.Batch] = {"no wheels": steps.Batch(plain, 1)}
    for name, axes, allocation in (
        ("3 wheels", three_orthogonal(), "least-squares"),
        ("4 wheels", pyramid(), "least-squares"),
        ("4 wheels, least peak", pyramid(), "least-peak"),
    ):
        wheels = make_wheels(axes, 1e-4, 0.02, 0.4, 1e-7, 1e-5)
        wheels = wheels._replace(allocation=ALLOCATIONS.index(allocation))
        batches[name] = WheelBatch(plain.with_parts(Fitted(find("effector", "wheels"), wheels)), 1)
    tasks: dict[str, Callable[[], Any]] = {}
    for name, batch in batches.items():
        tasks |= batch.tasks(name)
    times = interleaved(tasks, steps.REPEATS)
    without = steps.per_core(times, "no wheels")
    rows: list[list[str]] = []
    for name in batches:
        cost = steps.per_core(times, name)
        rows.append([name, f"{cost * 1e9:.1f}", f"{cost / without:.2f}"])
    show(["wheel law, many lanes, one core", "ns per lane-step", "of no wheels"], rows)
    four = steps.per_core(times, "4 wheels") / without
    print(f"Four wheels: {four:.2f}, {verdict(four <= GOAL, GOAL, wide=True)}")


if __name__ == "__main__":
    main()
