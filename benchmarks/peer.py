"""This tree beside another one of the same project, in one run: what changed in speed, and that no result did.

Each tree flies the same loops in a process of its own; the two take turns, task by task and round after round, so that a
busy machine slows both. End states are compared bit for bit where no random numbers are drawn.

Run: python benchmarks/peer.py PEER [--python PYTHON]    PEER: a worktree of another version; PYTHON: an interpreter that has
what it needs, if that is not this one. For the last version before kernels were recorded:
    git worktree add ../peer b18903c && python -m venv ../peer/.venv && ../peer/.venv/bin/pip install -e ../peer
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

ROUNDS = 9
ALONE, TOGETHER, LANES = 100_000, 2000, 2048


def worker() -> None:
    """Answer the name of a task with what it took, in seconds, and where it ended."""
    import numpy as np

    from common import NOISE, PUBLISHED, problem
    from starhold.algebra.structure import flatten
    from starhold.laws.catalogue import catalogue
    from starhold.simulation.lane import fly
    from starhold.simulation.lanes import simulate_many

    def loop_of(name: str) -> Any:
        law, _, extra = name.partition("+")
        gains = catalogue()[law].examples()[0]
        loop = problem(catalogue()[law], gains, PUBLISHED, torque_limit=0.01, limit="axis")
        return loop.with_parts(*NOISE) if extra == "noise" else loop

    for line in sys.stdin:
        kind, law = line.split()
        loop = loop_of(law)
        starts = np.repeat(np.array(flatten(loop.start))[:, None], LANES, axis=1)
        # Lanes that start alike would be flown once for all.
        starts[4:7] *= np.linspace(1.0, 0.5, LANES)
        steps = TOGETHER if "mpc" not in law else 20

        def run(kind: str = kind, loop: Any = loop, starts: Any = starts, steps: int = steps) -> Any:
            if kind == "one":
                return flatten(fly(loop, ALONE if steps == TOGETHER else 2000, ALONE)[1].state)
            return simulate_many(loop, starts, 0 if kind.startswith("none") else steps, threads=int(kind[-1])).states[:, 0]

        run()
        cpu, wall = time.process_time(), time.perf_counter()
        end = run()
        cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
        print(json.dumps([cpu, wall, list(map(float.hex, map(float, end)))]), flush=True)


class Tree:
    """A process that flies with one of the trees."""

    def __init__(self, python: str, root: Path) -> None:
        # The worker runs this file with the other tree's packages, and its own `common` beside them.
        path = os.pathsep.join((str(root / "src"), str(root / "benchmarks")))
        environment = os.environ | {"PYTHONPATH": path, "PYTHONSAFEPATH": "1"}
        self._process = subprocess.Popen(
            [python, __file__, "--worker"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment, text=True
        )

    def ask(self, task: str) -> tuple[float, float, list[str]]:
        """Processor seconds, seconds, and the end."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        print(task, file=self._process.stdin, flush=True)
        cpu, wall, end = json.loads(self._process.stdout.readline())
        return cpu, wall, end


LAWS = ("lyapunov", "sliding", "pd", "lyapunov+noise", "mpc")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("peer", type=Path)
    parser.add_argument("--python", default=sys.executable)
    given = parser.parse_args()
    from common import header, show

    print(header())
    trees = {"this": Tree(sys.executable, Path(__file__).parents[1]), "peer": Tree(given.python, given.peer.resolve())}
    kinds = ("one", "none1", "many1", "many2")
    least: dict[tuple[str, str, str], tuple[float, float]] = {}
    same: dict[str, bool] = {}
    for _ in range(ROUNDS):
        for law in LAWS:
            for kind in kinds:
                ends: list[list[str]] = []
                for name, tree in trees.items():
                    cpu, wall, end = tree.ask(f"{kind} {law}")
                    before = least.get((name, law, kind), (float("inf"),) * 2)
                    least[name, law, kind] = (min(cpu, before[0]), min(wall, before[1]))
                    ends.append(end)
                same[law] = same.get(law, True) and ends[0] == ends[1]
    rows: list[list[str]] = []
    for law in LAWS:
        steps, alone = (TOGETHER, ALONE) if law != "mpc" else (20, 2000)
        costs: dict[str, list[float]] = {}
        for name in trees:
            one, core = (least[name, law, kind][0] for kind in ("one", "many1"))
            core -= least[name, law, "none1"][0]
            both = least[name, law, "many2"][1] - least[name, law, "none1"][1]
            costs[name] = [one / alone, core / steps / LANES, both / steps / LANES]
        cells = [
            f"{mine * 1e9:.1f} / {other * 1e9:.1f} = {other / mine:.2f}x"
            for mine, other in zip(*costs.values(), strict=True)
        ]
        core, both = costs["this"][1:]
        ends = "equal, bit for bit" if same[law] else ("other random numbers" if "noise" in law else "DIFFERENT")
        rows.append([law, *cells, f"{core / both:.2f}", ends])
    print("ns a step, this tree / the peer = how many times as fast")
    show(["law", "one lane", "many lanes, one core", "many lanes, two cores", "two cores / one", "ends"], rows)


if __name__ == "__main__":
    if "--worker" in sys.argv:
        worker()
    else:
        main()
