"""Replays recorded sensor data through a scenario's estimator and law, and compares the results with the recorded ones."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.quaternion import relative
from starhold.algebra.structure import flatten, unflatten
from starhold.certification.wording import listed
from starhold.errors import InputError
from starhold.loop.closed_loop import ClosedLoop
from starhold.scenario.building import build
from starhold.scenario.csv_files import number_in
from starhold.scenario.reading import LawEntry, Scenario
from starhold.simulation.lane import Recording, fly, recorded
from starhold.simulation.replay import given_like, replay
from starhold.studies.telemetry import Telemetry, read
from starhold.studies.telemetry_files import LABELS, Array

SIGMAS = 3.0
"""The number of standard deviations beyond which two estimates count as different."""
TOLERANCE = 0.01
"""The share of the largest recorded value beyond which values without a known standard deviation count as different."""
ROUNDING = 1e-9
"""The share of the largest recorded value up to which a difference counts as rounding."""


@dataclass(frozen=True, repr=False)
class Comparison:
    """A computed and a recorded quantity, both (n, k), at the recorded times (n,; s), with the magnitude of their difference
    and the allowed difference, both (n,), in the quantity's unit; for attitudes these are angles (rad)."""

    name: str
    against: str
    unit: str
    rule: str
    times: Array
    computed: Array
    recorded: Array
    difference: Array
    allowed: Array

    @property
    def beyond(self) -> NDArray[np.bool_]:
        """A mask (n,) of the samples that differ by more than allowed."""
        return ~(self.difference <= self.allowed)

    @property
    def parted_at(self) -> float | None:
        """The first time (s) at which they differ by more than allowed, or None."""
        return float(self.times[self.beyond.argmax()]) if self.beyond.any() else None

    @property
    def same_bits(self) -> bool:
        """Whether all numbers are equal bit for bit."""
        return bool(np.array_equal(self.computed, self.recorded))

    def __repr__(self) -> str:
        return f"<Comparison {self.name}: parted at {self.parted_at}>"


@dataclass(frozen=True, repr=False)
class Replay:
    """The result of a replay: the recording of the computed quantities, with a sample per control step, the comparisons, and
    sentences about gaps in the telemetry."""

    telemetry: Telemetry
    run: Recording
    comparisons: list[Comparison]
    notes: list[str]

    def __repr__(self) -> str:
        return f"<Replay of {self.telemetry.name}: {self.sentence}>"

    @property
    def parted(self) -> Comparison | None:
        """The comparison that first exceeds the allowed difference, or None."""
        parted = [one for one in self.comparisons if one.parted_at is not None]
        return min(parted, key=lambda one: one.parted_at or 0.0, default=None)

    @property
    def sentence(self) -> str:
        """A sentence on when estimates and commands first differ from the recorded ones."""
        first = self.parted
        if not self.comparisons:
            return "Nothing that the scenario computes was recorded: there is nothing to compare with."
        if first is None:
            bits = ", bit for bit" if all(one.same_bits for one in self.comparisons) else ""
            return f"Computed and recorded values agree{bits}: {listed([c.name for c in self.comparisons])}."
        place = first.beyond.argmax()
        also = [c.name for c in self.comparisons if c.parted_at == first.parted_at and c is not first]
        return (
            f"They first deviate at {first.parted_at:g} s: {first.name} differs by {first.difference[place]:.3g} "
            f"{first.unit}, {first.rule} {first.allowed[place]:.3g}{f'; so do {listed(also)}' if also else ''}."
        )


def tolerance_of(text: str | float) -> float:
    """Return the tolerance that an option states. InputError unless it is a number above 0."""
    number = number_in(str(text))
    if number is None or not 0.0 < number < math.inf:
        raise InputError("replay", "tolerance", str(text), "a share such as 0.01")
    return number


def study(scenario: Scenario, entry: LawEntry, source: Any, mapping: Any = None, tolerance: float | None = None) -> Replay:
    """Return the replay of telemetry through a law of a scenario. source, mapping: as in `telemetry.read`; tolerance: the
    share of the largest recorded value by which quantities without a known standard deviation may differ. InputError where
    readings are missing."""
    loop = build(scenario, entry)
    telemetry = read(scenario, loop, source, mapping)
    duration = scenario.table.simulation.steps
    steps = np.round(np.clip(telemetry.times / loop.period, -1.0, duration + 1.0)).astype(int)
    inside = (steps >= 0) & (steps <= duration)
    if not inside.any():
        times = f"times from {telemetry.times[0]:g} to {telemetry.times[-1]:g} s"
        raise InputError(telemetry.name, "", times, f"times within the scenario, from 0 to {duration * loop.period:g} s")
    first, last = int(steps[inside].min()), int(steps[inside].max())
    rows = np.full(last - first + 1, -1)
    # Of several samples of a control step the last one counts.
    rows[steps[inside] - first] = np.flatnonzero(inside)
    values = {name: np.where((rows >= 0)[:, None], numbers[rows], np.nan) for name, numbers in telemetry.columns.items()}
    given, notes = _given(loop, values, telemetry, first)
    run = replay(loop, given, first)
    notes += [f"{int((~inside).sum())} samples lie outside the scenario's duration."] * bool((~inside).any())
    comparisons = list(_comparisons(loop, run, values, TOLERANCE if tolerance is None else tolerance))
    return Replay(telemetry, run, comparisons, [telemetry.sentence, *notes])


def _given(loop: ClosedLoop, values: dict[str, Array], telemetry: Telemetry, first: int) -> tuple[Array, list[str]]:
    """Return the rows that `replay` takes, and sentences about gaps in them."""
    like, count = given_like(loop), len(next(iter(values.values())))
    readings, gaps = _readings(loop, like.readings, values, telemetry)

    def part(shape: Any, name: str) -> Any:
        numbers = values.get(name, np.full((count, len(flatten((shape,)))), np.nan))
        return unflatten(list(np.where(_whole(numbers)[:, None], numbers, np.nan).T), (shape,))[0]

    fields = [name for name in like.state._fields if name != loop.body.module.COMMAND]
    needed = [name for name in (fields[:2] if not readings else []) if name not in values]
    if needed:
        raise InputError(telemetry.name, "", f"no {listed(needed)}", "the inputs of the law: this scenario has no sensors")
    known = {name: part(getattr(like.state, name), name if name in fields else "") for name in like.state._fields}
    state = like.state._replace(**known)
    if first and "position" in fields and "position" not in values:
        # The orbit alone is propagated until the first sample.
        flown = fly(loop, first, first)[1].state
        for name in ("position", "velocity"):
            for column, number in zip(getattr(state, name), getattr(flown, name), strict=True):
                column[0] = number
    names = _effector_names(loop)
    effectors = tuple(
        type(inner)(*(part(getattr(inner, field), names.get((k, field), "")) for field in inner._fields))
        for k, inner in enumerate(like.effectors)
    )
    rows = np.column_stack(flatten((readings, state, effectors, part(like.command, "command"))))
    taken = [*fields, *names.values(), "command"]
    lacking = [name for name in taken if name in values and np.isnan(values[name]).any()]
    absent = [name for name in taken if name not in values]
    every = f"{count} control steps, every {loop.period:g} s"
    notes = [f"{listed(gaps)} of {every}; between them none is new, and rates are interpolated linearly." if gaps else ""]
    notes += [f"Not recorded, and taken from the estimate or the model: {listed(absent)}." if absent else ""]
    notes += [
        f"Recorded at some control steps, at others taken from estimate or model: {listed(lacking)}." if lacking else ""
    ]
    return rows, [note for note in notes if note]


def _whole(numbers: Array) -> NDArray[np.bool_]:
    """Return a mask (n,) of the rows without missing numbers."""
    return np.asarray(np.isfinite(numbers).all(axis=1))


def _readings(loop: ClosedLoop, like: Any, values: dict[str, Array], telemetry: Telemetry) -> tuple[Any, list[str]]:
    """Return the readings of all sensors at each control step, and sentences on how often each is recorded. A missing
    reading is marked as not new if its sensor has such a flag, and else interpolated linearly."""
    sensors = loop.used("sensor")
    wanted = {f"{s.prefix}{n}": n for s, reading in zip(sensors, like, strict=True) for n in reading._fields}
    flags = {name for name, field in wanted.items() if "_is_" in field}
    if missing := [name for name in wanted if name not in values and name not in flags]:
        allowed = "every reading of the scenario's sensors: leave out the parts that the satellite lacks"
        raise InputError(telemetry.name, "", f"no {listed(missing)}", allowed)
    filled: dict[str, Array] = {}
    gaps: list[str] = []
    for name in wanted:
        if name in flags:
            continue
        there = _whole(values[name])
        if not there.any():
            raise InputError(telemetry.name, name, "no number within the scenario", "at least one reading")
        steps, places = np.arange(len(there)), np.flatnonzero(there)
        marks = [flag for flag in flags if flag.startswith(f"{name}_is_")]
        if marks or values[name].shape[1] == len(LABELS["quaternion"]):
            # An estimator ignores a reading that is not new.
            filled[name] = values[name][np.maximum.accumulate(np.where(there, steps, places[0]))]
        else:
            filled[name] = np.stack([np.interp(steps, places, column[places]) for column in values[name].T], axis=1)
        gaps += [f"{name} is read at {len(places)}"] * (not there.all())
        changed = np.append(True, (np.diff(filled[name], axis=0) != 0.0).any(axis=1))
        changed[places[0]] = True
        for flag in marks:
            shown = changed if flag.endswith("_is_new") else (filled[name] != 0.0).any(axis=1)
            says = values[flag][:, 0] > 0.5 if flag in values else shown
            filled[flag] = np.where(there & says, 1.0, 0.0)[:, None]
    columns = iter(filled[name] for name in wanted)
    readings = tuple(
        type(reading)(*(unflatten(list(next(columns).T), (value,))[0] for value in reading)) for reading in like
    )
    return readings, gaps


def _effector_names(loop: ClosedLoop) -> dict[tuple[int, str], str]:
    """Return the recorded name of each number of an effector's state that is carried from one control step to the next."""
    names = [name for name, _, _ in recorded(loop)][len(loop.body.module.Sample._fields) :]
    matched: dict[tuple[int, str], str] = {}
    for place, (fitted, inner) in enumerate(zip(loop.used("effector"), loop.carry().effectors, strict=True)):
        if fitted.part.hook("record") is None:
            continue
        count = len(fitted.part.module.Sample._fields)
        for name in names[:count] if fitted.part.hook("switch") is None else []:
            field = next((field for field in inner._fields if name.endswith(f"_{field}")), None)
            if field is not None:
                matched.setdefault((place, field), name)
        names = names[count:]
    return matched


def _comparisons(loop: ClosedLoop, run: Recording, values: dict[str, Array], share: float) -> Iterator[Comparison]:
    """Yield the comparisons of all quantities that are both computed and recorded."""
    estimators = tuple(fitted.prefix for fitted in loop.used("estimator"))
    sensors = tuple(fitted.prefix for fitted in loop.used("sensor"))
    given = {*loop.body.module.Sample._fields, *_effector_names(loop).values()} - {"command"}
    passed = (*sensors, *(f"{name}_deviation" for name in run.columns))
    pairs = [(n, n) for n in run.columns if n in values and n not in given and not n.startswith(passed)]
    for one in estimators:
        # The satellite's own estimates of its attitude and rate.
        if not any(name.startswith(one) for name in values):
            pairs = [(f"{one}{n}", n) for n in ("attitude", "rate") if n in values] + pairs
    # Causes come before their effects.
    pairs.sort(key=lambda pair: not pair[0].startswith(estimators))
    for name, against in pairs:
        there = _whole(values[against])
        seen, computed = values[against][there], run[name].reshape(len(run["time"]), -1)[there]
        angle = run.columns[name].dimension == "quaternion"
        largest = 1.0 if angle else float(np.abs(seen).max(initial=0.0))
        sigma = _deviation(loop, run, name)
        allowed = np.full(len(there), share * largest) if sigma is None else SIGMAS * sigma
        rule = f"beyond {SIGMAS:g} sigma," if sigma is not None else f"beyond {100.0 * share:g} % of the largest,"
        difference = _angles(computed, seen) if angle else np.linalg.norm(computed - seen, axis=1)
        unit = "rad" if angle else run.columns[name].unit
        limits = np.maximum(allowed[there], ROUNDING * largest)
        yield Comparison(name, against, unit, rule, run["time"][there], computed, seen, difference, limits)


def _angles(computed: Array, seen: Array) -> Array:
    """Return the angles (n,) between attitudes (n, 4), in rad; exactly 0 between equal ones."""
    turn: Any = relative(tuple(seen.T), tuple(computed.T))  # type: ignore[arg-type]
    angles = 2.0 * np.arctan2(np.linalg.norm(turn[1:], axis=0), np.abs(turn[0]))
    return np.where((computed == seen).all(axis=1), 0.0, angles)


def _deviation(loop: ClosedLoop, run: Recording, name: str) -> Array | None:
    """Return the standard deviation (n,) of an estimate: that reported by the estimator, else that of the sensors' noise."""
    if f"{name}_deviation" in run.columns:
        return np.linalg.norm(run[f"{name}_deviation"], axis=1)
    prefix, _, field = name.rpartition("_")
    if f"{prefix}_" not in [fitted.prefix for fitted in loop.used("estimator")]:
        return None
    measured = [(f, f.part.hook("noise")) for f in loop.used("sensor") if field in f.part.module.Reading._fields]
    noises = [make(fitted.params, loop.period) for fitted, make in measured if make is not None]
    sizes = {"rate": lambda n: math.sqrt(3.0) * n.rate, "attitude": lambda n: float(np.linalg.norm(n.attitude))}
    if field not in sizes or not noises:
        return None
    return np.full(len(run["time"]), max(sizes[field](noise) for noise in noises))
