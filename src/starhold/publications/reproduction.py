"""Reproduces every figure of a publication and gives every row a verdict."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pkgutil import iter_modules
from typing import Any

from starhold.publications import measures as common
from starhold.publications.desk import Desk
from starhold.publications.figure import Figure
from starhold.publications.paper import FigureItem, Item, Paper, Row, read_paper
from starhold.publications.verdicts import Finding, Verdict, judge


@dataclass(frozen=True)
class Judged:
    """A row with its measurement and the verdict on it."""

    row: Row
    finding: Finding
    verdict: Verdict

    @property
    def changed(self) -> bool:
        """Whether the verdict differs from the recorded one."""
        return self.verdict != self.row.verdict

    def summary(self) -> dict[str, Any]:
        """Return the row for `summary.json`."""
        value = self.finding.value
        ours = value if isinstance(value, (bool, dict)) else [value] if isinstance(value, (int, float)) else list(value)
        row = self.row
        return {
            "name": row.name,
            "where": row.where,
            "says": row.says,
            "published": list(row.published),
            "ours": [float(one) for one in ours] if isinstance(ours, list) else ours,
            "unit": row.unit,
            "verdict": self.verdict,
            "recorded": row.verdict,
            "why": row.why,
            "erratum": row.erratum,
        }


@dataclass(frozen=True)
class Reproduction:
    """A reproduced publication: its figures by name, its rows with verdicts by name, the texts of the flown scenario files,
    and the time (s) it took."""

    paper: Paper
    figures: dict[str, Figure]
    rows: dict[str, Judged]
    files: dict[str, str]
    seconds: float

    @property
    def changed(self) -> list[Judged]:
        """The rows whose verdict differs from the recorded one."""
        return [judged for judged in self.rows.values() if judged.changed]


def measure_of(letter: str, item: Item) -> Callable[..., Any]:
    """Return the function that makes an item, from a module of the publication or else the common one. AttributeError where
    there is none."""
    package = import_module(f"starhold.publications.papers.{letter}")
    modules = (import_module(f"{package.__name__}.{module.name}") for module in iter_modules(package.__path__))
    return getattr(next((module for module in modules if hasattr(module, item.by)), common), item.by)


def reproduce(letter: str, notice: Callable[[int, int], None] | None = None) -> Reproduction:
    """Return a publication's figures and rows. notice: called with the number of items done and the total."""
    begun, paper, desk = time.perf_counter(), read_paper(letter), Desk(letter)
    figures: dict[str, Figure] = {}
    rows: dict[str, Judged] = {}
    items: list[FigureItem | Row] = [item for section in paper.section for item in (*section.figure, *section.row)]
    for done, item in enumerate(items):
        if notice is not None:
            notice(done, len(items))
        made = measure_of(letter, item)(desk, **item.given)
        if isinstance(item, Row):
            rows[item.name] = Judged(item, made, judge(made, item.printed, item.tolerance))
        else:
            figures[item.name] = made
    if notice is not None:
        notice(len(items), len(items))
    return Reproduction(paper, figures, rows, desk.used, time.perf_counter() - begun)
