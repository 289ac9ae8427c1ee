"""Plots in a plane, with the paths of all laws and reference lines, as figures and as data of a page."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np

from starhold.report.figures import headed, plain, width_of
from starhold.report.page_parts import rounded
from starhold.report.plots import Curve, colour, strided
from starhold.studies.flight import Flight

CORNERS = 181
"""The number of points of a drawn circle."""
PATH = 1500
"""The most samples of a path on a page."""
FAMILY = 60
"""The most samples of a faint line on a page."""
FILLS = {"light": "#e8f1fa", "dark": "#c3dcf1"}
GREY = "0.35"


class Line(NamedTuple):
    """The path of a law."""

    x: Curve
    y: Curve


class Guide(NamedTuple):
    """A reference line: dashed (in a law's colour if it concerns only this law) or faint, the edge of an area, or points."""

    x: Curve
    y: Curve
    text: str = ""
    colour: str | None = None
    kind: Literal["dashed", "faint", "light", "dark", "points"] = "dashed"


@dataclass(frozen=True)
class Plane:
    """One plot: the names of its axes, a path per law, guides, the ranges of x and y, and whether both axes have the same
    scale."""

    xlabel: str
    ylabel: str
    lines: list[Line]
    guides: list[Guide]
    span: tuple[float, float, float, float]
    equal: bool = True


@dataclass(frozen=True)
class PlanePlot:
    """Plots side by side, the meaning of their dashed lines, and their units."""

    name: str
    title: str
    planes: list[Plane]
    dashed: str = ""
    note: str = ""


def ring(radius: float, text: str, shade: str | None = None) -> Guide:
    """Return a circle about the origin."""
    angle = np.linspace(0.0, 2.0 * np.pi, CORNERS)
    return Guide(radius * np.cos(angle), radius * np.sin(angle), text, shade)


def draw_planes(plot: PlanePlot, flights: Sequence[Flight], name: str) -> Any:
    """Return a figure of plots in a plane."""
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
        # A path traversed many times is clearer when thin.
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


def plane_data(plot: PlanePlot) -> dict[str, Any]:
    """Return plots in a plane for the script that draws them."""
    planes = [
        {
            "xlabel": plane.xlabel,
            "ylabel": plane.ylabel,
            "lines": [{"x": _thin(line.x), "y": _thin(line.y)} for line in plane.lines],
            "guides": [_guide_data(guide) for guide in plane.guides],
            "span": rounded(plane.span),
            "equal": plane.equal,
        }
        for plane in plot.planes
    ]
    data = {"name": plot.name, "title": plot.title, "dashed": plot.dashed, "note": plot.note, "topic": "Motion"}
    return data | {"planes": planes}


def _guide_data(guide: Guide) -> dict[str, Any]:
    most = FAMILY if guide.kind == "faint" else PATH
    return {"x": _thin(guide.x, most), "y": _thin(guide.y, most), "kind": guide.kind, "colour": guide.colour}


def _thin(values: Any, most: int = PATH) -> list[float | None]:
    return rounded(strided(values, most), 4)
