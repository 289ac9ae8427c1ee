"""The command `failures`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from starhold.cli.arguments import FailuresOutput, Force, ScenarioFile

if TYPE_CHECKING:
    from starhold.studies.failures import Failure


def failures(
    file: ScenarioFile,
    law: Annotated[str | None, typer.Option(help="which law of the file; the first if not given")] = None,
    output: FailuresOutput = None,
    force: Force = False,
) -> None:
    """Tell what is left after the loss of any one or two wheels: a table, failures.csv and failures.png."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    from starhold.cli.console import console
    from starhold.report.failures_picture import draw
    from starhold.report.results import FAILURES, open_folder
    from starhold.report.tables import write_failures
    from starhold.scenario.reading import load
    from starhold.studies.failures import require_wheels, study

    scenario = load(file).about("rigid-body")
    entry = scenario.pick(law)
    require_wheels(scenario)
    folder = open_folder(output or Path("results") / f"{scenario.name}-failures", force)
    table, picture = (folder / name for name in FAILURES)
    with Progress(TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), console=console) as bars:
        task = bars.add_task("compiling", total=None)

        def notice(done: int, total: int, name: str) -> None:
            bars.update(task, completed=done, total=total, description=f"lost: {name}" if name else "flown")

        found = study(scenario, entry, notice)
    write_failures(found, entry, table)
    draw(found, picture, f"{scenario.name}, {entry.name}: loss of wheels")
    print_failures(found)
    console.print(f"Table: {table}. Picture: {picture}", soft_wrap=True)


def print_failures(found: Sequence[Failure]) -> None:
    """One row a loss; of the gains those that were designed anew."""
    from rich.table import Table

    from starhold.cli.console import console
    from starhold.report.text import number_text

    flown = [failure.gains for failure in found if failure.gains is not None]
    retuned = [name for name in flown[0] if any(number_text(g[name]) != number_text(flown[0][name]) for g in flown)]
    designed = found[0].eta is not None
    table = Table(show_edge=False, pad_edge=False)
    heads = ["axes", "cond.", "authority\n[dim]N m[/dim]", "share\n[dim]%[/dim]", *retuned]
    heads += ["stability\n[dim]1/s, before → after[/dim]"] * designed
    heads += ["certified\n[dim]turn, °[/dim]", "settling\n[dim]s[/dim]", "wheel full\n[dim]min[/dim]"]
    for head in ("lost", *heads):
        table.add_column(head, justify="left" if head in ("lost", "axes") else "right")
    for failure in found:
        table.add_row(failure.name, *_row(failure, retuned, designed))
    console.print()
    console.print(table)
    if any(not failure.controllable for failure in found):
        console.print("not (x, y, z): no torque is left about this body direction.", highlight=False)
    for failure in found:
        if failure.refused:
            console.print(f"without {failure.name} not flown: {failure.refused}", highlight=False, markup=False)
    if any(failure.certified is not None for failure in found):
        console.print("certified: turns from rest on which no motor or wheel is proved to meet its limit.", highlight=False)
    if not retuned:
        console.print("The gains are the same in all of them.", highlight=False)
    if any(failure.saturation is not None and failure.saturation.known == "extrapolated" for failure in found):
        console.print("~ extrapolated from the growth of the momentum late in the flight.", highlight=False)


def _row(failure: Failure, retuned: Sequence[str], designed: bool) -> list[str]:
    from starhold.certification.wording import shown
    from starhold.report.failures_picture import direction_text
    from starhold.report.text import number_text

    axes = "three" if failure.controllable else f"[red]not {direction_text(failure)}[/red]"
    begun = [axes, f"{failure.condition:.3g}", f"{failure.authority:.4g}", f"{100.0 * failure.share:.1f}"]
    if failure.gains is None:
        return [*begun, *["—"] * (len(retuned) + designed + 3)]
    eta = [f"{failure.eta_intact:.4g} → {failure.eta:.4g}"] if designed else []
    certified = "—" if failure.certified is None else shown(math.degrees(failure.certified[0]))
    settling = "not settled" if failure.settling is None else f"{failure.settling:.4g}"
    if failure.diverged_at is not None:
        settling = f"[red]diverged at {failure.diverged_at:.4g}[/red]"
    return [*begun, *(number_text(failure.gains[name], 4) for name in retuned), *eta, certified, settling, _full(failure)]


def _full(failure: Failure) -> str:
    from starhold.studies.failures import HORIZON

    known: Any = failure.saturation
    if known is None:
        return "—"
    if known.time is None:
        return f"> {HORIZON} orbits" if failure.orbit else f"> {HORIZON * known.window / 60.0:.4g}"
    return f"{'~' if known.known == 'extrapolated' else ''}{known.time / 60.0:.4g} (wheel {known.wheel})"
