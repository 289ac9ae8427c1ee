"""The command `budget`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from starhold.cli.arguments import REFUTED, BudgetOutput, Force, ScenarioFile, Unstable

if TYPE_CHECKING:
    from starhold.studies.budget import Budget


def budget(
    file: ScenarioFile,
    law: Annotated[str | None, typer.Option(help="which law of the file; the first if not given")] = None,
    start: Annotated[str | None, typer.Option(metavar="TIME", help="errors count from here; else as the file says")] = None,
    window: Annotated[str | None, typer.Option(metavar="TIME", help="length of windows; else as the file says")] = None,
    separation: Annotated[
        str | None, typer.Option(metavar="TIME", help="of the two windows of a drift; else as the file says")
    ] = None,
    runs: Annotated[int | None, typer.Option(help="with random numbers of their own; else what the file says")] = None,
    output: BudgetOutput = None,
    force: Force = False,
    allow_unstable: Unstable = False,
) -> None:
    """Tell the pointing error by source, each alone and all together: a table, budget.csv, budget.png and summary.json."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    from starhold.cli.console import console
    from starhold.report.budget_picture import draw
    from starhold.report.results import BUDGET, SUMMARY, open_folder, write_summary
    from starhold.report.tables import write_budget
    from starhold.scenario.reading import load
    from starhold.studies.budget import study

    scenario = load(file, allow_unstable).about("rigid-body")
    given = {"start": start, "window": window, "separation": separation}
    told = {key: _time(text) for key, text in given.items() if text is not None} | ({} if runs is None else {"runs": runs})
    if told:
        scenario = scenario.with_({f"budget.{key}": value for key, value in told.items()})
    entry = scenario.pick(law)
    folder = open_folder(output or Path("results") / f"{scenario.name}-budget", force)
    table, picture = (folder / name for name in BUDGET)
    with Progress(TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), console=console) as bars:
        task = bars.add_task("compiling", total=None)

        def notice(done: int, total: int, name: str) -> None:
            bars.update(task, completed=done, total=total, description=name or "flown")

        found = study(scenario, entry, notice)
    write_budget(found, table)
    draw(found, picture)
    write_summary(scenario, {entry.name: found.summary()}, folder / SUMMARY)
    print_budget(found)
    console.print(f"Table: {table}. Picture: {picture}", soft_wrap=True)
    if not found.met:
        raise typer.Exit(REFUTED)


def _time(text: str) -> str | float:
    """A time as a file would have it: what is a number is one of seconds."""
    try:
        return float(text)
    except ValueError:
        return text


def print_budget(found: Budget) -> None:
    """One row a source, one column an index."""
    from rich.table import Table

    from starhold.analysis.pointing import MEANINGS
    from starhold.cli.console import console
    from starhold.report.budget_picture import setting_text, unit_of
    from starhold.studies.budget import COMBINED, TOGETHER

    table = Table(show_edge=False, pad_edge=False)
    table.add_column("source")
    units = {index: unit_of(found, index) for index in found.indices}
    for index, (unit, _) in units.items():
        table.add_column(f"{index}\n[dim]{unit}[/dim]", justify="right")
    for row in found.rows:
        levels = [f"{found.level(row.name, index) / size:.4g}" for index, (_, size) in units.items()]
        style = "bold" if row.name == TOGETHER else None
        table.add_row(row.name, *levels, style=style, end_section=row in (found.rows[-3], found.rows[-1]))
    ratios = [found.level(TOGETHER, index) / max(found.level(COMBINED, index), 1e-300) for index in found.indices]
    table.add_row("together / root sum square", *(f"{ratio:.3g}" for ratio in ratios), end_section=bool(found.required))
    if found.required:
        verdicts = {True: "[green]met[/green]", False: "[red]missed[/red]"}
        shown = {
            index: f"{most / units[index][1]:.4g} {verdicts[found.level(TOGETHER, index) <= most]}"
            for index, most in found.required.items()
        }
        table.add_row("required, at most", *(shown.get(index, "") for index in found.indices))
    console.print()
    console.print(table)
    console.print(setting_text(found), highlight=False, markup=False)
    for index in found.indices:
        console.print(f"{index}: {MEANINGS[index]}.", highlight=False, markup=False)
