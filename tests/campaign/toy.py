"""A job of cheap rows that any engine can fly, the campaign around it, and that campaign as a process of its own."""

import os
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from starhold.campaign.campaign import digest
from starhold.campaign.chunk import Chunk
from starhold.campaign.engines import Scheduler, Threads, Workers, flying
from starhold.campaign.manifest import Manifest
from starhold.campaign.store import Store
from starhold.errors import InputError
from starhold.files import atomic_write

LAWS = ("pd", "lyapunov")


@dataclass(frozen=True)
class Toy:
    """Rows that depend on the law and the run's number alone.

    pause: seconds a block; trail: where each block leaves its worker's number; refused: a run whose block raises InputError.
    """

    pause: float = 0.0
    trail: Path | None = None
    refused: int = -1

    def __call__(self, law, first, count, pool):
        return lambda: self.fly(law, first, count)

    def fly(self, law, first, count):
        # A run by itself is one that is flown again, where the campaign is.
        if self.trail is not None and count > 1:
            with atomic_write(self.trail / f"{law}-{first}") as hidden:
                hidden.write_text(str(os.getpid()))
        time.sleep(self.pause)
        if first <= self.refused < first + count:
            raise InputError("toy.toml", "law.pd", "a gain", "another")
        runs = np.arange(first, first + count)
        draws = np.array([np.random.default_rng((LAWS.index(law), run)).normal(size=3) for run in runs])
        lost = draws[:, 0] > 1.5
        rows = {
            "run": runs,
            "initial.rate[1]": draws[:, 0],
            "spacecraft.limit": np.where(draws[:, 1] > 0, "axis", "norm"),
            f"flown.{law}": draws[:, 1] * 2.0,
            "settling_time": np.where(lost, np.nan, 10.0 + draws[:, 2]),
            "failed": lost,
        }
        edges = np.linspace(-4.0, 4.0, 9)
        counts = {"rate": np.stack([np.histogram(column, edges)[0] for column in draws.T])}
        extremes = {"rate.least": draws.min(axis=0), "rate.most": draws.max(axis=0)}
        return Chunk(law, first, rows, counts, extremes)


def manifest(runs=100, chunk=16, sigma=0.05, **others):
    settings = {"sampling": "random", "over": {"law.pd.k_rate": {"distribution": "normal", "sigma": sigma}}}
    text = '[scenario]\nname = "toy"\n[spacecraft]\ninertia = [1.0, 2.0, 3.0]\n[campaign]\nruns = 1\n'
    return Manifest(
        **{"scenario": "toy", "text": text, "settings": settings, "laws": LAWS, "seed": 1, **others}, runs=runs, chunk=chunk
    )


def missing(store):
    return [(law, first, count) for law in store.manifest.laws for first, count in store.missing(law)]


def fly(store, engine=Threads(1), job=Toy(), progress=None):  # noqa: B008
    """Fly what is missing; returns the digest."""
    left = missing(store)
    with flying(job, engine, len(left)) as begin:
        for chunk in begin(left):
            store.put(chunk)
            if progress is not None:
                progress(chunk)
    return digest(store)


def main(folder, engine, runs, chunk, pause):
    """A campaign that tells each stored chunk, as a process that may be killed."""
    engines = {"threads": Threads(1), "workers": Workers(2)}
    chosen = engines.get(engine) or Scheduler(engine)
    store = Store.create(Path(folder), manifest(int(runs), int(chunk)))
    fly(store, chosen, Toy(float(pause)), lambda chunk: print(chunk.law, chunk.first, flush=True))


if __name__ == "__main__":
    main(*sys.argv[1:])
