"""Writes a reproduction: a page and a folder of scenario files a publication, an index and `summary.json`."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from starhold.files import atomic_write
from starhold.publications.drawing import draw
from starhold.publications.page import index_page, paper_page
from starhold.publications.reproduction import Reproduction, reproduce
from starhold.report.results import INDEX, SUMMARY
from starhold.version import __version__


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
