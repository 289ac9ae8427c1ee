"""Campaigns of real flights that are killed, or run out of disk, as a user's are: told in a line, and flown on to the same
digest. Each is of the command line, in processes of its own."""

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import suppress

import psutil
import pytest

import starhold as sh
from starhold.campaign.campaign import CHUNK
from tests.campaign.flown import ASKED, OVER, SMALL

COMMAND = [sys.executable, "-m", "starhold", "campaign", "long.toml", "--law", "pd", "--no-search", "-o"]
RUNS = 2 * CHUNK + 3000
"""Three blocks, half a second each or more."""


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    folder = tmp_path_factory.mktemp("crashes")
    tables = SMALL | {"simulation": SMALL["simulation"] | {"duration": 15.0}}
    tables |= {"campaign": {"runs": RUNS, "over": OVER}, "requirement": [one | {"method": "campaign"} for one in ASKED[:2]]}
    (folder / "long.toml").write_text(sh.scenario(tables).text)
    return folder


def digest(folder):
    return json.loads((folder / "campaign.json").read_text())["digest"]


def start(place, name, *words, **options):
    said = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen([*COMMAND, name, *words], cwd=place, **said | options)


def done(child, timeout=120):
    """Its exit code and what it said; ended whatever happens."""
    try:
        _, said = child.communicate(timeout=timeout)
    finally:
        child.kill()
        child.wait()
    return child.returncode, said


@pytest.fixture(scope="module")
def expected(place):
    assert done(start(place, "whole", "--threads", "2")) in [(0, ""), (3, ""), (4, "")]
    return digest(place / "whole")


def chunks(folder):
    return sorted((folder / "runs").glob("*/[0-9]*.parquet"))


def wait_for_chunks(child, folder, count):
    end = time.monotonic() + 60.0
    while len(chunks(folder)) < count:
        if child.poll() is not None or time.monotonic() > end:
            child.kill()
            pytest.fail(f"not {count} chunks: {child.communicate()}")
        time.sleep(0.005)


def resumed(place, name, *words):
    """The digest after `--resume`, and what was said."""
    code, said = done(start(place, name, "--resume", *(words or ("--threads", "2"))))
    assert code in (0, 3, 4), said
    return digest(place / name), said


@pytest.mark.slow
def test_an_interrupt_is_told_and_resumed_to_the_same_digest(place, expected):
    child = start(place, "asked", "--threads", "2")
    wait_for_chunks(child, place / "asked", 1)
    child.send_signal(signal.SIGINT)
    assert done(child) == (130, "starhold: interrupted; files already written are whole\n")
    assert not list((place / "asked").rglob(".writing-*"))
    assert resumed(place, "asked") == (expected, "")


def workers_of(child):
    found = []
    for process in psutil.Process(child.pid).children(recursive=True):
        with suppress(psutil.Error):
            if "spawn_main" in " ".join(process.cmdline()):
                found.append(process)
    return found


@pytest.mark.slow
def test_a_driver_killed_with_workers_is_resumed_to_the_same_digest(place, expected):
    child = start(place, "driver", "--workers", "2")
    wait_for_chunks(child, place / "driver", 1)
    workers = workers_of(child)
    assert len(workers) == 2
    child.kill()
    child.communicate()
    assert resumed(place, "driver", "--workers", "2") == (expected, "")
    end = time.monotonic() + 60.0
    while any(worker.is_running() and worker.status() != psutil.STATUS_ZOMBIE for worker in workers):
        assert time.monotonic() < end, "workers outlive their driver"
        time.sleep(0.2)


MILLION = """
import re, sys
from pathlib import Path
import starhold as sh
from tests.campaign.flown import SMALL
tables = SMALL | {"simulation": SMALL["simulation"] | {"duration": 4.0}, "law": SMALL["law"][:1]}
over = {"initial.rate": {"distribution": "shell", "high": "4 deg/s"}, "law.pd.k_rate": {"distribution": "uniform",
        "low": 1.5, "high": 2.5}}
asked = [{"metric": "effort", "at_most": 1.0, "share": 0.5}, {"metric": "lost"}]
found = sh.campaign(sh.scenario(tables), sys.argv[1], runs=int(sys.argv[2]), threads=int(sys.argv[3]), over=over,
                    requirement=asked, search=False)
peak = re.search(r"VmHWM:\\s*(\\d+) kB", Path("/proc/self/status").read_text())[1]
print(found.digest, found.laws[0].runs, peak)
"""


def many(folder, runs, threads):
    root = os.path.dirname(os.path.dirname(os.path.dirname(__file__)))
    command = [sys.executable, "-c", MILLION, str(folder), str(runs), str(threads)]
    told = subprocess.run(command, cwd=root, check=True, stdout=subprocess.PIPE, text=True).stdout.split()
    assert int(told[1]) == runs
    return told[0], int(told[2]) / 2**20


@pytest.mark.slow
def test_a_million_runs_stay_below_a_gibibyte(tmp_path):
    _, peak = many(tmp_path / "million", 1_000_000, 2)
    assert peak < 1.0


@pytest.mark.slow
def test_the_digest_of_many_runs_is_that_of_any_number_of_threads(tmp_path):
    one, two = (many(tmp_path / str(threads), 200_000, threads)[0] for threads in (1, 2))
    assert one == two
