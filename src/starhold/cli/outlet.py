"""Standard output that does not stop a command: who reads it may go away, its disk may be full, its encoding may be poor."""

from __future__ import annotations

import os
import sys
from typing import Any


class Outlet:
    """A stream in place of `sys.stdout` or `sys.stderr`. The first error of writing is noted in `failure`; what comes after
    it goes nowhere, so that a command ends its work and its files are written."""

    def __init__(self, stream: Any) -> None:
        self._stream = stream
        self.failure: OSError | None = None
        # What the encoding does not have is shown as a question mark.
        stream.reconfigure(errors="replace")

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write the text as far as the stream takes it."""
        try:
            return self._stream.write(text)
        except OSError as error:
            self._give_up(error)
            return len(text)

    def flush(self) -> None:
        """Send on as much as the stream takes."""
        try:
            self._stream.flush()
        except OSError as error:
            self._give_up(error)

    def _give_up(self, error: OSError) -> None:
        self.failure = self.failure or error
        # The stream keeps what it could not send, and would fail with it again as Python ends.
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, self._stream.fileno())
        os.close(nowhere)


def open_outlets() -> None:
    """Put outlets in place of the standard streams of this process; a stream that is closed prints nowhere."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
        setattr(sys, name, Outlet(getattr(sys, name)))
