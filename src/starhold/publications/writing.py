"""Writes reproductions: a page and a folder of scenario files per publication, an index and `summary.json`."""

import json
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from starhold.files import write_text
from starhold.publications.figure import Curve, Figure, Panel
from starhold.publications.paper import FigureItem, Paper, Section
from starhold.publications.reproduction import Judged, Reproduction, reproduce
from starhold.publications.verdicts import PLAIN, VERDICTS
from starhold.report.commands import Column, Table
from starhold.report.figures import DPI, address, plain, png
from starhold.report.page_parts import fold, plain_document
from starhold.report.plots import colour
from starhold.report.results import INDEX, SUMMARY
from starhold.report.tables import Markup, pill, table_html
from starhold.report.text import number_text
from starhold.version import __version__


def paper_page(made: Reproduction, pictures: Mapping[str, bytes]) -> str:
    """Return the page of a publication, with its pictures (PNG) by the names of their figures."""
    paper = made.paper
    body = [
        f'<header class="top"><h1>{escape(paper.letter)}. {escape(paper.title)}</h1>{tally(made.rows.values())}</header>',
        f'<p class="lead">{escape(paper.source)}</p>',
        _changes(made.changed),
        f"<p>{escape(paper.about)}</p>",
        *(_section(section, made, pictures) for section in paper.section),
        fold("What was flown", _files(made)),
        fold("How to read the verdicts", _reading()),
        _footer(made),
    ]
    return plain_document(f"{paper.letter}. {paper.title}", body)


def index_page(made: Sequence[Reproduction]) -> str:
    """Return the page with links to those of the publications, and all errata."""
    rows = [
        [
            Markup(
                f'<a href="{one.paper.letter}.html">{one.paper.letter}. {escape(one.paper.title)}</a>'
                f"<small>{escape(one.paper.source)}</small>"
            ),
            *(len(one.figures), len(one.rows)),
            Markup(tally(one.rows.values())),
        ]
        for one in made
    ]
    columns = [Column("publication"), Column("figures", "", "d"), Column("rows", "", "d"), Column("verdicts")]
    errata = [(judged, one.paper) for one in made for judged in one.rows.values() if judged.row.erratum is not None]
    body = [
        "<h1>Published and reproduced</h1>",
        '<p class="lead">Every figure, table and numerical statement of the publications that starhold implements, made '
        "again and compared with what is printed.</p>",
        _changes([judged for one in made for judged in one.changed]),
        table_html(Table(columns, rows), "told titled"),
        fold("Errata", _errata(errata)),
        fold("How to read the verdicts", _reading()),
        f"<footer>starhold {__version__}</footer>",
    ]
    return plain_document("Published and reproduced", body)


def tally(rows: Any) -> str:
    """Return the count of each verdict in words."""
    counted = Counter(judged.verdict for judged in rows)
    given = [verdict for verdict in VERDICTS if counted[verdict]]
    return " ".join(f'<span class="count">{pill(verdict)} {counted[verdict]}</span>' for verdict in given)


def value_words(judged: Judged) -> str:
    """Return the measured value in words."""
    value, unit = judged.finding.value, judged.row.unit
    if isinstance(value, dict):
        yes = [name for name, true in value.items() if true]
        no = [name for name, true in value.items() if not true]
        cases = [f"true: {', '.join(yes)}"] * bool(yes) + [f"false: {', '.join(no)}"] * bool(no)
        return "; ".join(cases)
    if isinstance(value, bool):
        return "true" if value else "false"
    numbers = [value] if isinstance(value, (int, float)) else list(value)
    return ", ".join(number_text(float(one)) for one in numbers) + (f" {unit}" if unit else "")


def difference(judged: Judged) -> str:
    """Return our value minus the printed one, as a share of it, or their ratio if far apart; "" for bounds and
    statements."""
    value = judged.finding.value
    if isinstance(value, (bool, dict)):
        return ""
    numbers = [value] if isinstance(value, (int, float)) else list(value)
    pairs = zip(judged.row.printed, numbers, strict=True)
    differences = [_apart(one.value, float(ours)) for one, ours in pairs if not one.bound]
    return "none" if differences and set(differences) == {"none"} else ", ".join(differences)


def _apart(printed: float, ours: float) -> str:
    if printed in (ours, 0.0):
        return "none" if printed == ours else f"{ours:+.2g}"
    ratio = ours / printed
    return f"× {ratio:.2g}" if ratio > 3.0 or 0.0 < ratio < 1.0 / 3.0 else f"{100.0 * (ratio - 1.0):+.2g} %"


def _section(section: Section, made: Reproduction, pictures: Mapping[str, bytes]) -> str:
    figures = "".join(_figure(item, pictures[item.name]) for item in section.figure)
    text = f"<p>{escape(section.text)}</p>" if section.text else ""
    return f"<h2>{escape(section.title)}</h2>\n{text}{figures}{_table([made.rows[row.name] for row in section.row])}"


def _figure(item: FigureItem, picture: bytes) -> str:
    title = f"Figure {item.number}" if item.number else "Added here"
    seen = f'<p class="note">{escape(item.seen)}</p>' if item.seen else ""
    caption = f"<figcaption><b>{escape(title)}.</b> {escape(item.caption)}</figcaption>"
    return (
        f'<figure class="plot" id="{escape(item.name)}">{caption}'
        f'<img src="{address(picture)}" alt="{escape(item.caption)}" loading="lazy">{seen}</figure>'
    )


def _table(rows: Sequence[Judged]) -> str:
    if not rows:
        return ""
    numbers = any(judged.row.published for judged in rows)
    heads = ("what is printed", *("published",) * numbers, "ours", *("difference",) * numbers, "verdict")
    ids = {i: f'id="{escape(judged.row.name)}"' for i, judged in enumerate(rows)}
    table = Table([*map(Column, heads)], [_row(judged, numbers) for judged in rows])
    return table_html(table, "rows" if numbers else "rows plain", rows=ids)


def _row(judged: Judged, numbers: bool) -> list[Any]:
    """Return a row of a table with its explanation, with or without the columns of printed numbers."""
    row = judged.row
    mark = f"Erratum {row.erratum}. " if row.erratum is not None else ""
    printed = ", ".join(row.published) + (f" {row.unit}" if row.unit and row.published else "")
    changed = f"recorded: {row.verdict}" if judged.changed else ""
    return [
        Markup(escape(mark + row.says) + _small(row.where) + _small(row.why)),
        *(printed,) * numbers,
        Markup(escape(value_words(judged)) + _small(judged.finding.note)),
        *(difference(judged),) * numbers,
        Markup(pill(judged.verdict) + _small(changed)),
    ]


def _small(text: str) -> str:
    return f"<small>{escape(text)}</small>" if text else ""


def _changes(changed: Sequence[Judged]) -> str:
    if not changed:
        return ""
    verdicts = "; ".join(f"{judged.row.name}: {judged.row.verdict} is now {judged.verdict}" for judged in changed)
    return f'<p class="alarm">Verdicts other than recorded: {escape(verdicts)}.</p>'


def _errata(errata: Sequence[tuple[Judged, Paper]]) -> str:
    if not errata:
        return ""
    numbered = sorted(errata, key=lambda pair: pair[0].row.erratum or 0)
    rows = [
        [
            judged.row.erratum,
            Markup(
                f'<a href="{paper.letter}.html#{escape(judged.row.name)}">{paper.letter}, {escape(judged.row.where)}</a>'
            ),
            judged.row.says,
            judged.row.why or judged.finding.note,
        ]
        for judged, paper in numbered
    ]
    return table_html(Table([*map(Column, ("no.", "where", "printed", "corrected"))], rows))


def _files(made: Reproduction) -> str:
    if not made.files:
        return ""
    letter = made.paper.letter
    parts = "".join(
        f"<details><summary>{escape(name)}.toml</summary><pre>{escape(text)}</pre></details>"
        for name, text in made.files.items()
    )
    return (
        f"<p>The files lie in the folder {letter}, beside this page; "
        f"<code>starhold compare {letter}/FILE.toml</code> flies each of them.</p>{parts}"
    )


def _reading() -> str:
    items = "".join(f"<dt>{pill(word)}</dt><dd>{escape(meaning)}</dd>" for word, meaning in VERDICTS.items())
    return f"<dl>{items}</dl>"


def _footer(made: Reproduction) -> str:
    plain = sum(judged.verdict in PLAIN for judged in made.rows.values())
    return (
        f"<footer>starhold {__version__}; {plain} of {len(made.rows)} rows as printed; "
        f"<code>starhold reproduce {made.paper.letter}</code></footer>"
    )


WIDTH = 8.0
"""Inches."""


def draw(figure: Figure) -> bytes:
    """Return the figure as the bytes of a PNG file."""
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
            # In a narrow panel more numbers would overlap.
            axis.locator_params(axis="x", nbins=4)
    for axis in axes[len(figure.panels) :]:
        axis.set_visible(False)
    return png(canvas)


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
    """Reproduce a publication, write its page and files into `folder`, which exists, and return it."""
    made = reproduce(letter, notice)
    write_text(folder / f"{letter}.html", paper_page(made, {name: draw(figure) for name, figure in made.figures.items()}))
    (folder / letter).mkdir(exist_ok=True)
    for name, text in made.files.items():
        write_text(folder / letter / f"{name}.toml", text)
    return made


def write_index(made: Sequence[Reproduction], folder: Path) -> Path:
    """Write the index and the summary of these publications, and return the index."""
    summary = {
        "starhold_version": __version__,
        "changed": [f"{one.paper.letter}/{judged.row.name}" for one in made for judged in one.changed],
        "papers": {
            one.paper.letter: {
                "title": one.paper.title,
                "figures": [item.model_dump(include={"name", "number", "caption"}) for item in one.paper.figures],
                "rows": [judged.summary() for judged in one.rows.values()],
            }
            for one in made
        },
    }
    write_text(folder / INDEX, index_page(made))
    write_text(folder / SUMMARY, json.dumps(summary, indent=2, ensure_ascii=False, allow_nan=True) + "\n")
    return folder / INDEX
