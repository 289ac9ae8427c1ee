"""Flies a campaign and stores its results in a folder, or resumes one."""

import hashlib
import os
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.campaign.again import hashes
from starhold.campaign.dispersions import Dispersion
from starhold.campaign.engines import Block, Engine, Threads, Workers, flying
from starhold.campaign.job import Job, Source
from starhold.campaign.manifest import FILE, Manifest
from starhold.campaign.proved import look
from starhold.campaign.results import CampaignResult
from starhold.campaign.store import Store
from starhold.campaign.summary import summarise, verdicts_of
from starhold.campaign.worst import brackets
from starhold.errors import InputError
from starhold.scenario.campaign import CampaignTable
from starhold.scenario.checking import show
from starhold.scenario.reading import Scenario

CHUNK, SMALL = 16384, 512
"""The number of runs in a block where the loops of many runs are made at once, and where each run's loop is made alone."""
LOOK = 1024
"""The numbers of runs at which the interim analyses of a sequential campaign are taken."""

NO_TABLE = "a table with [campaign.over] for drawn keys, or a number of runs that differ only in their noise"
Notice = Callable[..., None]
"""Called with a law and the number of further runs flown; during a search for the worst case also with its `Sought`."""


@dataclass(frozen=True)
class Options:
    """Options for flying a campaign; none changes the results. engine: None for all cores of this process."""

    engine: Engine | None = None
    resume: bool = False
    force: bool = False
    until_decided: bool = False
    search: bool = True
    """Whether to search for the worst cases of required metrics over the box of the dispersions."""
    proof: bool = False
    """Whether the flights are compared with the claim proved about the loop as it flies, which takes seconds per law."""


def with_campaign(scenario: Scenario, changes: Mapping[str, Any]) -> Scenario:
    """Return the scenario with other entries in its [campaign] table, which is added if absent, and other [[requirement]]
    tables, with method "campaign" by default; None leaves an entry unchanged. InputError where the table is absent and the
    entries give neither distributions nor a number of runs."""
    given = {key: value for key, value in changes.items() if value is not None}
    if scenario.table.campaign is None and not given.keys() & {"runs", "over"}:
        raise InputError(scenario.where, "campaign", "no [campaign] table", NO_TABLE)
    required = given.pop("requirement", None)
    change = {f"campaign.{key}": value for key, value in given.items()}
    if isinstance(required, list):
        required = [{"method": "campaign", **one} if isinstance(one, Mapping) else one for one in required]
    change |= {} if required is None else {"requirement": required}
    return scenario.with_(change) if change else scenario


def begin(scenario: Scenario, laws: Sequence[str]) -> Job:
    """Return the job of a campaign. InputError for any mistake in it, before anything is flown."""
    table = scenario.table.campaign
    job = Job(Source.of(scenario), table)
    reached: set[str] = set()
    for number, law in enumerate(laws):
        # Names of columns contain those of laws, and SQL ignores case.
        if law.casefold() in {other.casefold() for other in laws[:number]}:
            raise InputError(scenario.where, "law", show(law), "names that differ by more than case")
        job.requirements(law)
        reached |= {key for key, places in job.lanes(law).moved.items() if places}
    for dispersion in job.dispersions:
        name = dispersion.called
        if name not in reached:
            flown = f"law {laws[0]}" if len(laws) == 1 else "any law"
            raise InputError(
                scenario.where, f'campaign.over."{name}"', f"no effect on the flights of {flown}", "a key that affects them"
            )
    return job


def fly_campaign(
    scenario: Scenario, folder: Path, law: str | None = None, options: Options = Options(), notice: Notice | None = None
) -> CampaignResult:
    """Fly the campaign of a scenario's [campaign] table into a folder, for one law or all, and return its result. InputError
    for any mistake in it, and where flying fails: the runs flown until then are kept, and `resume` continues from there. The
    results are the same for any engine and any chunk size."""
    laws = tuple(entry.name for entry in scenario.laws) if law is None else (scenario.pick(law).name,)
    job = begin(scenario, laws)
    table, engine = job.table, options.engine or Threads(os.cpu_count() or 1)
    if options.until_decided:
        _check_decidable(job)
    at_once = all(job.lanes(name).at_once for name in laws)
    manifest = Manifest(
        scenario=scenario.name,
        text=scenario.text,
        settings={"files": hashes(scenario.text, scenario.where, scenario.folder)}
        | ({"until_decided": True} if options.until_decided else {}),
        laws=laws,
        runs=table.runs,
        chunk=LOOK if options.until_decided else _chunk(table.runs, engine, at_once),
        seed=table.seed,
        extensible=table.sampling in ("random", "sobol"),
        folder=str(scenario.folder.resolve()),
        allow_unstable=scenario.allow_unstable,
    )
    resuming = options.resume and (folder / FILE).exists()
    with ExitStack() as stack:
        begin_flying = flying(job, engine, -(-table.runs // manifest.chunk) * len(laws))
        # Before anything is written or removed, so that everything stays as it is if workers are not available.
        fly = None if resuming else stack.enter_context(begin_flying)
        store = Store.open(folder).resume(manifest) if resuming else Store.create(folder, manifest, options.force)
        missing = [block for name in laws for block in store.missing(name)]
        for line in store.notices:
            warnings.warn(line, stacklevel=2)
        if fly is None and missing:
            fly = stack.enter_context(begin_flying)
        job.progress = notice if isinstance(engine, Threads) else None
        begun, flown = time.perf_counter(), 0

        def take(blocks: Sequence[Block]) -> None:
            nonlocal flown
            for chunk in fly(list(blocks)) if fly is not None else ():
                store.put(chunk)
                flown += chunk.count
                if notice is not None and job.progress is None:
                    notice(chunk.law, chunk.count)

        if options.until_decided:
            runs = _fly_until_decided(store, job, take)
        else:
            take(list(_blocks(store, notice)))
            runs = table.runs
    seconds = time.perf_counter() - begun
    results = summarise(store, job, laws, options.until_decided)
    threads = engine.count if isinstance(engine, Threads) else os.cpu_count() or 1
    if options.search and job.dispersions and job.required:
        taken = set[str]()
        results = tuple(replace(result, brackets=brackets(job, store, result, threads, taken, notice)) for result in results)
    if options.proof:
        results = tuple(replace(result, claims=look(job, result.law, threads, notice)) for result in results)
    sealed = digest(store, runs)
    totals = {
        "verdicts": {
            result.law: {verdict.name: verdict.outcome for verdict in result.verdicts}
            for result in results
            if result.verdicts
        },
        "failed": {result.law: result.failed for result in results},
        "lost": {result.law: result.lost for result in results},
    }
    store.finish(sealed, totals)
    over = {one.called: in_words(one, table) for one in job.dispersions}
    required = job.requirements(laws[0])
    return CampaignResult(scenario.name, folder, runs, table.sampling, over, results, sealed, seconds, flown, required)


def _fly_until_decided(store: Store, job: Job, take: Callable[[Sequence[Block]], None]) -> int:
    """Fly until every requirement of every law is decided, and return the number of runs. Interim analyses take place at
    numbers of runs fixed beforehand, so every engine stops at the same number."""
    most, flown = job.table.runs, 0
    while flown < most:
        flown = min(most, max(flown + LOOK, -(-flown * 5 // (4 * LOOK)) * LOOK))
        missing = [(name, first, count) for name in store.manifest.laws for first, count in store.missing(name)]
        take([block for block in missing if block[1] < flown])
        verdicts = [verdict for name in store.manifest.laws for verdict in verdicts_of(store, job, name, True, flown)]
        if all(verdict.outcome != "not decided" for verdict in verdicts):
            break
    return flown


def _check_decidable(job: Job) -> None:
    where = job.source.where
    if not job.required:
        raise InputError(where, "requirement", "none of a campaign", "at least one, to fly until it is decided")
    if job.table.sampling != "random":
        given = show(job.table.sampling)
        raise InputError(where, "campaign.sampling", given, '"random", because only independent runs allow an early stop')


def _blocks(store: Store, notice: Notice | None) -> Iterator[tuple[str, int, int]]:
    for name in store.manifest.laws:
        missing = store.missing(name)
        kept = store.manifest.runs - sum(count for _, count in missing)
        if notice is not None and kept:
            notice(name, kept)
        yield from ((name, first, count) for first, count in missing)


def _chunk(runs: int, engine: Engine, at_once: bool) -> int:
    """Return the number of runs in a block, such that each worker gets a few blocks and each block fits into memory."""
    most = CHUNK if at_once else SMALL
    if isinstance(engine, Workers):
        most = min(most, -(-runs // (4 * engine.count)))
    return max(1, min(most, runs))


def in_words(dispersion: Dispersion, table: CampaignTable) -> str:
    """Return a dispersion as one line of text, with its parameters as in the file."""
    given = table.over[dispersion.places[0].table]
    options = {"judged_apart": "known before flight", "known_to_law": "known to the law"}
    numbers = given.model_dump(exclude_defaults=True, exclude={"distribution", *options})
    clauses = [
        name if value is True else f"{name} {value if isinstance(value, str) else show(value)}"
        for name, value in numbers.items()
    ]
    clauses += [words for name, words in options.items() if getattr(given, name)]
    clauses += ["not known to the law"] if dispersion.nominal_tables and not given.known_to_law else []
    return ", ".join([given.distribution, *clauses])


def digest(store: Store, runs: int | None = None) -> str:
    """Return the SHA-256, in hexadecimal, of the results: law by law in the manifest's order, column by column in the order
    of names, run by run; numbers as little-endian bytes, text as lengths and UTF-8; then counts and extremes. runs: the
    number of runs of each law, if fewer than planned. InputError where a chunk is missing or superfluous."""
    wanted = store.manifest.runs if runs is None else runs
    whole = hashlib.sha256(b"starhold campaign 1\n")
    for law in store.manifest.laws:
        covered = 0
        for file in store.files(law):
            covered = file.last + 1 if file.first == covered else -1
        if covered != wanted:
            allowed = "all of them; --resume flies the missing ones"
            raise InputError(str(store.folder), "", f"not {wanted} runs of {law}", allowed)
        for part in chain([_named(law, np.array(wanted))], _columns(store, law), _envelopes(store, law)):
            whole.update(part)
    return whole.hexdigest()


def _columns(store: Store, law: str) -> Iterator[bytes]:
    names = sorted(store.manifest.columns.get(law, ()))
    return map(_named, names, store.each_column(names, law))


def _envelopes(store: Store, law: str) -> Iterator[bytes]:
    counts, extremes = store.envelopes(law)
    for kind in (counts, extremes):
        yield from (_named(name, values) for name, values in sorted(kind.items()))


def _named(name: str, values: NDArray[Any]) -> bytes:
    """Return an array's bytes with its name, type and shape, so that different results never have the same encoding."""
    kind = values.dtype.kind
    if kind in "OU":
        kind = "text"
        words = [str(word).encode() for word in values.tolist()]
        data = np.array([len(word) for word in words], "<i8").tobytes() + b"".join(words)
    else:
        if kind == "f":
            values = np.where(np.isnan(values), np.nan, values)
        data = values.astype(values.dtype.newbyteorder("<"), copy=False).tobytes()
    head = f"{len(name.encode())} {name} {kind} {values.shape} {len(data)}\n"
    return head.encode() + data
