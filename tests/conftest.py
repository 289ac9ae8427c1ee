"""Settings of the whole test run."""

import os
import re
from functools import cache
from pathlib import Path

# Before NumPy loads: on small matrices the library's threads only wait for one another.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest
from hypothesis import settings

settings.register_profile("starhold", deadline=None, derandomize=True)
settings.load_profile("starhold")

ROOT = Path(__file__).parents[1]


@cache
def unit_of(file):
    """What one worker runs together: the files that mark any test of theirs with the same `xdist_group`, else a file alone.
    So what a file makes once, a certificate or a compiled kernel, no two workers make."""
    marked = re.search(r'xdist_group\("([^"]+)"\)', (ROOT / file).read_text(encoding="utf-8"))
    return marked[1] if marked else file


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """Whole files to a worker at a time. pytest-xdist 3.8 reads the mark from node ids, in which pytest 9.2 leaves none."""
    if config.getvalue("dist") != "loadgroup":
        return None
    from xdist.scheduler import LoadGroupScheduling

    class Units(LoadGroupScheduling):
        def _split_scope(self, nodeid):
            return unit_of(nodeid.split("::")[0])

    return Units(config, log)
