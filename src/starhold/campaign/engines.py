"""Engines fly the blocks of a campaign in this process, in processes on this machine, on its GPU, or on a Dask cluster. One
task is one block of runs, never a single run. Results return to this process, which alone writes them; only a few blocks per
worker are in flight at once, so memory stays bounded for any number of runs."""

from __future__ import annotations

import gc
import logging
import os
import pkgutil
import platform
import time
import warnings
from collections import deque
from collections.abc import Callable, Generator, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import islice
from queue import Empty, SimpleQueue
from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from starhold.campaign.chunk import Chunk
from starhold.campaign.extras import extra
from starhold.campaign.workers import Team
from starhold.errors import InputError
from starhold.simulation.device import Pool
from starhold.simulation.lanes import ThreadPool
from starhold.trace.device import Device, DeviceError
from starhold.version import __version__

Block: TypeAlias = tuple[str, int, int]
"""A law, the number of the first run, and the number of runs."""
_AHEAD = 2
"""The number of blocks in flight in this process, or per thread of a worker: one being flown, and one waiting."""
_LOOK = 1.0
"""Seconds between checks whether a silent cluster is still alive."""
_CHECKED = 0.1
"""The share of the time that may be spent on checking workers' results, beyond one run of each worker."""
_KEPT = "the runs flown are kept, --resume continues from there"


class Job(Protocol):
    """A job begins to fly a block and returns a function that waits for its results. It is pickled for other processes,
    which keep it between blocks."""

    def __call__(self, law: str, first: int, count: int, pool: Pool, /) -> Callable[[], Chunk]: ...


@dataclass(frozen=True)
class Threads:
    """Flies blocks one after the other in this process, each on `count` threads, while this thread prepares the next block
    and stores the previous one."""

    count: int


@dataclass(frozen=True)
class Workers:
    """`count` processes on this machine with one thread each, which communicate only with this process."""

    count: int


@dataclass(frozen=True)
class Scheduler:
    """An existing Dask cluster, given by its scheduler's address such as `tcp://host:8786`. patience: seconds to wait for a
    worker at the start and after all were lost."""

    address: str
    patience: float = 60.0


@dataclass(frozen=True)
class Gpu:
    """Flies blocks one after the other on the first NVIDIA GPU of this machine, with one GPU thread per run."""


Engine: TypeAlias = Threads | Workers | Scheduler | Gpu


Fly: TypeAlias = Callable[[list[Block]], Iterator[Chunk]]
"""Flies blocks and yields their results in any order."""


@contextmanager
def flying(job: Job, engine: Engine, most: int) -> Generator[Fly]:
    """Yield the function that flies blocks of a job, at most `most` at a time, once workers are started or reached.
    InputError where the job raises one or fails; where workers cannot be started or reached, have other versions of the
    packages, or compute different bits; and where all workers, or the scheduler, are lost. Results returned before an error
    or a KeyboardInterrupt are complete."""
    if isinstance(engine, Threads):
        with ThreadPool(engine.count) as pool:
            yield lambda blocks: _fly_here(job, blocks, pool)
        return
    if isinstance(engine, Gpu):
        device = Device()
        yield lambda blocks: _believed(job, _fly_there(job, blocks, device), "the GPU", checked=(0, -1))
        return
    packed = extra("cloudpickle").dumps(job)
    if isinstance(engine, Workers):
        count = min(engine.count, most)
        with closing(Team(_fly, (packed, __version__), count)) as team:
            yield lambda blocks: _believed(job, team.fly(blocks), f"{count} workers")
    else:
        with _existing(engine) as cluster:
            yield lambda blocks: _believed(job, cluster.fly(packed, blocks), engine.address)


def _fly_there(job: Job, blocks: list[Block], device: Device) -> Iterator[tuple[Block, _Told]]:
    """Yield blocks with their results from a GPU. InputError where its driver fails."""
    try:
        for block, chunk in zip(blocks, _fly_here(job, blocks, device), strict=True):
            yield block, (device.processor, chunk)
    except DeviceError as error:
        raise InputError("campaign", "gpu", str(error), f"a working GPU; {_KEPT}") from None


def _fly_here(job: Job, blocks: list[Block], pool: Pool) -> Iterator[Chunk]:
    begun = deque[Callable[[], Chunk]]()
    for block in blocks:
        begun.append(job(*block, pool))
        if len(begun) == _AHEAD:
            yield begun.popleft()()
    while begun:
        yield begun.popleft()()


def _believed(
    job: Job, results: Iterator[tuple[Block, _Told]], name: str, checked: tuple[int, ...] = (0,)
) -> Iterator[Chunk]:
    """Yield the checked results of blocks. Some runs (`checked`, by default the first) of each worker's first block, and of
    further blocks while this takes little time, are flown again here. InputError unless they give the same bits."""
    begun, spent, seen = time.monotonic(), 0.0, set[str]()
    columns: dict[str, dict[str, str]] = {}
    with ThreadPool(1) as pool:
        for (law, first, count), (who, result) in results:
            runs = f"runs {first} to {first + count - 1} of {law}"
            if isinstance(result, InputError):
                raise result
            if not _is_chunk(result, law, first, count) or columns.setdefault(law, _kinds(result)) != _kinds(result):
                raise InputError(name, who, f"a result that is not of {runs}", _KEPT)
            if who not in seen or spent < _CHECKED * (time.monotonic() - begun):
                seen.add(who)
                started = time.monotonic()
                for place in (one % count for one in checked):
                    again = job(law, first + place, 1, pool)()
                    if names := _differing(result, again, place):
                        raise InputError(
                            name,
                            who,
                            f"other numbers in run {first + place} of {law} ({names})",
                            f"those of this machine; {_KEPT}",
                        )
                spent += time.monotonic() - started
            yield result


def _is_chunk(result: Any, law: str, first: int, count: int) -> bool:
    if not isinstance(result, Chunk):
        return False
    try:
        # An object from a pipe was not constructed by its class.
        return (replace(result).law, result.first, result.count) == (law, first, count)
    except (ValueError, TypeError, AttributeError):
        return False


def _kinds(chunk: Chunk) -> dict[str, str]:
    """Return the type of each column."""
    return {name: values.dtype.kind for name, values in chunk.rows.items()}


def _differing(chunk: Chunk, again: Chunk, place: int) -> str:
    """Return the names of the columns whose value at a place differs from that of the same run flown here."""
    if _kinds(chunk) != _kinds(again):
        return "which has other columns"
    pairs = {name: (chunk.rows[name][place : place + 1], values[:1]) for name, values in again.rows.items()}
    names = [name for name, (one, other) in pairs.items() if _bits(one) != _bits(other)]
    return ", ".join(names[:4])


def _bits(values: NDArray[Any]) -> Any:
    """Return the bytes to compare; all NaNs count as equal, because machines may differ in their bits."""
    if values.dtype.kind == "f":
        values = np.where(np.isnan(values), np.nan, values)
    return values.tolist() if values.dtype.kind in "OU" else values.tobytes()


@lru_cache(maxsize=1)
def _unpacked(packed: bytes) -> Job:
    """Return the unpickled job, cached between blocks together with its compiled kernels."""
    return extra("cloudpickle").loads(packed)


_Told: TypeAlias = tuple[str, Chunk | InputError]
"""A worker's name, and its result for a block."""


def _fly(packed: bytes, version: str, law: str, first: int, count: int) -> _Told:
    """Fly a block in a worker and return its result. version: that of starhold in the process that sent the block."""
    who = f"process {os.getpid()} on {platform.node()}"
    if version != __version__:
        return who, InputError("a worker", "", f"starhold {__version__}", f"{version}, as here")
    try:
        job = _unpacked(packed)
    except ImportError as error:
        message = f"cannot read the campaign: {error}; it needs the packages installed here"
        return who, InputError("a worker", "", "", message)
    try:
        with ThreadPool(1) as pool:
            return who, job(law, first, count, pool)()
    except InputError as error:
        return who, error.with_traceback(None)
    except Exception as error:
        message = f"failed in runs {first} to {first + count - 1} of {law}: {_in_a_line(error)}; {_KEPT}"
        return who, InputError("a worker", who, "", message)


def _in_a_line(error: BaseException) -> str:
    lines = f"{error}".splitlines()
    return f"{type(error).__name__}: {lines[0]}" if lines else type(error).__name__


@dataclass(frozen=True)
class _Cluster:
    """A client of a Dask cluster, with the cluster's name in errors."""

    client: Any
    name: str
    patience: float

    def fly(self, packed: bytes, blocks: list[Block]) -> Iterator[tuple[Block, _Told]]:
        """Yield blocks of a pickled job with their results as they arrive."""
        distributed = extra("distributed")
        waiting, under_way = iter(blocks), dict[Any, Block]()
        done: SimpleQueue[Any] = SimpleQueue()
        try:
            while True:
                # Workers of a cluster come and go.
                for block in islice(waiting, max(0, _AHEAD * max(self._threads(), 1) - len(under_way))):
                    future = self.client.submit(_fly, packed, __version__, *block, pure=False)
                    under_way[future] = block
                    future.add_done_callback(done.put)
                if not under_way:
                    return
                future = self._next(done)
                yield under_way.pop(future), self._result(future, distributed)
                future.release()
        finally:
            # If the caller leaves early, these are no longer needed.
            for future in under_way:
                future.release()

    def _threads(self) -> int:
        """Return the number of blocks that the cluster can fly at once at this moment."""
        if self.client.status != "running":
            raise self._lost("the scheduler does not answer")
        try:
            return sum(self.client.nthreads().values())
        except (OSError, TimeoutError):
            raise self._lost("the scheduler does not answer") from None

    def _next(self, done: SimpleQueue[Any]) -> Any:
        """Return a task that has ended. InputError once there has been no worker for too long."""
        alone = 0.0
        while True:
            try:
                return done.get(timeout=_LOOK)
            except Empty:
                alone = self._still_alone(alone)

    def _still_alone(self, alone: float) -> float:
        """Return the seconds without any worker, after one more check. InputError once they exceed the patience."""
        alone = alone + _LOOK if self._threads() == 0 else 0.0
        if alone >= self.patience:
            raise self._lost(f"no worker for {self.patience:g} s")
        return alone

    def _result(self, future: Any, distributed: Any) -> _Told:
        """Return the result of a task that has ended; it is flown again if its worker was lost before the result was
        fetched."""
        alone = 0.0
        try:
            while True:
                try:
                    return future.result(timeout=_LOOK)
                except TimeoutError:
                    alone = self._still_alone(alone)
        except InputError:
            raise
        except distributed.KilledWorker:
            raise self._lost("a block ended all workers that tried it; they may lack memory") from None
        except Exception as error:
            if future.status == "error" or not isinstance(error, (distributed.CancelledError, OSError)):
                raise self._lost(f"a worker failed: {_in_a_line(error)}") from error
            raise self._lost("the scheduler does not answer") from None

    def _lost(self, reason: str) -> InputError:
        return InputError(self.name, "", "", f"{reason}; {_KEPT}")


@contextmanager
def _existing(engine: Scheduler) -> Generator[_Cluster]:
    """Connect to a cluster that outlives this context; InputError where it cannot be reached or has other versions."""
    distributed = extra("distributed")
    with _quiet():
        failure = ""
        try:
            client = distributed.Client(engine.address, set_as_default=False, timeout=min(engine.patience, 10.0))
        except (OSError, ValueError, TimeoutError, RuntimeError) as error:
            failure, client = f"{error}".partition("\n")[0] or type(error).__name__, None
            error.__traceback__ = None
        if client is None:
            # A client that did not start closes when it is collected: now, because during the start of another both would
            # deadlock.
            gc.collect()
            raise InputError(engine.address, "", "", f"no Dask scheduler answers: {failure}")
        with client:
            cluster = _Cluster(client, engine.address, engine.patience)
            _check_versions(cluster)
            yield cluster


def _check_versions(cluster: _Cluster) -> None:
    """Raise InputError where a machine of the cluster lacks starhold, or has other versions of packages that must agree."""
    end = time.monotonic() + cluster.patience
    while cluster._threads() == 0:
        if time.monotonic() > end:
            raise InputError(cluster.name, "", "", f"no worker for {cluster.patience:g} s")
        time.sleep(0.1)
    known = cluster.client.get_versions()
    here = _compared(known["client"])
    for machine, versions in [("the scheduler", known["scheduler"]), *known["workers"].items()]:
        for package, version in _compared(versions).items():
            if version != here[package]:
                raise InputError(cluster.name, machine, f"{package} {version}", f"{here[package]}, as here")
    versions_there = cluster.client.run(pkgutil.resolve_name, "starhold.version:__version__", on_error="return")
    for machine, version in versions_there.items():
        if version != __version__:
            shown = f"starhold {version}" if isinstance(version, str) else "no starhold"
            raise InputError(cluster.name, machine, shown, f"{__version__}, as here")


def _compared(versions: Any) -> dict[str, str]:
    """Return the versions that must agree for pickling; of Python only the two numbers on which pickled code depends."""
    packages = versions["packages"]
    python = ".".join(str(packages["python"]).split(".")[:2])
    return {"python": python, "dask": packages["dask"], "distributed": packages["distributed"]}


@contextmanager
def _quiet() -> Generator[None]:
    """Silence Dask's log and warnings; those that matter are reported as one-line errors."""
    names = [name for name in logging.root.manager.loggerDict if name.partition(".")[0] in ("distributed", "tornado")]
    handlers = {handler for name in ("distributed", *names) for handler in logging.getLogger(name).handlers}
    levels = [(handler, handler.level) for handler in handlers]
    for handler, _ in levels:
        handler.setLevel(logging.CRITICAL + 1)
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", module="distributed")
            yield
    finally:
        for handler, level in levels:
            handler.setLevel(level)


def engine_of(threads: int | None, workers: int | None, scheduler: str | None, gpu: bool = False) -> Engine | None:
    """Return the requested engine, or None. InputError for more than one, and for fewer than one thread or process."""
    options = {"threads": threads, "workers": workers, "scheduler": scheduler, "gpu": gpu or None}
    given = [name for name, value in options.items() if value is not None]
    if len(given) > 1:
        raise InputError("campaign", given[1], f"beside {given[0]}", "one of threads, workers, scheduler and gpu")
    for name in ("threads", "workers"):
        count = options[name]
        if count is not None and int(count) < 1:
            raise InputError("campaign", name, str(count), "at least 1")
    if gpu:
        return Gpu()
    if scheduler is not None:
        return Scheduler(scheduler)
    return Workers(workers) if workers is not None else None if threads is None else Threads(threads)
