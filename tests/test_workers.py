"""Workers run every test once, and what they find is told as one process tells it."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

CONFTEST = """
from tests import workers


def pytest_addoption(parser):
    parser.addoption("--workers", type=int, default=1)


def pytest_configure(config):
    config.pluginmanager.register(workers)
"""
ONE = """
import pytest


@pytest.mark.parametrize("k", range(5))
def test_it(k):
    print("said", k)
    assert k != 3
"""
TWO = """
import pytest


def test_it(tmp_path):
    (tmp_path / "x").touch()


def test_left():
    pytest.skip()
"""
THREE = """
import pytest


@pytest.fixture
def broken():
    raise OSError


def test_it(broken):
    pass
"""
FILES = {"test_one.py": ONE, "test_two.py": TWO, "test_three.py": THREE}
ENDS = {"test_ends.py": "import os\n\n\ndef test_it():\n    os._exit(0)\n\n\ndef test_after():\n    pass\n"}
SLOW = {"test_slow.py": "import time\n\n\ndef test_it():\n    time.sleep(60)\n"}


def told(folder, files, *words):
    """How a run of these files ends, and all that it prints."""
    for name, text in ({"conftest.py": CONFTEST} | files).items():
        (folder / name).write_text(text)
    command = [sys.executable, "-m", "pytest", "-c", os.devnull, "--rootdir", ".", "-p", "no:hypothesispytest", *words]
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[1])}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    return done.returncode, done.stdout + done.stderr


@pytest.mark.parametrize("count", [1, 2, 3])
def test_all_are_run_and_told_as_by_one(count, tmp_path):
    code, text = told(tmp_path, FILES, f"--workers={count}")
    assert code == 1
    assert "1 failed, 5 passed, 1 skipped, 1 error" in text
    assert text.count("said 3") == 1
    assert "said 2" not in text
    assert "FAILED test_one.py::test_it[3]" in text


def test_a_worker_that_ends_fails_the_test_it_ran_and_the_run(tmp_path):
    code, text = told(tmp_path, FILES | ENDS, "--workers=2")
    assert code == 2
    assert "FAILED test_ends.py::test_it - the process that ran this test ended" in text
    assert "a worker ended before its last" in text


def test_the_first_failure_ends_the_run_where_that_is_asked_for(tmp_path):
    code, text = told(tmp_path, FILES | SLOW, "--workers=2", "-x", "-W", "error")
    assert code == 1
    assert "stopping after 1 failures" in text
    assert "unclosed" not in text
