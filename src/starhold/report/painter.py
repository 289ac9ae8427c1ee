"""Draws the figures in a separate process, while proofs and the page are made."""

from __future__ import annotations

import gc
import os
import signal
import traceback
from collections.abc import Sequence
from contextlib import suppress
from importlib import import_module
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING, Any

from starhold.errors import InputError
from starhold.files import clear_unfinished
from starhold.processes import can_fork

if TYPE_CHECKING:
    from starhold.scenario.reading import Scenario
    from starhold.studies.flight import Flight


DRAWING = ("matplotlib.backends.backend_agg", "matplotlib.figure", "starhold.report.ticks", "starhold.report.accuracy")
"""The modules needed to draw figures, in addition to `starhold.report.figures`."""
SHARED = "numpy"
"""Loaded before the process starts, because both need it at once."""


class Painter:
    """A process that draws the figures of flights sent by `draw`; `finish` waits for it. Where this process can fork and
    there is another processor, it starts at once and loads its library in parallel with earlier work. It ends with the
    context. Unless `wanted`, nothing is drawn, no process starts, and figures of earlier flights are removed."""

    def __init__(self, wanted: bool = True) -> None:
        self._wanted, self._process = wanted, None
        self._folder: Path | None = None
        if wanted and can_fork() and len(os.sched_getaffinity(0)) > 1:
            self._start()

    def _start(self) -> None:
        import_module(SHARED)
        context: Any = get_context("fork" if can_fork() else "spawn")
        (self._failures, self._failed), (requests, self._requests) = (context.Pipe(duplex=False) for _ in range(2))
        self._process = context.Process(target=_draw, args=(requests, self._failed, self._requests))
        self._process.start()
        requests.close()

    def draw(self, scenario: Scenario, flights: Sequence[Flight], folder: Path) -> None:
        """Begin to draw the figures into a folder that exists."""
        from starhold.report.body import report_of

        self._folder = folder
        picture = report_of(scenario.body).picture(flights, scenario)
        if not self._wanted:
            for name in picture:
                (folder / f"{name}.png").unlink(missing_ok=True)
            return
        if self._process is None:
            self._start()
        # `finish` reports how it ended.
        with suppress(OSError):
            self._requests.send((picture, folder.absolute()))

    def __enter__(self) -> Painter:
        return self

    def __exit__(self, *failure: object) -> None:
        if self._process is not None and self._process.is_alive():
            self._process.kill()
            self._process.join()
            if self._folder is not None:
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


def _draw(requests: Connection, failures: Connection, other: Connection) -> None:
    """Draw the requested figures; errors go to `failures`, and output of libraries is discarded."""
    # With its last copy closed, the end of the original process is noticed here.
    other.close()
    # Ctrl-C goes to the original process alone, which ends this one.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    gc.disable()
    try:
        _load()
        from starhold.report.figures import paint

        picture, folder = requests.recv()
        paint(picture, folder)
    except EOFError:
        return
    except InputError as error:
        failures.send(error)
    except Exception:
        failures.send(traceback.format_exc()[-2000:])


def _load() -> None:
    """Load all that draws. While it loads, Matplotlib writes the documentation of its classes, which takes half the time and
    which nobody reads here."""
    from matplotlib import artist

    artist.kwdoc = lambda artist: ""
    artist.Artist._update_set_signature_and_docstring = lambda: None  # pyright: ignore[reportAttributeAccessIssue]
    for name in DRAWING:
        import_module(name)
