"""Draws the figures in processes of their own, while proofs and the page are made."""

from __future__ import annotations

import gc
import os
import signal
import traceback
from collections.abc import Sequence
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING, Any

from starhold.errors import InputError
from starhold.files import clear_unfinished
from starhold.report.body import report_of
from starhold.studies.timing import can_fork

if TYPE_CHECKING:
    from starhold.report.figures import Picture
    from starhold.scenario.reading import Scenario
    from starhold.studies.flight import Flight

AT_ONCE = 2


class Painter:
    """Processes that draw the figures of flights into `folder`, which exists; `finish` waits until they have. Leaving the
    context ends them. Where nothing is to be drawn, no process starts, and figures of earlier flights are removed."""

    def __init__(self, scenario: Scenario, flights: Sequence[Flight], folder: Path, draw: bool = True) -> None:
        picture = report_of(scenario.body).picture(flights, scenario)
        if not draw:
            for name in picture:
                (folder / f"{name}.png").unlink(missing_ok=True)
        # A copy of this process has nearly everything loaded.
        context: Any = get_context("fork" if can_fork() else "spawn")
        self._folder, (self._failures, self._told) = folder, context.Pipe(duplex=False)
        given = [(picture, folder.absolute(), slice(first, None, AT_ONCE), self._told) for first in range(AT_ONCE)]
        self._processes = [context.Process(target=_draw, args=args) for args in given if draw]
        for process in self._processes:
            process.start()

    def __enter__(self) -> Painter:
        return self

    def __exit__(self, *failure: object) -> None:
        late = [process for process in self._processes if process.is_alive()]
        for process in late:
            process.kill()
            process.join()
        if late:
            clear_unfinished(self._folder)

    def finish(self) -> None:
        """Wait for the files. InputError where they cannot be written; RuntimeError for any other failure."""
        for process in self._processes:
            process.join()
        failure = self._failures.recv() if self._failures.poll() else ""
        if isinstance(failure, InputError):
            raise failure
        if failure or any(process.exitcode for process in self._processes):
            raise RuntimeError(f"the figures could not be drawn: {failure}")


def _draw(picture: Picture, folder: Path, part: slice, failures: Connection) -> None:
    """Draw a part of the figures; what prevents that goes to `failures`, and what libraries say to nobody."""
    # Ctrl-C goes to the original process alone, which ends this one.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    gc.disable()
    from starhold.report.figures import paint

    try:
        paint(picture, folder, part)
    except InputError as error:
        failures.send(error)
    except Exception:
        failures.send(traceback.format_exc()[-2000:])
