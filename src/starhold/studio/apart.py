"""Processes that work for a studio."""

import os
import signal
import threading
from multiprocessing import parent_process


def begin() -> None:
    """Silence the output of files that are run, and end the process when the studio ends, however that ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for stream in (1, 2):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream)
    threading.Thread(target=_end_with_studio, daemon=True).start()


def _end_with_studio() -> None:
    studio = parent_process()
    assert studio is not None
    studio.join()
    os._exit(0)
