"""Scenarios are checked in a process of their own, for the files that they name may not end, or end the process."""

from __future__ import annotations

import threading
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from starhold.studio import editing
from starhold.studio.apart import begin

LONGEST = 20.0
"""Seconds that a check may take."""


class Checker:
    """Checks one text at a time; its process begins with the first one, and again after one that was ended."""

    def __init__(self, longest: float = LONGEST) -> None:
        self._longest, self._lock = longest, threading.Lock()
        self._pool: ProcessPoolExecutor | None = None

    def check(self, text: str, where: str, folder: Path) -> dict[str, Any]:
        """Return the answer of `editing.check` about a text, or that its check does not end."""
        with self._lock:
            self._pool = self._pool or ProcessPoolExecutor(1, get_context("spawn"), begin)
            try:
                return self._pool.submit(_check, text, where, folder).result(self._longest)
            except TimeoutError:
                why = f"did not end within {self._longest:g} s; a file that it names may not"
            except BrokenProcessPool:
                why = "ended without an answer; a file that it names may have ended it"
            self.close()
            return {"error": f"{where}: the check {why}"}

    def close(self) -> None:
        """End the process."""
        # Without the lock, which a check that does not end holds.
        pool, self._pool = self._pool, None
        if pool is not None:
            for process in list((pool._processes or {}).values()):
                process.kill()
            pool.shutdown()


def _check(text: str, where: str, folder: Path) -> dict[str, Any]:
    try:
        return editing.check(text, where, folder)
    except Exception as error:
        return {"error": f"{where}: {type(error).__name__}: {error}"}
