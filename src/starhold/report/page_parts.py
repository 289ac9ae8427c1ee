"""The building blocks of pages for any body: text, tables, and data for scripts."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from importlib import metadata, resources
from typing import TYPE_CHECKING, Any

import numpy as np

from starhold.report.commands import Cell, Column, Table
from starhold.report.plots import Panel, Plot, back_to_front, colour
from starhold.report.tables import swatch, titled
from starhold.report.text import value_text
from starhold.studies.flight import Flight

if TYPE_CHECKING:
    from starhold.scenario.reading import Scenario

PAGE_POINTS = 1500
"""The number of samples of a curve."""
_POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:; worker-src blob:"
WITH_PLOTLY = ("planes.js", "campaign.js")
"""Scripts that draw with Plotly; plots over time do without them."""


def document(
    scenario: Scenario,
    sections: Iterable[str],
    data: Mapping[str, Any],
    scripts: Sequence[str],
    footer: str,
    facts: str = "",
    answer: str = "",
    living: Mapping[str, Any] | None = None,
) -> str:
    """Return a page of these sections. Its head has the scenario's name with the answer in a word or two (HTML), a
    description and some facts, its end the scenario's text; the scripts, from the assets, read the data, which names the
    laws. living: the data for flying again, None for a page without sliders."""
    lead = " · ".join(filter(None, (scenario.table.description, facts)))
    body = [
        f'<header class="top"><h1>{escape(scenario.name)}</h1>{answer}</header>',
        f'<p class="lead">{escape(lead)}</p>' if lead else "",
        *sections,
        fold("Scenario text", f"<pre>{escape(scenario.text)}</pre>"),
        f"<footer>{escape(footer)}</footer>",
    ]
    libraries, used = [], [*scripts]
    if any(name in WITH_PLOTLY for name in scripts):
        from plotly.offline import get_plotlyjs

        libraries.append(get_plotlyjs())
        used.insert(0, "look.js")
    if data["plots"]:
        # Every copy must carry its licence.
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


def fold(name: str, content: str, hint: str = "") -> str:
    """Return a part of the page that the reader may unfold; "" where it is empty."""
    if not content:
        return ""
    below = f"<small>{escape(hint)}</small>" if hint else ""
    mark = name.lower().replace(" ", "-")
    return f'<details class="fold" id="{mark}"><summary><h2>{escape(name)}</h2>{below}</summary>\n{content}\n</details>'


def beside(*boxes: str) -> str:
    """Return boxes side by side, of which the first is the widest; empty ones are left out."""
    there = [box for box in boxes if box]
    return f'<div class="{"two" if len(there) > 1 else "one"}">{"".join(there)}</div>' if there else ""


def plain_document(title: str, body: Iterable[str], styles: Sequence[str] = ("uplot.css", "page.css")) -> str:
    """Return a page of these parts, without empty ones, with its title and the style sheets of these names."""
    return "\n".join(
        [
            "<!DOCTYPE html>",
            '<html lang="en"><head><meta charset="utf-8">',
            f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            f"<title>{escape(title)} — starhold</title>",
            f"<style>\n{''.join(map(_asset, styles))}</style></head><body>",
            *(part for part in body if part),
            "</body></html>\n",
        ]
    )


DIALS = """\
<button id="dials-button" type="button" aria-expanded="false" aria-controls="dials">Try it</button>
<aside id="dials" aria-label="Try it: fly again with other numbers">
<header><h2>Try it</h2><button id="dials-close" type="button" aria-label="close">×</button></header>
<p class="tools"><button id="dials-reset" type="button">Reset</button>\
<button id="dials-copy" type="button">Copy as TOML</button>\
<button id="dials-link" type="button">Copy link</button></p>
<p class="note" id="followed"></p><p class="alarm" id="unsound" hidden></p><div id="staying"></div>
<div id="groups"></div>
</aside>"""


def _embedded(name: str, data: Mapping[str, Any]) -> str:
    """Return data for scripts, escaped because a script's text ends at the first "</", even within a string."""
    embedded = json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    return f'<script type="application/json" id="{name}">{embedded}</script>'


def _asset(name: str) -> str:
    return (resources.files("starhold.report") / "assets" / name).read_text(encoding="utf-8")


def law_data(flights: Sequence[Flight]) -> list[dict[str, str]]:
    """Return the names and colours of the laws."""
    return [{"name": flight.name, "colour": colour(number)} for number, flight in enumerate(flights)]


def views(flights: Sequence[Flight], frames: int, title: str, what: str, note: str) -> str:
    """Return a three-dimensional view for each law, and one player for all. what: the subject of a view, in a word."""
    boxes = "".join(
        f'<div class="view"><div><span>{swatch(number)}{escape(flight.name)}</span><output></output></div>'
        f'<canvas role="img" aria-label="{what} under {escape(flight.name)}"></canvas></div>'
        for number, flight in enumerate(flights)
    )
    return (
        f'<section class="card"><h2>{title}</h2><div class="views">{boxes}</div>\n'
        '<div class="player"><button id="play" type="button">Play</button>'
        f'<input id="moment" type="range" min="0" max="{frames - 1}" step="0.01" value="0" aria-label="time">'
        '<output id="clock"></output></div>\n'
        f'<details class="about"><summary>What is shown</summary><p class="note">{note} Drag a view to look from elsewhere; '
        "its time follows the pointer on a plot.</p></details></section>"
    )


def over_time_data(plot: Plot, flights: Sequence[Flight]) -> dict[str, Any]:
    """Return the data of a plot over time for the script that draws it."""
    order = back_to_front(flights, plot)
    panels = [panel_data(panel, order, thin=plot.chatters) for panel in plot.panels]
    data = {"name": plot.name, "title": plot.title, "dashed": plot.dashed, "topic": plot.topic, "clock": plot.clock}
    return data | {"panels": panels}


def plot_box(plot: Mapping[str, Any], level: int = 3, more: str = "") -> str:
    """Return the box of a plot, which a script fills; level: that of its heading; more: text beside the heading."""
    notes = plot["notes"] if "notes" in plot else [f"– – {plot['dashed']}"] * bool(plot["dashed"])
    spans = "".join(f"<span>{escape(note)}</span>" for note in notes)
    below = f'<p class="note">{escape(plot["note"])}</p>' if plot.get("note") else ""
    head = f"<h{level}>{escape(plot['title'])}{spans}</h{level}>"
    return f'<div class="plot">{head}{more}<div id="{plot["name"]}"></div>{below}</div>'


def transient_switch(transient: float | None) -> str:
    """Return a switch between the whole run and its transient (s), if there is one."""
    if transient is None:
        return ""
    first = f"{float(f'{transient:.3g}'):g}"
    return (
        '<p class="switch"><button id="whole" type="button" aria-pressed="true">Whole</button>'
        f'<button id="transient-only" type="button" aria-pressed="false">first {first} s</button></p>'
    )


def laws_table(flights: Sequence[Flight]) -> str:
    """Return a table of the laws with their gains."""
    rows: list[list[Any]] = []
    for number, flight in enumerate(flights):
        gains = ", ".join(f"{name} = {value_text(*gain)}" for name, gain in flight.gains.items())
        rows.append([Cell(flight.name, "name", number), flight.law, gains or "—"])
    return titled("Laws", Table([*map(Column, ("name", "type", "gains"))], rows))


def versions() -> str:
    """Return a sentence with the versions that made the page."""
    from starhold.version import __version__

    libraries = ", ".join(f"{name} {metadata.version(name)}" for name in ("llvmlite", "numpy", "plotly"))
    return f"starhold {__version__}, {libraries}"


def panel_data(panel: Panel, order: list[int], thin: bool = False) -> dict[str, Any]:
    """Return a panel for the script that draws it; laws are in order from back to front."""
    # Later laws get thinner lines, so that equal curves show as a line within a line.
    slimmer = [1.0 - 0.5 * number / max(len(order) - 1, 1) for number in range(len(order))]
    return {
        "label": panel.label,
        "curves": [rounded(curve) for curve in panel.curves],
        "widths": [round((1.7 if thin else 2.6) * share, 2) for share in slimmer],
        "order": order,
        "log": panel.log,
        "levels": rounded(panel.levels),
        "span": None if panel.span is None else rounded(panel.span),
        "source": panel.source,
        **({"bounds": [[number, *map(rounded, curves)] for number, *curves in panel.bounds]} if panel.bounds else {}),
    }


def rounded(values: Iterable[float], digits: int = 6) -> list[float | None]:
    """Return numbers rounded to a few digits for JSON; those that are not finite become null."""
    numbers = np.asarray(values if isinstance(values, np.ndarray) else list(values), dtype=float).tolist()
    # All are written at once, because pages have tens of thousands.
    texts = (f"%.{digits}g " * len(numbers) % tuple(numbers)).split()
    return [value if math.isfinite(value) else None for value in map(float, texts)]
