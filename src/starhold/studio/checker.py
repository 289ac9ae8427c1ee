"""Scenarios are checked in a process of their own, for the files that they name may not end, or end the process."""

from __future__ import annotations

import json
import os
import queue
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path
from typing import Any

from starhold.studio import editing

LONGEST = 20.0
"""Seconds that a check may take."""


class Checker:
    """Checks one text at a time; its process begins with the first one, and again after one that was ended."""

    def __init__(self, longest: float = LONGEST) -> None:
        self._longest, self._lock = longest, threading.Lock()
        self._process: subprocess.Popen[str] | None = None
        self._answers: queue.Queue[str] = queue.Queue()

    def check(self, text: str, where: str, folder: Path) -> dict[str, Any]:
        """Tell of a text what `editing.check` does, or that its check does not end."""
        with self._lock:
            process = self._running()
            assert process.stdin is not None
            try:
                process.stdin.write(json.dumps([text, where, str(folder)]) + "\n")
                process.stdin.flush()
                line = self._answers.get(timeout=self._longest)
            except queue.Empty:
                self._end()
                return {"error": f"{where}: the check did not end within {self._longest:g} s; a file that it names may not"}
            except OSError:
                line = ""
            if not line:
                self._end()
                return {"error": f"{where}: the check ended without an answer; a file that it names may have ended it"}
            return json.loads(line)

    def close(self) -> None:
        """End the process."""
        # Without the lock, which a check that does not end holds.
        process = self._process
        if process is not None and process.stdin is not None:
            process.kill()
            process.wait()
            with suppress(OSError):
                process.stdin.close()

    def _running(self) -> subprocess.Popen[str]:
        if self._process is None or self._process.poll() is not None:
            command = [sys.executable, "-m", "starhold.studio.checker"]
            process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
                encoding="utf-8",
            )
            answers: queue.Queue[str] = queue.Queue()
            threading.Thread(target=_listen, args=(process, answers), daemon=True).start()
            self._process, self._answers = process, answers
        return self._process

    def _end(self) -> None:
        self.close()
        self._process = None


def _listen(process: subprocess.Popen[str], answers: queue.Queue[str]) -> None:
    assert process.stdout is not None
    with process.stdout as told:
        for line in told:
            answers.put(line)
    answers.put("")


def main() -> None:
    """Answer each line of standard input, a text with its name and folder, by a line of JSON."""
    # What files print as they are run must not stand between the answers.
    answers, sys.stdout = sys.stdout, sys.stderr
    asked: queue.Queue[str] = queue.Queue()
    threading.Thread(target=_hear, args=(asked,), daemon=True).start()
    while True:
        text, where, folder = json.loads(asked.get())
        try:
            found = editing.check(text, where, Path(folder))
        except Exception as error:
            found = {"error": f"{where}: {type(error).__name__}: {error}"}
        print(json.dumps(found), file=answers, flush=True)


def _hear(asked: queue.Queue[str]) -> None:
    for line in sys.stdin:
        asked.put(line)
    # The studio is gone, and with it whoever waits for a check that may not end.
    os._exit(0)


if __name__ == "__main__":
    main()
