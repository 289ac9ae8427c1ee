"""One page that tells a whole comparison, opens offline and loads nothing."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from importlib import metadata, resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from starhold.analysis.metrics import DECADES, MEASURES
from starhold.analysis.ranking import ORDER, columns, ranked, shown, winners
from starhold.models.craft import whole
from starhold.report.flight import Flight, colour, number_text
from starhold.report.plots import ACCURACIES, Panel, Plot, collect, steps_within
from starhold.report.proved import section as proved
from starhold.report.proved import swatch
from starhold.report.transients import section as transients

if TYPE_CHECKING:
    from starhold.scenario.reading import Scenario

POINTS = 1500
"""Samples of a curve."""
FRAMES = 180
"""Attitudes of the turning body; the page turns it smoothly from one to the next."""
EARLY = 1.6
"""Frame k of n shows the time T (k/n)^EARLY: most of the motion is at the start."""
MANY = 9
"""Numbers of a setting beyond which only the first and the last are shown."""
SECONDS = 14.0
"""How long the animation plays."""

BEST, LOST = '<td class="best">', '<tr class="lost">'
_POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"


def write_page(path: Path, scenario: Scenario, flights: Sequence[Flight]) -> None:
    """Write the report of a scenario's flights as one HTML file; the same flights give the same bytes."""
    path.write_text(render(scenario, flights), encoding="utf-8", newline="\n")


def render(scenario: Scenario, flights: Sequence[Flight]) -> str:
    """The report as HTML text. Whatever comes from files is escaped."""
    from plotly.offline import get_plotlyjs

    title = escape(scenario.name)
    data = _data(scenario, flights)
    body = [
        f"<h1>{title}</h1>",
        f'<p class="lead">{escape(scenario.table.description)}</p>' if scenario.table.description else "",
        _lost(flights),
        _ranking(flights),
        transients(flights),
        proved(flights),
        "<h2>The turning body</h2>",
        _views(flights, data["scene"]),
        "<h2>Over time</h2>",
        '<p class="note">Click a law in the legend to hide it, double-click to see it alone; drag to zoom, '
        "double-click to zoom out.</p>",
        *(_plot(plot) for plot in data["plots"]),
        _laws(flights),
        _settings(scenario),
        _columns(flights),
        f"<details><summary>Scenario text</summary><pre>{escape(scenario.text)}</pre></details>",
        f"<footer>{escape(_versions(scenario))}</footer>",
    ]
    # A script's text ends at the first "</", also within a string.
    embedded = json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    return "\n".join(
        [
            "<!DOCTYPE html>",
            '<html lang="en"><head><meta charset="utf-8">',
            f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            f"<title>{title} — starhold</title>",
            f"<style>\n{_asset('page.css')}</style></head><body>",
            *(part for part in body if part),
            f'<script type="application/json" id="data">{embedded}</script>',
            f"<script>{get_plotlyjs()}</script>",
            f"<script>\n{_asset('plots.js')}</script>",
            f"<script>\n{_asset('body.js')}</script>",
            "</body></html>\n",
        ]
    )


def _asset(name: str) -> str:
    return (resources.files("starhold.report") / "assets" / name).read_text(encoding="utf-8")


# --- text -------------------------------------------------------------------------------------------------------------


def _lost(flights: Sequence[Flight]) -> str:
    lost = [f"{flight.name} (at {flight.lost:.6g} s)" for flight in flights if flight.lost is not None]
    if not lost:
        return ""
    return f'<p class="alarm">Diverged, and so without final values: {escape(", ".join(lost))}.</p>'


def _ranking(flights: Sequence[Flight]) -> str:
    results = {flight.name: flight.metrics for flight in flights}
    metrics = columns(results)
    best = winners(results)
    numbers = {flight.name: number for number, flight in enumerate(flights)}
    head = "".join(
        f'<th scope="col" title="{escape(MEASURES[metric].meaning)}">{escape(MEASURES[metric].heading)}'
        f"<small>{escape(MEASURES[metric].unit) or '&nbsp;'}</small></th>"
        for metric in metrics
    )
    rows: list[str] = []
    for place, name in enumerate(ranked(results), 1):
        flight = flights[numbers[name]]
        lost = flight.lost is not None
        cells = "".join(
            f"{BEST if name in best[metric] else '<td>'}{shown(metric, flight.metrics.get(metric))}</td>"
            for metric in metrics
        )
        fate = f"diverged at {flight.lost:.6g} s" if lost else flight.law if flight.law != name else ""
        rows.append(
            f"{LOST if lost else '<tr>'}<td>{place}</td>"
            f'<th scope="row" style="text-align:left">{swatch(numbers[name])}{escape(name)}'
            f"{f'<small>{escape(fate)}</small>' if fate else ''}</th>{cells}</tr>"
        )
    order = ", then ".join(MEASURES[metric].heading for metric in ORDER)
    return (
        '<h2>Ranking</h2>\n<div class="wide"><table><thead><tr><th scope="col">#</th>'
        f'<th scope="col" style="text-align:left">law</th>{head}</tr></thead>\n'
        f"<tbody>{''.join(rows)}</tbody></table></div>\n"
        f'<p class="note">Ordered by {escape(order)}; less is better in every column, and the best value is marked. '
        "A dash: never reached, or not measured.</p>"
    )


def _views(flights: Sequence[Flight], scene: Mapping[str, Any]) -> str:
    views = "".join(
        f'<div class="view"><div><span>{swatch(number)}{escape(flight.name)}</span><output></output></div>'
        f'<canvas role="img" aria-label="Attitude under {escape(flight.name)}"></canvas></div>'
        for number, flight in enumerate(flights)
    )
    return (
        '<p class="note">Seen in the axes of the target (dashed, x* y* z*); solid axes are the body\'s, and the angle '
        "is what is left to turn. The outline is that of the uniform box with this inertia. "
        "Drag a view to look from elsewhere.</p>\n"
        '<div class="player"><button id="play" type="button">Play</button>'
        f'<input id="moment" type="range" min="0" max="{len(scene["times"]) - 1}" step="0.01" value="0" '
        'aria-label="time">'
        f'<output id="clock"></output></div>\n<div class="views">{views}</div>'
    )


def _plot(plot: Mapping[str, Any]) -> str:
    dashed = f"<span>– – {escape(plot['dashed'])}</span>" if plot["dashed"] else ""
    return f'<div class="plot"><h3>{escape(plot["title"])}{dashed}</h3><div id="{plot["name"]}"></div></div>'


def _laws(flights: Sequence[Flight]) -> str:
    rows = "".join(
        f'<tr><th scope="row">{swatch(number)}{escape(flight.name)}</th><td>{escape(flight.law)}</td>'
        f"<td>{', '.join(f'{escape(key)} = {escape(text)}' for key, text in flight.gains.items()) or '—'}</td></tr>"
        for number, flight in enumerate(flights)
    )
    head = '<th scope="col">name</th><th scope="col">type</th><th scope="col">gains</th>'
    return (
        f'<h2>Laws</h2>\n<div class="wide"><table class="text"><thead><tr>{head}</tr></thead>'
        f"<tbody>{rows}</tbody></table></div>"
    )


def _settings(scenario: Scenario) -> str:
    from pydantic import BaseModel

    parts: list[str] = []
    for name in type(scenario.table).model_fields:
        table = getattr(scenario.table, name)
        if isinstance(table, BaseModel):
            parts.append(_table(name, table))
    return f'<h2>Spacecraft and settings</h2>\n<div class="columns">{"".join(parts)}</div>'


def _table(name: str, table: Any) -> str:
    """One table of the scenario with the descriptions its schema holds; keys without a value are left out."""
    properties = type(table).model_json_schema()["properties"]
    rows: list[str] = []
    for key in type(table).model_fields:
        value = getattr(table, key)
        if value is not None:
            meaning = str(properties.get(key, {}).get("description", "")).replace("^2", "²").replace("^3", "³")
            rows.append(f"<tr><td>{escape(key)}</td><td>{escape(_value(value))}</td><td>{escape(meaning)}</td></tr>")
    title = name.replace("_", " ")
    return f'<section><h3>{escape(title)}</h3><table class="text"><tbody>{"".join(rows)}</tbody></table></section>'


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float) and math.isinf(value):
        return "none"
    if isinstance(value, tuple) and len(value) > MANY:
        return f"{number_text(value[0])} to {number_text(value[-1])}, {len(value)} values"
    return number_text(value) if isinstance(value, (int, float, tuple, list, np.ndarray)) else str(value)


def _columns(flights: Sequence[Flight]) -> str:
    measures = [MEASURES[metric] for metric in columns({flight.name: flight.metrics for flight in flights})]
    items = "".join(
        f"<dt>{escape(measure.heading)}{f', {escape(measure.unit)}' if measure.unit else ''}</dt>"
        f"<dd>{escape(measure.meaning)}</dd>"
        for measure in measures
    )
    return f"<h2>How to read the columns</h2>\n<dl>{items}</dl>"


def _versions(scenario: Scenario) -> str:
    from starhold import __version__

    libraries = ", ".join(f"{name} {metadata.version(name)}" for name in ("numba", "numpy", "plotly"))
    return f"starhold {__version__}, {libraries}; seed {scenario.table.simulation.seed}."


# --- data -------------------------------------------------------------------------------------------------------------


def _data(scenario: Scenario, flights: Sequence[Flight]) -> dict[str, Any]:
    """What the scripts of the page read."""
    plots = collect(flights, POINTS, scenario)
    quaternion = Plot("quaternion", "error quaternion", [*plots.scalar.panels, *plots.attitude.panels])
    drawn = (plots.angle, quaternion, plots.rate, plots.torque, *plots.further)
    return {
        "laws": [{"name": flight.name, "colour": colour(number)} for number, flight in enumerate(flights)],
        "times": _numbers(plots.times),
        "plots": [*({**_over_time(plot, flights), "marks": plots.marks} for plot in drawn), _accuracy(flights)],
        "scene": _scene(scenario, flights),
    }


def _over_time(plot: Plot, flights: Sequence[Flight]) -> dict[str, Any]:
    numbers = list(range(len(flights)))
    if plot.name == "torque":
        # Torques that chatter go behind those that do not, which they would hide.
        numbers.sort(key=lambda i: -float(flights[i].metrics.get("chatter") or 0.0))
    panels = [_panel(panel, numbers, thin=plot.name == "torque") for panel in plot.panels]
    return {"name": plot.name, "title": plot.title, "dashed": plot.dashed, "xlabel": "time, s", "panels": panels}


def _panel(panel: Panel, order: list[int], thin: bool = False) -> dict[str, Any]:
    # Later laws get thinner lines, so that equal curves show as a line within a line.
    slimmer = [1.0 - 0.5 * number / max(len(order) - 1, 1) for number in range(len(order))]
    return {
        "label": panel.label,
        "curves": [_numbers(curve) for curve in panel.curves],
        "widths": [round((1.7 if thin else 2.6) * share, 2) for share in slimmer],
        "order": order,
        "log": panel.log,
        # Ticks at powers of ten where there are several of them, else where Plotly likes.
        "ticks": max(1, math.ceil(panel.decades() / 6.0)) if panel.decades() > 2.0 else None,
        "levels": _numbers(panel.levels),
        "span": None if panel.span is None else _numbers(panel.span),
    }


def _accuracy(flights: Sequence[Flight]) -> dict[str, Any]:
    order = list(range(len(flights)))
    panels: list[dict[str, Any]] = []
    for kind, label in ACCURACIES:
        steps = [steps_within(flight, kind) for flight in flights]
        panels.append({**_panel(Panel(f"steps to {label}", []), order), "curves": steps, "widths": [2.0] * len(order)})
    period = flights[0].recording.attrs["control_period"]
    return {
        "name": "accuracy",
        "title": "control steps needed to stay within 10⁻ᵏ",
        "dashed": "",
        "xlabel": f"k; a control step lasts {period:g} s",
        "panels": panels,
        "x": list(DECADES),
        "split": True,
        "markers": True,
    }


def _scene(scenario: Scenario, flights: Sequence[Flight]) -> dict[str, Any]:
    longest = max((flight.recording["time"] for flight in flights), key=len)
    # Some frames of a short run would be equal; each sample shows once.
    places = np.unique(np.rint((len(longest) - 1) * np.linspace(0.0, 1.0, FRAMES + 1) ** EARLY).astype(int))
    attitudes: list[list[list[float | None]]] = []
    for flight in flights:
        q = flight.recording["attitude_error"]
        attitudes.append([_numbers(q[place], 4) for place in places if place < len(q)] or [[1.0, 0.0, 0.0, 0.0]])
    times = longest[places] if len(places) > 1 else np.array([0.0, 1.0])
    size, axes = _box(whole(scenario.craft))
    return {
        "times": _numbers(times),
        "digits": max(0, min(3, 3 - math.floor(math.log10(max(float(times[-1]), 1e-3))))),
        "attitudes": attitudes,
        "size": _numbers(size, 4),
        "axes": [_numbers(row) for row in axes],
        "seconds": SECONDS,
    }


def _box(inertia: Any) -> tuple[Any, Any]:
    """Half edges of the uniform box with this inertia, the longest 0.95, and its axes as columns, in body axes.

    For edges 2a, 2b, 2c a moment is proportional to b^2 + c^2, thus a^2 to the other two moments' sum less its own.
    Edges that would vanish (a flat body has them) are shown as a tenth of the longest.
    """
    full = np.asarray(inertia, dtype=float)
    if full.ndim == 1:
        moments, axes = full, np.eye(3)
    else:
        moments, axes = np.linalg.eigh(full)
        # The library is free in the signs; a picture should be the same everywhere.
        axes = axes * np.where(np.take_along_axis(axes, np.abs(axes).argmax(axis=0)[None], axis=0)[0] < 0.0, -1.0, 1.0)
        axes[:, 2] *= np.sign(np.linalg.det(axes))
    edges = np.sqrt(np.maximum(moments.sum() - 2.0 * moments, 0.0))
    return 0.95 * np.maximum(edges / edges.max(), 0.1), axes


def _numbers(values: Iterable[float], digits: int = 6) -> list[float | None]:
    """Numbers of a few digits for JSON, which has none for what is not finite."""
    return [float(f"{v:.{digits}g}") if math.isfinite(v) else None for v in np.asarray(list(values), dtype=float).tolist()]
