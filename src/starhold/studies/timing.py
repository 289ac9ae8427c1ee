"""Times the calls of laws, in a forked process that compiles them while the laws fly."""

from __future__ import annotations

import os
import signal
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, Any

import numpy as np

from starhold.analysis.cost import CALLS
from starhold.processes import can_fork
from starhold.studies.body import study_of
from starhold.studies.compare import costing, timed

if TYPE_CHECKING:
    from starhold.scenario.reading import Scenario
    from starhold.studies.flight import Flight


class Stopwatch:
    """A forked copy of this process, on systems that can fork, which compiles the calls of the loops' laws immediately and
    times them on request. It ends with the context."""

    def __init__(self, scenario: Scenario, loops: Sequence[Any]) -> None:
        self._scenario, self._loops, self._child = scenario, loops, None
        if can_fork():
            fork = get_context("fork")
            self._ours, theirs = fork.Pipe()
            self._child = fork.Process(target=_serve, args=(scenario, loops, theirs, self._ours))
            self._child.start()
            theirs.close()

    def __enter__(self) -> Stopwatch:
        return self

    def __exit__(self, *failure: object) -> None:
        if self._child is not None:
            self._child.kill()
            self._child.join()

    def timed(self, place: int, flight: Flight) -> Flight:
        """Return the flight of the loop with this index, from 0, with the time per call of its law among the metrics.
        Nothing else should run meanwhile."""
        if self._child is not None:
            run = flight.recording
            # Only the data needed for timing are sent.
            begun = {name: values[:CALLS] if np.ndim(values) else values for name, values in run.arrays.items()}
            # If the process has died, the cause is raised here.
            with suppress(EOFError, OSError):
                self._ours.send((place, replace(run, arrays=begun)))
                return costing(flight, self._ours.recv())
        return timed(self._scenario, self._loops[place], flight)


def _serve(scenario: Scenario, loops: Sequence[Any], requests: Connection, other: Connection) -> None:
    """Time calls on request until this process, or the original one at the other end of the pipe, ends."""
    # Ctrl-C and the like end the original process, and that ends this one.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    # With its last copy closed, the end of the original process is noticed here.
    other.close()
    try:
        study = study_of(scenario.body)
        for loop in loops:
            study.compile_calls(loop)
        while True:
            place, recording = requests.recv()
            requests.send(study.call_costs(loops[place], recording))
    finally:
        # The cause of a failure is raised by the original process, which does the same itself.
        os._exit(1)
