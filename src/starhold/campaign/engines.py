"""Where the blocks of a campaign are flown: in this process, in processes of this machine, or on a Dask cluster.

One task is one block of runs, never a single run. Results come back to this process, which alone writes them; a few blocks
for each worker are under way at once, so that memory stays bounded for any number of runs.
"""

from __future__ import annotations

import logging
import pkgutil
import signal
import threading
import time
import warnings
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import lru_cache
from itertools import islice
from multiprocessing import resource_tracker
from queue import Empty, SimpleQueue
from types import FrameType
from typing import Any, Protocol, TypeAlias

from starhold.campaign.chunk import Chunk
from starhold.campaign.extras import extra
from starhold.errors import InputError
from starhold.simulation.lanes import Crew
from starhold.version import __version__

Block: TypeAlias = tuple[str, int, int]
"""A law, the number of the first run, and the number of runs."""
_AHEAD = 2
"""Blocks under way in this process, or for each thread of a worker: one that is flown, and one at hand when it ends."""
_LOOK = 1.0
"""Seconds between two looks at whether a cluster that returns nothing still lives."""
_KEPT = "what was flown is kept, --resume goes on from there"


class Job(Protocol):
    """Begins to fly a block, and returns what waits for its results; pickled for engines of other processes, which keep it
    from block to block."""

    def __call__(self, law: str, first: int, count: int, crew: Crew, /) -> Callable[[], Chunk]: ...


@dataclass(frozen=True)
class Threads:
    """Blocks one after the other in this process, each by `count` threads; this one makes the next ready and stores the one
    before meanwhile."""

    count: int


@dataclass(frozen=True)
class Workers:
    """`count` processes of this machine with one thread each, which listen on the loopback interface alone."""

    count: int


@dataclass(frozen=True)
class Scheduler:
    """A Dask cluster that runs already, by its scheduler's address such as `tcp://host:8786`.

    patience: seconds to wait for a worker where there is none, at the start and after all were lost.
    """

    address: str
    patience: float = 60.0


Engine: TypeAlias = Threads | Workers | Scheduler


def fly_all(
    job: Job,
    blocks: Iterable[Block],
    put: Callable[[Chunk], None],
    engine: Engine,
    progress: Callable[[Chunk], None] | None = None,
) -> None:
    """Fly all blocks, in any order; `put` stores each result as it arrives, then `progress` is told of it.

    InputError where a job raises one; where workers cannot be started or reached, or have other versions of what takes part;
    and where all of them, or the scheduler, are lost: what was put is whole then, as it is after KeyboardInterrupt.
    """
    left = list(blocks)

    def take(chunk: Chunk) -> None:
        put(chunk)
        if progress is not None:
            progress(chunk)

    if not left:
        return
    if isinstance(engine, Threads):
        begun = deque[Callable[[], Chunk]]()
        with Crew(engine.count) as crew:
            for block in left:
                begun.append(job(*block, crew))
                if len(begun) == _AHEAD:
                    take(begun.popleft()())
            while begun:
                take(begun.popleft()())
        return
    with _local(min(engine.count, len(left))) if isinstance(engine, Workers) else _existing(engine) as crew:
        for chunk in crew.fly(job, left):
            take(chunk)


@dataclass(frozen=True)
class _Refusal:
    """An InputError on its way from a worker: its four texts."""

    where: str
    key: str
    found: str
    allowed: str


@lru_cache(maxsize=1)
def _unpacked(packed: bytes) -> Job:
    """The job, kept between blocks together with what it has compiled."""
    return extra("cloudpickle").loads(packed)


def _fly(packed: bytes, version: str, law: str, first: int, count: int) -> Chunk | _Refusal:
    """Fly a block in a worker. version: of starhold in the process that asks."""
    if version != __version__:
        return _Refusal("a worker", "", f"starhold {__version__}", f"{version}, as here")
    try:
        job = _unpacked(packed)
    except ImportError as error:
        return _Refusal("a worker", "", "", f"cannot read the campaign: {error}; it needs the packages that are here")
    try:
        with Crew(1) as crew:
            return job(law, first, count, crew)()
    except InputError as error:
        return _Refusal(error.where, error.key, error.found, error.allowed)


@dataclass(frozen=True)
class _Crew:
    """A client of a cluster, and how errors call the cluster."""

    client: Any
    name: str
    patience: float

    def fly(self, job: Job, blocks: list[Block]) -> Iterator[Chunk]:
        """The blocks' results as they arrive."""
        distributed = extra("distributed")
        packed = extra("cloudpickle").dumps(job)
        waiting, under_way = iter(blocks), set[Any]()
        done: SimpleQueue[Any] = SimpleQueue()
        try:
            while True:
                # Workers of a cluster come and go.
                for block in islice(waiting, max(0, _AHEAD * max(self._threads(), 1) - len(under_way))):
                    future = self.client.submit(_fly, packed, __version__, *block, pure=False)
                    under_way.add(future)
                    future.add_done_callback(done.put)
                if not under_way:
                    return
                future = self._next(done)
                under_way.remove(future)
                yield self._result(future, distributed)
                future.release()
        finally:
            # Whoever leaves early wants none of these any more.
            for future in under_way:
                future.release()

    def _threads(self) -> int:
        """How many blocks the cluster flies at once at this moment."""
        if self.client.status != "running":
            raise self._lost("the scheduler does not answer")
        try:
            return sum(self.client.nthreads().values())
        except (OSError, TimeoutError):
            raise self._lost("the scheduler does not answer") from None

    def _next(self, done: SimpleQueue[Any]) -> Any:
        """One that has ended; InputError once there is nobody left to end one."""
        alone = 0.0
        while True:
            try:
                return done.get(timeout=_LOOK)
            except Empty:
                alone = alone + _LOOK if self._threads() == 0 else 0.0
                if alone >= self.patience:
                    raise self._lost(f"no worker for {self.patience:g} s") from None

    def _result(self, future: Any, distributed: Any) -> Chunk:
        try:
            result = future.result()
        except distributed.KilledWorker:
            raise self._lost("a block ended all workers that tried it; they may lack memory") from None
        except (distributed.CancelledError, OSError):
            if future.status == "error":
                raise
            raise self._lost("the scheduler does not answer") from None
        if isinstance(result, _Refusal):
            raise InputError(result.where, result.key, result.found, result.allowed)
        return result

    def _lost(self, reason: str) -> InputError:
        return InputError(self.name, "", "", f"{reason}; {_KEPT}")


@contextmanager
def _local(count: int) -> Generator[_Crew]:
    """Processes of this machine, ended with the block."""
    distributed = extra("distributed")
    name = f"{count} workers"
    with _quiet(), ExitStack() as stack:
        try:
            with _undisturbed():
                # Nothing here is ever spilled to the disk or restarted for its memory: what is under way is bounded.
                cluster = distributed.LocalCluster(
                    n_workers=count,
                    threads_per_worker=1,
                    processes=True,
                    host="127.0.0.1",
                    dashboard_address=None,
                    memory_limit=0,
                    silence_logs=logging.CRITICAL,
                )
                stack.enter_context(cluster)
        except (RuntimeError, OSError) as error:
            hint = 'a script needs `if __name__ == "__main__":` before what starts workers'
            raise InputError(name, "", "", f"cannot be started: {error}; {hint}") from None
        client = stack.enter_context(distributed.Client(cluster, set_as_default=False, direct_to_workers=True))
        yield _Crew(client, name, 60.0)


@contextmanager
def _undisturbed() -> Generator[None]:
    """Hold requests to end back until processes are started: Dask cannot clean up what is half started.

    What is started takes no notice of interrupts from the keyboard: they reach all processes of a terminal, of which this
    one ends the others.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    asked: list[tuple[int, FrameType | None]] = []
    held = {number: signal.signal(number, lambda *call: asked.append(call)) for number in (signal.SIGINT, signal.SIGTERM)}
    # Threads and processes begin with what the thread blocks that starts them; the start of Python's tracker unblocks all.
    resource_tracker.ensure_running()
    masked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}) if hasattr(signal, "pthread_sigmask") else None
    try:
        yield
    finally:
        if masked is not None:
            signal.pthread_sigmask(signal.SIG_SETMASK, masked)
        for number, handler in held.items():
            signal.signal(number, handler)
    for number, _ in asked[:1]:
        signal.raise_signal(number)


@contextmanager
def _existing(engine: Scheduler) -> Generator[_Crew]:
    """A cluster that lives on after the block; InputError where it is out of reach, or of other versions."""
    distributed = extra("distributed")
    with _quiet():
        try:
            client = distributed.Client(engine.address, set_as_default=False, timeout=min(engine.patience, 10.0))
        except (OSError, ValueError, TimeoutError, RuntimeError) as error:
            told = f"{error}".splitlines()[0] if f"{error}" else type(error).__name__
            raise InputError(engine.address, "", "", f"no Dask scheduler answers: {told}") from None
        with client:
            crew = _Crew(client, engine.address, engine.patience)
            _check_versions(crew)
            yield crew


def _check_versions(crew: _Crew) -> None:
    """InputError where a machine of the cluster has no starhold, or other versions of what must be the same everywhere."""
    end = time.monotonic() + crew.patience
    while crew._threads() == 0:
        if time.monotonic() > end:
            raise InputError(crew.name, "", "", f"no worker for {crew.patience:g} s")
        time.sleep(0.1)
    told = crew.client.get_versions()
    here = _compared(told["client"])
    for machine, versions in [("the scheduler", told["scheduler"]), *told["workers"].items()]:
        for package, version in _compared(versions).items():
            if version != here[package]:
                raise InputError(crew.name, machine, f"{package} {version}", f"{here[package]}, as here")
    found = crew.client.run(pkgutil.resolve_name, "starhold.version:__version__", on_error="return")
    for machine, version in found.items():
        if version != __version__:
            shown = f"starhold {version}" if isinstance(version, str) else "no starhold"
            raise InputError(crew.name, machine, shown, f"{__version__}, as here")


def _compared(versions: Any) -> dict[str, str]:
    """Versions that must agree, of what pickles go through; of Python the two numbers on which pickled code depends."""
    packages = versions["packages"]
    python = ".".join(str(packages["python"]).split(".")[:2])
    return {"python": python, "dask": packages["dask"], "distributed": packages["distributed"]}


@contextmanager
def _quiet() -> Generator[None]:
    """Without Dask's log and warnings, for what they tell is told in one line, or is no news."""
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


def engine_of(threads: int | None, workers: int | None, scheduler: str | None) -> Engine | None:
    """The engine that is asked for; None where none is. InputError for more than one, and for less than one thread or
    process."""
    asked = {"threads": threads, "workers": workers, "scheduler": scheduler}
    given = [name for name, value in asked.items() if value is not None]
    if len(given) > 1:
        raise InputError("campaign", given[1], f"beside {given[0]}", "one of threads, workers and scheduler")
    for name in ("threads", "workers"):
        count = asked[name]
        if count is not None and int(count) < 1:
            raise InputError("campaign", name, str(count), "at least 1")
    if scheduler is not None:
        return Scheduler(scheduler)
    return Workers(workers) if workers is not None else None if threads is None else Threads(threads)
