"""Killed workers, schedulers and drivers, full disks, corrupted chunks: told in a line, and flown on to the same digest."""

import errno
import os
import signal
import subprocess
import time
from contextlib import suppress
from pathlib import Path

import psutil
import pytest

from starhold import files
from starhold.campaign.engines import Scheduler, Threads, Workers
from starhold.campaign.store import Store
from starhold.errors import InputError
from tests.campaign.cluster import cluster, start
from tests.campaign.toy import Toy, fly, manifest, missing
from tests.tiers import leading


@pytest.fixture
def trail(tmp_path):
    (tmp_path / "trail").mkdir()
    return tmp_path / "trail"


@pytest.fixture
def expected(tmp_path):
    return fly(Store.create(tmp_path / "expected", manifest()))


def resumed(store):
    return fly(Store.open(store.folder).resume(manifest()))


def chunks(folder):
    return sorted(folder.rglob("[0-9]*.parquet"))


def group(leader):
    """The living processes of a group."""
    living = []
    for process in psutil.process_iter(["status"]):
        with suppress(ProcessLookupError):
            if os.getpgid(process.pid) == leader and process.info["status"] != psutil.STATUS_ZOMBIE:
                living.append(process.pid)
    return living


def wait_for_end(driver):
    """Workers do not outlive their driver."""
    end = time.monotonic() + 20.0
    while group(driver.pid):
        assert time.monotonic() < end
        time.sleep(0.1)


def kill_worker_once(trail):
    """What to do after the first chunk: end the worker that flies a block at that moment."""
    killed = []

    def progress(chunk):
        if not killed:
            killed.append(int(max(trail.glob("[lp]*-[0-9]*"), key=lambda path: path.stat().st_mtime_ns).read_text()))
            os.kill(killed[0], signal.SIGKILL)

    return killed, progress


@pytest.mark.slow
def test_blocks_of_a_killed_worker_are_flown_by_others(store, trail, expected, capfd):
    killed, progress = kill_worker_once(trail)
    assert fly(store, Workers(2), Toy(0.2, trail), progress) == expected
    assert killed != [os.getpid()]
    assert capfd.readouterr() == ("", "")


@pytest.mark.slow
def test_a_killed_worker_of_a_cluster_leaves_its_blocks_to_the_others(tmp_path, store, trail, expected):
    with cluster(tmp_path, workers=2) as (address, _, workers):
        killed, progress = kill_worker_once(trail)
        assert fly(store, Scheduler(address), Toy(0.2, trail), progress) == expected
        assert killed[0] in [worker.pid for worker in workers]


@pytest.mark.slow
def test_without_any_worker_left_the_campaign_ends_and_can_be_resumed(tmp_path, store, trail, expected):
    with cluster(tmp_path) as (address, _, _):
        _, progress = kill_worker_once(trail)
        with pytest.raises(InputError, match=r"no worker for 1 s; the runs flown are kept, --resume continues from there$"):
            fly(store, Scheduler(address, patience=1.0), Toy(0.2, trail), progress)
    assert 1 <= len(chunks(store.folder)) < 14
    assert resumed(store) == expected


@pytest.mark.slow
def test_a_killed_scheduler_ends_the_campaign_which_can_be_resumed(tmp_path, store, expected, capfd):
    with cluster(tmp_path) as (address, scheduler, _):
        started = []

        def progress(chunk):
            started.append(time.monotonic())
            scheduler.kill()

        with pytest.raises(
            InputError, match=r"^tcp://.*does not answer; the runs flown are kept, --resume continues from there$"
        ):
            fly(store, Scheduler(address), Toy(0.2), progress)
        assert time.monotonic() - started[0] < 15.0
    assert 1 <= len(chunks(store.folder)) < 14
    assert capfd.readouterr() == ("", "")
    assert resumed(store) == expected


@pytest.mark.parametrize("engine", leading(["workers", "threads"]))
def test_a_killed_driver_leaves_what_can_be_resumed(tmp_path, expected, engine):
    folder = tmp_path / "campaign"
    told = {"stdout": subprocess.PIPE, "start_new_session": True}
    driver = start("tests.campaign.toy", str(folder), engine, "100", "16", "0.2", **told)
    driver.stdout.readline()
    driver.stdout.readline()
    driver.kill()
    driver.communicate()
    wait_for_end(driver)
    assert 2 <= len(chunks(folder)) < 14
    # What a write leaves that is cut off at the worst instant.
    half = folder / "runs" / "pd" / f"{files.UNFINISHED}half"
    half.mkdir()
    (half / "000000096-000000099.0123456789abcdef.parquet").write_bytes(b"PAR1")
    store = Store.open(folder).resume(manifest())
    assert not half.exists()
    assert store.notices == []
    assert fly(store) == expected


@pytest.mark.slow
def test_an_interrupt_while_workers_start_ends_all_of_them_quietly(tmp_path):
    """As the keyboard sends it: to the workers too."""
    folder = tmp_path / "campaign"
    told = {"stderr": subprocess.PIPE, "stdout": subprocess.DEVNULL, "text": True}
    driver = start("tests.campaign.toy", str(folder), "workers", "100", "16", "5", start_new_session=True, **told)
    # This one, Python's tracker of resources, and a worker.
    while len(group(driver.pid)) < 3:
        assert driver.poll() is None
        # Each look reads of every process of the machine.
        time.sleep(0.1)
    os.killpg(driver.pid, signal.SIGINT)
    _, said = driver.communicate(timeout=60)
    assert said.count("Traceback") == 1
    assert said.endswith("\nKeyboardInterrupt\n")
    wait_for_end(driver)


@pytest.mark.slow
def test_another_process_that_writes_there_is_refused(tmp_path):
    folder = tmp_path / "campaign"
    driver = start("tests.campaign.toy", str(folder), "threads", "100", "16", "5", stdout=subprocess.PIPE)
    while not (folder / "manifest.json").exists():
        assert driver.poll() is None
        time.sleep(0.05)
    try:
        with pytest.raises(InputError, match="another starhold is writing there"):
            Store.open(folder).resume(manifest())
        with pytest.raises(InputError, match="another starhold is writing there"):
            Store.create(folder, manifest(), force=True)
    finally:
        driver.kill()
        driver.communicate()
    assert Store.open(folder).resume(manifest()).missing("pd")


def test_a_disk_that_is_full_is_told_and_loses_nothing(store, expected, monkeypatch):
    written = 0

    def fsync(handle, to_disk=os.fsync):
        nonlocal written
        written += 1
        if written > 9:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        to_disk(handle)

    monkeypatch.setattr(os, "fsync", fsync)
    with pytest.raises(
        InputError, match=r"parquet: cannot be written: No space left on device; what was computed is kept, --res"
    ):
        fly(store)
    monkeypatch.undo()
    assert len(chunks(store.folder)) >= 2
    assert not list(store.folder.rglob(f"{files.UNFINISHED}*"))
    assert resumed(store) == expected


def flip(data: bytes, place: float) -> bytes:
    spot = int(place * (len(data) - 1))
    return data[:spot] + bytes([data[spot] ^ 1]) + data[spot + 1 :]


SPOILED = {
    "a flipped bit at the start": lambda data: flip(data, 0.0),
    "one of the numbers": lambda data: flip(data, 0.3),
    "one of the schema": lambda data: flip(data, 0.8),
    "half of the file": lambda data: data[: len(data) // 2],
    "nothing": lambda data: b"",
    "more than was written": lambda data: data + b"\0",
}


@pytest.mark.parametrize("how", list(SPOILED))
def test_a_corrupted_chunk_is_told_and_flown_again(store, how):
    expected = fly(store, Threads(1))
    spoiled = chunks(store.folder)[3]
    spoiled.write_bytes(SPOILED[how](spoiled.read_bytes()))
    law, first = spoiled.parent.name, int(spoiled.name[:9])
    reader = Store.open(store.folder)
    assert [(law, first, 16)] == missing(reader)
    reason = f"its bytes were changed; runs {first} to {first + 15} are left out"
    assert reader.notices == [f"{spoiled}: {reason}, --resume flies them again"]
    again = Store.open(store.folder).resume(manifest())
    assert missing(again) == [(law, first, 16)]
    assert [line.endswith("are flown again") for line in again.notices] == [True]
    assert fly(again) == expected
    assert Store.open(store.folder).resume(manifest()).notices == []


def test_a_lost_chunk_and_one_under_a_wrong_name_are_flown_again(store):
    expected = fly(store)
    first, second, *_ = chunks(store.folder)
    first.unlink()
    second.rename(second.with_name(f"000000{999:03}-000001014{second.name[19:]}"))
    again = Store.open(store.folder).resume(manifest())
    assert fly(again) == expected
    assert len(again.notices) == 1


def test_a_chunk_of_another_campaign_is_not_mixed_in(tmp_path, store):
    expected = fly(store)
    other = Store.create(tmp_path / "other", manifest(sigma=0.1))
    fly(other)
    for path in chunks(other.folder)[:1]:
        law, name = path.parent.name, path.name
        next((store.folder / "runs" / law).glob(f"{name[:19]}*")).unlink()
        Path(store.folder / "runs" / law / name).write_bytes(path.read_bytes())
    again = Store.open(store.folder).resume(manifest())
    assert fly(again) == expected
    assert ["it is of another campaign or of other runs" in line for line in again.notices] == [True]
