"""Plots over time for figures and pages: panels with a curve per law."""

from __future__ import annotations

from collections.abc import Container, Sequence
from colorsys import hls_to_rgb
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from starhold.studies.flight import Flight

if TYPE_CHECKING:
    from starhold.simulation.lane import Recording

COLOURS = (
    *("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#8A8A8A"),
    *("#7B3FA0", "#A6761D", "#E7298A", "#66A61E", "#4D5BD6", "#B3001B", "#2F8F9D"),
)
"""Okabe and Ito's palette, distinct to colour-blind readers, without colours invisible on white or black; then seven more
that differ from these and from one another."""
GOLDEN = 0.5 * (3.0 - 5.0**0.5)
"""The hue step as a share of a full turn: hues at this spacing fill the circle evenly for any number of them."""


def colour(number: int) -> str:
    """Return the colour of the law with this index in a comparison, the same in every picture."""
    if number < len(COLOURS):
        return COLOURS[number]
    extra = number - len(COLOURS)
    red, green, blue = hls_to_rgb(GOLDEN * extra % 1.0, (0.38, 0.58)[extra % 2], 0.62)
    return "#" + "".join(f"{round(255.0 * part):02X}" for part in (red, green, blue))


Curve: TypeAlias = NDArray[np.float64]

OFF_SCALE = 5.0
"""Limits above this multiple of the largest value of all curves are not drawn."""
ACTING = ("N", "N m", "N m s", "A m^2")
"""Units of quantities that act on a body."""
FLAG = "_is_new"
"""The suffix of quantities that mark the control instants with a new reading; plots over a flight omit them."""


@dataclass(frozen=True)
class Panel:
    """One pair of axes: the label with its unit, a curve for each flight, and levels drawn as dashed lines."""

    label: str
    curves: list[Curve]
    log: bool = False
    levels: tuple[float, ...] = ()
    span: tuple[float, float] | None = None
    """The range of ordinates to show, if not that of the curves."""
    source: tuple[Any, ...] = ()
    """The source of the curves when a page flies again: ("column", recorded quantity, component, factor), ("norm", quantity,
    factor), ("angle", factor), ("turn", 0 roll, 1 pitch, 2 yaw) or ("acceleration", component, factor); empty for curves
    that do not change."""
    bounds: tuple[tuple[int, Curve, Curve], ...] = ()
    """Proved bounds, drawn dashed: the index of the flight, times, and the value that is not exceeded from each time until
    the last."""

    def decades(self) -> float:
        """The number of decades that a logarithmic panel spans."""
        if not self.log:
            return 0.0
        levels = [np.array(self.levels)] if self.levels else []
        known = np.concatenate([*self.curves, *levels])
        known = known[known > 0.0]
        low, high = self.span or (float(known.min()), float(known.max()))
        return float(np.log10(high / low))


@dataclass(frozen=True)
class Plot:
    """Panels over one time axis, and the meaning of their dashed lines."""

    name: str
    title: str
    panels: list[Panel]
    dashed: str = ""
    chatters: bool = False
    """Whether curves may jump from sample to sample; their lines are thin, with the most irregular at the back."""
    clock: str = "s"
    """The unit of the times."""
    topic: str = "Motion"
    """The part of the page that holds the plot."""


def first_alone(plot: Plot) -> list[Plot]:
    """Return a plot split in two: its first panel, and the others."""
    rest = replace(plot, name=f"{plot.name}-further", title=f"{plot.title}, further", panels=plot.panels[1:])
    return [replace(plot, panels=plot.panels[:1]), *([rest] if rest.panels else [])]


class Mark(NamedTuple):
    """A vertical line across a plot at a time, with a word at its top."""

    time: float
    word: str = ""


def thinning(count: int, points: int) -> int:
    """Return the factor of `thin` that leaves about `points` of `count` samples."""
    return 1 if count <= points else int(np.ceil(2 * count / points))


def strided(values: Any, most: int) -> Any:
    """Return every k-th of the values, with the least k that leaves at most `most`."""
    return values[:: max(1, -(-len(values) // most))]


def thin(values: Curve, factor: int) -> Curve:
    """Return two of every `factor` samples, to be drawn over `thin_times`. Where omitted samples exceed those kept, the
    minimum and maximum replace them, so chatter keeps its amplitude and shifts by less than `factor` periods."""
    if factor == 1 or not len(values):
        return values
    groups = np.pad(values, (0, -len(values) % factor), mode="edge").reshape(-1, factor)
    kept = groups[:, [0, factor // 2]]
    following = np.append(groups[1:, 0], values[-1])
    swing = np.ptp(np.column_stack([kept, following]), axis=1)
    wild = np.ptp(groups, axis=1) > 3.0 * swing
    places = np.sort(np.column_stack([groups.argmin(axis=1), groups.argmax(axis=1)]), axis=1)
    flat = np.where(wild[:, None], np.take_along_axis(groups, places, axis=1), kept).ravel()
    flat[0], flat[-1] = values[0], values[-1]
    return flat


def thin_times(times: Curve, factor: int) -> Curve:
    """Return the times over which curves made by `thin` are drawn."""
    if factor == 1:
        return times
    starts = np.arange(0, len(times), factor)
    places = np.minimum(np.stack([starts, starts + factor // 2], axis=1).ravel(), len(times) - 1)
    places[-1] = len(times) - 1
    return times[places]


def back_to_front(flights: Sequence[Flight], plot: Plot) -> list[int]:
    """Return the order of curves from back to front: those that chatter come first, because they would hide others."""
    numbers = list(range(len(flights)))
    if plot.chatters:
        numbers.sort(key=lambda i: -float(flights[i].metrics.get("chatter") or 0.0))
    return numbers


def near(levels: tuple[float, ...], curves: list[Curve]) -> tuple[float, ...]:
    """Return the levels without those so far away that they would flatten the curves."""
    peak = max((float(np.abs(curve).max(initial=0.0)) for curve in curves), default=0.0)
    return levels if max(levels) <= OFF_SCALE * peak else ()


def positive(label: str, curves: list[Curve], levels: tuple[float, ...]) -> Panel:
    """Return a logarithmic panel, with gaps at zeros; a panel with only zeros is linear."""
    log = any((curve > 0.0).any() for curve in curves)
    shown = [np.where(curve > 0.0, curve, np.nan) for curve in curves] if log else curves
    return Panel(label, shown, log, levels)


def sound(panel: Panel, flights: Sequence[Flight]) -> Panel:
    """Return the panel scaled to the runs that did not diverge, so that diverged ones do not flatten the others."""
    kept = [c for c, flight in zip(panel.curves, flights, strict=True) if flight.lost is None and np.isfinite(c).any()]
    if not kept or all(flight.lost is None for flight in flights):
        return panel
    low = min(float(np.nanmin(curve)) for curve in kept)
    high = max(float(np.nanmax(curve)) for curve in kept)
    margin = 0.5 * (high - low) + 1e-9
    span = (low / 2.0, high * 10.0) if panel.log else (low - margin, high + margin)
    return replace(panel, span=span)


def longest(flights: Sequence[Flight]) -> Recording:
    """Return the recording with the most samples, whose times all curves share."""
    return max((flight.recording for flight in flights), key=lambda run: len(run["time"]))


def recorded_plots(
    flights: Sequence[Flight], factor: int, known: Container[str] = (), readers: tuple[str, ...] = ()
) -> list[Plot]:
    """Return a plot of each further quantity that all flights record, with a panel per component and the name, unit and
    meaning that its part declares. Flags of new readings are not drawn. readers: prefixes of the names of outputs of sensors
    and estimators."""
    lead = longest(flights)
    _, coordinates = lead.variables()
    plots: list[Plot] = []
    for name, (unit, meaning, dimension) in lead.columns.items():
        if name in known or name.endswith(FLAG) or not all(name in flight.recording.arrays for flight in flights):
            continue
        runs = [np.reshape(flight.recording[name], (len(flight.recording["time"]), -1)) for flight in flights]
        labels = coordinates[dimension].data if dimension in coordinates else range(1, runs[0].shape[1] + 1)
        panels = [
            Panel(
                f"{label}, {unit}" if dimension else unit,
                [thin(run[:, column], factor) for run in runs],
                source=("column", name, column, 1.0),
            )
            for column, label in enumerate(labels)
        ]
        shown = [sound(panel, flights) for panel in panels]
        title = f"{name.replace('_', ' ')}: {meaning}"
        acts = unit in ACTING or name in ("command", "control")
        topic = "Sensors and estimate" if name.startswith(readers) else "Actuators" if acts else "Motion"
        plots.append(Plot(name.replace("_", "-"), title, shown, "", name == "command", lead.time_unit, topic))
    return plots
