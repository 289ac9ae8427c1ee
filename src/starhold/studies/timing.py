"""The cost of laws' calls, which a copy of this process compiles while the laws fly."""

from __future__ import annotations

import os
import pickle
import signal
import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from threading import active_count
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from starhold.analysis.cost import CALLS
from starhold.studies.body import study_of
from starhold.studies.compare import costing, timed

if TYPE_CHECKING:
    from starhold.scenario.reading import Scenario
    from starhold.studies.flight import Flight


class Stopwatch:
    """A copy of this process, on systems that can fork, that compiles the calls of these loops' laws at once and times them
    on request. Leaving the context ends it."""

    def __init__(self, scenario: Scenario, loops: Sequence[Any]) -> None:
        self._scenario, self._loops, self._child = scenario, loops, 0
        # A copy of a process with several threads may wait for locks that are never released.
        if not sys.platform.startswith("linux") or active_count() > 1:
            return
        (requests, request), (answers, answer) = os.pipe(), os.pipe()
        self._child = os.fork()
        if self._child == 0:
            os.close(request)
            os.close(answers)
            _serve(scenario, loops, os.fdopen(requests, "rb"), os.fdopen(answer, "wb"))
        os.close(requests)
        os.close(answer)
        self._requests, self._answers = os.fdopen(request, "wb"), os.fdopen(answers, "rb")

    def __enter__(self) -> Stopwatch:
        return self

    def __exit__(self, *failure: object) -> None:
        if self._child:
            os.kill(self._child, signal.SIGKILL)
            os.waitpid(self._child, 0)
            for pipe in (self._answers, self._requests):
                with suppress(OSError):
                    pipe.close()

    def timed(self, place: int, flight: Flight) -> Flight:
        """Return the flight of the loop with this index, from 0, with the cost of a call of its law. Nothing else should run
        meanwhile."""
        if self._child:
            run = flight.recording
            # Only what can be timed is sent.
            begun = {name: values[:CALLS] if np.ndim(values) else values for name, values in run.arrays.items()}
            # If it has died, the cause is raised here.
            with suppress(EOFError, OSError):
                pickle.dump((place, replace(run, arrays=begun)), self._requests)
                self._requests.flush()
                return costing(flight, pickle.load(self._answers))
        return timed(self._scenario, self._loops[place], flight)


def _serve(scenario: Scenario, loops: Sequence[Any], requests: BinaryIO, answer: BinaryIO) -> None:
    """Time calls on request until this process is ended."""
    # Ctrl-C and the like end the original process, and that ends this one.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    try:
        study = study_of(scenario.body)
        for loop in loops:
            study.compile_calls(loop)
        while True:
            place, recording = pickle.load(requests)
            pickle.dump(study.call_costs(loops[place], recording), answer)
            answer.flush()
    finally:
        # Exit handlers of the original process must not run twice.
        os._exit(1)
