"""The picture of what is left after the loss of wheels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from starhold.files import atomic_write
from starhold.report.colours import COLOURS
from starhold.report.figures import plain
from starhold.studies.failures import Failure

DPI = 110


def draw(found: Sequence[Failure], path: Path, title: str) -> Path:
    """Write a picture to `path`, in a folder that exists, and return the path: one row a loss, one panel a quantity."""
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    panels: list[tuple[str, list[float | None]]] = [
        ("authority left, % of intact", [100.0 * failure.share for failure in found])
    ]
    if any(failure.eta is not None for failure in found):
        panels.append(("degree of stability, 1/s", [failure.eta for failure in found]))
    panels.append(("settling time, s", [failure.settling for failure in found]))
    if any(failure.certified is not None for failure in found):
        # Rounded down, so as not to say more than is proved.
        turns = [None if f.certified is None else math.floor(10.0 * math.degrees(f.certified[0])) / 10.0 for f in found]
        panels.append(("certified turn, °", turns))
    height = 1.45 + 0.27 * len(found)
    figure = Figure(figsize=(2.0 + 2.0 * max(3, len(panels)), height), dpi=DPI)
    figure.set_layout_engine("none")
    grid: Any = figure.subplots(1, len(panels), sharey=True, squeeze=False)
    figure.subplots_adjust(
        left=0.944 / figure.get_figwidth(),
        right=1.0 - 0.176 / figure.get_figwidth(),
        bottom=0.55 / height,
        top=1.0 - 0.72 / height,
        wspace=0.09,
    )
    heading = title if len(title) <= 80 else f"{title[:79]}…"
    figure.text(0.02, 1.0 - 0.28 / height, heading, fontsize=11, fontweight="bold", parse_math=False)
    places = np.arange(len(found))
    for number, (axis, (name, values)) in enumerate(zip(grid[0], panels, strict=True)):
        sizes = [value or 0.0 for value in values]
        colours = [COLOURS[2] if not failure.lost else COLOURS[0] for failure in found]
        axis.barh(places, sizes, height=0.62, color=colours)
        if sizes[0] > 0.0:
            axis.axvline(sizes[0], color="0.35", linewidth=0.9, dashes=(5, 3), zorder=2.5)
        axis.set_xlim(0.0, 1.28 * max(max(sizes), 1e-9))
        axis.locator_params(axis="x", nbins=4, prune="upper")
        for place, failure in enumerate(found):
            missing = "not proved" if name.startswith("certified") else "not settled"
            missing = "not flown" if failure.refused else missing
            _mark(axis, place, failure, values[place], number, missing)
        axis.set_xlabel(name, fontsize=9)
        plain(axis, "x")
        axis.set_axisbelow(True)
        axis.tick_params(axis="y", length=0.0)
    # Two directions take more room than the first panel has; the others have nothing to show beside them.
    grid[0][0].set_zorder(1)
    grid[0][0].set_yticks(places, [failure.name for failure in found])
    grid[0][0].set_ylim(len(found) - 0.5, -0.5)
    grid[0][0].set_ylabel("lost wheels", fontsize=9)
    handles = [
        Line2D([], [], color=COLOURS[2], linewidth=6.0, label="intact"),
        Line2D([], [], color=COLOURS[0], linewidth=6.0, label="three axes left"),
        Line2D([], [], color=COLOURS[1], marker="X", linestyle="", markersize=7.0, label="an axis without torque"),
        Line2D([], [], color="0.35", linewidth=0.9, dashes=(5, 3), label="as intact"),
    ]
    at = (0.012, 1.0 - 0.30 / height)
    figure.legend(handles=handles, loc="upper left", bbox_to_anchor=at, ncols=4, fontsize=8.5, frameon=False)
    # No software entry, lest equal figures differ between releases.
    with atomic_write(path) as hidden:
        figure.savefig(hidden, metadata={"Software": None}, pil_kwargs={"compress_level": 3})
    return path


def _mark(axis: Any, place: int, failure: Failure, value: float | None, panel: int, missing: str) -> None:
    """The number at the end of a bar, or why there is none."""
    across = axis.get_yaxis_transform()
    if failure.controllable:
        text = f"{value:.3g}" if value is not None else missing if failure.diverged_at is None else "diverged"
        behind = {"facecolor": "white", "edgecolor": "none", "pad": 0.8}
        axis.annotate(
            text,
            (value or 0.0, place),
            (4, 0),
            textcoords="offset points",
            va="center",
            fontsize=7.5,
            color="0.2",
            bbox=behind,
        )
        return
    axis.axhspan(place - 0.5, place + 0.5, color="0.94", linewidth=0.0, zorder=0)
    if panel == 0:
        axis.plot(0.03, place, marker="X", color=COLOURS[1], markersize=6.5, transform=across, clip_on=False)
        shown = f"no torque about {direction_text(failure)}"
        behind = {"facecolor": "0.94", "edgecolor": "none", "pad": 0.8}
        axis.text(0.075, place, shown, va="center", fontsize=7.5, color="0.2", transform=across, zorder=5, bbox=behind)


def direction_text(failure: Failure) -> str:
    """The body directions without authority, for reading."""
    if len(failure.lacking) == 3:
        return "any axis"
    return " and ".join(f"({', '.join(f'{x:.3g}' for x in direction)})" for direction in failure.lacking)
