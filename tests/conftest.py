"""Settings of the whole test run."""

import os
import re
import sys
from functools import cache
from pathlib import Path

# Before NumPy loads: on small matrices the library's threads only wait for one another.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest
from hypothesis import settings

# Where modules are not to be kept once compiled, each process that a test starts would compile all of starhold anew.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

settings.register_profile("starhold", deadline=None, derandomize=True)
settings.load_profile("starhold")

ROOT = Path(__file__).parents[1]
LONGEST = (
    "cli",
    "textbook",
    "every machine",
    "campaign engines",
    "built-in sets",
    "tests/laws/test_conformance.py",
    "tests/certification/test_region.py",
    "tests/campaign/test_campaign.py",
    "tests/parts/test_conformance_of_parts.py",
    "tests/certification/test_station_checker.py",
)
"""Units that take longest: begun first, so that no worker is left with one at the end."""


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

        def _assign_work_unit(self, node):
            longest = next((unit for unit in LONGEST if unit in self.workqueue), None)
            if longest is not None:
                self.workqueue.move_to_end(longest, last=False)
            super()._assign_work_unit(node)

    return Units(config, log)
