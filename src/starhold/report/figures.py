"""Figures as PNG files, every law in every figure, and the helpers that draw them."""

import struct
import warnings
import zlib
from base64 import b64encode
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from starhold.files import atomic_write
from starhold.report.plots import Mark, Plot, back_to_front, colour
from starhold.report.text import lost_text
from starhold.studies.flight import Flight

DPI = 110
NOTHING: Any = None
"""Stands for a recording where none is needed."""
POINTS = 2000
"""The number of samples of a curve, about two per column of pixels."""


Picture: TypeAlias = dict[str, Callable[[], Any]]
"""For each file name, a function that draws its figure without the runs, and so can quickly be sent to another process."""


def without_runs(flights: Sequence[Flight]) -> list[Flight]:
    """Return the flights without their recordings."""
    return [replace(flight, recording=NOTHING) for flight in flights]


def paint(what: Picture, folder: Path) -> list[Path]:
    """Write the figures into `folder`, which exists, and return their paths."""
    with warnings.catch_warnings(), sharing_axes():
        # A name with characters missing in the font is drawn as boxes; a warning would not help the user.
        warnings.filterwarnings("ignore", message="Glyph .* missing from", category=UserWarning)
        return [save(make(), folder / f"{key}.png") for key, make in what.items()]


_shared: dict[tuple[Any, ...], tuple[Any, Any, float]] | None = None
"""Figures for reuse, with their axes and height, by the arguments of `blank`; None: figures are not reused."""


@contextmanager
def sharing_axes() -> Generator[None]:
    """Reuse one figure for all of the same layout, because axes and ticks take long to make; each figure has to be saved
    before the next is made."""
    global _shared
    _shared = {}
    try:
        yield
    finally:
        _shared = None


def over_time(plot: Plot, times: Any, marks: Sequence[Mark], flights: Sequence[Flight], name: str, shaded: Any = ()) -> Any:
    """Return a figure of panels over one time axis, grey where the estimate is not valid."""
    from starhold.report.ticks import label_ticks

    count = len(plot.panels)
    end = max(float(times[-1]), 1e-9)
    rows = word_rows(marks, end)
    above = (14.0 + WORD_HEIGHT * max(rows.values())) / 72.0 if rows else 0.0
    height = {1: 3.6, 2: 5.2}.get(count, 1.6 * (count + 1)) + above
    figure, axes = blank(count, 1, height, f"{plot.title}", flights, name, plot.dashed, above)
    for axis, panel in zip(axes, plot.panels, strict=True):
        for number in back_to_front(flights, plot):
            curve = panel.curves[number]
            width = width_of(number, len(flights), plot.chatters)
            axis.plot(times[: len(curve)], curve, color=colour(number), linewidth=width)
        axis.set_yscale("log" if panel.log else "linear")
        # Ticks take most of the drawing time, so there are few, and none are compared with missing minor ticks.
        minor = panel.log and panel.decades() <= 2.0
        axis.xaxis.remove_overlapping_locs, axis.yaxis.remove_overlapping_locs = False, minor
        if panel.log:
            label_ticks(axis.yaxis, log=True)
            if not minor:
                axis.minorticks_off()
        else:
            # Digits of small numbers would push the labels out of the figure.
            label_ticks(axis.yaxis)
            axis.yaxis.get_offset_text().set_size(8.5)
        for level in panel.levels:
            axis.axhline(level, color="0.35", linewidth=0.9, dashes=(5, 3))
        for first, last in shaded:
            axis.axvspan(first, last, color="0.5", alpha=0.15, linewidth=0.0)
            if axis is axes[0]:
                words = axis.get_xaxis_transform()
                axis.text(first, 0.98, " estimate not valid", transform=words, va="top", size=7.5, color="0.3", clip_on=True)
        for mark in marks:
            axis.axvline(mark.time, color="0.2", linewidth=0.9, linestyle=":")
            if mark in rows and axis is axes[0]:
                # Above the axes and any power of ten there.
                place = {"xy": (mark.time, 1.0), "xycoords": axis.get_xaxis_transform(), "textcoords": "offset points"}
                side = "right" if mark.time > 0.9 * end else "left"
                axis.annotate(
                    shortened(mark.word, 24),
                    xytext=(0, 12 + WORD_HEIGHT * rows[mark]),
                    ha=side,
                    fontsize=8,
                    color="0.2",
                    **place,
                )
        if panel.span is not None:
            axis.set_ylim(*panel.span)
        axis.set_ylabel(panel.label)
        axis.set_xlim(0.0, end)
    axes[-1].set_xlabel(f"time, {plot.clock}")
    return figure


WORD_HEIGHT, WORD_ROWS = 9.5, 4
"""Points between rows of words above axes, and the most rows."""


def word_rows(marks: Sequence[Mark], end: float) -> dict[Mark, int]:
    """Return the row of each mark's word, such that none overlap; words without room are left out."""
    ends, rows = [-1.0] * WORD_ROWS, dict[Mark, int]()
    for mark in sorted(marks):
        row = next((row for row, taken in enumerate(ends) if mark.time >= taken), None)
        if mark.word and row is not None:
            # About 4.6 points per letter, on axes of 507 points.
            rows[mark] = row
            ends[row] = mark.time + end * (4.6 * len(shortened(mark.word, 24)) + 8.0) / 507.0
    return rows


def blank(
    rows: int, columns: int, height: float, title: str, flights: Sequence[Flight], name: str, dashed: str, above: float = 0.0
) -> tuple[Any, Any]:
    """Return a figure with its title and legend, and its axes, which leave room above (inches)."""
    form = rows, columns, height, above, *map(_legend_text, flights)
    if _shared is not None and form in _shared:
        figure, axes, total = _shared[form]
        _clear(figure, axes)
        _entitle(figure, total, title, name, dashed)
        return figure, axes
    from starhold.report.ticks import Ticks

    figure, total, top = headed(height, title, flights, name, dashed, (0.28 if columns > 1 else 0.06) + above)
    grid: Any = figure.subplots(rows, columns, sharex=True, squeeze=False)
    figure.subplots_adjust(left=0.098, right=0.978, bottom=0.48 / total, top=top, hspace=0.09, wspace=0.14)
    axes = grid.ravel()
    for axis in axes:
        plain(axis)
        for one in (axis.xaxis, axis.yaxis):
            Ticks(one)
    for axis in grid[:-1].ravel():
        # Matplotlib computes a label's position from those of the ticks even where there is no label.
        axis.xaxis.set_label_coords(0.5, 0.0)
    if _shared is not None:
        _shared[form] = figure, axes, total
    return figure, axes


def _clear(figure: Any, axes: Sequence[Any]) -> None:
    """Remove everything drawn, except the legend, the axes and their ticks."""
    drawn = [artist for axis in axes for kind in (axis.lines, axis.patches, axis.texts) for artist in kind]
    for artist in [*figure.texts, *drawn]:
        artist.remove()
    for axis in axes:
        axis.relim()
        axis.set_autoscaley_on(True)


def plain(axis: Any, lines: str = "both") -> None:
    """Give axes a light grid, in both directions or only at values of "x", and no frame at the top and right."""
    axis.grid(True, axis=lines, color="0.9", linewidth=0.6)
    axis.tick_params(labelsize=8.5)
    for side in ("top", "right"):
        axis.spines[side].set_visible(False)


def headed(
    height: float, title: str, flights: Sequence[Flight], name: str, dashed: str, gap: float
) -> tuple[Any, float, float]:
    """Return a figure with its title and legend, its height (inches), and the top of its axes, `gap` (inches) below the
    legend. Distances are fixed, because layout engines draw everything twice."""
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    # As many names in a line as fit.
    names = [_legend_text(flight) for flight in flights]
    per_row = max(1, min(len(flights), 104 // (7 + max(map(len, names), default=0))))
    lines = -(-len(flights) // per_row)
    head = 0.40 + 0.20 * lines + gap
    total = height + 0.20 * lines
    figure = Figure(figsize=(8.0, total), dpi=DPI)
    figure.set_layout_engine("none")
    _entitle(figure, total, title, name, dashed)
    legend = figure.legend(
        [Line2D([], [], color=colour(number), linewidth=2.2) for number in range(len(flights))],
        [f"law {number}" for number in range(len(flights))],
        loc="upper left",
        bbox_to_anchor=(0.09, 1.0 - 0.30 / total),
        ncols=per_row,
        fontsize=8.5,
        frameon=False,
        borderpad=0.0,
        handlelength=1.8,
        columnspacing=1.6,
    )
    # Set afterwards, because labels interpret a leading underscore and dollar signs as commands.
    for text, words in zip(legend.get_texts(), names, strict=True):
        text.set_parse_math(False)
        text.set_text(words)
    return figure, total, 1.0 - head / total


def _entitle(figure: Any, total: float, title: str, name: str, dashed: str) -> None:
    heading = shortened(f"{name}: {title}" if name else title, 86 - len(dashed))
    figure.text(0.098, 1.0 - 0.26 / total, heading, fontsize=11, fontweight="bold", parse_math=False)
    if dashed:
        figure.text(0.978, 1.0 - 0.26 / total, f"– –  {dashed}", fontsize=8.5, ha="right", color="0.3")


def _legend_text(flight: Flight) -> str:
    fate = "" if flight.lost is None else f" (diverged at {lost_text(flight, 4)})"
    return shortened(flight.name, (48 if fate else 40) - len(fate)) + fate


def shortened(text: str, most: int) -> str:
    return text if len(text) <= most else f"{text[: most - 1]}…"


def width_of(number: int, count: int, thin: bool = False) -> float:
    """Return a line width that decreases from law to law, so that equal curves show as a line within a line."""
    return (1.2 if thin else 2.4) - (0.5 if thin else 1.3) * number / max(count - 1, 1)


def framed(
    size: tuple[float, float],
    title: str,
    rows: int,
    columns: int,
    sides: tuple[float, float, float, float],
    sharex: bool = False,
    sharey: bool = False,
    **grid: Any,
) -> tuple[Any, Any]:
    """Return a figure of this size with its title, and a grid of axes with margins left, right, below, above (inches)."""
    from matplotlib.figure import Figure

    (width, height), (left, right, below, above) = size, sides
    figure = Figure(figsize=size, dpi=DPI)
    # Distances are fixed, because layout engines draw everything twice.
    figure.set_layout_engine("none")
    grid |= {"left": left / width, "right": 1.0 - right / width, "bottom": below / height, "top": 1.0 - above / height}
    axes = figure.subplots(rows, columns, sharex=sharex, sharey=sharey, squeeze=False, gridspec_kw=grid)
    heading = shortened(title, round(11.9 * (width - left)))
    figure.text(left / width, 1.0 - 0.27 / height, heading, fontsize=11, fontweight="bold", parse_math=False)
    return figure, axes


def png(figure: Any, level: int = 6) -> bytes:
    """Return a figure as the bytes of a PNG file; level: of compression."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    # One canvas for all that is drawn on a figure, since it knows the sizes of words.
    canvas: Any = figure.canvas if isinstance(figure.canvas, FigureCanvasAgg) else FigureCanvasAgg(figure)
    canvas.draw()
    return encoded(np.asarray(canvas.buffer_rgba()), figure.dpi, level)


def encoded(pixels: NDArray[np.uint8], dpi: float, level: int) -> bytes:
    """Return pixels (height, width, 4) as the bytes of a PNG file. Rows are compressed unfiltered: filters chosen row by
    row, as libraries choose them, take five times as long, and curves on white are hardly smaller for it."""
    height, width = pixels.shape[:2]
    rows = np.zeros((height, 1 + 4 * width), np.uint8)
    rows[:, 1:] = pixels.reshape(height, 4 * width)
    per_metre = round(dpi / 0.0254)
    parts = (
        (b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0)),
        (b"pHYs", struct.pack(">IIB", per_metre, per_metre, 1)),
        (b"IDAT", zlib.compress(rows.tobytes(), level)),
        (b"IEND", b""),
    )
    sealed = (
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)) for kind, data in parts
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(sealed)


def address(picture: bytes) -> str:
    """Return a PNG file as a data URL."""
    return f"data:image/png;base64,{b64encode(picture).decode()}"


def save(figure: Any, path: Path) -> Path:
    """Write a figure to `path`, in a folder that exists, and return the path."""
    with atomic_write(path) as hidden:
        # Fast compression: the files are small either way.
        hidden.write_bytes(png(figure, 1))
    return path
