"""Writes a reproduction: a page and a folder of scenario files a publication, an index and `summary.json`."""

import json
from collections.abc import Callable, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

from starhold.files import atomic_write
from starhold.publications.figure import Curve, Figure, Panel
from starhold.publications.page import index_page, paper_page
from starhold.publications.reproduction import Reproduction, reproduce
from starhold.report.figures import DPI, plain
from starhold.report.plots import colour
from starhold.report.results import INDEX, SUMMARY
from starhold.version import __version__

WIDTH = 8.0
"""Inches."""


def draw(figure: Figure) -> bytes:
    """The figure as a PNG file."""
    from matplotlib.figure import Figure as Canvas

    columns = min(figure.columns, len(figure.panels))
    rows = -(-len(figure.panels) // columns)
    height = _height(figure, columns)
    canvas = Canvas(figsize=(WIDTH, height * rows), dpi=DPI, layout="constrained")
    grid: Any = canvas.subplots(rows, columns, squeeze=False)
    axes = grid.ravel()
    for axis, panel in zip(axes, figure.panels, strict=False):
        _panel(axis, panel)
        if columns > 2 and not panel.log_x:
            # In a narrow panel more numbers would run into one another.
            axis.locator_params(axis="x", nbins=4)
    for axis in axes[len(figure.panels) :]:
        axis.set_visible(False)
    file = BytesIO()
    # No software entry, lest equal figures differ between releases.
    canvas.savefig(file, metadata={"Software": None}, pil_kwargs={"compress_level": 6})
    return file.getvalue()


def _height(figure: Figure, columns: int) -> float:
    if any(panel.equal for panel in figure.panels):
        return max(2.6, WIDTH / columns * 0.82)
    return {1: 3.3, 2: 2.9}.get(columns, 2.6)


def _panel(axis: Any, panel: Panel) -> None:
    plain(axis)
    named = False
    for number, curve in enumerate(panel.curves):
        _curve(axis, curve, colour(number if curve.hue is None else curve.hue))
        named = named or bool(curve.label)
    for level in panel.levels:
        axis.axhline(level, color="0.35", linewidth=0.9, dashes=(5, 3))
    for x, y, words in panel.notes:
        axis.text(x, y, words, fontsize=8.5, color="0.2", ha="center", va="center")
    if panel.log_x:
        axis.set_xscale("log")
    if panel.log_y:
        axis.set_yscale("log")
    if panel.x_span is not None:
        axis.set_xlim(*panel.x_span)
    if panel.y_span is not None:
        axis.set_ylim(*panel.y_span)
    if panel.equal:
        axis.set_aspect("equal", adjustable="box" if panel.x_span is not None else "datalim")
    axis.set_xlabel(panel.x_label, fontsize=9)
    axis.set_ylabel(panel.y_label, fontsize=9)
    if panel.title:
        axis.set_title(panel.title, fontsize=9.5)
    if named:
        axis.legend(fontsize=8, frameon=False, loc="best", ncols=2 if len(panel.curves) > 4 else 1)


def _curve(axis: Any, curve: Curve, hue: str) -> None:
    label = curve.label or None
    if curve.style == "area":
        axis.fill(curve.x, curve.y, color=hue, alpha=0.22, linewidth=0.0, label=label)
    elif curve.style == "faint":
        axis.plot(curve.x, curve.y, color="0.72", linewidth=0.7, zorder=1, label=label)
    elif curve.style == "points":
        axis.plot(curve.x, curve.y, color=hue, linestyle="", marker="o", markersize=3.2, label=label)
    elif curve.style == "steps":
        axis.plot(curve.x, curve.y, color=hue, linewidth=1.2, drawstyle="steps-post", label=label)
    else:
        lines = {"line": "-", "dashed": (0, (5, 3)), "dotted": ":"}
        axis.plot(curve.x, curve.y, color=hue, linewidth=1.3, linestyle=lines[curve.style], label=label)


def write_paper(letter: str, folder: Path, notice: Callable[[int, int], None] | None = None) -> Reproduction:
    """Make a publication and write its page and its files into `folder`, which exists."""
    made = reproduce(letter, notice)
    _write(folder / f"{letter}.html", paper_page(made, {name: draw(figure) for name, figure in made.figures.items()}))
    (folder / letter).mkdir(exist_ok=True)
    for name, text in made.files.items():
        _write(folder / letter / f"{name}.toml", text)
    return made


def write_index(made: Sequence[Reproduction], folder: Path) -> Path:
    """Write the index and the summary of these publications, and return the index."""
    summary = {
        "starhold_version": __version__,
        "changed": [f"{one.paper.letter}/{judged.row.name}" for one in made for judged in one.changed],
        "papers": {one.paper.letter: _summary(one) for one in made},
    }
    _write(folder / INDEX, index_page(made))
    _write(folder / SUMMARY, json.dumps(summary, indent=2, ensure_ascii=False, allow_nan=True) + "\n")
    return folder / INDEX


def _summary(made: Reproduction) -> dict[str, Any]:
    return {
        "title": made.paper.title,
        "figures": [{"name": item.name, "number": item.number, "caption": item.caption} for item in made.paper.figures],
        "rows": [judged.summary() for judged in made.rows.values()],
    }


def _write(path: Path, text: str) -> None:
    with atomic_write(path) as hidden:
        hidden.write_text(text, encoding="utf-8", newline="\n")
