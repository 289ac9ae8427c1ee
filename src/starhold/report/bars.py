"""Bar charts: a row for each item, a panel for each quantity."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from starhold.report.figures import framed, plain, shortened
from starhold.report.plots import COLOURS

ACROSS = 4
"""The number of panels in a row."""
LINE, LIMIT = {"color": "0.3", "linewidth": 1.0, "dashes": (5, 3)}, {"color": "#b3202c", "linewidth": 1.2}


class Bars(NamedTuple):
    """A panel: its label, the lengths of its bars and the texts at their ends, the position of a dashed line, a title, and
    the required value, drawn as a line unless it is far outside the panel."""

    label: str
    values: Sequence[float]
    words: Sequence[str]
    line: float | None
    title: str = ""
    limit: float | None = None


def draw_bars(
    title: str,
    note: str,
    rows: Sequence[str],
    hues: Sequence[int],
    panels: Sequence[Bars],
    kinds: Mapping[str, int],
    dashed: str,
    label: str = "",
    struck: Mapping[int, str] | None = None,
    why: str = "",
) -> Any:
    """Return a figure of bar charts.

    note: text below the title. rows: names of the rows; hues: the numbers of their colours, which `kinds` names in the
    legend. dashed: the meaning of dashed lines. label: the label of the row axis. struck: texts in place of the bars of some
    rows, which `why` explains in the legend."""
    from matplotlib.lines import Line2D

    struck = struck or {}
    names = [shortened(name, 26) for name in rows]
    across, down = min(ACROSS, len(panels)), -(-len(panels) // ACROSS)
    panel, gap, above = 0.28 * len(rows), 0.78, 0.98 if note else 0.74
    left = 0.35 + 0.054 * max(map(len, names)) + 0.22 * bool(label)
    size = (0.85 + left + 2.25 * max(3, across), 0.52 + above + down * panel + (down - 1) * gap)
    figure, grid = framed(size, title, down, across, (left, 0.2, 0.52, above), sharey=True, wspace=0.1, hspace=gap / panel)
    height = size[1]
    if note:
        figure.text(left / size[0], 1.0 - 0.47 / height, note, fontsize=7.5, color="0.35", parse_math=False)
    for number, (axis, what) in enumerate(zip(grid.flat, panels, strict=False)):
        axis.barh(range(len(rows)), what.values, height=0.62, color=[COLOURS[hue] for hue in hues])
        lines = [value for value in (what.line,) if value]
        for value in lines:
            axis.axvline(value, zorder=2.5, **LINE)
        largest = max(*what.values, *lines, 1e-12)
        if what.limit is not None and what.limit < 20.0 * largest:
            axis.axvline(what.limit, **LIMIT)
            largest = max(largest, what.limit)
        axis.set_xlim(0.0, 1.3 * largest)
        axis.locator_params(axis="x", nbins=4, prune="upper")
        for place, (value, words) in enumerate(zip(what.values, what.words, strict=True)):
            if place in struck:
                axis.axhspan(place - 0.5, place + 0.5, color="0.94", linewidth=0.0, zorder=0)
                if number == 0:
                    _strike(axis, place, struck[place])
                continue
            beside = {"xytext": (4, 0), "textcoords": "offset points", "va": "center"}
            axis.annotate(words, (value, place), **beside, fontsize=7.5, color="0.2", bbox=_behind("white"))
        axis.set_xlabel(what.label, fontsize=9)
        axis.set_title(what.title, fontsize=8, color="0.25", loc="left", pad=3)
        plain(axis, "x")
        axis.set_axisbelow(True)
        axis.tick_params(axis="y", length=0.0)
    for axis in grid.flat[len(panels) :]:
        axis.set_visible(False)
    for first in grid[:, 0]:
        first.set_yticks(np.arange(len(rows)), names, parse_math=False)
        first.set_ylim(len(rows) - 0.5, -0.5)
        first.set_ylabel(label, fontsize=9)
        # Text in place of bars needs more room than the first panel has; in these rows the other panels are empty.
        first.set_zorder(1)
    handles = [Line2D([], [], color=COLOURS[hue], linewidth=6.0, label=name) for name, hue in kinds.items()]
    if why:
        handles.append(Line2D([], [], color=COLOURS[1], marker="X", linestyle="", markersize=7.0, label=why))
    handles.append(Line2D([], [], label=dashed, **LINE))
    if any(what.limit is not None for what in panels):
        handles.append(Line2D([], [], label="required", **LIMIT))
    at = (left / size[0] - 0.008, 1.0 - (0.48 if note else 0.30) / height)
    figure.legend(handles=handles, loc="upper left", bbox_to_anchor=at, ncols=5, fontsize=8.5, frameon=False)
    return figure


def _strike(axis: Any, place: int, words: str) -> None:
    across = axis.get_yaxis_transform()
    axis.plot(0.03, place, marker="X", color=COLOURS[1], markersize=6.5, transform=across, clip_on=False)
    beside = {"va": "center", "fontsize": 7.5, "color": "0.2", "zorder": 5, "bbox": _behind("0.94")}
    axis.text(0.075, place, words, transform=across, **beside)


def _behind(colour: str) -> dict[str, Any]:
    return {"facecolor": colour, "edgecolor": "none", "pad": 0.7}
