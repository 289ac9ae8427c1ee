"""Flies blocks of runs: draws their values, makes their lanes, computes metrics in the kernel, and the margins from them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.structure import places
from starhold.analysis.meter import Meter, Metrics
from starhold.campaign import envelopes
from starhold.campaign.chunk import LEAST, MOST, Chunk
from starhold.campaign.dispersions import Dispersion, read_dispersions
from starhold.campaign.lanes import Lanes, Lot
from starhold.campaign.sampling import Plan
from starhold.errors import input_at
from starhold.loop.closed_loop import ClosedLoop
from starhold.scenario.building import build
from starhold.scenario.campaign import CampaignTable
from starhold.scenario.reading import Scenario, parse
from starhold.scenario.requirement import RequirementTable
from starhold.simulation.batched import Flights, begin_metered
from starhold.simulation.device import Pool, begin_on_device
from starhold.simulation.lane import Progress
from starhold.studies.body import study_of
from starhold.studies.requirements import Requirement, cones_of, extras_of, orbit_of, read_requirements, tables_of
from starhold.trace.device import Device


@dataclass(frozen=True)
class Source:
    """A scenario in a form from which any process can read it again."""

    text: str
    where: str
    folder: Path
    allow_unstable: bool

    @classmethod
    def of(cls, scenario: Scenario) -> Source:
        """Return the source of a scenario."""
        return cls(scenario.text, scenario.where, scenario.folder, scenario.allow_unstable)

    def read(self) -> Scenario:
        """Read and return the scenario."""
        return parse(self.text, self.where, self.folder, self.allow_unstable)


@dataclass
class Job:
    """Flies the runs of a campaign. Its pickle is small, because each process reads the scenario again."""

    source: Source
    table: CampaignTable
    progress: Callable[[str, int], None] | None = None
    """Called with a law and the number of further runs flown, while a block is flown; not in other processes."""
    extras: tuple[str, ...] = ()
    """Names of metrics to measure in addition to the campaign's."""
    _lanes: dict[str, Lanes] = field(default_factory=dict[str, Lanes])
    _meters: dict[str, Meter] = field(default_factory=dict[str, Meter])

    def __getstate__(self) -> dict[str, Any]:
        return vars(replace(self, progress=None, _lanes={}, _meters={}))

    @cached_property
    def scenario(self) -> Scenario:
        """The scenario before dispersions."""
        return self.source.read()

    @cached_property
    def plan(self) -> Plan:
        """The draws of all runs."""
        table, dispersions = self.table, self.dispersions
        return Plan(dispersions, table.sampling, table.seed, table.runs, self.source.where)

    @cached_property
    def required(self) -> Mapping[str, RequirementTable]:
        """The requirements on runs, by their names in errors."""
        return tables_of(self.scenario, "campaign")

    @cached_property
    def dispersions(self) -> tuple[Dispersion, ...]:
        """The keys that differ between runs."""
        return read_dispersions(self.scenario, self.table.over)

    def lanes(self, law: str) -> Lanes:
        """Return the lanes of a law, which are made at the first call."""
        if law not in self._lanes:
            self._lanes[law] = Lanes(self.scenario, law, self.plan)
        return self._lanes[law]

    def meter(self, law: str) -> Meter:
        """Return the meter of a law in the scenario, which is made at the first call. InputError where a requested metric
        cannot be measured."""
        if law not in self._meters:
            loop = build(self.scenario, self.scenario.pick(law))
            self._meters[law] = self._meter_of(loop, loop.gains)
        return self._meters[law]

    def _meter_of(self, loop: ClosedLoop, gains: Any) -> Meter:
        """Return the meter for lanes of a loop; gains: arrays (lanes,) in place of the numbers that differ."""
        required = self.required.values()
        extras, cones = (*extras_of(required, self.table.metrics), *self.extras), cones_of(required)
        key = "requirement" if cones else "campaign.metrics"
        with input_at(self.source.where, key):
            return study_of(self.scenario.body).meter(self.scenario, loop, gains, extras, cones)

    def requirements(self, law: str) -> tuple[Requirement, ...]:
        """Return the requirements on runs of a law."""
        return read_requirements(self.required, self.meter(law).units, self.source.where, orbit_of(self.scenario))

    def __call__(self, law: str, first: int, count: int, pool: Pool) -> Callable[[], Chunk]:
        """Begin to fly runs first .. first+count-1 of a law; the function returned waits for their results."""
        runs = np.arange(first, first + count)
        columns = self.plan.columns(first, count)
        histogram: Any = 0
        extremes: list[Any] = []

        def take(metrics: Metrics, windows: Any, lot: Lot) -> None:
            nonlocal histogram
            kept = np.isnan(metrics["diverged_at"])
            bins, least, most = envelopes.count(windows if kept.all() else windows[:, :, kept])
            histogram = histogram + bins
            extremes.append((least, most))

        progress = None if self.progress is None else by_lots(partial(self.progress, law))
        measured = self.measure(law, columns, runs, pool, take, progress)

        def finish() -> Chunk:
            rows: dict[str, NDArray[Any]] = {"run": runs, **columns, **measured()}
            failed = ~np.isnan(rows["diverged_at"])
            for requirement in self.requirements(law):
                margins = requirement.margins(rows)
                rows[f"margin.{requirement.name}"] = margins
                failed = failed | (margins < 0.0)
            rows["failed"] = failed
            merged = (np.fmin.reduce([a for a, _ in extremes]), np.fmax.reduce([b for _, b in extremes]))
            name = envelopes.NAME
            return Chunk(law, first, rows, {name: histogram}, {f"{name}{LEAST}": merged[0], f"{name}{MOST}": merged[1]})

        return finish

    def measure(
        self,
        law: str,
        columns: Mapping[str, NDArray[Any]],
        runs: NDArray[np.int64],
        pool: Pool,
        take: Callable[[Metrics, Any, Lot], None] = lambda metrics, windows, lot: None,
        progress: Progress | None = None,
        refused: NDArray[np.bool_] | None = None,
    ) -> Callable[[], Metrics]:
        """Begin to fly runs of a law; the function returned waits for their metrics and the values read back, (lanes,) by
        name. columns: the drawn values; runs: the numbers of the runs, which select their random numbers; take: called with
        the metrics and windows of each lot, and the lot; refused: as in `Lanes.lots`; lanes marked there have no values."""
        under_way = [
            (lot, at, numbers, self._begin(lot, pool)) for lot, at, numbers in self.lanes(law).lots(columns, runs, refused)
        ]

        def finish() -> Metrics:
            gathered: Metrics = {}
            for lot, at, numbers, flown in under_way:
                metrics, windows = flown(progress)
                take(metrics, windows, lot)
                for name, values in (numbers | metrics).items():
                    gathered.setdefault(name, np.full(len(runs), np.nan))[at] = values
            return gathered

        return finish

    def _begin(self, lot: Lot, pool: Pool) -> Callable[[Progress | None], tuple[Metrics, Any]]:
        """Begin to fly a lot; the function returned waits for its metrics (lanes,) and the values of its windows (windows,
        quantities, lanes)."""
        meter = self._meter_of(lot.loop, lot.phases[0].gains)
        lanes, runs = len(lot.runs), lot.runs
        along = bool((np.diff(runs) == 1).all())
        flights = Flights(
            lot.loop,
            lot.carries,
            lot.phases,
            int(runs[0]) if along else runs,
            meter.observers(lot.loop.composition()),
            meter.begun(lanes),
            meter.cuts(),
            meter.marks[-1],
            [window.row for window in meter.windows.values()],
        )
        wait = begin_on_device(pool, flights) if isinstance(pool, Device) else begin_metered(pool, flights)

        def finish(progress: Progress | None) -> tuple[Metrics, Any]:
            flown = wait(None if progress is None else lambda done, total: progress(lanes * done // total, lanes))
            lost = flown.ends[places(lot.loop.carry()).lost_at]
            return meter.metrics(flown.notes, flown.windows, lost), flown.windows

        return finish


def by_lots(tell: Callable[[int], None]) -> Progress:
    """Return a progress function for a kernel that calls `tell` with the number of further runs flown, lot by lot."""
    reported, whole = 0, 0

    def progress(done: int, lanes: int) -> None:
        nonlocal reported, whole
        now = whole + done
        tell(now - reported)
        reported = now
        if done == lanes:
            whole += lanes

    return progress


def scenario_of(job: Job, columns: Mapping[str, NDArray[Any]], run: int) -> Scenario:
    """Return the scenario of a single run: with the drawn values, columns (1,), in place of the file's, the number of the
    run, and without a campaign."""
    change = {**job.plan.change({name: values[0] for name, values in columns.items()}), "campaign": None}
    change |= {"requirement": None}
    if hasattr(job.scenario.table.simulation, "run"):
        change["simulation.run"] = run
    return job.scenario.with_(change)
