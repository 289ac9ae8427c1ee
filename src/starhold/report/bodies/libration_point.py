"""The report of a craft near a libration point: its figures, and its path in space on the page."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from starhold.analysis.libration_point import DAY, YEAR, goal_of
from starhold.report.body import PageParts
from starhold.report.figures import POINTS, Picture, headed, over_time, width_of, without_runs
from starhold.report.page_parts import PAGE_POINTS, over_time_data, rounded, views
from starhold.report.path_plots import PathPlots, collect
from starhold.report.plane_plots import GREY, draw_planes, plane_data
from starhold.report.plots import colour, first_alone, longest
from starhold.report.tables import listed, titled

if TYPE_CHECKING:
    from starhold.scenario.reading import Scenario
    from starhold.studies.flight import Flight

FRAMES = 1200
"""The number of positions of the craft in the three-dimensional views."""
SECONDS = 30.0
"""The duration of the animation."""
TURNS = 10.0
"""The largest number of revolutions of the two bodies shown in the animation."""

_VIEWS = (
    "The path in the axes that rotate with the two bodies. Dashed: the circle to be held; line: the X axis, which leads "
    "to the bodies; cross: the libration point; arrow: the control. The number is the distance from the circle or point "
    "held."
)


def picture(flights: Sequence[Flight], scenario: Scenario) -> Picture:
    """Return the figures: projections, path in space, phase portrait and plots over time."""
    plots, shown, name = collect(flights, POINTS, scenario), without_runs(flights), scenario.name
    figures: Picture = {plot.name: partial(over_time, plot, plots.times, (), shown, name) for plot in plots.over_time}
    figures |= {plot.name: partial(draw_planes, plot, shown, name) for plot in plots.planes}
    return figures | {"space": partial(_space, plots, shown, name)}


def page(flights: Sequence[Flight], scenario: Scenario) -> PageParts:
    """Return the parts of the page: the path in planes and in space, with the circle or point held, and the control over
    time."""
    plots = collect(flights, PAGE_POINTS, scenario)
    scene, (lead, *rest) = _scene(scenario, flights, plots), plots.over_time
    drawn = [*first_alone(lead), *rest]
    data = {
        "times": rounded(plots.times),
        "plots": [*(over_time_data(plot, flights) for plot in drawn), *map(plane_data, plots.planes)],
        "scene": scene,
    }
    return PageParts(
        data,
        views=views(flights, len(scene["times"]), "In space", "Path", _VIEWS),
        folds={"Numbers and settings": titled("Libration point and units", listed(_units(scenario)))},
        scripts=("planes.js", "space.js", "orbit.js"),
    )


def _space(plots: PathPlots, flights: Sequence[Flight], name: str) -> Any:
    title = f"paths in space, in {plots.unit}"
    figure, _, top = headed(6.2, title, flights, name, "circle to be held" if plots.rings else "", 0.0)
    axis: Any = figure.add_axes((0.0, 0.02, 1.0, top - 0.02), projection="3d", computed_zorder=False)
    size = _size(plots, flights)
    axis.plot([-0.7 * size, 0.7 * size], [0.0, 0.0], [0.0, 0.0], color="0.5", linewidth=1.0)
    axis.text(-0.74 * size, 0.0, 0.0, "to the two bodies", fontsize=8.5, color="0.35", ha="right", va="bottom")
    axis.plot([0.0], [0.0], [0.0], "x", color="0.2", markersize=6)
    angle = np.linspace(0.0, 2.0 * np.pi, 181)
    for radius in plots.rings:
        flat = np.zeros_like(angle), radius * np.cos(angle), radius * np.sin(angle)
        axis.plot(*flat, color=GREY, linewidth=1.0, dashes=(5, 3), zorder=3)
    for number, path in enumerate(plots.paths):
        inside = np.where((np.abs(path) <= 1.1 * size).all(axis=1, keepdims=True), path, np.nan)
        axis.plot(*inside.T, color=colour(number), linewidth=0.6 * width_of(number, len(flights)), zorder=2)
        axis.plot(*path[:1].T, "o", color=colour(number), markersize=4)
    # Paths lie across the X axis, so less of that axis is shown.
    for name_of, share in (("x", 0.7), ("y", 1.1), ("z", 1.1)):
        getattr(axis, f"set_{name_of}lim")(-share * size, share * size)
        getattr(axis, f"set_{name_of}label")(name_of)
        getattr(axis, f"{name_of}axis").pane.set_alpha(0.25)
    axis.set_box_aspect((0.7, 1.1, 1.1), zoom=0.98)
    axis.tick_params(labelsize=8)
    axis.view_init(elev=22, azim=-52)
    return figure


def _size(plots: PathPlots, flights: Sequence[Flight]) -> float:
    kept = [path for path, flight in zip(plots.paths, flights, strict=True) if flight.lost is None]
    farthest = max((float(np.abs(path).max()) for path in kept), default=0.0)
    return max([farthest, *plots.rings]) or float(max((np.abs(path[0]).max() for path in plots.paths), default=1.0)) or 1.0


def _units(scenario: Scenario) -> list[tuple[str, str]]:
    """Return the physical units of scaled numbers, for the settings."""
    units, plant = scenario.table.libration.units, scenario.craft
    pair = scenario.table.libration.pair
    return [
        ("bodies", f"{pair.name}, {pair.separation / 1e3:.6g} km apart, {scenario.table.libration.point}"),
        ("distance of the point", f"{abs(plant.from_smaller) * units.length / 1e3:.6g} km from the smaller body"),
        ("stiffness C", f"{plant.stiffness:.6g} Ω²"),
        ("length", f"{units.length / 1e3:g} km"),
        ("time", f"{units.time / DAY:.6g} days; 2π is a revolution of the two bodies"),
        ("velocity", f"{units.velocity:.6g} m/s"),
        ("acceleration", f"{units.acceleration * 1e6:.6g} µm/s²"),
    ]


def _scene(scenario: Scenario, flights: Sequence[Flight], plots: PathPlots) -> dict[str, Any]:
    every = longest(flights)["time"]
    played = every[every <= TURNS * 2.0 * np.pi]
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
    times = every[places] if len(places) > 1 else np.array([0.0, 1.0])
    strongest = max(float(np.abs(flight.recording["control"]).max()) for flight in flights) or 1.0
    sound = [flight for flight in flights if flight.lost is None]
    farthest = max((float(np.abs(flight.recording["position"]).max()) for flight in sound), default=0.0)
    return {
        "times": rounded(times * units.time / DAY),
        "tick": YEAR / DAY if plots.over_time[0].clock == "years" else 1.0,
        "paths": paths,
        "rings": rounded(plots.rings),
        "size": max([farthest, *plots.rings]) or 1.0,
        "strongest": strongest,
        "seconds": SECONDS,
    }
