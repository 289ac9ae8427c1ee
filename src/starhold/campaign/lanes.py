"""Converts drawn values to the numbers that kernels fly: for many runs at once where this gives the same bits as each run's
own scenario, else run by run. Scenarios with other values are built and compared to determine which numbers of a loop a
value changes."""

import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.structure import flatten, leaves, mapped
from starhold.campaign.dispersions import Dispersion
from starhold.campaign.moving import Moving
from starhold.campaign.sampling import Plan
from starhold.errors import InputError
from starhold.loop.closed_loop import ClosedLoop, Phase
from starhold.loop.kernels import Numbers, numbers_of
from starhold.scenario.building import build
from starhold.scenario.making import variants
from starhold.scenario.reading import Scenario
from starhold.simulation.lanes import carry_columns, stacked
from starhold.studies.flat import Flat, named_numbers, shown_name
from starhold.trace.handles import RecordingError

Array: TypeAlias = NDArray[np.float64]
Columns: TypeAlias = Mapping[str, NDArray[Any]]

TRIES = 64
"""The number of runs searched for a value that differs from the first run's."""
PROBES = 4
"""The number of runs in which numbers made for many runs at once are first compared with those of each run alone."""
_FORM = -1
"""The index that stands for everything that is not a number, the kernel itself."""


@dataclass(frozen=True)
class Lot:
    """Lanes that one kernel flies: run numbers (lanes,), a loop of their structure, carries (numbers, lanes), and phases
    with an array (lanes,) in place of each number that differs."""

    runs: NDArray[np.int64]
    loop: ClosedLoop
    carries: Array
    phases: tuple[Phase, ...]


class Lanes:
    """The lanes of one law of a scenario under a plan of draws. moved: indices of the loop's numbers that each dispersion
    changes; at_once: whether numbers of many runs are made at once; flown: names of the numbers that are read back from the
    loop."""

    def __init__(self, scenario: Scenario, law: str, plan: Plan) -> None:
        self.scenario, self.law, self.plan = scenario, law, plan
        # For one run nothing else is read.
        self._bare = scenario.with_({"campaign": None, "requirement": None})
        self.steps = scenario.table.simulation.steps
        self.first = plan.columns(0, 1)
        self.base = self.exact(self.first)
        self.moving = Moving(scenario, scenario.pick(law), self.base, plan.dispersions)
        self.moved: dict[str, set[int]] = {}
        self._varied: list[Flat] = []
        more = plan.columns(0, min(TRIES, plan.runs))
        # If there are few values, the first runs may all share one, which does not show what the others change.
        probes = {*range(min(plan.runs, PROBES))}
        for dispersion in plan.dispersions:
            others = self._others(dispersion, more)
            self.moved[dispersion.called] = self._moved_by(dispersion, more, others)
            probes.update(others)
        fixed = not any(_FORM in places for places in self.moved.values())
        self.at_once = fixed and self._agrees(_some(more, sorted(probes)), np.array(sorted(probes)))
        self.flown = self._read_back()

    def exact(self, columns: Columns) -> Flat:
        """Return the numbers of one run, built from its own scenario; columns: (1,)."""
        return next(self._each(columns, [0]))

    def _each(self, columns: Columns, runs: Sequence[int]) -> Iterator[Flat]:
        """Yield the numbers of each run, built from its own scenario. InputError names the run."""
        drawn = ({name: values[place] for name, values in columns.items()} for place in range(len(runs)))
        others = variants(self._bare, (self.plan.change(one) for one in drawn))
        for run in runs:
            try:
                # Warnings concern the file, not each run.
                with warnings.catch_warnings(action="ignore"):
                    other = next(others)
                    flat = Flat.of(build(other, other.pick(self.law), drawn=True), self.steps)
                yield flat
            except InputError as error:
                where = f"{self.scenario.where}, run {run}"
                raise InputError(where, error.key, error.given, error.allowed) from None

    def _tried(self, columns: Columns, place: int, run: int) -> Flat | None:
        """Return the numbers of one of these runs, or None where its scenario is refused."""
        try:
            return next(self._each(_one(columns, place), [run]))
        except InputError:
            return None

    def lots(
        self, columns: Columns, runs: NDArray[np.int64], refused: NDArray[np.bool_] | None = None
    ) -> Iterator[tuple[Lot, NDArray[np.int64], dict[str, Array]]]:
        """Yield the lanes of these runs (lanes,) with the drawn columns, in lots: each lot with the indices of its lanes and
        the values read back from it. InputError where a run's scenario is refused; if the mask `refused` (lanes,) is given,
        such lanes are marked there and left out."""
        impossible = self.scenario.hooks.refused(self.scenario, self.moving.by_key(columns))
        if impossible is not None and impossible.any():
            if refused is None:
                place = int(np.flatnonzero(impossible)[0])
                next(self._each(_one(columns, place), [runs[place]]))
            else:
                refused |= impossible
        left = np.arange(len(runs)) if refused is None else np.flatnonzero(~refused)
        if not len(left):
            return
        # Two of them are checked for changes that no probe showed.
        looked = left[sorted({0, len(left) // 2})]
        if self.at_once and self._agrees(_some(columns, looked), runs[looked], refused is None):
            lot = self._together(_some(columns, left), runs[left])
            if lot is not None:
                yield lot, left, self._readings(lot)
                return
        if refused is None:
            flats = dict(enumerate(self._each(columns, runs.tolist())))
        else:
            tried = {place: self._tried(columns, place, int(runs[place])) for place in left.tolist()}
            flats = {place: flat for place, flat in tried.items() if flat is not None}
            refused[[place for place in tried if place not in flats]] = True
        groups: dict[Any, list[int]] = {}
        for place, flat in flats.items():
            groups.setdefault(flat.form, []).append(place)
        for places in groups.values():
            lot = self._apart([flats[place] for place in places], runs[places])
            yield lot, np.array(places), self._readings(lot)

    def moves(self, name: str) -> bool:
        """Return whether a dispersion changes a number of this name, or more than numbers."""
        places = set[int]().union(*self.moved.values())
        return _FORM in places or not places.isdisjoint(self.base.places(name))

    def _others(self, dispersion: Dispersion, more: Columns) -> list[int]:
        """Return at most two runs, among the first ones with the columns `more`, in which a value of the dispersion differs
        from that of run 0."""
        names = dispersion.columns
        return [run for run in range(self.plan.runs)[:TRIES] if any(more[n][run] != self.first[n][0] for n in names)][:2]

    def _moved_by(self, dispersion: Dispersion, more: Columns, others: Sequence[int]) -> set[int]:
        """Return the indices of the numbers that change when only one dispersion has the values of the runs `others`; more:
        columns of the first runs."""
        names = dispersion.columns
        moved: set[int] = set()
        for run in others:
            flat = self.exact({**self.first, **{name: more[name][run : run + 1] for name in names}})
            self._varied.append(flat)
            if flat.form != self.base.form:
                moved.add(_FORM)
            if flat.names == self.base.names:
                apart = flat.numbers.view(np.int64) != self.base.numbers.view(np.int64)
                moved |= set(np.flatnonzero(apart).tolist())
        # A number that differs in none of them may differ in another run.
        return moved if others else {_FORM}

    def _agrees(self, columns: Columns, runs: NDArray[np.int64], strict: bool = True) -> bool:
        """Return whether the numbers of these runs made at once equal those of each run's own scenario. InputError where a
        scenario is refused; if not strict, this counts as a difference."""
        lot = self._together(columns, runs)
        if lot is None:
            return False
        numbers = np.array([*_numbers(lot).values()])
        pairs = enumerate(runs.tolist())
        flats = self._each(columns, runs.tolist()) if strict else (self._tried(columns, *pair) for pair in pairs)
        return all(self.base.gives(flat, numbers[:, lane]) for lane, flat in enumerate(flats))

    @cached_property
    def _follows(self) -> dict[int, str]:
        """The column of the drawn value that a number equals, by the index of each such number, judged by the first run."""
        followed: dict[int, str] = {}
        for dispersion in self.plan.dispersions:
            for place in self.moved[dispersion.called] - {_FORM}:
                number = self.base.numbers[place]
                equal = [n for n in dispersion.columns if not dispersion.wordy and self.first[n][0] == number]
                if equal:
                    followed[place] = equal[0]
        return followed

    def _together(self, columns: Columns, runs: NDArray[np.int64]) -> Lot | None:
        """Return lanes made at once, or None where this is impossible."""
        try:
            return self._made(columns, runs)
        except (ValueError, TypeError, RecordingError):
            return None

    def _made(self, columns: Columns, runs: NDArray[np.int64]) -> Lot:
        """Return lanes made at once: some numbers are drawn values, the others are computed from them by equations."""
        base, every = self.base, set[int]().union(*self.moved.values())
        rows: dict[int, Array] = {place: columns[name].astype(float) for place, name in self._follows.items()}
        like = base.loop.carry()
        carried, moving = len(numbers_of(like)), len(flatten((like.state, like.effectors)))
        numbers = self.moving.numbers(columns)
        # The equation does not make the carry where it begins with values themselves, or with a law's memory of them.
        begun = any(place < len(flatten(like.state)) and base.names[place] not in numbers for place in rows)
        for name, row in numbers.items():
            rows |= {place: row for place in base.places(name) if place in every or base.names[place] == name}
        phases = _phases(base.loop.phases(self.steps), carried, rows)
        if any(base.names[place].startswith("gains.") and place not in rows for place in every):
            gains = self.moving.gains(columns, phases[0].nominal)
            rows |= {place: row for name, row in gains.items() for place in base.places(name)}
            phases = _phases(base.loop.phases(self.steps), carried, rows)
        carries = np.repeat(base.numbers[:carried, None], len(runs), axis=1)
        for place in range(carried):
            if place in rows:
                carries[place] = rows[place]
        varying = any(isinstance(leaf, np.ndarray) for leaf in leaves((phases[0].gains, phases[0].nominal)))
        if begun or (varying and base.loop.remembers):
            carries = carry_columns(base.loop, carries[:moving], phases[0])
        return Lot(runs, base.loop, carries, phases)

    def _apart(self, flats: Sequence[Flat], runs: NDArray[np.int64]) -> Lot:
        """Return lanes of one structure, made one by one."""
        loop, phases = flats[0].loop, stacked([flat.loop.phases(self.steps) for flat in flats])
        carries = np.array([flat.numbers[: len(numbers_of(loop.carry()))] for flat in flats]).T
        return Lot(runs, loop, np.ascontiguousarray(carries), tuple(phases))

    def _read_back(self) -> tuple[str, ...]:
        """Return the names of the numbers that show each dispersion: those equal to its values, else all that it changes. Of
        several that are always equal one is named, preferably that of the true craft and not of the nominal model."""
        kept: list[int] = []
        alike = [flat for flat in self._varied if flat.names == self.base.names]
        for dispersion, places in zip(self.plan.dispersions, self.moved.values(), strict=True):
            moved = sorted(places - {_FORM}, key=lambda place: (self.base.names[place].startswith("nominal."), place))
            follow = {place: self._follows[place] for place in moved if place in self._follows}
            seen: set[bytes] = set()
            for place in follow if {*dispersion.columns} <= {*follow.values()} else moved:
                values = np.array([self.base.numbers[place], *(flat.numbers[place] for flat in alike)]).tobytes()
                if values not in seen:
                    seen.add(values)
                    kept.append(place)
        return tuple(self.base.names[place] for place in sorted(set(kept)))

    def _readings(self, lot: Lot) -> dict[str, Array]:
        """Return the numbers read back from a lot's flown arrays, (lanes,) by name; NaN where its structure lacks one."""
        numbers = _numbers(lot)
        missing = np.full(len(lot.runs), np.nan)
        return {f"flown.{shown_name(lot.loop, name)}": numbers.get(name, missing) for name in self.flown}


def _phases(phases: Sequence[Phase], begin: int, rows: Mapping[int, Array]) -> tuple[Phase, ...]:
    """Return phases with some numbers replaced by rows (lanes,), given by index; the first number of the phases has the
    index `begin`."""
    changed: list[Phase] = []
    place = begin - 1
    before: Any = None

    def leaf(number: Any) -> Any:
        nonlocal place
        if not isinstance(number, float):
            return number
        place += 1
        return rows.get(place, number)

    for phase in phases:
        numbers = mapped(Numbers.of(phase), leaf)
        changed.append(phase._replace(**numbers._asdict(), before=numbers.craft if before is None else before))
        before = numbers.craft
    return tuple(changed)


def _numbers(lot: Lot) -> dict[str, Array]:
    """Return the numbers of a lot, each (lanes,), by their names in `Flat`."""
    numbers = named_numbers(lot.loop, [*lot.carries], lot.phases)
    return {name: np.broadcast_to(np.asarray(value, dtype=float), (len(lot.runs),)) for name, value in numbers.items()}


def _some(columns: Columns, places: Sequence[int] | NDArray[np.int64]) -> dict[str, NDArray[Any]]:
    return {name: values[np.asarray(places)] for name, values in columns.items()}


def _one(columns: Columns, place: int) -> dict[str, NDArray[Any]]:
    return _some(columns, [place])
