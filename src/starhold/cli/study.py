"""Makes commands of what stands in `starhold.report.commands`, and prints tables."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Annotated, Any

import typer

from starhold.cli.arguments import REFUTED, Force, ScenarioFile, Unstable, number_or_text, results_in
from starhold.report.commands import Result, command


def command_of(name: str) -> Any:
    """The command of a name."""
    declared = command(name)

    def run(file: str, law: str | None, output: Path | None, force: bool, allow_unstable: bool = False, **given: Any):
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

        from starhold.cli.console import console
        from starhold.report.results import open_folder, write_result
        from starhold.scenario.reading import load

        changes = {key: number_or_text(value) for key, value in given.items() if value is not None}
        scenario, entry = declared.prepare(load(file, allow_unstable), law, **changes)
        folder = open_folder(output or Path("results") / f"{scenario.name}-{declared.suffix}", force)
        with Progress(TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), console=console) as bars:
            task = bars.add_task("compiling", total=None)

            def notice(done: int, total: int, what: str) -> None:
                bars.update(task, completed=done, total=total, description=what)

            result = declared.result(scenario, entry, notice)
        table, picture = write_result(result, name, scenario, entry.name, folder)
        print_result(result)
        console.print(f"Table: {table}. Picture: {picture}", soft_wrap=True)
        if not result.met:
            raise typer.Exit(REFUTED)

    kinds: dict[str, Any] = {"file": ScenarioFile, "law": Annotated[str | None, typer.Option(help=declared.law)]}
    for key, option in declared.options.items():
        shown = typer.Option(help=option.help, metavar=None if option.whole else "TIME")
        kinds[key] = Annotated[int | None if option.whole else str | None, shown]
    kinds |= {"output": Annotated[Path | None, results_in(f"SCENARIO-{declared.suffix}")], "force": Force}
    kinds |= {"allow_unstable": Unstable} if declared.unstable else {}
    defaults: dict[str, Any] = {"file": inspect.Parameter.empty, "force": False, "allow_unstable": False}
    parameters = [
        inspect.Parameter(key, inspect.Parameter.KEYWORD_ONLY, annotation=kind, default=defaults.get(key))
        for key, kind in kinds.items()
    ]
    run.__doc__, run.__annotations__ = declared.summary, kinds
    run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    return run


def print_result(result: Result) -> None:
    """Print the table, then the sentences."""
    from starhold.cli.console import console
    from starhold.cli.show import print_rows

    print_rows(result.table, apart=True)
    for text in result.sentences:
        console.print(text, highlight=False, markup=False)
