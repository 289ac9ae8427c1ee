"""The command `budget`, the pointing error by source."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from starhold.report.commands import Column, Command, Option, Result, Table, coloured, later

if TYPE_CHECKING:
    from starhold.scenario.reading import LawEntry, Scenario
    from starhold.studies.budget import Budget
UNITS = (("deg", math.radians(1.0)), ("arcsec", math.radians(1.0 / 3600.0)), ("mas", math.radians(1.0 / 3.6e6)))
LEAST = 0.1
"""The unit of an index is chosen such that its largest level is at least this."""
SMALL = 1e-4
"""Levels below this share of the largest in their panel have no bar."""
SHARES = "The column proved shows this bound, and by how much it decreases without a source; — where it does not change."
INTERPRETED = {
    "mixed": "of all instants of all runs",
    "temporal": "of the instants of the worst run",
    "ensemble": "of the runs, at their worst instants",
}


def present(scenario: Scenario, entry: LawEntry, budget: Budget) -> Result:
    """Return the result: a table with a row per source and a column per index."""
    from starhold.analysis.pointing import MEANINGS, Figures

    records = budget.records()
    heads = [Column(name.replace("deviation", "standard deviation"), "rad") for name in Figures._fields]
    numbers = Table([*map(Column, list(records[0])[: -len(heads)]), *heads], [list(row.values()) for row in records])
    sentences = [_setting_text(budget), *(f"{index}: {MEANINGS[index]}." for index in budget.indices)]
    if budget.proof is not None:
        sentences += [budget.proof.sentence, *[SHARES] * (budget.proof.angle is not None)]
    title = f"{budget.scenario}, {budget.law}: pointing error by source"
    blocks, summary = ["", _table(budget), *sentences], {budget.law: budget.summary()}
    outcome = "met" if budget.met else "missed"
    return Result(title, blocks, numbers, lambda: draw(budget, title), summary, outcome=outcome)


def _table(budget: Budget) -> Table:
    from starhold.studies.budget import COMBINED, TOGETHER

    units = {index: _unit_of(budget, index) for index in budget.indices}
    rows: list[list[Any]] = [
        [row.name, *(budget.level(row.name, index) / size for index, (_, size) in units.items())] for row in budget.rows
    ]
    count, ends = len(rows), {len(rows) - 3, len(rows) - 1}
    bold = [place for place, row in enumerate(budget.rows) if row.name == TOGETHER]
    ratios = [budget.level(TOGETHER, index) / max(budget.level(COMBINED, index), 1e-300) for index in budget.indices]
    rows.append(["together / root sum square", *(f"{ratio:.3g}" for ratio in ratios)])
    if budget.required:
        shown = {
            index: f"{most / units[index][1]:.4g} {coloured('met' if budget.level(TOGETHER, index) <= most else 'missed')}"
            for index, most in budget.required.items()
        }
        rows.append(["required, at most", *(shown.get(index, "") for index in budget.indices)])
        ends.add(count)
    columns = [Column("source"), *(Column(index, unit, ".4g") for index, (unit, _) in units.items())]
    if budget.proof is not None and budget.proof.angle is not None:
        bounds = {**budget.proof.shares, TOGETHER: budget.proof.angle}
        unit, size = _fitting(budget.proof.angle)
        columns.append(Column("proved", unit, ".4g"))
        for row in rows:
            bound = bounds.get(row[0])
            row.append(None if bound is None else bound / size)
    return Table(columns, rows, bold=bold, ends=ends)


def _unit_of(budget: Budget, index: str) -> tuple[str, float]:
    """Return the unit in which the levels of an index are shown, and its value in rad."""
    return _fitting(max(budget.level(row.name, index) for row in budget.rows))


def _fitting(largest: float) -> tuple[str, float]:
    """Return the unit in which an angle (rad) is shown, and its value in rad."""
    return next((unit for unit in UNITS if largest >= LEAST * unit[1]), UNITS[-1])


def _setting_text(budget: Budget) -> str:
    """Return one or two sentences on the sampling of errors."""
    settings = budget.settings
    about = "about any axis" if settings.boresight is None else "half the cone of the line of sight"
    runs = "run" if settings.runs == 1 else "runs"
    return (
        f"Levels that {100.0 * settings.confidence:.6g} % {INTERPRETED[settings.interpretation]} keep, {about}; "
        f"{settings.runs} {runs}. Errors from {settings.start:g} s on, windows of {settings.window:g} s, "
        f"for drift {settings.separation:g} s apart."
    )


def draw(budget: Budget, title: str) -> Any:
    """Return a figure with a panel per index and a bar per source."""
    from starhold.analysis.pointing import MEANINGS
    from starhold.report.bars import Bars, draw_bars
    from starhold.studies.budget import COMBINED, LOOP, TOGETHER

    shown = [row.name for row in budget.rows if row.name != COMBINED]
    panels: list[Bars] = []
    for index in budget.indices:
        unit, size = _unit_of(budget, index)
        levels = [budget.level(name, index) / size for name in shown]
        combined, required = budget.level(COMBINED, index) / size, budget.required.get(index)
        most = None if required is None else required / size
        words = [f"{value:.3g}" if value > SMALL * max(levels) else "≈ 0" for value in levels]
        panels.append(Bars(f"{index}, {unit}", levels, words, combined, MEANINGS[index].partition(":")[0], most))
    kinds = {LOOP: 2, "a source alone": 0, TOGETHER: 1}
    hues = [kinds.get(name, 0) for name in shown]
    return draw_bars(title, _setting_text(budget), shown, hues, panels, kinds, COMBINED)


COMMAND = Command(
    "Break the pointing error down by source, each alone and all together: a table, budget.csv, budget.png and "
    "summary.json.",
    "budget",
    later("studies.budget.study"),
    present,
    options={
        "start": Option("budget.start", "time from which errors count; by default as in the file"),
        "window": Option("budget.window", "length of windows; by default as in the file"),
        "separation": Option("budget.separation", "time between a drift's two windows; by default as in the file"),
        "runs": Option(
            "budget.runs", "number of runs with independent random numbers; by default as in the file", whole=True
        ),
    },
    unstable=True,
    prove=later("studies.pointing.budget_with_proof"),
)
