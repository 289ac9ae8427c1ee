"""The timing of a flight in real time, as numbers and a histogram."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from starhold.files import write_text
from starhold.report.figures import framed, plain, save
from starhold.report.plots import COLOURS
from starhold.report.results import TIMING

LEAST = 1e-6
"""The lower end (s) of the histogram; shorter times are counted there."""
BINS = 60


def write_timing(timing: dict[str, Any], folder: Path) -> Path:
    """Write `Served.timing` into a folder, as JSON and as a figure, and return the figure's path."""
    numbers, picture = (folder / name for name in TIMING)
    write_text(numbers, json.dumps(timing, allow_nan=False) + "\n")
    return save(draw_timing(timing), picture)


def draw_timing(timing: dict[str, Any]) -> Any:
    """Return a figure with histograms of the commands' latencies and of the plant's delays, over one logarithmic axis."""
    title = f"Real time: {timing['periods']} periods of {1e3 * timing['period']:.4g} ms, {timing['missed']} missed"
    figure, grid = framed((8.0, 4.6), title, 2, 1, (0.75, 0.2, 0.55, 0.5), sharex=True, hspace=0.12)
    shown = {"from readings to command": timing["latencies"], "the plant's own lateness": timing["lateness"]}
    most = max((2.0 * timing["period"], *timing["latencies"], *timing["lateness"]))
    edges = np.geomspace(LEAST, 1.0001 * most, BINS + 1)
    for number, (axis, (label, seconds)) in enumerate(zip(grid.flat, shown.items(), strict=True)):
        axis.hist(np.maximum(seconds, LEAST), edges, color=COLOURS[number])
        axis.axvline(timing["period"], color="0.3", linewidth=1.0, dashes=(5, 3))
        axis.set_xscale("log")
        axis.set_axisbelow(True)
        axis.set_xlim(edges[0], edges[-1])
        axis.set_ylabel("times")
        axis.text(0.01, 0.9, f"{label}, {len(seconds)}", transform=axis.transAxes, fontsize=8.5)
        plain(axis)
    grid.flat[-1].set_xlabel("seconds (dashed: the period)")
    return figure
