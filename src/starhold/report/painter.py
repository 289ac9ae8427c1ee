"""Draws the figures in a process of its own, which loads the plotting library while the laws are still flying."""

from __future__ import annotations

import gc
import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING

from starhold.errors import InputError
from starhold.files import clear_unfinished

if TYPE_CHECKING:
    from starhold.report.figures import Picture

UNWRITABLE = 2
"""Exit code where the files cannot be written; the reason stands on standard error."""


class Painter:
    """A waiting process; `start` sends it what to draw, `finish` waits until it has. Leaving the context ends it."""

    def __init__(self) -> None:
        self._sender: Thread | None = None
        self._folder: Path | None = None
        self._process = subprocess.Popen(
            # A group of its own, of which half the figures' process is one too.
            [sys.executable, "-m", "starhold.report.painter"],
            stdin=subprocess.PIPE,
            stderr=subprocess.PIPE,
            process_group=0,
        )

    def __enter__(self) -> Painter:
        return self

    def __exit__(self, *failure: object) -> None:
        killed = self._process.poll() is None
        if killed:
            self._signal("SIGKILL")
        self._sent()
        self._process.communicate()
        if killed and self._folder is not None:
            clear_unfinished(self._folder)

    def _signal(self, name: str) -> None:
        """Send a signal to all that draw; on a system without groups of processes only its end is asked for."""
        if hasattr(os, "killpg"):
            with suppress(ProcessLookupError):
                os.killpg(self._process.pid, getattr(signal, name))
        elif name == "SIGKILL":
            self._process.kill()

    @contextmanager
    def paused(self) -> Generator[None]:
        """Draw nothing for a while, so that a timed call has the machine to itself."""
        self._signal("SIGSTOP")
        try:
            yield
        finally:
            self._signal("SIGCONT")

    def start(self, picture: Picture, folder: Path) -> None:
        """Let it draw into `folder`, which exists."""
        self._folder = folder
        # On a thread, for it may not listen yet.
        self._sender = Thread(target=self._send, args=((picture, folder.absolute()),))
        self._sender.start()

    def _send(self, what: object) -> None:
        assert self._process.stdin is not None
        # Where it has died, `finish` tells why.
        with suppress(OSError):
            pickle.dump(what, self._process.stdin)
            self._process.stdin.flush()

    def _sent(self) -> None:
        if self._sender is not None:
            self._sender.join()

    def finish(self) -> InputError | None:
        """Wait for the files. Returns why they cannot be written; RuntimeError for any other failure."""
        self._sent()
        _, said = self._process.communicate()
        message = said.decode(errors="replace").strip()
        if self._process.returncode == UNWRITABLE:
            return InputError(message.splitlines()[0], "", "", "")
        if self._process.returncode != 0:
            raise RuntimeError(f"the figures could not be drawn: {message[-2000:]}")
        return None


def main() -> None:
    """The waiting process: load what drawing needs, read what to draw, draw it."""
    # Ctrl-C goes to the parent alone, which ends this process.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    gc.disable()
    from starhold.report.figures import paint, warm_up

    # The pictures of every body load the parts of pages.
    import_module("starhold.report.page_parts")
    warm_up()
    what, folder = pickle.load(sys.stdin.buffer)
    # Everything is loaded, so the other half of the figures costs a second process no start-up.
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
