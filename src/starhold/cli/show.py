"""Tables and progress bars that the commands print."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from starhold.cli.console import WIDE, bars_with, console
from starhold.report.commands import Block, Heading
from starhold.report.commands import Table as Rows

if TYPE_CHECKING:
    from pathlib import Path

    from starhold.scenario.reading import LawEntry
    from starhold.studies.flight import Flight

COLUMN = 9
"""Width of a metric in characters."""


@contextmanager
def flying(entries: Sequence[LawEntry], steps: int) -> Iterator[Callable[[str, int, int], None]]:
    """Show progress bars on a terminal, one for each law; yield the function that the simulation calls."""
    if not console.is_terminal:
        yield lambda name, done, total: None
        return
    from rich.progress import TimeRemainingColumn

    with bars_with("steps", TimeRemainingColumn()) as bars:
        tasks = {entry.name: bars.add_task(f"{entry.name} (compiling)", total=steps) for entry in entries}
        yield lambda name, done, total: bars.update(tasks[name], completed=done, total=total, description=name)


def print_outcome(flights: Sequence[Flight]) -> None:
    """Print the table and the warnings."""
    from starhold.report.text import lost_text, unknown_text

    print_table(flights)
    for flight in flights:
        if flight.lost is not None:
            console.print(f"{flight.name} diverged at {lost_text(flight)}; its results end there", style="red")
        if said := unknown_text(flight):
            console.print(said, style="red", markup=False)
        if flight.metrics.get("solver_budget_hits"):
            hits, calls = flight.metrics["solver_budget_hits"], flight.metrics["solver_calls"]
            console.print(f"{flight.name}: the solver used up its budget in {hits} of {calls} calls", style="yellow")
        if "step_error" in flight.metrics:
            console.print(_step_text(flight), markup=False)
        if "limits_kept" in flight.metrics:
            from starhold.report.transients import transient_text

            said, kept = transient_text(flight), flight.metrics["limits_kept"]
            console.print(f"{flight.name}: {said}", style=None if kept else "yellow", markup=False)


def print_results(path: Path) -> None:
    """Print where the results are: the page, or the folder where there is no page."""
    console.print(f"{'Results' if path.is_dir() else 'Report'}: {path}", soft_wrap=True)


def _step_text(flight: Flight) -> str:
    """Print how much halving the integration step changes the metrics."""
    errors = flight.metrics["step_error"]
    if None in errors.values():
        return f"{flight.name}: with half the integration step the motion diverges at another time"
    changes: list[str] = []
    for name, error in errors.items():
        told_of = flight.recording.columns[name]
        unit = "rad" if told_of.dimension == "quaternion" else told_of.unit
        changes.append(f"{name.replace('_', ' ')} by {error:.1e} {unit}")
    return f"{flight.name}: halving the integration step changes at most the {', '.join(changes)}"


def print_table(flights: Sequence[Flight]) -> None:
    """Print the ranked comparison; a star marks the best value of each metric. On a narrow screen laws become columns."""
    metric_set = flights[0].metric_set
    results: Mapping[str, Mapping[str, Any]] = {flight.name: flight.metrics for flight in flights}
    won, order = metric_set.winners(results), metric_set.ranked(results)
    metrics = metric_set.columns(results)
    measures = [metric_set.measures[metric] for metric in metrics]
    heads = [f"{measure.heading}\n[dim]{measure.unit}[/dim]" for measure in measures]
    cells = [[_cell(metric_set.cell(metric, results[name]), name in won[metric]) for metric in metrics] for name in order]
    # Lines between thirteen columns would not fit into 120 characters.
    table = Table(box=SIMPLE_HEAD, collapse_padding=True, show_edge=False, pad_edge=False)
    if console.width >= max(WIDE, COLUMN * (1 + len(metrics))):
        for head in ("law", *heads):
            table.add_column(head, justify="left" if head == "law" else "right")
        for name, row in zip(order, cells, strict=True):
            table.add_row(name, *row)
    else:
        for head in ("", *order):
            table.add_column(head, justify="right" if head else "left")
        for column, head in enumerate(heads):
            table.add_row(head.replace("\n", " "), *(row[column] for row in cells))
    console.print()
    console.print(table)
    if late := metric_set.late(results):
        console.print(late)
    if len(flights) > 1:
        console.print(
            f"Ranked by {', then '.join(metric_set.headings(results))}; [bold green]*[/bold green] best value of its column."
        )
    for flight in flights:
        if flight.modes:
            first, *later = flight.modes
            stretches = ""
            for one in later:
                notes = [f"{one.utc} UTC"] * bool(one.utc) + [f"the monitor {one.monitor} is tripped"] * bool(one.monitor)
                said = f" ({'; '.join(notes)})" if notes else ""
                stretches += f", {one.mode} from {metric_set.moment(one.time, 6)}{said}"
            never = "".join(f" {one}." for one in flight.never)
            console.print(escape(f"Modes of {flight.name}: {first.mode}{stretches}.{never}"))


def _cell(text: str, best: bool) -> str:
    return f"[bold green]{text}*[/bold green]" if best else text


def print_blocks(blocks: Iterable[Block]) -> None:
    """Print the blocks of a command's result."""
    for block in blocks:
        if isinstance(block, Rows):
            print_rows(block)
        elif isinstance(block, Heading):
            console.print(f"[bold]{escape(block.name)}[/bold]{escape(block.rest)}", soft_wrap=True)
        else:
            console.print(block, markup=False)


def print_rows(what: Rows, apart: bool = False) -> None:
    """Print a table, after an empty line if `apart`; an empty cell is a dash."""
    table = Table(show_edge=False, pad_edge=False, title=what.title or None, title_justify="left")
    for column in what.columns:
        head = f"{column.name}\n[dim]{column.unit}[/dim]" if column.unit else column.name
        table.add_column(
            head, justify="right" if column.format else "left", overflow="ellipsis" if column.format else "fold"
        )
    for number, cells in enumerate(what.texts()):
        table.add_row(*cells, style="bold" if number in what.bold else None, end_section=number in what.ends)
    if apart:
        console.print()
    console.print(table)


def printable(text: str) -> str:
    """Return text from a file without terminal control characters."""
    return "".join(c if c.isprintable() or c == "\N{NARROW NO-BREAK SPACE}" else ascii(c)[1:-1] for c in text)
