"""Engines fly the same results, pass errors on, and keep few blocks under way."""

import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from dataclasses import dataclass, field, replace

import numpy as np
import psutil
import pytest

from starhold.campaign import engines
from starhold.campaign.engines import Scheduler, Threads, Workers
from starhold.campaign.store import Store
from starhold.errors import InputError
from tests.campaign.cluster import ENVIRONMENT, cluster
from tests.campaign.toy import Toy, fly, manifest, missing
from tests.tiers import leading


@pytest.fixture(scope="module")
def running(tmp_path_factory):
    with cluster(tmp_path_factory.mktemp("cluster")) as (address, *_):
        yield address


def reference(tmp_path):
    return fly(Store.create(tmp_path / "reference", manifest()))


@pytest.mark.slow
def test_an_existing_cluster_finds_the_same_results(tmp_path, store, running):
    assert fly(store, Scheduler(running)) == reference(tmp_path)


@pytest.mark.parametrize("processes", [False, True])
def test_what_a_job_refuses_is_told_as_it_is(store, running, processes):
    with pytest.raises(InputError) as caught:
        fly(store, Scheduler(running) if processes else Threads(1), Toy(refused=40))
    assert (caught.value.where, caught.value.key) == ("toy.toml", "law.pd")
    assert str(caught.value) == "toy.toml: law.pd: found a gain; allowed: another"


@dataclass(frozen=True)
class Faulty(Toy):
    """In a process of its own it goes wrong, from a block on."""

    how: str = ""
    since: int = 32
    home: int = field(default_factory=os.getpid)

    def fly(self, law, first, count):
        chunk = super().fly(law, first, count)
        if os.getpid() == self.home or first < self.since:
            return chunk
        if self.how == "raises":
            raise TypeError("no number\nbut a word")
        if self.how == "ends":
            os._exit(3)
        changes = {
            "is something else": lambda: "runs",
            "is of other runs": lambda: super(Faulty, self).fly(law, first + 1, count),
            "has other columns": lambda: replace(chunk, rows={"run": chunk.rows["run"]}),
            "is cut": lambda: cut(chunk),
            "has another bit": lambda: replace(
                chunk, rows=chunk.rows | {"flown.pd": np.nextafter(chunk.rows["flown.pd"], 9.0)}
            ),
        }
        return changes[self.how]()


def cut(chunk):
    """What no chunk can be, and a pipe delivers."""
    chunk.rows["settling_time"] = chunk.rows["settling_time"][1:]
    return chunk


FAULTS = {
    "has another bit": r"other numbers in run 32 of pd \(flown.pd\)",
    "raises": r"process \d+ on .*: failed in runs 32 to 47 of pd: TypeError: no number; the runs flown are kept",
    "ends": "a block ended all workers that tried it",
    "is something else": r"process \d+ on .*: found a result that is not of runs 32 to 47 of pd; allowed: the",
    "is of other runs": "a result that is not of runs 32 to 47 of pd",
    "has other columns": "a result that is not of runs 32 to 47 of pd",
    "is cut": "a result that is not of runs 32 to 47 of pd",
}


@pytest.mark.parametrize("how", leading(FAULTS))
def test_a_worker_that_goes_wrong_is_told_in_one_line(store, how, monkeypatch):
    monkeypatch.setattr(engines, "_CHECKED", 1.0)
    with pytest.raises(InputError, match=FAULTS[how]) as caught:
        fly(store, Workers(1), Faulty(how=how))
    assert "\n" not in str(caught.value)
    # What came before is kept, and nothing of what is wrong.
    assert store.missing("pd")[0] == (32, 16)


@pytest.mark.parametrize("how", leading(["raises", "has another bit"]))
def test_a_worker_of_a_cluster_that_goes_wrong_is_told_in_one_line(store, how, running):
    with pytest.raises(InputError, match=FAULTS[how].replace("32 to 47", "0 to 15").replace("32", "0")):
        fly(store, Scheduler(running), Faulty(how=how, since=0))
    assert store.missing("pd")[0] == (0, 16)


def test_a_fault_of_this_process_is_no_user_error(store):
    with pytest.raises(TypeError, match="cannot be interpreted"):
        fly(store, Threads(1), Toy(pause="long"))


def test_workers_find_the_same_results_say_nothing_and_listen_to_nobody_else(tmp_path, store, capfd):
    """Not to other users of the machine, nor by the network."""
    here, seen = psutil.Process(), set()
    before = set(here.children(recursive=True))

    def listening(process):
        return {one.laddr for one in process.net_connections() if one.status == psutil.CONN_LISTEN}

    held = listening(here)

    def progress(chunk):
        for process in set(here.children(recursive=True)) - before:
            seen.add(process)
            assert not listening(process)
        assert listening(here) <= held

    assert fly(store, Workers(2), progress=progress) == reference(tmp_path)
    assert capfd.readouterr() == ("", "")
    assert len(seen) >= 2


@pytest.mark.slow
def test_workers_of_a_script_without_its_guard_leave_nothing(tmp_path):
    """Each worker reads the script too."""
    text = (
        "import starhold as sh\nfrom tests.campaign.flown import OVER, small\n"
        "sh.campaign(small(), 'out', runs=20, over=OVER, search=False, workers=1)\n"
    )
    (tmp_path / "script.py").write_text(text)
    done = subprocess.run(
        [sys.executable, "script.py"], cwd=tmp_path, env=ENVIRONMENT, capture_output=True, text=True, check=False, timeout=60
    )
    assert "InputError: 1 workers: cannot be started: one ended with code 1; a script needs `if __name__ ==" in done.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_few_blocks_are_under_way_however_many_there_are(tmp_path, running):
    trail = tmp_path / "trail"
    trail.mkdir()
    store = Store.create(tmp_path / "campaign", manifest(runs=32, chunk=2))
    ahead = []

    def progress(chunk):
        # A writer that is slow: workers would be far ahead of it if they had all blocks.
        time.sleep(0.03)
        ahead.append(len(list(trail.glob("[lp]*"))) - len(ahead))

    fly(store, Scheduler(running), Toy(trail=trail), progress)
    assert len(ahead) == 32
    assert 1 <= max(ahead) <= engines._AHEAD + 1


def test_threads_have_the_next_block_at_hand_and_no_more(store):
    ahead, stored = [], []

    class Told(Toy):
        def __call__(self, law, first, count, pool):
            ahead.append(len(ahead) + 1 - len(stored))
            return super().__call__(law, first, count, pool)

    fly(store, Threads(1), Told(), stored.append)
    assert ahead == [1, *[2] * 13]
    assert len(stored) == 14


@pytest.mark.slow
def test_an_interrupt_keeps_what_is_there_and_does_not_wait_for_blocks_under_way(tmp_path, store):
    def interrupt():
        while not list((tmp_path / "campaign").rglob("*.parquet")):
            time.sleep(0.02)
        time.sleep(0.3)
        os.kill(os.getpid(), signal.SIGINT)

    class Slow(Toy):
        def fly(self, law, first, count):
            time.sleep(60.0 if first else 0.0)
            return super().fly(law, first, count)

    threading.Thread(target=interrupt, daemon=True).start()
    started = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        fly(store, Workers(1), Slow())
    assert time.monotonic() - started < 20.0
    assert 0 < len(missing(store)) < 14
    assert fly(Store.open(store.folder).resume(manifest())) == reference(tmp_path)


def test_other_versions_are_told(store, running, monkeypatch):
    monkeypatch.setattr(engines, "__version__", "9.9")
    with pytest.raises(InputError, match=r"tcp://.*: tcp://.*: found starhold \d.*; allowed: 9.9, as here"):
        fly(store, Scheduler(running))
    monkeypatch.undo()
    as_is = engines._compared
    monkeypatch.setattr(engines, "_compared", lambda versions: as_is(versions) | {"dask": str(id(versions))})
    with pytest.raises(InputError, match=r"the scheduler: found dask \d+; allowed: \d+, as here"):
        fly(store, Scheduler(running))


@pytest.mark.parametrize(
    ("packed", "version", "told"),
    [
        (b"", "9.9", "a worker: found starhold .*; allowed: 9.9, as here"),
        (b"cnowhere\nnothing\n.", engines.__version__, "cannot read the campaign: No module named 'nowhere'"),
    ],
)
def test_a_worker_of_another_version_or_without_a_module_tells(packed, version, told):
    _, refusal = engines._fly(packed, version, "pd", 0, 1)
    with pytest.raises(InputError, match=told):
        raise pickle.loads(pickle.dumps(refusal))
