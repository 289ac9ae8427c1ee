"""Pictures in a plane: paths of the laws over one another, and lines to judge them by."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from starhold.report.plots import Curve

CORNERS = 181
"""Of a circle that is drawn."""


class Line(NamedTuple):
    """The path of a law."""

    x: Curve
    y: Curve


class Guide(NamedTuple):
    """What is no law's path: a line, dashed (in a law's colour where it is about that law alone) or faint, the edge of an
    area, or points."""

    x: Curve
    y: Curve
    text: str = ""
    colour: str | None = None
    kind: Literal["dashed", "faint", "light", "dark", "points"] = "dashed"


@dataclass(frozen=True)
class Plane:
    """One picture: the names of its axes, a path for each law, guides, what it shows (x and y from and to), and whether
    both axes have one scale."""

    xlabel: str
    ylabel: str
    lines: list[Line]
    guides: list[Guide]
    span: tuple[float, float, float, float]
    equal: bool = True


@dataclass(frozen=True)
class PlanePlot:
    """Pictures side by side, what their dashed lines are, and what they are drawn in."""

    name: str
    title: str
    planes: list[Plane]
    dashed: str = ""
    note: str = ""


def ring(radius: float, text: str, colour: str | None = None) -> Guide:
    """A circle about the origin."""
    angle = np.linspace(0.0, 2.0 * np.pi, CORNERS)
    return Guide(radius * np.cos(angle), radius * np.sin(angle), text, colour)
