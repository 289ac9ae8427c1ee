"""The worst of a metric over the box of the dispersions: looked for by an optimiser whose population flies side by side."""

from __future__ import annotations

import re
from itertools import count
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from starhold.campaign.distributions import Choice, Rotations, Shell, TruncatedNormal, Uniform
from starhold.campaign.job import scenario_of
from starhold.campaign.requirements import LOST, Requirement
from starhold.campaign.results import Bracket, LawResult
from starhold.certification.openness import assumed_away
from starhold.files import atomic_write
from starhold.scenario.building import build
from starhold.simulation.lanes import Crew
from starhold.studies.body import study_of

if TYPE_CHECKING:
    from starhold.campaign.job import Job
    from starhold.campaign.store import Store
    from starhold.scenario.reading import Scenario

Array = NDArray[np.float64]
TAIL = 0.00135
"""What the box leaves out on each side of a distribution without bounds: what lies beyond three sigma of a normal one."""
EDGE = 1e-12
"""What it leaves out of one with bounds, whose ends are not drawn."""
POPULATION, GENERATIONS = 256, 24
"""Of the optimiser; one generation flies side by side."""
FEW = 64, 8
"""The same where each lane is made by itself."""
NONE = 1e100
"""Stands for the badness of a run without the metric: lost, or never settled. Nothing is worse, and its square is finite."""


_ODD = re.compile(r"[^\w.-]+")
"""What names of files are kept free of."""
_LONGEST = 200
"""Bytes of a file's name, without what tells it from others; systems take 255."""


class Found(NamedTuple):
    """The worst that a search has flown: the point of the unit cube (dims,), what was drawn there by column, the metric
    (NaN: the run has none), and the flights it took."""

    point: Array
    columns: dict[str, NDArray[Any]]
    value: float
    evaluations: int


def box(job: Job) -> list[tuple[float, float]]:
    """The bounds of each uniform: all of a distribution that has bounds, else all but its tails."""
    found: list[tuple[float, float]] = []
    for dispersion in job.dispersions:
        tail = EDGE if _bounded(dispersion.distribution) else TAIL
        found += [(tail, 1.0 - tail)] * dispersion.dims
    return found


def _bounded(own: Any) -> bool:
    if isinstance(own, TruncatedNormal):
        return bool(np.isfinite([*own.low, *own.high]).all())
    return isinstance(own, Uniform | Choice | Rotations | Shell)


def search(job: Job, law: str, requirement: Requirement, threads: int, seed: int = 0) -> Found:
    """Look for the worst of a requirement's metric over the box, by differential evolution (Storn and Price, 1997), with the
    random numbers of run 0 in all flights. Ends early where a run has no such value, which is as bad as can be."""
    from scipy.optimize import differential_evolution

    side = 1.0 if requirement.at_most else -1.0
    evaluations, lost = 0, False

    def badness(points: Array) -> Array:
        nonlocal evaluations, lost
        points = np.atleast_2d(points.T).T
        lanes = points.shape[1]
        evaluations += lanes
        found = job.measure(law, job.plan.values(points), np.zeros(lanes, dtype=np.int64), crew)()[requirement.column]
        values = np.where(np.isnan(found), NONE, side * found)
        lost = lost or bool((values == NONE).any())
        return -values

    limits = np.array(box(job))
    population, generations = (POPULATION, GENERATIONS) if job.lanes(law).at_once else FEW
    begin = np.random.default_rng(seed).uniform(limits[:, 0], limits[:, 1], (population, len(limits)))
    with Crew(threads) as crew:
        result = differential_evolution(
            badness,
            limits,
            init=cast(Any, begin),
            maxiter=generations,
            vectorized=True,
            updating="deferred",
            polish=False,
            rng=seed,
            tol=1e-6,
            callback=lambda *_, **__: lost,
        )
    point = np.asarray(result.x)
    columns = job.plan.values(point[:, None])
    value = -float(result.fun)
    return Found(point, columns, np.nan if value == NONE else side * value, evaluations)


def brackets(job: Job, store: Store, result: LawResult, threads: int, taken: set[str]) -> tuple[Bracket, ...]:
    """How bad what is required of a law gets: by its campaign, by a search, and at most by proof. The worst run of each is
    kept as a scenario file in the campaign's folder; taken: the names of such files so far."""
    found: list[Bracket] = []
    law, worst_runs = result.law, {verdict.name: verdict.worst_run for verdict in result.verdicts}
    for requirement in job.requirements(law):
        if requirement.metric == LOST:
            continue
        run, side = worst_runs[requirement.name], 1.0 if requirement.at_most else -1.0
        value, columns = float(store.row(law, run)[requirement.column]), job.plan.columns(run, 1)
        looked = search(job, law, requirement, threads)
        if not np.isnan(value) and not side * value >= side * looked.value:
            value, columns, run = looked.value, looked.columns, 0
        path = store.folder / _file_name(law, requirement.name, taken)
        with atomic_write(path) as hidden:
            hidden.write_text(scenario_of(job, columns, run).text, encoding="utf-8")
        proved, assumption = proved_of(job, law, requirement)
        if proved is not None and side * value > side * proved:
            # Of what holds in the end alone.
            assumption = f"{assumption}; flights of this length have not come to their end"
        told = (requirement.column, requirement.unit, value, path.name, looked.evaluations, proved, assumption)
        found.append(Bracket(*told, requirement.at_most))
    return tuple(found)


def _file_name(law: str, requirement: str, taken: set[str]) -> str:
    """The name of the file of the worst run, which is added to those taken."""
    stem = f"worst-{law}-{_ODD.sub('-', requirement)}".encode()[:_LONGEST].decode(errors="ignore")
    names = (f"{stem}{'' if number == 1 else f'-{number}'}.toml" for number in count(1))
    name = next(name for name in names if name.casefold() not in taken)
    taken.add(name.casefold())
    return name


def proved_of(job: Job, law: str, requirement: Requirement) -> tuple[float | None, str]:
    """The bound that is proved of a metric over everything that is drawn, and what it rests on; None where nothing is.

    The torque is bounded by where it is cut off. The end of a flight is, where a certificate bounds it under disturbance
    from every attitude and from rates as large as any that is drawn, where nothing but the start is drawn, and the loop has
    no part that certificates leave out."""
    scenario = job.scenario
    if scenario.body != "rigid-body" or not requirement.at_most:
        return None, ""
    entry = scenario.pick(law)
    loop = build(scenario, entry)
    if requirement.metric == "peak_torque" and loop.limit == "axis" and not loop.rotors:
        fixed = not any("torque_limit" in key for dispersion in job.dispersions for key in dispersion.keys)
        return (loop.cutoff(), "the actuators cut each component of the torque off there") if fixed else (None, "")
    place = {"final_attitude_error": "angle", "final_rate_error": "rate"}.get(requirement.metric)
    keys = {key for dispersion in job.dispersions for key in dispersion.keys}
    if place is None or not all(key.startswith("initial.") for key in keys):
        return None, ""
    if assumed_away(loop):
        return None, ""
    fastest = _fastest(job, scenario)
    for issued in study_of(scenario.body).certify(scenario, entry, loop):
        for claim in issued.certificate.claims:
            told = claim.numbers
            if claim.kind != "disturbance" or claim.outcome != "proved" or issued.step:
                continue
            if told["rate_everywhere"] is not None and fastest <= told["rate_everywhere"]:
                start = f"from every attitude and rates up to {told['rate_everywhere']:.3g} rad/s"
                return told[place], "; ".join([f"in the end, {start}", *claim.assumptions])
    return None, ""


def _fastest(job: Job, scenario: Scenario) -> float:
    """A rate (rad/s) that no start in the box is faster than; infinite where none is known."""
    fastest = float(np.linalg.norm(scenario.table.initial.rate))
    if scenario.table.initial.relative_to == "target":
        return np.inf
    for dispersion in job.dispersions:
        if not any(key.startswith("initial.rate") for key in dispersion.keys):
            continue
        own = dispersion.distribution
        if dispersion.keys != ("initial.rate",) or not (isinstance(own, Shell) or dispersion.independent):
            return np.inf
        if isinstance(own, Shell):
            scale = 1.0 if dispersion.scale is None else float(np.abs(dispersion.scale).max())
            fastest = own.high * scale * (1.0 + 1e-12)
        else:
            # Each component grows with its own uniform.
            tail = EDGE if _bounded(own) else TAIL
            ends = dispersion.draw(np.array([[tail, 1.0 - tail]] * dispersion.dims))
            fastest = float(np.linalg.norm(np.abs(ends).max(axis=1))) * (1.0 + 1e-12)
    return fastest
