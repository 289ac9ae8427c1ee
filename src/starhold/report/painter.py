"""Draws the figures in a process of its own, while proofs and the page are made."""

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

AT_ONCE = 1


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
        self._process = context.Process(target=_draw, args=(picture, folder.absolute(), self._told)) if draw else None
        if self._process is not None:
            self._process.start()

    def __enter__(self) -> Painter:
        return self

    def __exit__(self, *failure: object) -> None:
        if self._process is not None and self._process.is_alive():
            self._process.kill()
            self._process.join()
            clear_unfinished(self._folder)

    def finish(self) -> None:
        """Wait for the files. InputError where they cannot be written; RuntimeError for any other failure."""
        if self._process is None:
            return
        self._process.join()
        failure = self._failures.recv() if self._failures.poll() else ""
        if isinstance(failure, InputError):
            raise failure
        if failure or self._process.exitcode:
            raise RuntimeError(f"the figures could not be drawn: {failure}")


def _draw(picture: Picture, folder: Path, failures: Connection) -> None:
    """Draw the figures; what prevents that goes to `failures`, and what libraries say to nobody."""
    # Ctrl-C goes to the original process alone, which ends this one.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    gc.disable()
    from starhold.report.figures import paint

    try:
        paint(picture, folder)
    except InputError as error:
        failures.send(error)
    except Exception:
        failures.send(traceback.format_exc()[-2000:])
