"""Searches for the worst value of a metric over the box of the dispersions, by batches of flights from many starts."""

import math
import re
from collections.abc import Callable
from itertools import count
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from starhold.campaign.job import Job, by_lots, scenario_of
from starhold.campaign.results import Bracket, LawResult
from starhold.campaign.store import Store
from starhold.files import atomic_write
from starhold.simulation.lanes import ThreadPool
from starhold.studies.requirements import LOST, Requirement

Array = NDArray[np.float64]
TAIL = 0.00135
"""The probability excluded from the box on each side of an unbounded distribution, that beyond three sigma of a normal
one."""
EDGE = 1e-12
"""The probability excluded on each side of a bounded distribution, whose bounds themselves are not drawn."""


class Effort(NamedTuple):
    """The size of the search: points spread over the box, the number of starts chosen from them, flights in a batch, and
    rounds."""

    spread: int
    starts: int
    lanes: int
    rounds: int


MANY = Effort(2048, 16, 512, 30)
FEW = Effort(256, 4, 64, 9)
"""The effort where the loops of many runs are made at once, and where each is made alone."""
CORNERS = 0.25
"""The share of the initial points that lie in corners of the box."""
APART = 0.1
"""The least distance between starts along one side of the box, as a share of the side."""
FIRST, LONGEST, WIDER, CLOSER = 0.15, 0.3, 1.2, 0.7
"""Step sizes as shares of the box: the initial and the largest one, and the factors after a round that found a worse point
and after one that did not."""


_ODD = re.compile(r"[^\w.-]+")
"""Characters that are replaced in file names."""
_LONGEST = 200
"""The most bytes of a file name, without the number that makes it unique; file systems allow 255."""


class Found(NamedTuple):
    """The worst run of a search: its point in the unit cube (dims,), the values drawn there by column, its metric (NaN: the
    run has none), and the number of flights."""

    point: Array
    columns: dict[str, NDArray[Any]]
    value: float
    evaluations: int


def box(job: Job) -> list[tuple[float, float]]:
    """Return the bounds of each uniform in the box, which excludes the tails of unbounded distributions."""
    bounds: list[tuple[float, float]] = []
    for dispersion in job.dispersions:
        tail = EDGE if dispersion.distribution.bounded else TAIL
        bounds += [(tail, 1.0 - tail)] * dispersion.dims
    return bounds


class Sought(NamedTuple):
    """A search in progress: its purpose, and the most flights that it adds to those of the campaign."""

    name: str
    flights: int


def search(
    job: Job,
    law: str,
    requirement: Requirement,
    threads: int,
    begin: Array | None = None,
    seed: int = 0,
    notice: Callable[[str, int, Sought], None] | None = None,
) -> Found | None:
    """Return the worst run for a requirement's metric over the box, with the random numbers of run 0 in all flights; None if
    no scenario within the box can be flown. begin: a further point (dims,) to search around. The search ends early at a run
    without a value, the worst case. It is an evolution strategy from many starts: a batch of random steps is flown from
    each, and the worst is kept; step sizes adapt, and the less bad half of the starts is dropped after each third of the
    rounds. notice: called with the law and the number of further flights that are done or no longer needed."""
    side = 1.0 if requirement.at_most else -1.0
    evaluations = 0
    sought = np.random.default_rng(seed)
    effort = MANY if job.lanes(law).at_once else FEW
    low, high = np.array(box(job)).T
    sought_after, done = Sought(f"worst {requirement.name}", effort.spread + effort.rounds * effort.lanes), 0

    def tell(more: int) -> None:
        nonlocal done
        done += more
        if notice is not None:
            notice(law, more, sought_after)

    def badness(points: Array) -> Array:
        """Return the badness of points (n, dims): infinity where a run has no value, minus infinity where the craft is
        refused."""
        nonlocal evaluations
        needed = done + len(points)
        unit = np.ascontiguousarray(points.T)
        result = np.full(len(points), -np.inf)
        there = np.flatnonzero(job.plan.possible(unit))
        refused, runs = np.zeros(len(there), dtype=bool), np.zeros(len(there), dtype=np.int64)
        drawn = job.plan.values(unit[:, there])
        measured = job.measure(law, drawn, runs, pool, progress=by_lots(tell), refused=refused)()
        tell(needed - done)
        if refused.all():
            return result
        values = side * measured[requirement.column]
        evaluations += int((~refused).sum())
        result[there] = np.where(refused, -np.inf, np.where(np.isnan(values), np.inf, values))
        return result

    with ThreadPool(threads) as pool:
        points = sought.uniform(low, high, (effort.spread, len(low)))
        corners = int(CORNERS * effort.spread)
        points[:corners] = np.where(sought.random((corners, len(low))) < 0.5, low, high)
        if begin is not None:
            points[-1] = np.clip(begin, low, high)
        values = badness(points)
        kept = _apart(points, values, (high - low) * APART, effort.starts)
        points, values = points[kept], values[kept]
        sizes = np.full(len(points), FIRST)
        for number in range(effort.rounds):
            if values.max() == np.inf:
                break
            if number and number % (effort.rounds // 3) == 0:
                kept = np.argsort(-values, kind="stable")[: -(-len(points) // 2)]
                points, values, sizes = points[kept], values[kept], sizes[kept]
            tried = _stepped(points, sizes, effort.lanes // len(points), low, high, sought)
            tries = badness(tried.reshape(-1, len(low))).reshape(tried.shape[:2])
            best, rows = tries.argmax(axis=1), np.arange(len(points))
            better = tries[rows, best] > values
            points = np.where(better[:, None], tried[rows, best], points)
            values = np.maximum(values, tries[rows, best])
            sizes = np.minimum(np.where(better, WIDER, CLOSER) * sizes, LONGEST)
    tell(sought_after.flights - done)
    worst = int(values.argmax())
    if values[worst] == -np.inf:
        return None
    value = np.nan if values[worst] == np.inf else side * float(values[worst])
    return Found(points[worst], job.plan.values(points[worst][:, None]), value, evaluations)


def _apart(points: Array, values: Array, least: Array, most: int) -> list[int]:
    """Return the indices of at most `most` of the worst points (n, dims) whose mutual distance along some side is at least
    `least`."""
    apart: list[int] = []
    for place in np.argsort(-values, kind="stable").tolist():
        if all((np.abs(points[place] - points[other]) > least).any() for other in apart):
            apart.append(place)
        if len(apart) == most:
            break
    return apart


def _stepped(points: Array, sizes: Array, count: int, low: Array, high: Array, sought: np.random.Generator) -> Array:
    """Return points (n, count, dims) at random steps from each of the points (n, dims), along some sides of the box."""
    each = (len(points), count, 1)
    step = sought.normal(size=(len(points), count, len(low))) * sizes[:, None, None] * sought.lognormal(0.0, 0.7, each)
    step *= sought.random(step.shape) < sought.random(each)
    return np.clip(points[:, None] + step * (high - low), low, high)


def brackets(
    job: Job,
    store: Store,
    result: LawResult,
    threads: int,
    taken: set[str],
    notice: Callable[[str, int, Sought], None] | None = None,
) -> tuple[Bracket, ...]:
    """Return brackets of the worst value of each required metric of a law, from its campaign, a search, and a proof. The
    worst run of each is written as a scenario file to the campaign's folder; taken: the names of such files so far; notice:
    as in `search`."""
    gathered: list[Bracket] = []
    law, worst_runs = result.law, {verdict.name: verdict.worst_run for verdict in result.verdicts}
    for requirement in job.requirements(law):
        if requirement.metric == LOST:
            continue
        run, side = worst_runs[requirement.name], 1.0 if requirement.at_most else -1.0
        value, columns = float(store.row(law, run)[requirement.column]), job.plan.columns(run, 1)
        looked = search(job, law, requirement, threads, job.plan.unit(run, 1)[:, 0], notice=notice)
        if looked is not None and not np.isnan(value) and not side * value >= side * looked.value:
            value, columns, run = looked.value, looked.columns, 0
        path = store.folder / _file_name(law, requirement.name, taken)
        with atomic_write(path) as hidden:
            hidden.write_text(scenario_of(job, columns, run).text, encoding="utf-8")
        flights = 0 if looked is None else looked.evaluations
        fields = (requirement.column, requirement.unit, value, path.name, flights, *proved_of(job, law, requirement))
        gathered.append(Bracket(*fields, requirement.at_most))
    return tuple(gathered)


def _file_name(law: str, requirement: str, taken: set[str]) -> str:
    """Return a new file name for the worst run and add it to those taken."""
    stem = f"worst-{law}-{_ODD.sub('-', requirement)}".encode()[:_LONGEST].decode(errors="ignore")
    names = (f"{stem}{'' if number == 1 else f'-{number}'}.toml" for number in count(1))
    name = next(name for name in names if name.casefold() not in taken)
    taken.add(name.casefold())
    return name


_FOLLOWING = ("lag", "rate-limit")
"""Actuators whose output lies between their previous output and the command."""


def proved_of(job: Job, law: str, requirement: Requirement) -> tuple[float | None, str]:
    """Return a bound on a metric that holds for all draws, and its basis; None where none is proved. The saturation limit of
    the command bounds the torque on the body, if no effector produces the torque, no actuator amplifies it, and no draw
    changes the limit. Claims of certificates hold only for flights that meet their premises; see `proved`."""
    lanes = job.lanes(law)
    loop = lanes.base.loop
    axes = {"peak_torque": 1.0, "peak_torque_norm": math.sqrt(3.0)}.get(requirement.metric)
    if axes is None or job.scenario.body != "rigid-body" or not requirement.at_most or loop.limit == "none":
        return None, ""
    acts = any(fitted.part.flag("ACTS") for fitted in loop.used("effector"))
    followed = all(fitted.part.name in _FOLLOWING and fitted.part.file is None for fitted in loop.used("actuator"))
    if acts or not followed or lanes.moves("setup.limit"):
        return None, ""
    limit = max(phase.setup.limit for phase in loop.phases(lanes.steps))
    bound = limit * (axes if loop.limit == "axis" else 1.0)
    cut = "each component" if loop.limit == "axis" else "the norm"
    return bound, f"the actuators saturate {cut} of the torque at {limit:.6g} N m"
