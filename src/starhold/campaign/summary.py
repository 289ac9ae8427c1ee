"""Summarizes the stored runs of a campaign column by column, because many runs do not fit into memory."""

import math
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.analysis.meter import Meter
from starhold.campaign import envelopes, sensitivity
from starhold.campaign.chunk import LEAST, MOST
from starhold.campaign.drivers import Drivers, find_drivers
from starhold.campaign.job import Job
from starhold.campaign.results import QUANTILES, Again, LawResult, Spread
from starhold.campaign.store import Store
from starhold.campaign.verdicts import Verdict, judge
from starhold.scenario.bodies.rigid_body.faults import action_on
from starhold.studies.requirements import Requirement

BARS, WIDE = 60, 100.0
"""The most bars of a histogram; and the ratio of largest to least value above which a metric has a logarithmic scale."""
MOST_DRIVEN = 200_000
"""The number of runs, from the first on, in which drivers are sought."""
KINDS: Mapping[str, Any] = {"morris": sensitivity.morris, "saltelli": sensitivity.sobol}
"""The functions that compute sensitivity indices, by sampling."""
FAILURES = 3
"""The number of failed runs worth flying again, in addition to the worst of each requirement."""


def summarise(store: Store, job: Job, laws: Sequence[str], until_decided: bool = False) -> tuple[LawResult, ...]:
    """Return the results of each law, from its stored runs."""
    spreads: dict[str, dict[str, Spread]] = {law: {} for law in laws}
    units = {name: unit for law in laws for name, unit in job.meter(law).units.items()}
    columns = {law: store.each_column([name for name in units if name in job.meter(law).units], law) for law in laws}
    for name, unit in units.items():
        # All laws at once, so that their histograms have the same bins.
        by_law = {law: next(columns[law]) for law in laws if name in job.meter(law).units}
        for law, spread in zip(by_law, spreads_of(name, unit, list(by_law.values())), strict=True):
            spreads[law][name] = spread
    return tuple(_summary(store, job, law, spreads[law], until_decided) for law in laws)


def _summary(store: Store, job: Job, law: str, spreads: Mapping[str, Spread], until_decided: bool) -> LawResult:
    meter, requirements = job.meter(law), job.requirements(law)
    flags = store.columns(["failed", "diverged_at"], law)
    failed, lost = flags["failed"].astype(bool), ~np.isnan(flags["diverged_at"])
    verdicts = verdicts_of(store, job, law, until_decided)
    return LawResult(
        law,
        len(failed),
        int(lost.sum()),
        int(failed.sum()),
        tuple(spreads[name] for name in meter.units),
        _envelopes(store, meter, law),
        verdicts,
        _drivers(store, job, law, failed, requirements),
        _indices(store, job, law, requirements),
        _again(store.folder, law, verdicts, failed, job.table.seed),
    )


def spreads_of(name: str, unit: str, values: Sequence[NDArray[np.float64]]) -> list[Spread]:
    """Return the distributions of a metric for several laws, with the same bins; values: (runs,) for each law."""
    there = [column[~np.isnan(column)] for column in values]
    # The number of bars is about the number of runs in each.
    edges = _edges(np.concatenate(there), min(BARS, math.isqrt(max(map(len, there)) or 1)))
    return [_spread(name, unit, finite, len(column), edges) for finite, column in zip(there, values, strict=True)]


def _spread(name: str, unit: str, there: NDArray[np.float64], runs: int, edges: NDArray[np.float64]) -> Spread:
    quantiles = tuple(np.quantile(there, QUANTILES).tolist()) if len(there) else (np.nan,) * len(QUANTILES)
    mean = float(there.mean()) if len(there) else np.nan
    counts = np.histogram(there.clip(edges[0], edges[-1]), edges)[0] if len(edges) else np.zeros(0, dtype=np.int64)
    return Spread(name, unit, runs, runs - len(there), mean, quantiles, edges, counts)


def _edges(values: NDArray[np.float64], bars: int) -> NDArray[np.float64]:
    """Return the edges of the bins, equally spaced, on a logarithmic scale where the values span decades; a single bin where
    all values are equal. Outliers are counted in the end bins, so that they do not compress the rest."""
    if not len(values):
        return np.zeros(0)
    least, low, high, most = np.quantile(values, [0.0, 0.005, 0.995, 1.0]).tolist()
    if least == most:
        side = 0.01 * abs(most) or 0.01
        return np.array([most - side, most + side])
    if low == high:
        low, high = least, most
    if least > 0.0 and high > WIDE * low:
        return np.geomspace(max(least, low / 3.0), min(most, 3.0 * high), bars + 1)
    reach = 0.5 * (high - low)
    return np.linspace(max(least, low - reach), min(most, high + reach), bars + 1)


def _envelopes(store: Store, meter: Meter, law: str) -> Any:
    counts, extremes = store.envelopes(law)
    name, times = envelopes.NAME, np.minimum(meter.cuts(), meter.steps) * meter.instant
    return envelopes.read(counts[name], extremes[f"{name}{LEAST}"], extremes[f"{name}{MOST}"], meter.windows, times)


def verdicts_of(store: Store, job: Job, law: str, until_decided: bool, runs: int | None = None) -> tuple[Verdict, ...]:
    """Return the verdicts on a law's requirements from its stored runs, or from the first `runs` of them."""
    return tuple(_verdict(store, job, law, requirement, until_decided, runs) for requirement in job.requirements(law))


def _verdict(store: Store, job: Job, law: str, requirement: Requirement, until_decided: bool, runs: int | None) -> Verdict:
    known = [name for dispersion in job.dispersions if dispersion.distribution.judged_apart for name in dispersion.columns]
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
        knowledge=_knowledge(job, law),
    )


def _knowledge(job: Job, law: str) -> str:
    """Return a sentence on which drawn values the law knows; "" where laws never know any number of the craft."""
    clauses: dict[str, list[str]] = {"assumes the file's value of": [], "knows each drawn value of": []}
    clauses |= {"learns at the diagnosis each drawn value of": [], "never learns the drawn value of": []}
    supposed, known, learnt, missed = clauses.values()
    for one in job.dispersions:
        if one.distribution.known_to_law or not one.known:
            (known if one.known else supposed).extend(one.keys)
        for place in one.places:
            if place.path[0] == "fault" and place.path[2] == "inertia":
                fault = job.scenario.table.fault[int(place.path[1])]
                (missed if action_on(fault, job.scenario.pick(law)) == "none" else learnt).append(place.key)
    said = [f"{words} {' and '.join(keys)}" for words, keys in clauses.items() if keys]
    return f"The law {', and '.join(said)}." if said else ""


def _drivers(
    store: Store, job: Job, law: str, failed: NDArray[np.bool_], requirements: tuple[Requirement, ...]
) -> Drivers | None:
    names = [name for dispersion in job.dispersions for name in dispersion.columns]
    if not names or job.table.sampling in KINDS:
        # Runs of these designs share values with one another, so tests on them are not valid.
        return None
    inputs = {name: values[:MOST_DRIVEN] for name, values in store.columns(names, law).items()}
    inputs |= _sizes(job, inputs)
    metrics = _of_interest(job, law, requirements)
    outputs = {name: values[:MOST_DRIVEN] for name, values in store.columns(metrics, law).items()} if metrics else {}
    return find_drivers(inputs, failed[:MOST_DRIVEN], outputs)


def _sizes(job: Job, inputs: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[np.float64]]:
    """Return the angles (runs,) of drawn attitudes and the norms of vectors in any direction, by name: these may explain
    failures better than components do."""
    sizes: dict[str, NDArray[np.float64]] = {}
    for dispersion in job.dispersions:
        if size := dispersion.distribution.size([inputs[name] for name in dispersion.columns]):
            sizes[f"{size[0]} of {dispersion.called}"] = size[1]
    return sizes


USUAL = (
    "settling_time",
    "final_attitude_error",
    "final_rate_error",
    "effort",
    "final_distance",
    "deviation",
    "effort_per_year",
)
"""The metrics whose drivers are sought where nothing is required."""


def _of_interest(job: Job, law: str, requirements: tuple[Requirement, ...]) -> list[str]:
    """Return the metrics whose drivers are sought: those with a requirement, else the usual ones."""
    bounded = [requirement.column for requirement in requirements if not np.isnan(requirement.bound)]
    return list(dict.fromkeys(bounded or [name for name in job.meter(law).units if name in USUAL]))


def _indices(store: Store, job: Job, law: str, requirements: tuple[Requirement, ...]) -> Mapping[str, Any]:
    kind = KINDS.get(job.table.sampling)
    if kind is None:
        return {}
    names = _of_interest(job, law, requirements)
    unit, columns = job.plan.points(), store.columns(names, law)
    return {name: kind(job.plan.factors, unit, columns[name]) for name in names}


def _again(folder: Path, law: str, verdicts: tuple[Verdict, ...], failed: NDArray[np.bool_], seed: int) -> tuple[Again, ...]:
    """Return the worst run of each requirement, the first failed runs, and one run picked at random."""
    why: dict[int, list[str]] = {}
    for verdict in verdicts:
        why.setdefault(verdict.worst_run, []).append(f"worst {verdict.name}")
    for run in np.flatnonzero(failed)[:FAILURES].tolist():
        why.setdefault(run, []).append("failed")
    other = int(np.random.default_rng(seed).integers(len(failed)))
    why.setdefault(other, []).append("picked at random")
    quoted = shlex.quote(str(folder))
    return tuple(
        Again(run, ", ".join(reasons), f"starhold rerun {quoted} {run} --law {shlex.quote(law)}")
        for run, reasons in why.items()
    )
