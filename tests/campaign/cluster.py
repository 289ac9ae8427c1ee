"""A Dask cluster in processes of its own, which tests may kill."""

import os
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

from distributed import Client

ROOT = Path(__file__).parents[2]
ENVIRONMENT = os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "src")])}


def start(module, *words, **options):
    """A Python process of its own that runs a module."""
    return subprocess.Popen([sys.executable, "-m", module, *words], cwd=ROOT, env=ENVIRONMENT, **options)


@contextmanager
def cluster(folder, workers=1):
    """The scheduler's address, its process and those of its workers, which nobody starts again."""
    log = (folder / "cluster.log").open("w")
    quiet = {"stdout": log, "stderr": log}
    told = folder / "scheduler.json"
    processes = []
    words = ("--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(told))
    try:
        processes.append(start("distributed.cli.dask_scheduler", *words, **quiet))
        # The file is there before it is written.
        while not (address := told.read_text().partition('"address": "')[2].partition('"')[0] if told.exists() else ""):
            assert processes[0].poll() is None
            time.sleep(0.05)
        words = (address, "--nthreads", "1", "--no-nanny", "--no-dashboard", "--local-directory", str(folder))
        processes += [start("distributed.cli.dask_worker", *words, **quiet) for _ in range(workers)]
        with Client(address, set_as_default=False) as client:
            client.wait_for_workers(workers, timeout=60)
        yield address, processes[0], processes[1:]
    finally:
        for process in processes:
            process.kill()
            process.wait()
        log.close()
