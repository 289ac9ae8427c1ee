"""Flies single runs of a campaign again, each by its own scenario."""

import hashlib
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from starhold.campaign.job import Job, Source, scenario_of
from starhold.campaign.store import Store
from starhold.errors import InputError
from starhold.files import read_bytes
from starhold.scenario.building import build
from starhold.scenario.checking import nearest, read_toml, show
from starhold.scenario.reading import Scenario
from starhold.simulation.lanes import ThreadPool
from starhold.studies.compare import fly_law
from starhold.studies.flight import Flight

WORDS = ("name", "description", "type", "campaign")
"""Keys whose values never name a file."""


class FlownAgain(NamedTuple):
    """A run of a campaign, flown again: its scenario, its flight, and the columns whose values differ in any bit from the
    stored ones, as may happen on another machine."""

    scenario: Scenario
    flight: Flight
    differs: tuple[str, ...]


def fly_again(folder: Path, run: int, law: str | None = None) -> FlownAgain:
    """Fly one run of a campaign again from its own scenario and return it with a recording. InputError if there is no such
    run, or a file that the scenario reads has changed."""
    store = Store.open(folder)
    manifest = store.manifest
    name = manifest.laws[0] if law is None else law
    if name not in manifest.laws:
        raise InputError(str(folder), "law", show(name), nearest(name, list(manifest.laws)))
    stored = store.row(name, run)
    where = Path(manifest.folder)
    now_there, then = hashes(manifest.text, str(folder), where), manifest.settings.get("files", {})
    for file in sorted({*now_there} & {*then}):
        if now_there[file] != then[file]:
            raise InputError(str(where / file), "", "a file changed since the campaign", "the file that was flown")
    job = _job_of(Source(manifest.text, str(folder), where, manifest.allow_unstable))
    with ThreadPool(1) as pool:
        now = job(name, run, 1, pool)().rows
    differs = tuple(column for column, value in stored.items() if not _equal(value, now[column][0]))
    drawn = scenario_of(job, job.plan.columns(run, 1), run)
    entry = drawn.pick(name)
    return FlownAgain(drawn, fly_law(drawn, entry, build(drawn, entry, drawn=True)), differs)


@lru_cache(maxsize=1)
def _job_of(source: Source) -> Job:
    """Return the job of a campaign, cached so that several of its runs share it."""
    return Job(source, source.read().table.campaign)


def _equal(a: Any, b: Any) -> bool:
    return bool(a == b or (a != a and b != b))


def hashes(text: str, where: str, folder: Path) -> dict[str, str]:
    """Return the SHA-256, by name, of the files that a scenario's text names, such as modules or tables of numbers."""
    digests: dict[str, str] = {}

    def look(value: Any) -> None:
        if isinstance(value, str) and value not in digests:
            # Many strings are words, and some cannot name a file.
            with suppress(OSError, ValueError):
                digests[value] = hashlib.sha256(read_bytes(folder / value)).hexdigest()
        elif isinstance(value, dict):
            for key, item in value.items():
                if key not in WORDS:
                    look(item)
        elif isinstance(value, list):
            for item in value:
                look(item)

    look(read_toml(text, where))
    return digests
