"""How long the commands take, from an empty compiler cache and from a full one, and what the imports cost.

Each command runs in a process of its own and writes into a temporary folder. Cold is the first start on a machine: the
compiler's cache is empty. Warm is every start after it. Commands take turns, round after round; times are by the clock
on the wall, so on a busy machine the minimum says most. Python's own byte code is warm throughout.

Run: python benchmarks/cli.py
"""

from __future__ import annotations

import os
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
COLD, WARM, IMPORTS = 2, 5, 5
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
WRITES = ("run", "compare")
"""Commands that take an output folder."""


def seconds(command: list[str], cache: Path, folder: Path) -> float:
    """Wall seconds of a process; its output is shown when it fails."""
    begun = time.perf_counter()
    environment = os.environ | {"NUMBA_CACHE_DIR": str(cache)}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    spent = time.perf_counter() - begun
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(command)} failed:\n{done.stdout[-1000:]}\n{done.stderr[-2000:]}")
    return spent


def starhold(name: str, cache: Path, folder: Path) -> float:
    """Wall seconds of a command of starhold."""
    output = ["-o", str(Path(tempfile.mkdtemp(dir=folder)) / "results")] if name in WRITES else []
    return seconds([sys.executable, "-m", "starhold", *COMMANDS[name], *output], cache, folder)


def commands(folder: Path) -> None:
    """Cold and warm starts."""
    cold: dict[str, list[float]] = {name: [] for name in COMMANDS}
    warm: dict[str, list[float]] = {name: [] for name in COMMANDS}
    caches: dict[str, Path] = {}
    for _ in range(COLD):
        for name in COMMANDS:
            caches[name] = Path(tempfile.mkdtemp(dir=folder))
            cold[name].append(starhold(name, caches[name], folder))
    files = {name: sorted(cache.rglob("*.nbc")) for name, cache in caches.items()}
    for _ in range(WARM):
        for name in COMMANDS:
            warm[name].append(starhold(name, caches[name], folder))
    rows: list[list[str]] = []
    for name in COMMANDS:
        more = len(sorted(caches[name].rglob("*.nbc"))) - len(files[name])
        kept = f"{len(files[name])}" + (f", then {more} more" if more else "")
        times = [min(cold[name]), min(warm[name]), median(warm[name]), max(warm[name])]
        rows.append([f"starhold {' '.join(COMMANDS[name])}", *(f"{t:.2f}" for t in times), kept])
    print(f"Seconds; {COLD} cold starts, {WARM} warm ones. `compiled`: kernels in the cache after the cold start.")
    show(["command", "cold min", "warm min", "warm median", "warm max", "compiled"], rows)


def imports(folder: Path) -> None:
    """Import times above that of bare Python."""
    cache = Path(tempfile.mkdtemp(dir=folder))
    times: dict[str, list[float]] = {name: [] for name in ("", *LIBRARIES)}
    for _ in range(IMPORTS):
        for name in times:
            code = f"import {name}" if name else ""
            times[name].append(seconds([sys.executable, "-c", code], cache, folder))
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
