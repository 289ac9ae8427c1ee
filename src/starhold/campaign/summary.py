"""From the stored runs of a campaign to what it says: column by column, for no memory holds all of many runs."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.analysis.meter import Meter
from starhold.campaign import envelopes, sensitivity
from starhold.campaign.chunk import LEAST, MOST
from starhold.campaign.drivers import Drivers, find_drivers
from starhold.campaign.job import Job
from starhold.campaign.requirements import Requirement
from starhold.campaign.results import QUANTILES, Again, LawResult, Spread
from starhold.campaign.store import Store
from starhold.campaign.verdicts import Verdict, judge

BARS = 60
"""Of a histogram."""
MOST_DRIVEN = 200_000
"""Runs, the first ones, that drivers are looked for among."""
FAILURES = 3
"""Failed runs that are worth flying again, beside the worst of each requirement."""


def summarise(store: Store, job: Job, law: str, until_decided: bool = False) -> LawResult:
    """What the stored runs of a law say."""
    meter, requirements = job.meter(law), job.requirements(law)
    own = store.columns(["failed", "diverged_at"], law)
    failed, lost = own["failed"].astype(bool), ~np.isnan(own["diverged_at"])
    verdicts = verdicts_of(store, job, law, until_decided)
    return LawResult(
        law,
        len(failed),
        int(lost.sum()),
        int(failed.sum()),
        tuple(_spread(name, unit, store.columns([name], law)[name]) for name, unit in meter.units.items()),
        _envelopes(store, meter, law),
        requirements,
        verdicts,
        _drivers(store, job, law, failed, requirements),
        _indices(store, job, law, requirements),
        _again(store.folder, law, verdicts, failed, job.table.seed),
    )


def _spread(name: str, unit: str, values: NDArray[np.float64]) -> Spread:
    there = values[~np.isnan(values)]
    if not len(there):
        nothing = np.zeros(0)
        return Spread(name, unit, 0, len(values), np.nan, (np.nan,) * len(QUANTILES), nothing, nothing.astype(np.int64))
    # Without the last hundredth of each side where that is far away, so that one run does not squeeze all others.
    quantiles = tuple(np.quantile(there, QUANTILES).tolist())
    low, high = np.quantile(there, [0.005, 0.995]).tolist()
    least, most = quantiles[0], quantiles[-1]
    wide = max(high - low, 1e-12 * max(abs(high), 1e-300))
    span = (max(least, low - 0.5 * wide), min(most, high + 0.5 * wide))
    counts, edges = np.histogram(there, BARS, span if span[0] < span[1] else None)
    return Spread(name, unit, len(there), len(values) - len(there), float(there.mean()), quantiles, edges, counts)


def _envelopes(store: Store, meter: Meter, law: str) -> Any:
    counts, extremes = store.envelopes(law)
    name, times = envelopes.NAME, np.array(meter.cuts()) * meter.instant
    return envelopes.read(counts[name], extremes[f"{name}{LEAST}"], extremes[f"{name}{MOST}"], meter.windows, times)


def verdicts_of(store: Store, job: Job, law: str, until_decided: bool, runs: int | None = None) -> tuple[Verdict, ...]:
    """The verdicts on a law's requirements by its stored runs, or by the first ones."""
    return tuple(_verdict(store, job, law, requirement, until_decided, runs) for requirement in job.requirements(law))


def _verdict(store: Store, job: Job, law: str, requirement: Requirement, until_decided: bool, runs: int | None) -> Verdict:
    known = [name for dispersion in job.dispersions if dispersion.known for name in dispersion.columns]
    margin = f"margin.{requirement.name}"
    columns = {name: values[:runs] for name, values in store.columns([margin, *known], law).items()}
    return judge(
        requirement.name,
        columns.pop(margin),
        requirement.share,
        requirement.confidence,
        columns,
        independent=job.table.sampling == "random",
        until_decided=until_decided,
    )


def _drivers(
    store: Store, job: Job, law: str, failed: NDArray[np.bool_], requirements: tuple[Requirement, ...]
) -> Drivers | None:
    names = [name for dispersion in job.dispersions for name in dispersion.columns]
    if not names:
        return None
    inputs = {name: values[:MOST_DRIVEN] for name, values in store.columns(names, law).items()}
    asked = [requirement.column for requirement in requirements if not np.isnan(requirement.bound)]
    metrics = dict.fromkeys(asked or [name for name in job.meter(law).units if name in USUAL])
    told = {name: values[:MOST_DRIVEN] for name, values in store.columns(list(metrics), law).items()} if metrics else {}
    return find_drivers(inputs, failed[:MOST_DRIVEN], told)


USUAL = (
    "settling_time",
    "final_attitude_error",
    "final_rate_error",
    "effort",
    "final_distance",
    "deviation",
    "effort_per_year",
)
"""Metrics whose drivers are looked for where nothing is required."""


def _indices(store: Store, job: Job, law: str, requirements: tuple[Requirement, ...]) -> Mapping[str, Any]:
    kind = {"morris": sensitivity.morris, "saltelli": sensitivity.sobol}.get(job.table.sampling)
    if kind is None:
        return {}
    asked = [requirement.column for requirement in requirements if not np.isnan(requirement.bound)]
    names = list(dict.fromkeys(asked or [name for name in job.meter(law).units if name in USUAL]))
    unit, columns = job.plan.unit(0, job.plan.runs).T, store.columns(names, law)
    return {name: kind(job.plan.factors, unit, columns[name]) for name in names}


def _again(folder: Path, law: str, verdicts: tuple[Verdict, ...], failed: NDArray[np.bool_], seed: int) -> tuple[Again, ...]:
    """The worst run of each requirement, the first ones that failed, and one for comparison."""
    why: dict[int, list[str]] = {}
    for verdict in verdicts:
        why.setdefault(verdict.worst_run, []).append(f"worst {verdict.name}")
    for run in np.flatnonzero(failed)[:FAILURES].tolist():
        why.setdefault(run, []).append("failed")
    other = int(np.random.default_rng(seed).integers(len(failed)))
    why.setdefault(other, []).append("picked at random")
    told = shlex.quote(str(folder))
    return tuple(
        Again(run, ", ".join(reasons), f"starhold rerun {told} {run} --law {shlex.quote(law)}")
        for run, reasons in why.items()
    )
