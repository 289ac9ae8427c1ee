"""The picture of a pointing budget: a panel for each index, in it a bar for each source."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from starhold.analysis.pointing import MEANINGS
from starhold.files import atomic_write
from starhold.report.colours import COLOURS
from starhold.report.figures import plain
from starhold.studies.budget import COMBINED, LOOP, TOGETHER

if TYPE_CHECKING:
    from starhold.studies.budget import Budget

DPI = 110
UNITS = (("deg", math.radians(1.0)), ("arcsec", math.radians(1.0 / 3600.0)), ("mas", math.radians(1.0 / 3.6e6)))
LEAST = 0.1
"""The largest level is no less in the unit that it is told in."""
SMALL = 1e-4
"""Levels below this share of the largest of their panel are told as nothing."""
ACROSS = 4
"""Panels in a row."""
INTERPRETED = {
    "mixed": "of all instants of all runs",
    "temporal": "of the instants of the worst run",
    "ensemble": "of the runs, at their worst instants",
}


def unit_of(budget: Budget, index: str) -> tuple[str, float]:
    """The unit that the levels of an index are told in, and its size (rad)."""
    largest = max(budget.level(row.name, index) for row in budget.rows)
    return next((unit for unit in UNITS if largest >= LEAST * unit[1]), UNITS[-1])


def setting_text(budget: Budget) -> str:
    """How the errors were taken, in a sentence or two."""
    told = budget.settings
    about = "about whatever axis" if told.boresight is None else "half the cone of the line of sight"
    runs = "run" if told.runs == 1 else "runs"
    return (
        f"Levels that {100.0 * told.confidence:.6g} % {INTERPRETED[told.interpretation]} keep, {about}; {told.runs} {runs}. "
        f"Errors from {told.start:g} s on, windows of {told.window:g} s, for drift {told.separation:g} s apart."
    )


def draw(budget: Budget, path: Path) -> Path:
    """Write a picture to `path`, in a folder that exists, and return the path."""
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    shown = [row.name for row in budget.rows if row.name != COMBINED]
    across, down = min(ACROSS, len(budget.indices)), -(-len(budget.indices) // ACROSS)
    panel, between = 0.28 * len(shown), 0.78
    height, width = 1.50 + down * panel + (down - 1) * between, 2.6 + 2.25 * across
    figure = Figure(figsize=(width, height), dpi=DPI)
    figure.set_layout_engine("none")
    grid: Any = figure.subplots(down, across, sharey=True, squeeze=False)
    sides = {"left": 1.75 / width, "right": 1.0 - 0.2 / width, "bottom": 0.52 / height, "top": 1.0 - 0.98 / height}
    figure.subplots_adjust(**sides, wspace=0.1, hspace=between / panel)
    title = f"{budget.scenario}, {budget.law}: pointing error by source"
    figure.text(0.02, 1.0 - 0.27 / height, title[:90], fontsize=11, fontweight="bold", parse_math=False)
    figure.text(0.02, 1.0 - 0.47 / height, setting_text(budget), fontsize=7.5, color="0.35", parse_math=False)
    colours = [COLOURS[2] if name == LOOP else COLOURS[1] if name == TOGETHER else COLOURS[0] for name in shown]
    for axis, index in zip(grid.flat, budget.indices, strict=True):
        unit, size = unit_of(budget, index)
        levels = [budget.level(name, index) / size for name in shown]
        combined, required = budget.level(COMBINED, index) / size, budget.required.get(index)
        places = np.arange(len(shown))
        axis.barh(places, levels, height=0.62, color=colours)
        axis.axvline(combined, color="0.25", linewidth=1.0, dashes=(5, 3))
        largest = max(*levels, combined)
        if required is not None and required / size < 20.0 * largest:
            axis.axvline(required / size, color="#b3202c", linewidth=1.2)
            largest = max(largest, required / size)
        axis.set_xlim(0.0, 1.3 * max(largest, 1e-12))
        axis.locator_params(axis="x", nbins=4, prune="upper")
        for place, value in enumerate(levels):
            behind = {"facecolor": "white", "edgecolor": "none", "pad": 0.6}
            beside = {"xytext": (4, 0), "textcoords": "offset points", "va": "center"}
            number = f"{value:.3g}" if value > SMALL * largest else "≈ 0"
            axis.annotate(number, (value, place), **beside, fontsize=7.5, color="0.2", bbox=behind)
        axis.set_xlabel(f"{index}, {unit}", fontsize=9)
        axis.set_title(MEANINGS[index].partition(":")[0], fontsize=8, color="0.25", loc="left", pad=3)
        plain(axis, "x")
        axis.set_axisbelow(True)
        axis.tick_params(axis="y", length=0.0)
    for row in grid:
        row[0].set_yticks(np.arange(len(shown)), [_short(name) for name in shown], parse_math=False)
        row[0].set_ylim(len(shown) - 0.5, -0.5)
    handles = [
        Line2D([], [], color=COLOURS[2], linewidth=6.0, label=LOOP),
        Line2D([], [], color=COLOURS[0], linewidth=6.0, label="a source alone"),
        Line2D([], [], color=COLOURS[1], linewidth=6.0, label=TOGETHER),
        Line2D([], [], color="0.25", linewidth=1.0, dashes=(5, 3), label=COMBINED),
    ]
    if budget.required:
        handles.append(Line2D([], [], color="#b3202c", linewidth=1.2, label="required"))
    at = (0.012, 1.0 - 0.48 / height)
    figure.legend(handles=handles, loc="upper left", bbox_to_anchor=at, ncols=5, fontsize=8.5, frameon=False)
    # No software entry, lest equal figures differ between releases.
    with atomic_write(path) as hidden:
        figure.savefig(hidden, metadata={"Software": None}, pil_kwargs={"compress_level": 3})
    return path


def _short(name: str) -> str:
    return name if len(name) <= 26 else f"{name[:25]}…"
