"""Figures of station keeping as PNG files, every law in every figure."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from starhold.report.figures import POINTS, headed, over_time, paint, plain, width_of, without_runs
from starhold.report.station.planes import Guide, Plane, PlanePlot
from starhold.report.station.plots import StationPlots, collect
from starhold.scenario.reading import Scenario
from starhold.studies.flight import Flight, colour

FILLS = {"light": "#e8f1fa", "dark": "#c3dcf1"}
GREY = "0.35"


class StationSketch(NamedTuple):
    """A picture of station-keeping laws."""

    plots: StationPlots
    flights: list[Flight]
    name: str

    def makers(self) -> dict[str, Callable[[], Any]]:
        """The projections, the path in space, the phase portrait and the plots over time."""
        plots, flights, name = self
        makers: dict[str, Callable[[], Any]] = {
            plot.name: partial(over_time, plot, plots.times, (), flights, name) for plot in plots.over_time
        }
        makers |= {plot.name: partial(_planes, plot, flights, name) for plot in plots.planes}
        return makers | {"space": partial(_space, plots, flights, name)}


def sketch(flights: Sequence[Flight], scenario: Scenario) -> StationSketch:
    """What `figures.paint` needs."""
    return StationSketch(collect(flights, POINTS, scenario), without_runs(flights), scenario.name)


def draw(flights: Sequence[Flight], folder: Path, scenario: Scenario) -> list[Path]:
    """Write the figures into `folder`, which exists, and return their paths."""
    return paint(sketch(flights, scenario), folder)


def _planes(plot: PlanePlot, flights: Sequence[Flight], name: str) -> Any:
    count = len(plot.planes)
    figure, total, top = headed(8.1 if count > 1 else 6.9, plot.title, flights, name, plot.dashed, 0.10)
    axes: Any = figure.subplots(-(-count // 2), min(count, 2), squeeze=False).ravel()
    figure.subplots_adjust(left=0.088, right=0.985, bottom=0.80 / total, top=top, wspace=0.22, hspace=0.22)
    for axis, plane in zip(axes, plot.planes, strict=True):
        plain(axis)
        _fill(axis, plane, flights)
    from textwrap import wrap

    figure.text(0.078, 0.10 / total, "\n".join(wrap(plot.note, 120)), fontsize=8.5, color="0.3", parse_math=False)
    return figure


def _fill(axis: Any, plane: Plane, flights: Sequence[Flight]) -> None:
    for guide in plane.guides:
        _guide(axis, guide)
    for number, line in enumerate(plane.lines):
        # What was run through again and again shows the better the thinner it is.
        axis.plot(line.x, line.y, color=colour(number), linewidth=0.7 * width_of(number, len(flights)))
        if len(line.x):
            axis.plot(line.x[:1], line.y[:1], "o", color=colour(number), markersize=4)
    if plane.equal:
        axis.set_aspect("equal", adjustable="box", anchor="N")
    axis.locator_params(axis="x", nbins=6)
    axis.set_xlim(*plane.span[:2])
    axis.set_ylim(*plane.span[2:])
    axis.set_xlabel(_mathematical(plane.xlabel))
    axis.set_ylabel(_mathematical(plane.ylabel), labelpad=2)


def _mathematical(label: str) -> str:
    return f"${label}$" if label.startswith("u_") else label


def _guide(axis: Any, guide: Guide) -> None:
    if guide.kind in FILLS:
        axis.fill(guide.x, guide.y, color=FILLS[guide.kind], linewidth=0, zorder=0)
    elif guide.kind == "faint":
        axis.plot(guide.x, guide.y, color="0.78", linewidth=0.6, zorder=1)
    elif guide.kind == "points":
        axis.plot(guide.x, guide.y, "o", color=guide.colour or GREY, markersize=6, zorder=3)
    else:
        axis.plot(guide.x, guide.y, color=guide.colour or GREY, linewidth=1.0, dashes=(5, 3), zorder=3)


def _space(plots: StationPlots, flights: Sequence[Flight], name: str) -> Any:
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
    # Paths lie across the X axis, so that less of it is shown.
    for name_of, share in (("x", 0.7), ("y", 1.1), ("z", 1.1)):
        getattr(axis, f"set_{name_of}lim")(-share * size, share * size)
        getattr(axis, f"set_{name_of}label")(name_of)
        getattr(axis, f"{name_of}axis").pane.set_alpha(0.25)
    axis.set_box_aspect((0.7, 1.1, 1.1), zoom=0.98)
    axis.tick_params(labelsize=8)
    axis.view_init(elev=22, azim=-52)
    return figure


def _size(plots: StationPlots, flights: Sequence[Flight]) -> float:
    kept = [path for path, flight in zip(plots.paths, flights, strict=True) if flight.lost is None]
    farthest = max((float(np.abs(path).max()) for path in kept), default=0.0)
    return max([farthest, *plots.rings]) or float(max((np.abs(path[0]).max() for path in plots.paths), default=1.0)) or 1.0
