"""Worker processes on this machine that fly blocks. Each communicates only with this process, through a private pipe, and
ends with it."""

import multiprocessing
import os
import signal
import threading
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from multiprocessing import connection, resource_tracker
from multiprocessing.process import BaseProcess
from types import FrameType
from typing import Any

from starhold.errors import InputError

TRIES = 3
"""The number of processes that may die while flying a block before the block counts as the cause."""
AHEAD = 2
"""The number of blocks sent to a process: one being flown, and one waiting."""
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Environment variables that keep libraries from starting a thread per core."""


@dataclass
class _Worker:
    """A process, this end of its pipe, and the blocks sent to it, in order."""

    process: BaseProcess
    pipe: Any
    blocks: deque[Any] = field(default_factory=deque[Any])


class Team:
    """A number of processes that call `work` for blocks, all with the same first argument."""

    def __init__(self, work: Callable[..., Any], begun: tuple[Any, ...], count: int) -> None:
        self._work, self._begun, self._name = work, begun, f"{count} workers"
        self._workers: list[_Worker] = []
        try:
            self._start(count)
        except BaseException:
            self.close()
            raise

    def _start(self, count: int) -> None:
        """Start processes, and wait until they listen."""
        with _undisturbed():
            begun = [self._begin() for _ in range(count)]
        for worker in begun:
            try:
                worker.pipe.recv()
            except (EOFError, OSError):
                worker.process.join()
                raise self._cannot_start(f"one ended with code {worker.process.exitcode}") from None

    def _begin(self) -> _Worker:
        # Spawned, because a fork would copy threads in the middle of their work.
        context = multiprocessing.get_context("spawn")
        pipe, other = context.Pipe()
        process = context.Process(target=_serve, args=(other, self._work, self._begun), daemon=True)
        kept = {name: os.environ.get(name) for name in ONE_THREAD}
        os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
        try:
            process.start()
        except (OSError, RuntimeError) as error:
            raise self._cannot_start(str(error)) from None
        finally:
            for name, value in kept.items():
                os.environ.pop(name) if value is None else os.environ.update({name: value})
            # Only the worker keeps its end open, so that its death is noticed here.
            other.close()
        self._workers.append(_Worker(process, pipe))
        return self._workers[-1]

    def fly(self, blocks: Iterable[Any]) -> Iterator[tuple[Any, Any]]:
        """Yield each block with its result, in order of arrival. InputError where processes cannot be started, or where all
        that fly a block die."""
        waiting, deaths = deque(blocks), Counter[Any]()
        while waiting or any(worker.blocks for worker in self._workers):
            for worker in self._workers:
                while waiting and len(worker.blocks) < AHEAD:
                    worker.blocks.append(waiting.popleft())
                    self._give(worker)
            ended: list[_Worker] = []
            for pipe in connection.wait([worker.pipe for worker in self._workers]):
                worker = next(one for one in self._workers if one.pipe is pipe)
                try:
                    result = worker.pipe.recv()
                except (EOFError, OSError):
                    ended.append(worker)
                    continue
                yield worker.blocks.popleft(), result
            for worker in ended:
                self._replace(worker, deaths)
                waiting.extendleft(reversed(worker.blocks))

    def _give(self, worker: _Worker) -> None:
        try:
            worker.pipe.send(worker.blocks[-1])
        except OSError:
            # The worker has ended, which the wait for its results will show.
            return

    def _replace(self, worker: _Worker, deaths: Counter[Any]) -> None:
        """Start a process to replace one that has ended."""
        self._workers.remove(worker)
        worker.pipe.close()
        worker.process.join()
        if worker.blocks:
            deaths[worker.blocks[0]] += 1
            if deaths[worker.blocks[0]] >= TRIES:
                raise InputError(self._name, "", "", "a block ended all workers that tried it; they may lack memory")
        self._start(1)

    def _cannot_start(self, reason: str) -> InputError:
        hint = 'a script needs `if __name__ == "__main__":` before the code that starts workers'
        return InputError(self._name, "", "", f"cannot be started: {reason}; {hint}")

    def close(self) -> None:
        """End all processes."""
        for worker in self._workers:
            worker.pipe.close()
            worker.process.kill()
        for worker in self._workers:
            worker.process.join()


def _serve(pipe: Any, work: Callable[..., Any], begun: tuple[Any, ...]) -> None:
    """Process blocks from a pipe until it is closed."""
    follow_parent()
    try:
        pipe.send(None)
        while True:
            pipe.send(work(*begun, *pipe.recv()))
    except (EOFError, OSError):
        return


def follow_parent() -> None:
    """Ignore keyboard interrupts, which the parent process handles, and end with the parent, however it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)


@contextmanager
def _undisturbed() -> Generator[None]:
    """Defer termination signals until processes are started, because an incompletely started one would print a traceback.
    Started processes ignore keyboard interrupts, which reach all processes of a terminal; this process ends the others."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    signals: list[tuple[int, FrameType | None]] = []
    handlers = {
        number: signal.signal(number, lambda *call: signals.append(call)) for number in (signal.SIGINT, signal.SIGTERM)
    }
    # Threads and processes inherit the signal mask of the thread that starts them; starting Python's resource tracker
    # unblocks all signals.
    resource_tracker.ensure_running()
    masked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}) if hasattr(signal, "pthread_sigmask") else None
    try:
        yield
    finally:
        if masked is not None:
            signal.pthread_sigmask(signal.SIG_SETMASK, masked)
        for number, handler in handlers.items():
            signal.signal(number, handler)
    for number, _ in signals[:1]:
        signal.raise_signal(number)
