"""The command `modal-roots`, the roots of the modal law that slew fastest within limits, over the initial angle."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from starhold.report.commands import Column, Command, Result, Table, later

if TYPE_CHECKING:
    from starhold.analysis.roots import TwoPieceFit
    from starhold.scenario.reading import LawEntry, Scenario
    from starhold.studies.modal_roots import Study
LINES = {"fit": ("own fit", "-", 2), "published": ("published fit", (0, (5, 2.5)), 1)}
"""The style of each fit: its label, dashes and the number of its colour."""
POINTS = 200
"""The number of points of each piece of a fit."""


def present(scenario: Scenario, entry: LawEntry, result: Study) -> Result:
    """Return the result: a row per angle, the quality of the fits, and the law to be pasted."""
    from starhold.studies.modal_roots import law_lines

    sentences: list[str] = []
    for name, pieces in result.fits().items():
        off = 100.0 * abs(pieces.errors(result.angles, result.roots))
        sentences.append(f"{name}: off by {(off**2).mean() ** 0.5:.2f} % rms, {off.max():.2f} % at most")
    if result.fitted is not None:
        sentences.append("\n".join(["", *law_lines(result.fitted, result.b), ""]))
    title = f"{scenario.name}: fastest root within the limits"
    return Result(title, ["", _table(result), *sentences], _numbers(result), lambda: draw(result, title))


def _numbers(result: Study) -> Table:
    head = ["angle", "root", "time", "peak_rate", *(f"peak_acceleration_{axis}" for axis in "xyz")]
    head += ["eased_root", "eased_time"] * result.eased
    fits = [pieces.at(result.angles).tolist() for pieces in result.fits().values()]
    rows: list[list[Any]] = []
    for item, *fitted in zip(result.results, *fits, strict=True):
        hard: Any = item.hard
        eased: Any = [item.eased.root, item.eased.time] if result.eased and item.eased is not None else []
        peaks = hard.transient.peak_rate, *hard.transient.peak_acceleration
        rows.append([item.angle, hard.root, hard.time, *peaks, *eased, *fitted])
    return Table([Column(name) for name in (*head, *(f"{name}_root" for name in result.fits()))], rows)


def _table(result: Study) -> Table:
    columns = [Column("angle", "°", ".4g"), Column("root", "1/s", ".6g"), Column("time", "s", ".2f")]
    columns += [Column("peak rate", "°/s", ".2f"), Column("peak accel.", "°/s²", ".2f")]
    eased = [Column("root, eased", "1/s", ".6g"), Column("time, eased", "s", ".2f"), Column("gain", "%", ".1f")]
    columns += eased * result.eased
    for name in result.fits():
        columns += [Column(name, "1/s", ".4f"), Column("off by", "%", "+.2f")]
    rows: list[list[Any]] = []
    for angle, root, time, rate, x, y, z, *more in _numbers(result).rows:
        row = [math.degrees(angle), root, time, math.degrees(rate), math.degrees(max(x, y, z))]
        if result.eased:
            row += [*more[:2], 100.0 * (1.0 - more[1] / time)]
        for pieces in result.fits().values():
            row += [pieces.at(angle), 100.0 * pieces.errors(angle, root)]
        rows.append(row)
    return Table(columns, rows)


def draw(result: Study, title: str) -> Any:
    """Return a figure of roots, times and rates over the angle, and of the errors of the fits, if any."""
    import numpy as np

    from starhold.report.figures import framed, plain
    from starhold.report.plots import COLOURS

    fits, angles = result.fits(), np.degrees(result.angles)
    ratios = [1.5, 0.8, 1.0] if fits else [1.5, 1.0]
    size, sides = (8.0, 2.3 * len(ratios) + 1.0), (0.784, 0.176, 0.5, 0.72)
    figure, grid = framed(size, title, len(ratios), 1, sides, sharex=True, height_ratios=ratios, hspace=0.1)
    axes = grid[:, 0]
    top, last = axes[0], axes[-1]
    for name, pieces in fits.items():
        words, dashes, number = LINES[name]
        style: dict[str, Any] = {"color": COLOURS[number], "linestyle": dashes}
        _line(top, pieces, angles, words, style)
        errors = 100.0 * pieces.errors(result.angles, result.roots)
        axes[1].plot(angles, errors, linewidth=1.2, marker=".", markersize=5, **style)
    if fits:
        axes[1].axhline(0.0, color="0.35", linewidth=0.8)
        axes[1].set_ylabel("error of fit, %")
    kinds = [("within the limits", [item.hard for item in result.results], COLOURS[0], COLOURS[0])]
    kinds += [("with their tolerances", [item.eased for item in result.results], COLOURS[4], "white")] * result.eased
    for words, best, colour, inside in kinds:
        style = {"color": colour, "markerfacecolor": inside, "linestyle": "", "marker": "o", "markersize": 4.5}
        for axis, name in ((top, "root"), (last, "time")):
            axis.plot(angles, [np.nan if item is None else getattr(item, name) for item in best], label=words, **style)
    top.set_ylabel("root a, 1/s")
    last.set_ylabel("transient time, s")
    last.set_ylim(0.0, 1.08 * max(last.dataLim.y1, 1e-9))
    last.set_xlabel("initial angle, deg")
    for axis in axes:
        plain(axis)
        axis.set_axisbelow(True)
    # Fits are drawn first, behind the points; in the legend the points come first.
    handles = top.get_legend_handles_labels()[0]
    place = {"loc": "upper left", "bbox_to_anchor": (0.09, 1.0 - 0.30 / figure.get_figheight())}
    handles = [*handles[len(fits) :], *handles[: len(fits)]]
    figure.legend(handles=handles, ncols=len(handles), fontsize=8.5, frameon=False, borderpad=0.0, **place)
    return figure


def _line(axis: Any, pieces: TwoPieceFit, angles: Any, words: str, style: dict[str, Any]) -> None:
    """Draw each piece separately, because the pieces do not join."""
    import numpy as np

    split = np.degrees(pieces.split)
    low, high = (np.linspace(*ends, POINTS) for ends in ((angles[0], split), (np.nextafter(split, np.inf), angles[-1])))
    for at, label in ((low, words), (high, None)):
        inside = at[(at >= angles[0]) & (at <= angles[-1])]
        axis.plot(inside, pieces.at(np.radians(inside)), linewidth=1.4, label=label, **style)


COMMAND = Command(
    "The root of the modal law that turns fastest within limits, over the initial angle: a table, a fit and a picture.",
    "roots",
    later("studies.modal_roots.study"),
    present,
    later("studies.modal_roots.pick_modal"),
    law="which modal law of the file; the first if not given",
    unstable=True,
)
