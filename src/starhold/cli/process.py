"""The streams and signals of a command's process."""

import os
import signal
import sys
from threading import Event
from typing import Any

from starhold.errors import InterruptedByUserError


class Outlet:
    """A stream in place of `sys.stdout` or `sys.stderr`. The first write error is stored in `failure` and later output is
    dropped, so that a command finishes its work and writes its files."""

    def __init__(self, stream: Any) -> None:
        self._stream = stream
        self.failure: OSError | None = None
        # Characters that the encoding lacks are shown as question marks.
        stream.reconfigure(errors="replace")

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write the text as far as the stream accepts it."""
        try:
            return self._stream.write(text)
        except OSError as error:
            self._give_up(error)
            return len(text)

    def flush(self) -> None:
        """Flush as much as the stream accepts."""
        try:
            self._stream.flush()
        except OSError as error:
            self._give_up(error)

    def _give_up(self, error: OSError) -> None:
        self.failure = self.failure or error
        # The stream keeps unsent output, and would fail again when Python exits.
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, self._stream.fileno())
        os.close(nowhere)


def open_outlets() -> None:
    """Put outlets in place of the standard streams of this process; output to a closed stream is dropped."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
        setattr(sys, name, Outlet(getattr(sys, name)))


_interrupted = Event()


def on_signal(number: int, frame: object) -> None:
    """Handle a signal that ends the process."""
    # Stored as well as raised, because an exception in a callback of the garbage collector is swallowed.
    _interrupted.set()
    raise InterruptedByUserError(number)


def heed_interrupt() -> None:
    """Raise the stored interrupt, if there is one."""
    if _interrupted.is_set():
        raise InterruptedByUserError(signal.SIGINT)
