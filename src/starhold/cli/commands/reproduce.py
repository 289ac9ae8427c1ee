"""The command `reproduce`."""

from __future__ import annotations

import os
import signal
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from starhold.cli.arguments import FAILED_CHECK, Force, ReproductionOutput

if TYPE_CHECKING:
    from starhold.publications.reproduction import Reproduction

LONGEST_FIRST = "BEDCA"
"""The order in which publications are started, so that no process works alone for long."""


def reproduce(
    paper: Annotated[str, typer.Argument(metavar="[A|B|C|D|E|all]", help="which publication")] = "all",
    output: ReproductionOutput = None,
    force: Force = False,
    processes: Annotated[int | None, typer.Option(min=1, help="processes in parallel; all cores by default")] = None,
) -> None:
    """Reproduce every figure, table and number of the publications: a page for each, with verdicts."""
    from starhold.cli.console import console
    from starhold.publications.paper import papers_of
    from starhold.publications.writing import write_index
    from starhold.report.results import open_folder

    letters = papers_of(paper)
    folder = open_folder(output or Path("results") / f"reproduce-{paper.lower()}", force)
    made = _make(letters, folder, processes)
    _print(made)
    page = write_index(made, folder)
    console.print(f"Pages: {page}", soft_wrap=True)
    if any(one.changed for one in made):
        raise typer.Exit(FAILED_CHECK)


def _make(letters: list[str], folder: Path, processes: int | None) -> list[Reproduction]:
    """Reproduce the publications, each in its own process, and return them in order."""
    from concurrent.futures import FIRST_EXCEPTION, ProcessPoolExecutor, wait
    from multiprocessing import get_context
    from threading import Thread

    from rich.progress import TimeElapsedColumn

    from starhold.cli.console import bars_with

    context = get_context("spawn")
    count = min(processes or os.cpu_count() or 1, len(letters))
    queue: Any = context.SimpleQueue()
    with (
        bars_with(TimeElapsedColumn()) as bars,
        ProcessPoolExecutor(count, context, initializer=_begin, initargs=(queue,)) as pool,
    ):
        tasks = {letter: bars.add_task(letter, total=None) for letter in letters}
        futures = {letter: pool.submit(_work, letter, folder) for letter in sorted(letters, key=LONGEST_FIRST.index)}

        def show() -> None:
            for letter, done, whole in iter(queue.get, None):
                bars.update(tasks[letter], completed=done, total=whole)

        shower = Thread(target=show, daemon=True)
        shower.start()
        try:
            for future in wait(futures.values(), return_when=FIRST_EXCEPTION).done:
                future.result()
        except BaseException:
            for process in list((pool._processes or {}).values()):
                process.kill()
            raise
        queue.put(None)
        shower.join()
        return [futures[letter].result() for letter in letters]


_queue: Any = None
"""The queue to which this process reports its progress."""


def _begin(queue: Any) -> None:
    global _queue
    _queue = queue
    # Ctrl-C goes to the parent alone, which ends this process.
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _work(letter: str, folder: Path) -> Reproduction:
    from dataclasses import replace

    from starhold.publications.writing import write_paper

    made = write_paper(letter, folder, lambda done, whole: _queue.put((letter, done, whole)))
    # Figures already drawn need not be sent between processes.
    return replace(made, figures=dict.fromkeys(made.figures))


def _print(made: list[Reproduction]) -> None:
    from collections import Counter

    from rich.markup import escape

    from starhold.cli.console import console
    from starhold.cli.show import print_rows
    from starhold.publications.verdicts import VERDICTS
    from starhold.report.commands import Column, Table

    rows: list[list[Any]] = []
    for one in made:
        counted = Counter(judged.verdict for judged in one.rows.values())
        cells = [counted[verdict] or "" for verdict in VERDICTS]
        rows.append([escape(f"{one.paper.letter}. {one.paper.title}"), len(one.figures), len(one.rows), *cells])
    print_rows(Table([Column("publication"), *(Column(head, "", ">") for head in ("figures", "rows", *VERDICTS))], rows))
    for one in made:
        for judged in one.changed:
            text = f"{one.paper.letter}/{judged.row.name}: recorded {judged.row.verdict}, now {judged.verdict}"
            console.print(text, style="red", markup=False, soft_wrap=True)


COMMANDS = {"reproduce": reproduce}
