"""The studio's jobs, each a process with a folder of results; both are removed when the studio ends."""

import shutil
import tempfile
import threading
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from pathlib import Path
from typing import Any

from starhold.studio.worker import work

SPAWN = get_context("spawn")
MOST = 3
"""The largest number of jobs at a time."""


@dataclass
class Job:
    """One task: its number, kind, folder, progress and result."""

    number: int
    kind: str
    name: str
    folder: Path
    process: SpawnProcess
    laws: Sequence[str] = ()
    state: dict[str, Any] = field(default_factory=dict[str, Any])
    ended: bool = False

    def status(self) -> dict[str, Any]:
        """Return a description of the task for the page."""
        return {
            "number": self.number,
            "kind": self.kind,
            "name": self.name,
            "laws": self.laws,
            "ended": self.ended,
            **self.state,
        }


class Jobs:
    """All tasks since the studio began."""

    def __init__(self) -> None:
        self._place = tempfile.TemporaryDirectory(prefix="starhold-studio-", ignore_cleanup_errors=True)
        self._jobs: dict[int, Job] = {}
        self._lock = threading.Lock()

    def start(self, kind: str, name: str, text: str, where: str, beside: Path, laws: Sequence[str]) -> Job:
        """Start a job about these laws and return it. ValueError where the largest number of jobs is running."""
        with self._lock:
            if sum(not job.ended for job in self._jobs.values()) >= MOST:
                raise ValueError(f"{MOST} jobs are running already; stop one, or wait")
            number = len(self._jobs) + 1
            folder = Path(self._place.name) / str(number)
            folder.mkdir()
            reports, teller = SPAWN.Pipe(duplex=False)
            process = SPAWN.Process(target=work, args=(teller, kind, text, where, beside, folder, laws))
            process.start()
            # When the process ends, the last sending end of the pipe is closed.
            teller.close()
            job = self._jobs[number] = Job(number, kind, name, folder, process, laws)
        threading.Thread(target=_follow, args=(job, reports), daemon=True).start()
        return job

    def get(self, number: int) -> Job | None:
        """Return the job of this number, or None."""
        return self._jobs.get(number)

    def all(self) -> list[dict[str, Any]]:
        """Return descriptions of all tasks for the page."""
        return [job.status() for job in self._jobs.values()]

    def stop(self, number: int) -> None:
        """End a job; results that it has not written are lost."""
        job = self._jobs.get(number)
        if job is not None and not job.ended:
            job.state = {"error": "stopped"}
            job.process.terminate()

    def close(self) -> None:
        """End all jobs and remove their folders."""
        for number in self._jobs:
            self.stop(number)
        for job in self._jobs.values():
            job.process.join()
        shutil.rmtree(self._place.name, ignore_errors=True)
        self._place.cleanup()


def _follow(job: Job, reports: Connection) -> None:
    """Store the reports of a process until it ends."""
    with suppress(EOFError):
        while True:
            state = reports.recv()
            if "error" not in job.state:
                job.state = state
    job.process.join()
    if not {"shown", "error"} & job.state.keys():
        job.state = {"error": f"ended with code {job.process.exitcode}"}
    job.ended = True
