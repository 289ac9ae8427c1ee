"""Tick labels as plain text, because matplotlib's math parser takes longer than the rest of a figure."""

import math
import re
from itertools import compress
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.ticker import LogFormatterSciNotation, ScalarFormatter
from numpy.typing import NDArray

RAISED = str.maketrans("0123456789-−", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁻")
POWERS = (-2, 4)
"""The powers of ten beyond which labels show their common power above the axis."""


def as_text(formula: str) -> str:
    """Return a tick's formula as plain text: 10⁻³ for $\\mathdefault{10^{-3}}$."""
    raised = re.sub(r"\^\{([-−0-9]+)\}", lambda power: power[1].translate(RAISED), formula)
    return re.sub(r"\$|\\mathdefault|[{}]", "", raised).replace(r"\times", "×")


class Even(ScalarFormatter):
    """Labels of a linear axis."""

    def __init__(self) -> None:
        super().__init__(useMathText=False)
        self.set_powerlimits(POWERS)

    def get_offset(self) -> str:
        """Return the power of ten shown above the axis."""
        self.set_useMathText(True)
        try:
            return as_text(super().get_offset())
        finally:
            self.set_useMathText(False)


class Decades(LogFormatterSciNotation):
    """Labels of a logarithmic axis."""

    def __call__(self, x: float, pos: int | None = None) -> str:
        """Return the label of a tick."""
        return as_text(super().__call__(x, pos))


def label_ticks(axis: Any, log: bool = False) -> None:
    """Label the ticks of an axis of a plot (its `xaxis` or `yaxis`) as plain text."""
    axis.set_major_formatter(Decades() if log else Even())
    if log:
        axis.set_minor_formatter(Decades())


class Ticks(Artist):
    """Draws an axis as Matplotlib does, but with one tick of each kind that stands at all places together: most of the time
    of a figure would go into making, copying and measuring a tick for each place. Labels are plain text, below the axes or
    left of them."""

    def __init__(self, axis: Any) -> None:
        super().__init__()
        self._axis = axis
        self.set_zorder(axis.get_zorder())
        axis.set_visible(False)
        axis.axes.add_artist(self)

    def draw(self, renderer: Any) -> None:
        """Draw grid, ticks, their labels, the label of the axis and the power of ten."""
        axis = self._axis
        dots, level = axis.axes.figure.dpi / 72.0, axis.axis_name == "x"
        scale = axis.get_transform()
        low, high = np.sort(scale.transform(np.array(axis.get_view_interval())))
        slack = 1e-10 * (high - low)
        # The outer edge of the labels.
        edge = math.inf
        for get, ticker, places in (
            (axis.get_major_ticks, axis.major, np.asarray(axis.get_majorticklocs())),
            (axis.get_minor_ticks, axis.minor, np.asarray(axis.get_minorticklocs())),
        ):
            labels, at = ticker.formatter.format_ticks(places), scale.transform(places)
            shown = (low - slack <= at) & (at <= high + slack)
            if shown.any():
                edge = min(edge, _draw_ticks(renderer, get(1)[0], places[shown], list(compress(labels, shown)), level))
        if axis.label.get_text():
            spine = axis.axes.spines["bottom" if level else "left"].get_window_extent()
            x, y = axis.label.get_position()
            outside = min(edge, spine.y0 if level else spine.x0) - axis.labelpad * dots
            axis.label.set_position((x, outside) if level else (outside, y))
            axis.label.draw(renderer)
        if power := axis.major.formatter.get_offset():
            (x, _), box, pad = axis.offsetText.get_position(), axis.axes.bbox, axis.OFFSETTEXTPAD * dots
            axis.offsetText.set_position((x, min(edge, box.ymin) - pad if level else box.ymax + pad))
            axis.offsetText.set_text(power)
            axis.offsetText.draw(renderer)


def _draw_ticks(renderer: Any, tick: Any, places: NDArray[np.float64], labels: list[str], level: bool) -> float:
    """Draw ticks and grid lines at places of an axis, and their labels; level: it is the x axis. Return the coordinate
    (pixels) of the labels' outer edge, inf if there is none."""
    # Grid lines are one line from edge to edge, with gaps.
    across, along = np.tile([0.0, 1.0, np.nan], len(places)), np.repeat(places, 3)
    tick.gridline.set_data(*((along, across) if level else (across, along)))
    tick.gridline.draw(renderer)
    zeros = np.zeros(len(places))
    points = (places, zeros) if level else (zeros, places)
    tick.tick1line.set_data(*points)
    tick.tick1line.draw(renderer)
    text = tick.label1
    if not text.get_visible() or not any(labels):
        return math.inf
    font = text.get_fontproperties().copy()
    context = renderer.new_gc()
    context.set_foreground(text.get_color())
    # The layout of `matplotlib.text.Text`: a line is at least as tall as "lp".
    _, tall, deep = _extent(renderer, "lp", font)
    edge = math.inf
    for (x, y), label in zip(text.get_transform().transform(np.column_stack(points)), labels, strict=True):
        if label:
            width, height, descent = _extent(renderer, label, font)
            height, descent = max(height, tall), max(descent, deep)
            edge = min(edge, y - height if level else x - width)
            # Centred below the tick, or right-aligned with the middle of the line at its height.
            x, y = (x - 0.5 * width, y - (height - descent)) if level else (x - width, y - 0.5 * (height - descent))
            renderer.draw_text(context, x, renderer.height - y, label, font, 0.0)
    context.restore()
    return edge


def _extent(renderer: Any, words: str, font: Any) -> tuple[float, float, float]:
    """Return width, height and descent (pixels) of a line of text."""
    key = words, font, renderer.dpi
    if key not in _extents:
        _extents[key] = renderer.get_text_width_height_descent(words, font, False)
    return _extents[key]


_extents: dict[tuple[str, Any, float], tuple[float, float, float]] = {}
"""Sizes of lines of text in pixels, by text, font and dots per inch, since many figures have the same labels."""
