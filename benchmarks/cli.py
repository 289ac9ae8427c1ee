"""How long the commands take, and what the imports cost.

Each command runs in a process of its own and writes into a temporary folder; there is no cache of kernels, so that every
start is a cold one. Commands take turns, round after round; times are by the clock on the wall, so on a busy machine the
minimum says most. Python's own byte code is warm throughout.

Run: python benchmarks/cli.py
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

from common import header, show

COMMANDS = {
    "run": ["run", "three-laws", "--law", "lyapunov"],
    "compare": ["compare", "three-laws"],
    "laws": ["laws"],
    "--version": ["--version"],
}
ROUNDS, IMPORTS = 7, 5
"""Rounds of each kind."""
GOALS = {"run": 1.5, "compare": 5.0}
"""Seconds that commands may take."""
LIBRARIES = (
    "numpy",
    "scipy.linalg",
    "scipy.integrate",
    "llvmlite.binding",
    "sympy",
    "xarray",
    "h5netcdf",
    "pydantic",
    "pint",
    "typer",
    "rich",
    "matplotlib.pyplot",
    "plotly.graph_objects",
    "flint",
    "starhold.cli.main",
    "starhold.scenario.reading",
    "starhold.loop.kernels",
    "starhold.api",
)
WRITES = ("run", "compare")
"""Commands that take an output folder."""


def seconds(command: list[str], folder: Path) -> float:
    """Wall seconds of a process; its output is shown when it fails."""
    begun = time.perf_counter()
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    spent = time.perf_counter() - begun
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(command)} failed:\n{done.stdout[-1000:]}\n{done.stderr[-2000:]}")
    return spent


def starhold(name: str, folder: Path) -> float:
    """Wall seconds of a command of starhold."""
    output = ["-o", str(Path(tempfile.mkdtemp(dir=folder)) / "results")] if name in WRITES else []
    return seconds([sys.executable, "-m", "starhold", *COMMANDS[name], *output], folder)


def commands(folder: Path) -> None:
    """Starts of each command."""
    times: dict[str, list[float]] = {name: [] for name in COMMANDS}
    for _ in range(ROUNDS):
        for name in COMMANDS:
            times[name].append(starhold(name, folder))
    rows: list[list[str]] = []
    for name, spent in times.items():
        goal = GOALS.get(name)
        verdict = "" if goal is None else f"{'meets' if min(spent) <= goal else 'MISSES'} {goal:g}"
        rows.append([f"starhold {' '.join(COMMANDS[name])}", *(f"{f(spent):.2f}" for f in (min, median, max)), verdict])
    print(f"Seconds, {ROUNDS} starts")
    show(["command", "min", "median", "max", ""], rows)


def imports(folder: Path) -> None:
    """Import times above that of bare Python."""
    times: dict[str, list[float]] = {name: [] for name in ("", *LIBRARIES)}
    for _ in range(IMPORTS):
        for name in times:
            code = f"import {name}" if name else ""
            times[name].append(seconds([sys.executable, "-c", code], folder))
    bare = min(times.pop(""))
    rows = [[name, f"{(min(values) - bare) * 1e3:.0f}"] for name, values in times.items()]
    print(f"Milliseconds an import adds to bare Python ({bare * 1e3:.0f}), least of {IMPORTS} rounds")
    show(["import", "ms"], rows)


def main() -> None:
    """Measure and print."""
    print(header())
    with tempfile.TemporaryDirectory() as name:
        commands(Path(name))
        imports(Path(name))


if __name__ == "__main__":
    main()
