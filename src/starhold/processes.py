"""Copies of this process, which work on other processors."""

import os
import signal
import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager
from threading import active_count


def can_fork() -> bool:
    """Return whether this process can be copied: a copy of one with several threads may wait for locks that are never
    released."""
    return sys.platform.startswith("linux") and active_count() == 1


def has_others() -> bool:
    """Return whether this process may use several processors."""
    return can_fork() and len(os.sched_getaffinity(0)) > 1


@contextmanager
def aside(work: Callable[[], None]) -> Generator[None]:
    """Have a copy of this process do some work while the context runs, where there is a processor for it; otherwise the work
    is done at once. The context ends when it is done."""
    if not has_others():
        work()
        yield
        return
    from multiprocessing import get_context

    process = get_context("fork").Process(target=_quietly, args=(work,))
    process.start()
    try:
        yield
    finally:
        process.join()
        if process.exitcode:
            # What prevented it is raised here.
            work()


def _quietly(work: Callable[[], None]) -> None:
    """Do the work of a copy. Signals and errors are left to the original process."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    try:
        work()
    except BaseException:
        os._exit(1)
