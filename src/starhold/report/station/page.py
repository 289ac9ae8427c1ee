"""The page that tells a comparison of station-keeping laws, opens offline and loads nothing."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from starhold.analysis.station import DAY, goal_of
from starhold.report.page_parts import (
    OVER_TIME,
    POINTS,
    columns_list,
    document,
    law_data,
    laws_table,
    lost_alarm,
    over_time,
    plot_box,
    ranking,
    rounded,
    settings,
    versions,
    views,
)
from starhold.report.proved import section as proved
from starhold.report.station.planes import Guide, PlanePlot
from starhold.report.station.plots import StationPlots, collect
from starhold.scenario.reading import Scenario
from starhold.studies.flight import Flight

FRAMES = 1200
"""Places of the craft in the three-dimensional views."""
PATH = 1500
"""Samples of a path in a plane at most."""
FAMILY = 60
"""Samples of a faint line at most."""
SECONDS = 30.0
"""How long the animation plays."""
TURNS = 10.0
"""Revolutions of the two bodies that are played at most; what follows is left out of the views."""

_VIEWS = (
    "The path in the axes that turn with the two bodies, dashed the circle to be held; the line is the X axis, which leads "
    "to the bodies, the cross the libration point, the arrow the control. The number is the distance from what is held."
)


def write_page(path: Path, scenario: Scenario, flights: Sequence[Flight]) -> None:
    """Write the report of a scenario's flights as one HTML file; the same flights give the same bytes."""
    path.write_text(render(scenario, flights), encoding="utf-8", newline="\n")


def render(scenario: Scenario, flights: Sequence[Flight]) -> str:
    """The report as HTML text. Whatever comes from files is escaped."""
    plots = collect(flights, POINTS, scenario)
    data = _data(scenario, flights, plots)
    planes = [plot for plot in data["plots"] if "planes" in plot]
    sections = [
        lost_alarm(flights),
        ranking(flights),
        proved(flights),
        *(_plane_box(plot) for plot in planes),
        "<h2>In space</h2>",
        views(flights, len(data["scene"]["times"]), "Path", _VIEWS),
        OVER_TIME,
        *(plot_box(plot) for plot in data["plots"] if "planes" not in plot),
        laws_table(flights),
        _units(scenario),
        settings(scenario, "Settings"),
        columns_list(flights),
    ]
    return document(scenario, sections, data, ("planes.js", "space.js", "orbit.js"), f"{versions()}.")


def _plane_box(plot: dict[str, Any]) -> str:
    return plot_box(plot) + f'<p class="note">{escape(plot["note"])}</p>'


def _units(scenario: Scenario) -> str:
    units, plant = scenario.table.libration.units, scenario.craft
    pair = scenario.table.libration.pair
    rows = (
        ("bodies", f"{pair.name}, {pair.separation / 1e3:.6g} km apart, {scenario.table.libration.point}"),
        ("distance of the point", f"{abs(plant.from_smaller) * units.length / 1e3:.6g} km from the smaller body"),
        ("stiffness C", f"{plant.stiffness:.6g} Ω²"),
        ("length", f"{units.length / 1e3:g} km"),
        ("time", f"{units.time / DAY:.6g} days; 2π is a revolution of the two bodies"),
        ("velocity", f"{units.velocity:.6g} m/s"),
        ("acceleration", f"{units.acceleration * 1e6:.6g} µm/s²"),
    )
    cells = "".join(f"<tr><td>{escape(name)}</td><td>{escape(text)}</td></tr>" for name, text in rows)
    return (
        "<h2>Libration point and units</h2>\n"
        f'<p class="note">Numbers in the settings are scaled: one of them is worth this.</p>\n'
        f'<div class="columns"><section><table class="text"><tbody>{cells}</tbody></table></section></div>'
    )


def _data(scenario: Scenario, flights: Sequence[Flight], plots: StationPlots) -> dict[str, Any]:
    """What the scripts of the page read."""
    return {
        "laws": law_data(flights),
        "times": rounded(plots.times),
        "plots": [*map(_plane_plot, plots.planes), *(over_time(plot, flights) for plot in plots.over_time)],
        "scene": _scene(scenario, flights, plots),
    }


def _plane_plot(plot: PlanePlot) -> dict[str, Any]:
    planes = [
        {
            "xlabel": plane.xlabel,
            "ylabel": plane.ylabel,
            "lines": [{"x": _thin(line.x), "y": _thin(line.y)} for line in plane.lines],
            "guides": [_guide(guide) for guide in plane.guides],
            "span": rounded(plane.span),
            "equal": plane.equal,
        }
        for plane in plot.planes
    ]
    return {"name": plot.name, "title": plot.title, "dashed": plot.dashed, "note": plot.note, "planes": planes}


def _guide(guide: Guide) -> dict[str, Any]:
    most = FAMILY if guide.kind == "faint" else PATH
    return {"x": _thin(guide.x, most), "y": _thin(guide.y, most), "kind": guide.kind, "colour": guide.colour}


def _thin(values: Any, most: int = PATH) -> list[float | None]:
    return rounded(values[:: max(1, -(-len(values) // most))], 4)


def _scene(scenario: Scenario, flights: Sequence[Flight], plots: StationPlots) -> dict[str, Any]:
    longest = max((flight.recording["time"] for flight in flights), key=len)
    played = longest[longest <= TURNS * 2.0 * np.pi]
    places = np.unique(np.rint(np.linspace(0.0, len(played) - 1, FRAMES + 1)).astype(int))
    units = scenario.table.libration.units
    paths: list[dict[str, Any]] = []
    for flight in flights:
        kept = places[places < len(flight.recording["time"])]
        goal = goal_of(scenario.pick(flight.name).gains)
        position = flight.recording["position"][kept]
        paths.append(
            {
                "place": [rounded(row, 4) for row in position],
                "push": [rounded(row, 3) for row in flight.recording["control"][kept]],
                "away": rounded(goal.distance(position) * units.length / 1e3, 3),
            }
        )
    times = longest[places] if len(places) > 1 else np.array([0.0, 1.0])
    strongest = max(float(np.abs(flight.recording["control"]).max()) for flight in flights) or 1.0
    sound = [flight for flight in flights if flight.lost is None]
    farthest = max((float(np.abs(flight.recording["position"]).max()) for flight in sound), default=0.0)
    return {
        "times": rounded(times * units.time / DAY),
        "paths": paths,
        "rings": rounded(plots.rings),
        "size": max([farthest, *plots.rings]) or 1.0,
        "strongest": strongest,
        "seconds": SECONDS,
    }
