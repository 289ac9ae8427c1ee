"""The picture of the roots that turn fastest within limits, over the initial angle."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from starhold.analysis.roots import Best, TwoPieceFit
from starhold.files import atomic_write
from starhold.report.colours import COLOURS
from starhold.report.figures import plain
from starhold.studies.modal_roots import Study

DPI = 110
LINES = {"fit": ("own fit", "-", COLOURS[2]), "published": ("published fit", (0, (5, 2.5)), COLOURS[1])}
"""How each fit is drawn: its words, dashes and colour."""
POINTS = 200
"""Points of each piece of a fit."""


def draw(found: Study, path: Path, title: str) -> Path:
    """Write a picture to `path`, in a folder that exists, and return the path: roots and what they take, over the angle;
    errors of the fits where there are any."""
    from matplotlib.figure import Figure

    fits, angles = found.fits(), np.degrees(found.angles)
    rows = 3 if fits else 2
    height = 2.3 * rows + 1.0
    figure = Figure(figsize=(8.0, height), dpi=DPI)
    figure.set_layout_engine("none")
    ratios = [1.5, 0.8, 1.0] if fits else [1.5, 1.0]
    axes: Any = figure.subplots(rows, 1, sharex=True, gridspec_kw={"height_ratios": ratios})
    figure.subplots_adjust(left=0.098, right=0.978, bottom=0.5 / height, top=1.0 - 0.72 / height, hspace=0.1)
    heading = title if len(title) <= 86 else f"{title[:85]}…"
    figure.text(0.098, 1.0 - 0.26 / height, heading, fontsize=11, fontweight="bold", parse_math=False)
    top, last = axes[0], axes[-1]
    for name, pieces in fits.items():
        words, dashes, colour = LINES[name]
        _line(top, pieces, angles, dashes, colour, words)
        errors = 100.0 * pieces.errors(found.angles, found.roots)
        axes[1].plot(angles, errors, color=colour, linestyle=dashes, linewidth=1.2, marker=".", markersize=5)
    if fits:
        axes[1].axhline(0.0, color="0.35", linewidth=0.8)
        axes[1].set_ylabel("error of fit, %")
    hard, eased = [item.hard for item in found.found], [item.eased for item in found.found]
    kinds = [("within the limits", hard, COLOURS[0], COLOURS[0])]
    kinds += [("with their tolerances", eased, COLOURS[4], "white")] * found.eased
    for words, best, colour, inside in kinds:
        style: dict[str, Any] = {
            "color": colour,
            "markerfacecolor": inside,
            "linestyle": "",
            "marker": "o",
            "markersize": 4.5,
        }
        top.plot(angles, _numbers(best, "root"), label=words, **style)
        last.plot(angles, _numbers(best, "time"), **style)
    top.set_ylabel("root a, 1/s")
    last.set_ylabel("transient time, s")
    times = [time for _, best, *_ in kinds for time in _numbers(best, "time")]
    last.set_ylim(0.0, 1.08 * max(np.nanmax(times), 1e-9))
    last.set_xlabel("initial angle, deg")
    # Fits first were drawn behind; the points they go through come first in words.
    handles, labels = top.get_legend_handles_labels()
    order = [*range(len(fits), len(handles)), *range(len(fits))]
    figure.legend(
        [handles[k] for k in order],
        [labels[k] for k in order],
        loc="upper left",
        bbox_to_anchor=(0.09, 1.0 - 0.30 / height),
        ncols=len(handles),
        fontsize=8.5,
        frameon=False,
        borderpad=0.0,
    )
    for axis in axes:
        plain(axis)
        axis.set_axisbelow(True)
    # No software entry, lest equal figures differ between releases.
    with atomic_write(path) as hidden:
        figure.savefig(hidden, metadata={"Software": None}, pil_kwargs={"compress_level": 3})
    return path


def _line(axis: Any, pieces: TwoPieceFit, angles: Any, dashes: Any, colour: str, words: str) -> None:
    """Each piece by itself, for they do not meet."""
    split = np.degrees(pieces.split)
    low, high = (np.linspace(*ends, POINTS) for ends in ((angles[0], split), (np.nextafter(split, np.inf), angles[-1])))
    for at, label in ((low, words), (high, None)):
        inside = at[(at >= angles[0]) & (at <= angles[-1])]
        axis.plot(inside, pieces.at(np.radians(inside)), color=colour, linestyle=dashes, linewidth=1.4, label=label)


def _numbers(best: Sequence[Best | None], name: str) -> list[float]:
    return [np.nan if item is None else getattr(item, name) for item in best]
