"""Figures as data: curves and panels, without the drawing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, TypeAlias

Style: TypeAlias = Literal["line", "dashed", "dotted", "points", "steps", "area", "faint"]


@dataclass(frozen=True)
class Curve:
    """A curve: x (n,) and y (n,), in the units of the panel's labels. An "area" is a closed, filled outline; "faint" is a
    thin grey line."""

    x: Any
    y: Any
    label: str = ""
    style: Style = "line"
    hue: int | None = None
    """The number of its colour, by default its index in the panel. Curves of one hue look alike."""

    @classmethod
    def along(cls, points: Any, label: str = "", style: Style = "line", hue: int | None = None) -> Curve:
        """Return the curve through points (2, n)."""
        x, y = points
        return cls(x, y, label, style, hue)


@dataclass(frozen=True)
class Panel:
    """One pair of axes. Spans (low, high) limit the view; None shows all. Levels are horizontal lines."""

    x_label: str
    y_label: str
    curves: Sequence[Curve]
    title: str = ""
    x_span: tuple[float, float] | None = None
    y_span: tuple[float, float] | None = None
    log_x: bool = False
    log_y: bool = False
    equal: bool = False
    """Whether both axes have the same scale."""
    levels: Sequence[float] = ()
    notes: Sequence[tuple[float, float, str]] = ()
    """Labels at points (x, y)."""


@dataclass(frozen=True)
class Figure:
    """Panels in `columns` columns, filled row by row."""

    panels: Sequence[Panel] = field(default_factory=tuple[Panel, ...])
    columns: int = 1
