"""Draws the figures in processes of their own, while proofs and the page are made."""

from __future__ import annotations

import gc
import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING

from starhold.errors import InputError
from starhold.files import clear_unfinished
from starhold.report.body import report_of

if TYPE_CHECKING:
    from starhold.scenario.reading import Scenario
    from starhold.studies.flight import Flight

UNWRITABLE = 2
"""The exit code where the files cannot be written; the reason is on standard error."""


class Painter:
    """Processes that draw the figures of flights into `folder`, which exists; `finish` waits until they have. Leaving the
    context ends them. Where nothing is to be drawn, no process starts, and figures of earlier flights are removed.
    """

    def __init__(self, scenario: Scenario, flights: Sequence[Flight], folder: Path, draw: bool = True) -> None:
        picture = report_of(scenario.body).picture(flights, scenario)
        self._folder = folder
        self._process: subprocess.Popen[bytes] | None = None
        if not draw:
            for name in picture:
                (folder / f"{name}.png").unlink(missing_ok=True)
            return
        self._process = subprocess.Popen(
            # A process group of its own, which the process that draws the other half joins.
            [sys.executable, "-m", "starhold.report.painter"],
            stdin=subprocess.PIPE,
            stderr=subprocess.PIPE,
            process_group=0,
        )
        # On a thread, because the process does not read yet.
        self._sender = Thread(target=self._send, args=((picture, folder.absolute()),))
        self._sender.start()

    def __enter__(self) -> Painter:
        return self

    def __exit__(self, *failure: object) -> None:
        if self._process is None:
            return
        killed = self._process.poll() is None
        if killed:
            self._kill()
        self._sender.join()
        self._process.communicate()
        if killed:
            clear_unfinished(self._folder)

    def _kill(self) -> None:
        """End all processes that draw; on a system without process groups only the one started here."""
        assert self._process is not None
        if hasattr(os, "killpg"):
            with suppress(ProcessLookupError):
                os.killpg(self._process.pid, signal.SIGKILL)
        else:
            self._process.kill()

    def _send(self, what: object) -> None:
        assert self._process is not None
        assert self._process.stdin is not None
        # If it has died, `finish` reports why.
        with suppress(OSError):
            pickle.dump(what, self._process.stdin)
            self._process.stdin.flush()

    def finish(self) -> InputError | None:
        """Wait for the files. Return why they cannot be written, if so; RuntimeError for any other failure."""
        if self._process is None:
            return None
        self._sender.join()
        _, said = self._process.communicate()
        message = said.decode(errors="replace").strip()
        if self._process.returncode == UNWRITABLE:
            return InputError(message.splitlines()[0], "", "", "")
        if self._process.returncode != 0:
            raise RuntimeError(f"the figures could not be drawn: {message[-2000:]}")
        return None


def main() -> None:
    """Run the process that draws: load the modules, read what to draw, draw it."""
    # Ctrl-C goes to the parent alone, which ends this process.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    gc.disable()
    from starhold.report.figures import paint, warm_up

    warm_up()
    what, folder = pickle.load(sys.stdin.buffer)
    # Everything is loaded, so a second process draws the other half without start-up cost.
    other = os.fork() if hasattr(os, "fork") else None
    share = slice(None) if other is None else slice(0 if other else 1, None, 2)
    try:
        paint(what, folder, share)
    except InputError as error:
        print(error, file=sys.stderr)
        sys.exit(UNWRITABLE)
    if other:
        sys.exit(os.waitstatus_to_exitcode(os.waitpid(other, 0)[1]))


if __name__ == "__main__":
    main()
