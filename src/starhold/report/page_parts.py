"""The parts that pages about any body are made of: text, tables, and data for their scripts."""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from html import escape
from importlib import metadata, resources
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from starhold.report.commands import Cell, Column, Table
from starhold.report.plots import Mark, Panel, Plot, back_to_front, colour
from starhold.report.proved import swatch
from starhold.report.tables import titled
from starhold.report.text import lost_text, number_text, unknown_text, value_text
from starhold.scenario.checking import read_toml
from starhold.studies.flight import Flight

if TYPE_CHECKING:
    from starhold.parts.part import Fitted
    from starhold.scenario.reading import Scenario

POINTS = 1500
"""Samples of a curve."""
MANY = 9
"""Numbers of a setting beyond which only the first and the last are shown."""

BEST, LOST = '<td class="best">', '<tr class="lost">'
_POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:; worker-src blob:"
WITH_PLOTLY = ("planes.js", "campaign.js")
"""Scripts that draw with Plotly; plots over time need less."""


def document(
    scenario: Scenario,
    sections: Iterable[str],
    data: Mapping[str, Any],
    scripts: Sequence[str],
    footer: str,
    living: Mapping[str, Any] | None = None,
) -> str:
    """A page of these sections, headed by the scenario's name and ended by its text; the scripts, of the assets, read the
    data, which names the laws. living: what its scenario flies again with, None for a page that does not."""
    title = escape(scenario.name)
    body = [
        f"<h1>{title}</h1>",
        f'<p class="lead">{escape(scenario.table.description)}</p>' if scenario.table.description else "",
        *sections,
        f"<details><summary>Scenario text</summary><pre>{escape(scenario.text)}</pre></details>",
        f"<footer>{escape(footer)}</footer>",
    ]
    libraries, used = [], [*scripts]
    if any(name in WITH_PLOTLY for name in scripts):
        from plotly.offline import get_plotlyjs

        libraries.append(get_plotlyjs())
        used.insert(0, "look.js")
    if data["plots"]:
        # Its licence goes with every copy.
        libraries.append(f"/*!\n{_asset('uplot.LICENSE').strip()}\n*/\n{_asset('uplot.js')}")
        used.insert(0, "plots.js")
    embedded = [_embedded("data", data)]
    if living is not None:
        embedded += [_embedded("living", living), f'<script type="text/plain" id="flight">\n{_asset("flight.js")}</script>']
        body.append(DIALS)
        used += ["living.js", "sliders.js"]
    ending = [
        *embedded,
        *(f"<script>{library}</script>" for library in libraries),
        f"<script>\n{_asset('page.js')}{_asset('tables.js')}</script>",
        f"<script>\n{''.join(_asset(name) for name in used)}</script>",
    ]
    return plain_document(scenario.name, [*body, *ending])


def plain_document(title: str, body: Iterable[str]) -> str:
    """A page of these parts, those that are empty left out, with the style and the title of all pages."""
    return "\n".join(
        [
            "<!DOCTYPE html>",
            '<html lang="en"><head><meta charset="utf-8">',
            f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            f"<title>{escape(title)} — starhold</title>",
            f"<style>\n{_asset('uplot.css')}{_asset('page.css')}</style></head><body>",
            *(part for part in body if part),
            "</body></html>\n",
        ]
    )


DIALS = """\
<button id="dials-button" type="button" aria-expanded="false" aria-controls="dials">Fly again</button>
<aside id="dials" aria-label="Fly again with other numbers">
<header><h2>Fly again</h2><button id="dials-close" type="button" aria-label="close">×</button></header>
<p class="tools"><button id="dials-reset" type="button">Reset</button>\
<button id="dials-copy" type="button">Copy as TOML</button>\
<button id="dials-link" type="button">Copy link</button></p>
<p class="note" id="followed"></p><p class="alarm" id="unsound" hidden></p><div id="staying"></div>
<div id="groups"></div>
</aside>"""


def _embedded(name: str, data: Mapping[str, Any]) -> str:
    """Data for scripts. A script's text ends at the first "</", also within a string."""
    embedded = json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    return f'<script type="application/json" id="{name}">{embedded}</script>'


def _asset(name: str) -> str:
    return (resources.files("starhold.report") / "assets" / name).read_text(encoding="utf-8")


def law_data(flights: Sequence[Flight]) -> list[dict[str, str]]:
    """Names and colours."""
    return [{"name": flight.name, "colour": colour(number)} for number, flight in enumerate(flights)]


def views(flights: Sequence[Flight], frames: int, what: str, note: str) -> str:
    """A view of each law in three dimensions, and the player for all of them."""
    boxes = "".join(
        f'<div class="view"><div><span>{swatch(number)}{escape(flight.name)}</span><output></output></div>'
        f'<canvas role="img" aria-label="{what} under {escape(flight.name)}"></canvas></div>'
        for number, flight in enumerate(flights)
    )
    return (
        f'<p class="note">{note} Drag a view to look from elsewhere.</p>\n'
        '<div class="player"><button id="play" type="button">Play</button>'
        f'<input id="moment" type="range" min="0" max="{frames - 1}" step="0.01" value="0" '
        'aria-label="time">'
        f'<output id="clock"></output></div>\n<div class="views">{boxes}</div>'
    )


OVER_TIME = (
    "<h2>Over time</h2>\n"
    '<p class="note">Click a law in the legend to hide it, double-click to see it alone; drag to zoom, '
    "double-click to zoom out.</p>"
)


def over_time_heading(transient: float | None) -> str:
    """The heading of the plots over time, with a switch to the transient (s) where there is one."""
    if transient is None:
        return OVER_TIME
    first = f"{float(f'{transient:.3g}'):g}"
    return (
        f'{OVER_TIME}\n<p class="switch"><button id="whole" type="button" aria-pressed="true">Whole run</button>'
        f'<button id="transient-only" type="button" aria-pressed="false">Transient, first {first} s</button></p>'
    )


def over_time(plot: Plot, flights: Sequence[Flight], marks: Sequence[Mark] = ()) -> dict[str, Any]:
    """A plot over time for the script that draws it."""
    order = back_to_front(flights, plot)
    panels = [panel_data(panel, order, thin=plot.chatters) for panel in plot.panels]
    return {
        "name": plot.name,
        "title": plot.title,
        "dashed": plot.dashed,
        "xlabel": f"time, {plot.clock}",
        "panels": panels,
        "marks": [(mark.time, mark.word) for mark in marks],
    }


def lost_alarm(flights: Sequence[Flight]) -> str:
    """List the motions that diverged, and the metrics that are not numbers; empty if there are none."""
    lost = [f"{flight.name} (at {lost_text(flight)})" for flight in flights if flight.lost is not None]
    sentences = [f"Diverged, and so without final values: {', '.join(lost)}"] if lost else []
    sentences += [said for flight in flights if (said := unknown_text(flight))]
    return "".join(f'<p class="alarm">{escape(said)}.</p>' for said in sentences)


def ranking(flights: Sequence[Flight]) -> str:
    """The ranked table."""
    metric_set = flights[0].metric_set
    results = {flight.name: flight.metrics for flight in flights}
    metrics = metric_set.columns(results)
    best = metric_set.winners(results)
    numbers = {flight.name: number for number, flight in enumerate(flights)}
    head = "".join(
        f'<th scope="col" title="{escape(measure.meaning)}">{escape(measure.heading)}'
        f"<small>{escape(measure.unit) or '&nbsp;'}</small></th>"
        for measure in (metric_set.measures[metric] for metric in metrics)
    )
    rows: list[str] = []
    for place, name in enumerate(metric_set.ranked(results), 1):
        flight = flights[numbers[name]]
        lost = flight.lost is not None
        cells = "".join(
            f"{BEST if name in best[metric] else '<td>'}{metric_set.cell(metric, flight.metrics)}</td>" for metric in metrics
        )
        fate = f"diverged at {lost_text(flight)}" if lost else flight.law if flight.law != name else ""
        rows.append(
            f"{LOST if lost else '<tr>'}<td>{place}</td>"
            f'<th scope="row" style="text-align:left">{swatch(numbers[name])}{escape(name)}'
            f"{f'<small>{escape(fate)}</small>' if fate else ''}</th>{cells}</tr>"
        )
    order = ", then ".join(metric_set.headings(results))
    late = f" {metric_set.late(results)}".rstrip()
    return (
        '<h2>Ranking</h2>\n<div class="wide"><table class="ranking"><thead><tr><th scope="col">#</th>'
        f'<th scope="col" style="text-align:left">law</th>{head}</tr></thead>\n'
        f"<tbody>{''.join(rows)}</tbody></table></div>\n"
        f'<p class="note">Ordered by {escape(order)}; less is better in every column, and the best value is marked. '
        f"A dash: never reached, or not measured.{late}</p>"
    )


def plot_box(plot: Mapping[str, Any]) -> str:
    """The box of a plot, which a script fills."""
    notes = plot["notes"] if "notes" in plot else [f"– – {plot['dashed']}"] * bool(plot["dashed"])
    spans = "".join(f"<span>{escape(note)}</span>" for note in notes)
    return f'<div class="plot"><h3>{escape(plot["title"])}{spans}</h3><div id="{plot["name"]}"></div></div>'


def laws_table(flights: Sequence[Flight]) -> str:
    """The laws with their gains."""
    rows: list[list[Any]] = []
    for number, flight in enumerate(flights):
        gains = ", ".join(f"{name} = {value_text(*gain)}" for name, gain in flight.gains.items())
        rows.append([Cell(flight.name, "name", number), flight.law, gains or "—"])
    return titled("Laws", Table([*map(Column, ("name", "type", "gains"))], rows))


def settings(scenario: Scenario, title: str) -> str:
    """All tables of a scenario, those of its parts included."""
    from pydantic import BaseModel

    parts: list[str] = []
    written = read_toml(scenario.text, scenario.where)
    shared = {key: scenario.table.shared[key] for key in _taken(scenario)}
    for name in type(scenario.table).model_fields:
        table = getattr(scenario.table, name)
        # What a campaign draws is not flown here, nor a target beside one that is a part.
        is_part = any(fitted.part.role == name for fitted in scenario.parts)
        if isinstance(table, BaseModel) and name != "campaign" and not is_part:
            parts.append(_table(name, table, shared, written.get(name, {})))
        elif table is None:
            # Told with each part where the table is not there.
            shared = {key: value for key, value in shared.items() if not key.startswith(f"{name}.")}
    parts += [
        _part(fitted, shared, is_part) for fitted, is_part in zip(scenario.parts, written.get("part", []), strict=True)
    ]
    return f'<h2>{title}</h2>\n<div class="columns">{"".join(parts)}</div>'


def _taken(scenario: Scenario) -> set[str]:
    """The keys that give parameters to the parts and laws of a scenario, targets of modes among them."""
    fitted = [*scenario.parts, *(target for entry in scenario.laws for target in entry.targets)]
    declared = [item for one in fitted if not one.part.table for item in one.part.fields()]
    declared += [item for entry in scenario.laws for item in entry.law.fields(entry.form)]
    return {item.gain.shared for item in declared} & {*scenario.table.shared}


def _table(name: str, table: Any, shared: Mapping[str, Any], written: Any) -> str:
    """One table of the scenario with the descriptions its schema holds, numbers with units as the file has them; keys
    without a value are left out, but for those with a default that parts take."""
    from pydantic import BaseModel

    properties = type(table).model_json_schema()["properties"]
    rows: list[str] = []
    for key in type(table).model_fields:
        value, given = getattr(table, key), ""
        if value is None and f"{name}.{key}" in shared:
            value, given = shared[f"{name}.{key}"], ", by default"
        if isinstance(value, BaseModel):
            texts = written.get(key, {})
            for name_within in type(value).model_fields:
                if (number := getattr(value, name_within)) is not None:
                    text = with_units(texts.get(name_within), number) or _value(number)
                    rows.append(_row(f"{key}.{name_within}", text, ""))
        elif value is not None:
            meaning = str(properties.get(key, {}).get("description", "")).replace("^2", "²").replace("^3", "³")
            rows.append(_row(key, (with_units(written.get(key), value) or _value(value)) + given, meaning))
    return _section(name.replace("_", " "), rows)


def with_units(written: Any, value: Any) -> str:
    """Return the file's text of numbers, where that has units; "" where it has none."""
    texts = cast(list[Any], written) if isinstance(written, list) else [written]
    numbers = isinstance(value, (int, float, tuple, list, np.ndarray)) and not isinstance(value, bool)
    return ", ".join(texts) if numbers and texts and all(isinstance(text, str) for text in texts) else ""


def _part(fitted: Fitted, shared: Collection[str], written: Mapping[str, Any]) -> str:
    """The parameters of a part with their units and meanings; numbers that the file gives with units are shown as written
    there. Parameters that these shared keys of the scenario give are left out."""
    rows: list[str] = []
    for item, value in zip(fitted.part.fields(), fitted.params, strict=True):
        if item.gain.shared in shared:
            continue
        text = _value(item.written(value))
        unit = "" if item.gain.unit == "1" or item.gain.choices else f" {item.gain.unit}"
        rows.append(_row(item.name, with_units(written.get(item.name), value) or text + unit, item.gain.text))
    return _section(f"{fitted.part.role} {fitted.called}", rows)


def _section(title: str, rows: Sequence[str]) -> str:
    return f'<section><h3>{escape(title)}</h3><table class="text"><tbody>{"".join(rows)}</tbody></table></section>'


def _row(*cells: str) -> str:
    return f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in cells)}</tr>"


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float) and math.isinf(value):
        return "none"
    if isinstance(value, tuple) and len(value) > MANY:
        return f"{number_text(value[0])} to {number_text(value[-1])}, {len(value)} values"
    return number_text(value) if isinstance(value, (int, float, tuple, list, np.ndarray)) else str(value)


def columns_list(flights: Sequence[Flight]) -> str:
    """The columns of the ranking with their meanings."""
    metric_set = flights[0].metric_set
    measures = [
        metric_set.measures[metric] for metric in metric_set.columns({flight.name: flight.metrics for flight in flights})
    ]
    items = "".join(
        f"<dt>{escape(measure.heading)}{f', {escape(measure.unit)}' if measure.unit else ''}</dt>"
        f"<dd>{escape(measure.meaning)}</dd>"
        for measure in measures
    )
    return f"<h2>How to read the columns</h2>\n<dl>{items}</dl>"


def versions() -> str:
    """The versions that made the page."""
    from starhold.version import __version__

    libraries = ", ".join(f"{name} {metadata.version(name)}" for name in ("llvmlite", "numpy", "plotly"))
    return f"starhold {__version__}, {libraries}"


def panel_data(panel: Panel, order: list[int], thin: bool = False) -> dict[str, Any]:
    """A panel for the script that draws it; laws in the order from back to front."""
    # Later laws get thinner lines, so that equal curves show as a line within a line.
    slimmer = [1.0 - 0.5 * number / max(len(order) - 1, 1) for number in range(len(order))]
    return {
        "label": panel.label,
        "curves": [rounded(curve) for curve in panel.curves],
        "widths": [round((1.7 if thin else 2.6) * share, 2) for share in slimmer],
        "order": order,
        "log": panel.log,
        # Ticks at powers of ten where there are several of them, else where Plotly likes.
        "ticks": max(1, math.ceil(panel.decades() / 6.0)) if panel.decades() > 2.0 else None,
        "levels": rounded(panel.levels),
        "span": None if panel.span is None else rounded(panel.span),
        "source": panel.source,
    }


def rounded(values: Iterable[float], digits: int = 6) -> list[float | None]:
    """Numbers of a few digits for JSON, which has none that are not finite."""
    return [float(f"{v:.{digits}g}") if math.isfinite(v) else None for v in np.asarray(list(values), dtype=float).tolist()]
