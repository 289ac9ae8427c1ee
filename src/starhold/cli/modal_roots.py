"""The command `modal-roots`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from starhold.cli.arguments import Force, RootsOutput, ScenarioFile, Unstable

if TYPE_CHECKING:
    from starhold.studies.modal_roots import Study


def modal_roots(
    file: ScenarioFile,
    law: Annotated[str | None, typer.Option(help="which modal law of the file; the first if not given")] = None,
    output: RootsOutput = None,
    force: Force = False,
    allow_unstable: Unstable = False,
) -> None:
    """The root of the modal law that turns fastest within limits, over the initial angle: a table, a fit and a picture."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    from starhold.cli.console import console
    from starhold.report.modal_roots_picture import draw
    from starhold.report.results import ROOTS, open_folder
    from starhold.report.tables import write_modal_roots
    from starhold.scenario.reading import load
    from starhold.studies.modal_roots import law_lines, pick_modal, study

    scenario = load(file, allow_unstable).about("rigid-body")
    entry = pick_modal(scenario, law)
    folder = open_folder(output or Path("results") / f"{scenario.name}-roots", force)
    table, picture = (folder / name for name in ROOTS)
    with Progress(TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), console=console) as bars:
        task = bars.add_task("angles (compiling)", total=None)
        found = study(
            scenario, entry, lambda done, total: bars.update(task, completed=done, total=total, description="angles")
        )
    write_modal_roots(found, table)
    draw(found, picture, f"{scenario.name}: fastest root within the limits")
    print_roots(found)
    if found.own is not None:
        console.print("\n".join(["", *law_lines(found.own, found.b), ""]), highlight=False, markup=False)
    console.print(f"Table: {table}. Picture: {picture}", soft_wrap=True)


def print_roots(found: Study) -> None:
    """One row an angle, then how good the fits are."""
    from rich.table import Table

    from starhold.cli.console import console

    heads = ["angle\n[dim]°[/dim]", "root\n[dim]1/s[/dim]", "time\n[dim]s[/dim]"]
    heads += ["peak rate\n[dim]°/s[/dim]", "peak accel.\n[dim]°/s²[/dim]"]
    heads += ["root, eased\n[dim]1/s[/dim]", "time, eased\n[dim]s[/dim]", "gain\n[dim]%[/dim]"] * found.eased
    fits = found.fits()
    for name in fits:
        heads += [f"{name}\n[dim]1/s[/dim]", "off by\n[dim]%[/dim]"]
    table = Table(show_edge=False, pad_edge=False)
    for head in heads:
        table.add_column(head, justify="right")
    for place, row in enumerate(_rows(found)):
        for pieces in fits.values():
            angle, root = found.angles[place], found.roots[place]
            row += [f"{pieces.at(angle):.4f}", f"{100.0 * pieces.errors(angle, root):+.2f}"]
        table.add_row(*row)
    console.print()
    console.print(table)
    for name, pieces in fits.items():
        off = 100.0 * abs(pieces.errors(found.angles, found.roots))
        said = f"{name}: off by {(off**2).mean() ** 0.5:.2f} % rms, {off.max():.2f} % at most"
        console.print(said, highlight=False)


def _rows(found: Study) -> list[list[str]]:
    rows: list[list[str]] = []
    for item in found.found:
        row = [f"{math.degrees(item.angle):.4g}"]
        if item.hard is not None:
            flown = item.hard.transient
            row += [f"{item.hard.root:.6g}", f"{item.hard.time:.2f}"]
            row += [f"{math.degrees(flown.peak_rate):.2f}", f"{math.degrees(max(flown.peak_acceleration)):.2f}"]
            if found.eased and item.eased is not None:
                gain = 100.0 * (1.0 - item.eased.time / item.hard.time)
                row += [f"{item.eased.root:.6g}", f"{item.eased.time:.2f}", f"{gain:.1f}"]
        rows.append(row)
    return rows
