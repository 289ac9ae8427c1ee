"""Things that were asked of the studio, each a process with a folder of results; they go when the studio does."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tempfile
import threading
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

MOST = 3
"""Jobs that work at a time."""


@dataclass
class Job:
    """One thing that was asked for: its number, kind, folder, how far it is, and what came of it."""

    number: int
    kind: str
    name: str
    folder: Path
    process: subprocess.Popen[str]
    laws: Sequence[str] = ()
    state: dict[str, Any] = field(default_factory=dict[str, Any])
    ended: bool = False

    def told(self) -> dict[str, Any]:
        """Tell the page of it."""
        return {
            "number": self.number,
            "kind": self.kind,
            "name": self.name,
            "laws": self.laws,
            "ended": self.ended,
            **self.state,
        }


class Jobs:
    """All that was asked for since the studio began."""

    def __init__(self) -> None:
        self._place = tempfile.TemporaryDirectory(prefix="starhold-studio-", ignore_cleanup_errors=True)
        self._jobs: dict[int, Job] = {}
        self._lock = threading.Lock()

    def start(self, kind: str, name: str, text: str, where: str, beside: Path, laws: Sequence[str]) -> Job:
        """Begin a job about these laws; ValueError where as many as may are at work."""
        with self._lock:
            if sum(not job.ended for job in self._jobs.values()) >= MOST:
                raise ValueError(f"{MOST} things are at work already; stop one, or wait")
            number = len(self._jobs) + 1
            folder = Path(self._place.name) / str(number)
            folder.mkdir()
            command = [sys.executable, "-m", "starhold.studio.worker", kind, where, str(beside), str(folder), *laws]
            process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, encoding="utf-8"
            )
            job = self._jobs[number] = Job(number, kind, name, folder, process, laws)
        threading.Thread(target=_follow, args=(job, text), daemon=True).start()
        return job

    def get(self, number: int) -> Job | None:
        """The job of this number."""
        return self._jobs.get(number)

    def all(self) -> list[dict[str, Any]]:
        """Tell the page of all of them."""
        return [job.told() for job in self._jobs.values()]

    def stop(self, number: int) -> None:
        """End a job; what it has not written is lost."""
        job = self._jobs.get(number)
        if job is not None and not job.ended:
            job.state = {"error": "stopped"}
            job.process.terminate()

    def close(self) -> None:
        """End all jobs and take their folders away."""
        for number in self._jobs:
            self.stop(number)
        for job in self._jobs.values():
            job.process.wait()
        shutil.rmtree(self._place.name, ignore_errors=True)
        self._place.cleanup()


def _follow(job: Job, text: str) -> None:
    """Hand a process its scenario, and note what it tells until it ends."""
    process = job.process
    given, told, errors = process.stdin, process.stdout, process.stderr
    assert given is not None
    assert told is not None
    assert errors is not None
    # Read beside, for a full pipe would stop the process.
    complaints: list[str] = []
    listener = threading.Thread(target=lambda: complaints.extend(errors), daemon=True)
    listener.start()
    with suppress(BrokenPipeError):
        # Left open: where this process ends, however that happens, the job sees its end and ends too.
        given.write(json.dumps(text) + "\n")
        given.flush()
    for line in told:
        if "error" not in job.state:
            job.state = json.loads(line)
    process.wait()
    listener.join()
    with suppress(BrokenPipeError):
        given.close()
    if not {"shown", "error"} & job.state.keys():
        job.state = {"error": "".join(complaints[-20:]).strip() or f"ended with code {process.returncode}"}
    job.ended = True
