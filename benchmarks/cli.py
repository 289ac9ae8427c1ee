"""How long the commands take until they print their table, and what the imports cost.

Each command runs in a process of its own and writes into a temporary folder; there is no cache of kernels, so that every
start is a cold one. Commands take turns, round after round; times are by the clock on the wall, so on a busy machine the
minimum says most. Python's own byte code is warm throughout. Goals are the seconds of one machine; on another they count as
many times longer as other people's libraries take to be imported.

Run: python benchmarks/cli.py
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from statistics import median
from types import MappingProxyType
from typing import NamedTuple

from common import header, show


class Timed(NamedTuple):
    """A command and how it ends; the seconds that it may take until its table, and from there to the end (None: any)."""

    words: tuple[str, ...]
    table: float | None = None
    rest: float | None = None
    code: int = 0
    writes: bool = False
    environment: Mapping[str, str] = MappingProxyType({})


COMPLETION = {"_STARHOLD_COMPLETE": "complete_bash", "COMP_WORDS": "starhold comp", "COMP_CWORD": "1"}
COMMANDS = {
    "run three-laws": Timed(("run", "three-laws"), rest=1.0, writes=True),
    "compare three-laws": Timed(("compare", "three-laws"), rest=3.0, writes=True),
    "run cubesat-mission": Timed(("run", "cubesat-mission"), 1.5, 6.0, writes=True),
    "run of no file": Timed(("run", "no-such-file.toml"), rest=0.4, code=2),
    "--help": Timed(("--help",), rest=0.15),
    "completion of comp": Timed((), rest=0.15, environment=COMPLETION),
    "laws": Timed(("laws",)),
    "--version": Timed(("--version",)),
}
HEAD = "─" * 40
"""What stands in the line below the head of a table, and nowhere before."""
START = "import sys; sys.argv[0] = 'starhold'; from starhold.cli.main import main; main()"
ENVIRONMENT = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
ROUNDS, IMPORTS = 3, 3
"""Rounds of each kind."""
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


def starhold(timed: Timed, folder: Path) -> tuple[float | None, float]:
    """Wall seconds of a command until its table and to its end; its output is shown when it fails."""
    output = ["-o", str(Path(tempfile.mkdtemp(dir=folder)) / "results")] if timed.writes else []
    words, printed, table = [sys.executable, "-c", START, *timed.words, *output], list[str](), None
    environment = {**ENVIRONMENT, **timed.environment}
    begun = time.perf_counter()
    with subprocess.Popen(
        words, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, encoding="utf-8"
    ) as process:
        assert process.stdout is not None
        for line in process.stdout:
            printed.append(line)
            if table is None and timed.writes and HEAD in line:
                table = time.perf_counter() - begun
    if process.returncode != timed.code:
        raise SystemExit(f"starhold {' '.join(timed.words)} failed:\n{''.join(printed)[-3000:]}")
    return table, time.perf_counter() - begun


PEERS = ("numpy", "scipy.integrate", "sympy", "xarray", "pint", "matplotlib.pyplot")
SET = 2.39
"""Seconds that these imports took where the goals were set."""


def verdict(seconds: float, goal: float | None) -> str:
    """Tell whether a goal is met."""
    return "" if goal is None else f"{'OK' if seconds <= goal else 'MISSES'} {goal:.2g}"


def commands(folder: Path, slower: float) -> None:
    """Starts of each command, after one for the byte code, where goals are so many times longer."""
    times: dict[str, list[tuple[float | None, float]]] = {name: [] for name in COMMANDS}
    for turn in range(ROUNDS + 1):
        for name, timed in COMMANDS.items():
            spent = starhold(timed, folder)
            if turn:
                times[name].append(spent)
    rows: list[list[str]] = []
    for name, timed in COMMANDS.items():
        table_goal, rest_goal = (goal and goal * slower for goal in (timed.table, timed.rest))
        tables = [table for table, _ in times[name] if table is not None]
        ends = [end for _, end in times[name]]
        first = ["", ""]
        if tables:
            first = [f"{min(tables):.2f}", verdict(min(tables), table_goal)]
        # The rest counts from the table on where that has a goal of its own.
        rest = min(end - (table or 0.0) * (timed.table is not None) for table, end in times[name])
        rows.append([f"starhold {name}", *first, *(f"{f(ends):.2f}" for f in (min, median, max)), verdict(rest, rest_goal)])
    print(f"Seconds, {ROUNDS} starts; the verdict on the rest is about what comes after the table, where that has its own")
    show(["command", "table", "", "min", "median", "max", ""], rows)


def imports(folder: Path) -> dict[str, float]:
    """Import times above that of bare Python, in seconds."""
    times: dict[str, list[float]] = {name: [] for name in ("", *LIBRARIES)}
    for _ in range(IMPORTS):
        for name in times:
            code = f"import {name}" if name else ""
            begun = time.perf_counter()
            subprocess.run([sys.executable, "-c", code], cwd=folder, env=ENVIRONMENT, check=True)
            times[name].append(time.perf_counter() - begun)
    bare = min(times.pop(""))
    added = {name: min(values) - bare for name, values in times.items()}
    print(f"Milliseconds an import adds to bare Python ({bare * 1e3:.0f}), least of {IMPORTS} rounds")
    show(["import", "ms"], [[name, f"{seconds * 1e3:.0f}"] for name, seconds in added.items()])
    return added


def main() -> None:
    """Measure and print."""
    print(header())
    with tempfile.TemporaryDirectory() as name:
        added = imports(Path(name))
        slower = sum(added[peer] for peer in PEERS) / SET
        print(f"Goals are {slower:.2f} times what they were set to: {', '.join(PEERS)} take so much longer to be imported")
        commands(Path(name), slower)


if __name__ == "__main__":
    main()
