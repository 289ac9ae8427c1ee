"""Prints what a campaign comes to, and shows bars while it is flown."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, Task, TaskID, TextColumn
from rich.progress import TimeRemainingColumn as TimeLeft
from rich.table import Table
from rich.text import Text

from starhold.campaign.verdicts import percent
from starhold.cli.console import console
from starhold.cli.show import print_rows
from starhold.errors import InputError
from starhold.report.campaign_units import (
    CONTRADICTED,
    DASH,
    Wording,
    bounds_text,
    count_text,
    counted,
    figure,
    headings_of,
    order,
    with_unit,
    worst_text,
)
from starhold.report.campaign_words import headline, outcome_of
from starhold.report.commands import Column
from starhold.report.commands import Table as Rows

if TYPE_CHECKING:
    from starhold.campaign.results import CampaignResult, LawResult
    from starhold.campaign.verdicts import Verdict

COLOURS = {"met": "green", "missed": "red", "not decided": "yellow"}
METRICS, DRIVERS, AGAIN = 8, 4, 3
"""How many metrics, drivers of a law and runs of a law are printed; the page has all."""


class Rate(ProgressColumn):
    """Shows how many runs a second are flown."""

    def render(self, task: Task) -> Text:
        """The rate of a task; nothing before there is one."""
        speed = task.finished_speed or task.speed
        return Text(f"{figure(speed, 3)} runs/s" if speed else "")


@contextmanager
def flying_campaign(laws: Sequence[str], runs: int, drawn: bool = True) -> Iterator[Callable[[str, int], None]]:
    """Show a bar for each law, of so many runs, with the rate and the time left; yields what is to be called with a law and
    how many more of its runs are done, from any thread. Where an error ends it before any run, nothing of it stays. drawn:
    whether runs differ in more than their noise."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("runs"),
        Rate(),
        TimeLeft(),
    )
    titles = [f"{counted(runs, 'run')} of {counted(len(laws), 'law')}"]
    if not drawn:
        titles[0] += "; nothing is drawn, so they differ by their random numbers alone, if there are any"
    bars = Progress(*columns, console=console)
    tasks: dict[str, TaskID] = {}
    for law in laws:
        tasks[law] = bars.add_task(f"{escape(_plain(law))} (compiling)", total=runs)

    def notice(law: str, more: int) -> None:
        with suppress(IndexError):
            console.print(titles.pop(), highlight=False)
            bars.start()
        bars.update(tasks[law], advance=more, description=escape(_plain(law)))

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
    """Print what a campaign on a body of this name comes to: what its laws do, verdicts, metrics, drivers, the worst
    runs."""
    words = Wording.of(body, result)
    console.print()
    for law in result.laws:
        outcome = outcome_of(law)
        shown = f"[{COLOURS[outcome]}]{outcome}[/{COLOURS[outcome]}]  " if outcome else ""
        told = escape(_plain(headline(law, result.sampling, words)))
        console.print(f"{shown}[bold]{_safe(law.law)}[/bold] {told}", highlight=False)
    if (verdicts := _verdicts(result, words)).rows:
        print_rows(verdicts, apart=True)
        _conditions(result)
    if (metrics := _metrics(result, words)).rows:
        print_rows(metrics, apart=True)
    _brackets(result, words)
    for law in result.laws:
        _drivers(law)
    _again(result)
    console.print(f"\ndigest {result.digest}", highlight=False)
    if result.flown and result.seconds > 0.0:
        rate = figure(result.flown / result.seconds, 3)
        flown = f"{counted(result.flown, 'run')} flown in {result.seconds:.3g} s, {rate} runs/s"
        console.print(flown, highlight=False)


def _verdicts(result: CampaignResult, words: Wording) -> Rows:
    rows = [_verdict(law, verdict, words) for law in result.laws for verdict in law.verdicts]
    numbers = {"keep it": "and must", "miss it": "and may", "failure": "probability", "worst": "margin, run"}
    heads = [*map(Column, ("law", "requirement", "verdict")), *(Column(head, below, ">") for head, below in numbers.items())]
    return Rows(heads, rows)


def _verdict(law: LawResult, verdict: Verdict, words: Wording) -> list[str]:
    colour = COLOURS[verdict.outcome]
    allowed = "none" if verdict.allowed is None else count_text(verdict.allowed)
    return [
        _safe(law.law),
        _safe(words.asks(verdict.name) or verdict.name),
        f"[{colour}]{verdict.outcome}[/{colour}]",
        f"{percent(verdict.observed)} / {percent(verdict.share)}",
        f"{count_text(verdict.failures)} / {allowed if verdict.independent else DASH}",
        bounds_text(verdict),
        f"{words.margin(verdict.name, verdict.worst_margin)}, {verdict.worst_run}",
    ]


def _conditions(result: CampaignResult) -> None:
    """The conditions known before flight in which requirements are not met."""
    for law in result.laws:
        for verdict in law.verdicts:
            part = verdict.worst_part
            if part is not None and part.outcome != "met" and verdict.independent:
                missed = f"{count_text(part.failures)} of {counted(part.runs, 'run')} miss it"
                where = f"with {_safe(part.name)}, known before flight"
                told = f"{_safe(law.law)}: {where}, {_safe(verdict.name)} is {part.outcome}: {missed}"
                console.print(told, highlight=False)


def _metrics(result: CampaignResult, words: Wording) -> Rows:
    """The first metrics, those that something is required of before all."""
    found = headings_of(result, words)
    asked = {item.column for item in words.asked.values()}
    chosen = sorted(found, key=lambda metric: (metric not in asked, found.index(metric)))[:METRICS]
    rows: list[list[str]] = []
    for metric in chosen:
        measure, head = words.measure(metric), True
        for law in result.laws:
            for spread in law.spreads:
                if spread.metric == metric:
                    _, low, _, median, _, high, most = (figure(measure.scale * value) for value in spread.quantiles)
                    told = (_safe(measure.heading), _safe(measure.unit)) if head else ("", "")
                    missing = count_text(spread.missing) if spread.missing else DASH
                    rows.append([*told, _safe(law.law), low, median, high, most, missing])
                    head = False
    numbers = [Column(head, "", ">") for head in ("5 %", "median", "95 %", "largest", "without")]
    return Rows([*map(Column, ("metric", "unit", "law")), *numbers], rows)


def _brackets(result: CampaignResult, words: Wording) -> None:
    if any(law.brackets for law in result.laws):
        console.print("\nworst case, flown ≤ true ≤ proved:", highlight=False)
    for law in result.laws:
        for item in law.brackets:
            measure = words.measure(item.metric, item.unit)
            proved = "; nothing is proved"
            if item.proved is not None:
                proved = f" {order(item)} {with_unit(item.proved, measure)} ({_safe(item.assumption)})"
            told = f"{_safe(measure.heading)} {worst_text(item, measure)}{proved}"
            console.print(f"  {_safe(law.law)}: {told}  [dim]{_safe(item.file)}[/dim]", highlight=False, soft_wrap=True)
            if item.contradicted:
                console.print(f"  [bold red]{CONTRADICTED}[/bold red]", highlight=False, soft_wrap=True)


def _drivers(law: LawResult) -> None:
    for metric, found in law.indices.items():
        console.print(f"\n{_safe(law.law)}, {_safe(metric)}: {_safe(found.sentence())}", highlight=False, soft_wrap=True)
    if law.drivers is None:
        return
    # The first sentence says how many runs failed.
    first, *sentences = law.drivers.sentences()
    console.print(f"\n[bold]{_safe(law.law)}[/bold]: {first}", highlight=False)
    for sentence in sentences[:DRIVERS]:
        console.print(f"  {_safe(sentence)}", highlight=False)
    if len(sentences) > DRIVERS:
        console.print(f"  [dim]{len(sentences) - DRIVERS} more in the report[/dim]", highlight=False)


def _again(result: CampaignResult) -> None:
    table = Table(show_edge=False, pad_edge=False, box=None, show_header=False)
    for _ in range(3):
        table.add_column(overflow="fold")
    for law in result.laws:
        for item in law.again[:AGAIN]:
            table.add_row(f"  {_safe(law.law)}", _safe(item.why), _safe(item.command))
    if table.row_count:
        console.print("\nworth flying again:", highlight=False)
        console.print(table, highlight=False)


def _plain(text: str) -> str:
    """Text from a file without what steers a terminal."""
    return "".join(c if c.isprintable() or c == "\N{NARROW NO-BREAK SPACE}" else ascii(c)[1:-1] for c in text)


def _safe(text: str) -> str:
    """Text from a file as one that can be printed: without markup, and nothing that steers a terminal."""
    return escape(_plain(text))
