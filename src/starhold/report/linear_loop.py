"""The section of the page on the linear loop near the target: its margins, and Bode and Nichols plots."""

import math
from collections.abc import Sequence
from html import escape
from typing import Any, NamedTuple, Self

import numpy as np

from starhold.analysis.linear import AXES, Linear
from starhold.analysis.margins import Margins, Response, margins, response
from starhold.errors import InputError
from starhold.report.commands import Cell, Column, Table
from starhold.report.plots import colour
from starhold.report.tables import note, table_html
from starhold.report.text import number_text
from starhold.scenario.reading import Scenario
from starhold.studies.flight import Flight
from starhold.studies.linear import linear_of

NOTE = (
    "The loop near rest on a fixed target, exact between control instants under held torque, with the gains of the file, "
    "without a torque limit and without computational delay. One axis is opened at a time; the others "
    "stay closed. The margins are computed in floating point and prove nothing."
)
DASHES = {"x": "none", "y": "7 3", "z": "2 3"}
DIGITS = 4
POINTS = 4
"""The number of frequencies of the response per point of a curve."""
DEEPEST = 60.0
"""The gain below 0 dB (dB) to which plots extend."""
WIDTH, HEIGHT, LEFT, BOTTOM = 430.0, 250.0, 52.0, 36.0


class Known(NamedTuple):
    """The linear loop of the law with this number, its response and margins; or the reason `why` there is none."""

    number: int
    name: str
    linear: Linear | None = None
    shown: Response | None = None
    margins: Sequence[Margins] = ()
    why: str = ""

    @classmethod
    def of(cls, number: int, name: str, linear: Linear) -> Self:
        """Return a linear loop with its response and margins."""
        shown = response(linear)
        return cls(number, name, linear, shown, margins(linear, shown))


def section(scenario: Scenario, flights: Sequence[Flight]) -> str:
    """Return the section as HTML; "" where no law has a linear form."""
    known = [_know(scenario, number, flight.name) for number, flight in enumerate(flights)]
    if not any(one.linear for one in known):
        return ""
    table = table_html(margins_table(known))
    without = "".join(note(f"{one.name} has no linear form: {one.why}.") for one in known if one.linear is None)
    left = sorted({text for one in known if one.linear for text in one.linear.left_out})
    apart = f" Left out: {escape(', '.join(left))}." if left else ""
    return (
        f'<p class="note">{NOTE}{apart}</p>\n{table}\n{without}'
        f'<div class="plot"><h3>Bode and Nichols plots of the loop, opened about each axis</h3>{_plots(known)}</div>'
        '<p class="note">Solid: about x, dashed: y, dotted: z. The cross in the Nichols plot is the point −1.</p>'
    )


def margins_table(known: Sequence[Known]) -> Table:
    """Return a table with a row per law and axis."""
    heads = ("gain margin|dB", "phase margin|deg", "delay margin|s", "crossover|rad/s", "peak of |1/(1 + L)||")
    named = [Column(name, unit, ">") for name, _, unit in (head.rpartition("|") for head in heads)]
    return Table([Column("law"), Column("axis"), *named], [row for one in known for row in _rows(one)])


def _know(scenario: Scenario, number: int, name: str) -> Known:
    try:
        linear = linear_of(scenario, scenario.pick(name))
    except InputError as error:
        return Known(number, name, why=error.given)
    return Known.of(number, name, linear)


def _rows(one: Known) -> list[list[Any]]:
    rows: list[list[Any]] = []
    for about in one.margins:
        numbers = (math.degrees(about.phase), about.delay, about.crossover, about.sensitivity)
        gain, *rest = _decibels(about), *(number_text(x, DIGITS) if math.isfinite(x) else "—" for x in numbers)
        if one.linear is not None and not one.linear.is_stable:
            gain, rest[:2] = "not stable", ["—", "—"]
        rows.append([Cell(one.name, "name", one.number), about.axis, gain, *rest])
    return rows


def _decibels(about: Margins) -> str:
    """Return the upper gain margin (dB), and the lower one where a smaller gain also loses stability."""
    up = f"{20.0 * math.log10(about.gain):.1f}" if math.isfinite(about.gain) else "none"
    return f"{up}, −{-20.0 * math.log10(about.less):.1f}" if about.less > 0.0 else up


class _Panel(NamedTuple):
    """A pair of axes in the picture: its left edge, ranges (from, to), labels and ticks."""

    left: float
    x: tuple[float, float]
    y: tuple[float, float]
    words: tuple[str, str]
    ticks: tuple[dict[float, str], Sequence[float]]

    def at(self, x: Any, y: Any) -> tuple[Any, Any]:
        across = (np.asarray(x) - self.x[0]) / (self.x[1] - self.x[0])
        up = (np.asarray(y) - self.y[0]) / (self.y[1] - self.y[0])
        return self.left + LEFT + across * (WIDTH - LEFT - 12.0), 8.0 + (1.0 - up) * (HEIGHT - BOTTOM - 8.0)


def _plots(known: Sequence[Known]) -> str:
    curves: list[tuple[int, str, Any, Any, Any]] = []
    for one in known:
        if one.shown is not None:
            w = np.log10(one.shown.frequencies[::POINTS])
            for axis, loop in zip(AXES, one.shown.loops[:, ::POINTS], strict=True):
                size = 20.0 * np.log10(np.maximum(np.abs(loop), 1e-12))
                curves.append((one.number, axis, w, size, np.degrees(_unwrapped(loop))))
    low = min(float(w[0]) for _, _, w, _, _ in curves)
    high = max(float(w[-1]) for _, _, w, _, _ in curves)
    near = [np.abs(size) <= DEEPEST for _, _, _, size, _ in curves]
    turns = np.concatenate([turn[inside] for (*_, turn), inside in zip(curves, near, strict=True)])
    first, last = math.floor(turns.min(initial=-181.0) / 90.0), math.ceil(turns.max(initial=-90.0) / 90.0)
    phases = (90.0 * first, 90.0 * last)
    decades = {float(k): f"1e{k}" for k in range(math.ceil(low), math.floor(high) + 1, 1 + round((high - low) / 6))}
    sizes, angles = range(-60, 61, 20), range(90 * first, 90 * last + 1, 90)
    gain, phase, frequency = "gain, dB", "phase, deg", "frequency, rad/s"
    by_angle = {float(angle): f"{angle}" for angle in angles}
    panels = (
        _Panel(0.0, (low, high), (-DEEPEST, DEEPEST), (frequency, gain), (decades, sizes)),
        _Panel(WIDTH, (low, high), phases, (frequency, phase), (decades, angles)),
        _Panel(2 * WIDTH, phases, (-DEEPEST, DEEPEST), (phase, gain), (by_angle, sizes)),
    )
    drawn = "".join(_frame(panel) for panel in panels)
    for number, axis, w, size, turn in curves:
        for k, (panel, x, y) in enumerate(zip(panels, (w, w, turn), (size, turn, size), strict=True)):
            drawn += _curve(panel, x, y, k, colour(number), DASHES[axis])
    x, y = panels[2].at(-180.0, 0.0)
    drawn += f'<path d="M{x - 5:.0f} {y:.0f}h10M{x:.0f} {y - 5:.0f}v10" stroke="currentColor" stroke-width="1.5"/>'
    clips = "".join(
        f'<clipPath id="linear{k}"><rect x="{p.left + LEFT:g}" y="8" width="{WIDTH - LEFT - 12:g}" '
        f'height="{HEIGHT - BOTTOM - 8:g}"/></clipPath>'
        for k, p in enumerate(panels)
    )
    return (
        f'<div class="wide"><svg viewBox="0 0 {3 * WIDTH:g} {HEIGHT:g}" style="min-width:{2 * WIDTH:g}px;width:100%" '
        f'role="img" aria-label="Bode and Nichols plots" font-size="11" fill="currentColor">'
        f"<defs>{clips}</defs>{drawn}</svg></div>"
    )


def _unwrapped(loop: Any) -> Any:
    """Return the unwrapped phase, within (-270, 90] degrees at the highest gain."""
    phase = np.unwrap(np.angle(loop))
    return phase - 2.0 * math.pi * np.ceil((phase[0] - 0.5 * math.pi) / (2.0 * math.pi))


def _frame(panel: _Panel) -> str:
    (x0, y0), (x1, y1) = panel.at(panel.x[0], panel.y[0]), panel.at(panel.x[1], panel.y[1])
    lines, texts = "", ""
    for value, word in panel.ticks[0].items():
        x = panel.at(value, panel.y[0])[0]
        lines += f"M{x:.1f} {y0:.1f}V{y1:.1f}"
        texts += f'<text x="{x:.1f}" y="{y0 + 14:.1f}" text-anchor="middle">{word}</text>'
    for value in panel.ticks[1]:
        y = panel.at(panel.x[0], value)[1]
        lines += f"M{x0:.1f} {y:.1f}H{x1:.1f}"
        texts += f'<text x="{x0 - 6:.1f}" y="{y + 4:.1f}" text-anchor="end">{value:g}</text>'
    middle = 0.5 * (y0 + y1)
    return (
        f'<path d="{lines}" stroke="currentColor" stroke-opacity="0.15" fill="none"/>{texts}'
        f'<text x="{0.5 * (x0 + x1):.1f}" y="{y0 + 30:.1f}" text-anchor="middle">{panel.words[0]}</text>'
        f'<text transform="translate({panel.left + 12:g} {middle:.1f}) rotate(-90)" text-anchor="middle">'
        f"{panel.words[1]}</text>"
    )


def _curve(panel: _Panel, x: Any, y: Any, k: int, shade: str, dashes: str) -> str:
    points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(*panel.at(x, y), strict=True))
    return (
        f'<polyline points="{points}" clip-path="url(#linear{k})" fill="none" stroke="{shade}" stroke-width="1.6" '
        f'stroke-dasharray="{dashes}"/>'
    )
