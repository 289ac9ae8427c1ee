"""Prints the outcome of a campaign, and shows its progress."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any

from rich.markup import escape
from rich.progress import ProgressColumn, Task, TaskID
from rich.progress import TimeRemainingColumn as TimeLeft
from rich.text import Text

from starhold.cli.console import bars_with, console
from starhold.cli.show import print_rows, printable
from starhold.errors import InputError
from starhold.report.campaign_tables import again, brackets, claims, drivers, indices, metrics, verdicts
from starhold.report.campaign_units import Wording, counted, figure, headline, outcome_of
from starhold.report.commands import Cell, coloured

if TYPE_CHECKING:
    from starhold.campaign.results import CampaignResult
    from starhold.campaign.worst import Sought
    from starhold.report.commands import Table

METRICS, DRIVERS, AGAIN = 8, 4, 3
"""The numbers of metrics, of drivers of each kind, and of runs per law that are printed; the page lists all."""


class Rate(ProgressColumn):
    """A column with the number of runs flown per second."""

    def render(self, task: Task) -> Text:
        """Return the rate of a task as text, empty before it is known."""
        speed = task.finished_speed or task.speed
        return Text(f"{figure(speed, 3)} runs/s" if speed else "")


@contextmanager
def flying_campaign(laws: Sequence[str], runs: int, drawn: bool = True) -> Iterator[Callable[..., None]]:
    """Show a bar for each law, of `runs` runs, and for each search for a worst case, with the rate and the time left; yield
    the function to call, from any thread, with a law and the number of further runs done, in a search also with its
    `Sought`. If an error occurs before the first run, the bars disappear. drawn: whether anything is dispersed."""
    titles = [f"{counted(runs, 'run')} of {counted(len(laws), 'law')}"]
    if not drawn:
        titles[0] += "; nothing is dispersed, so runs differ only in their noise, if any"
    bars = bars_with("runs", Rate(), TimeLeft())
    tasks: dict[Any, TaskID] = {}
    for law in laws:
        tasks[law] = bars.add_task(f"{escape(printable(law))} (compiling)", total=runs)

    def notice(law: str, more: int, sought: Sought | None = None) -> None:
        with suppress(IndexError):
            console.print(titles.pop())
            bars.start()
        if sought is None:
            bars.update(tasks[law], advance=more, description=escape(printable(law)))
            return
        key = law, sought.name
        if key not in tasks:
            words = escape(printable(f"{law}: {sought.name}"))
            tasks[key] = bars.add_task(words, total=sought.flights)
        bars.update(tasks[key], advance=more)

    if console.is_terminal:
        bars.start()
    try:
        yield notice
    except InputError:
        bars.live.transient = bool(titles)
        raise
    finally:
        if bars.live.is_started:
            bars.stop()


def print_campaign(result: CampaignResult, body: str) -> None:
    """Print the outcome of a campaign on the body of this name: a summary of each law, verdicts, metrics, drivers and worst
    runs."""
    words = Wording.of(body, result)
    console.print()
    for law in result.laws:
        outcome = outcome_of(law)
        shown = f"{marked(Cell(outcome, outcome))}  " if outcome else ""
        text = escape(printable(headline(law, result.sampling, words)))
        console.print(f"{shown}[bold]{marked(law.law)}[/bold] {text}")
    _print(verdicts(result, words), columns=7)
    _print(metrics(result, words, METRICS), with_note=False)
    _print(brackets(result, words), with_note=result.contradicted)
    _print(claims(result, words))
    for table in indices(result, words):
        _print(table)
    for law in result.laws:
        if law.drivers is not None:
            causes = drivers(law.drivers, words, DRIVERS)
            _print(causes._replace(title=law.law, note=f"{law.law}: {causes.note}"))
    _print(again(result, AGAIN), with_note=False)
    console.print(f"\ndigest {result.digest}")
    if result.flown and result.seconds > 0.0:
        rate = figure(result.flown / result.seconds, 3)
        flown = f"{counted(result.flown, 'run')} flown in {result.seconds:.3g} s, {rate} runs/s"
        console.print(flown)


def _print(table: Table | None, columns: int | None = None, with_note: bool = True) -> None:
    """Print the first columns of a table, and its note."""
    if table is None:
        return
    if table.rows:
        rows = [[*map(marked, row[:columns])] for row in table.rows]
        title = "" if table.title == "Verdicts" else marked(table.title)
        print_rows(table._replace(columns=table.columns[:columns], rows=rows, title=title), apart=True)
    if with_note and table.note:
        console.print(marked(table.note))


def marked(cell: Any) -> str:
    """Return text without markup or terminal control characters; outcomes are coloured."""
    text = escape(printable(f"{cell}"))
    return coloured(cell.kind if isinstance(cell, Cell) else "", text)
