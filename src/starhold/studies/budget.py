"""A pointing error budget: the contribution of each source to the error, their root sum square, and the error under all
sources together."""

from __future__ import annotations

import math
import warnings
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from starhold.algebra.quaternion import relative
from starhold.algebra.rotation import rotation_vector
from starhold.algebra.structure import flatten, places
from starhold.algebra.vector import ZERO
from starhold.analysis.meter import sampled
from starhold.analysis.pointing import (
    ANGLE,
    KNOWLEDGE,
    LINE,
    MEANINGS,
    PERFORMANCE,
    Array,
    Figures,
    Interpretation,
    about_axes,
    figures,
    indices,
    root_sum_square,
    shortfall,
    spacing,
)
from starhold.errors import InputError
from starhold.laws.modes import Modes, make_law
from starhold.loop.closed_loop import Composition
from starhold.loop.kernels import Observer, numbers_of
from starhold.parts.contract import Parameter
from starhold.parts.effectors.wheel_motion import has_friction
from starhold.parts.part import Fitted
from starhold.scenario.bodies.rigid_body.craft import wheels_of
from starhold.scenario.building import build
from starhold.simulation.lanes import RunningBatch, ThreadPool, carry_columns
from starhold.studies.body import SILENT, Notice
from starhold.studies.requirements import Requirement, at_most, tables_of
from starhold.trace.machine import widest

if TYPE_CHECKING:
    from pandas import DataFrame

    from starhold.loop.closed_loop import ClosedLoop
    from starhold.scenario.reading import LawEntry, Scenario
    from starhold.studies.pointing import ProvedPointing

LOOP, TOGETHER, COMBINED = "the loop itself", "all together", "root sum square"
SMALL = math.radians(5.0)
"""Rotation vectors up to this size (rad) can be added with an error of less than a twentieth of their size."""
MOST = 5_000_000
"""The most error samples kept from one batch of runs."""


@dataclass(frozen=True)
class Settings:
    """The settings of a budget: the time (s) from which errors count, the length of windows (s), the separation (s) of a
    drift's windows, the share of errors below a level with its interpretation, the number of runs, and the line of sight."""

    start: float
    window: float
    separation: float
    confidence: float
    interpretation: Interpretation
    runs: int
    boresight: tuple[float, float, float] | None


@dataclass(frozen=True)
class Contribution:
    """One row of a budget: a source, the loop without sources, the root sum square of sources, or all of them together."""

    name: str
    kind: Literal["loop", "source", "combined", "together"]
    figures: Mapping[str, Mapping[str, Figures]]
    """Level, mean and standard deviation (rad), by index ("APE", "MPE", "RPE", "PDE"; with an estimator "AKE", "MKE", "RKE",
    "KDE" of its error) and axis ("x", "y", "z", "angle" for the total angle, "line of sight" with a boresight)."""


@dataclass(frozen=True)
class Budget:
    """The pointing errors of a law by source. Levels are of the line of sight if there is one, else of the total angle."""

    scenario: str
    law: str
    settings: Settings
    rows: tuple[Contribution, ...]
    """Rows: the loop itself, each source, their root sum square, all together."""
    required: Mapping[str, float]
    """The largest level (rad) allowed for each index with a requirement."""
    proof: ProvedPointing | None = None
    """The proved bound on the pointing error, with each source's share, where a proof was requested."""

    @property
    def axis(self) -> str:
        """The axis of the levels."""
        return ANGLE if self.settings.boresight is None else LINE

    @property
    def indices(self) -> tuple[str, ...]:
        """The indices present."""
        return tuple(self.rows[0].figures)

    @property
    def met(self) -> bool:
        """Whether all sources together meet the requirement."""
        return all(self.level(TOGETHER, index) <= most for index, most in self.required.items())

    def row(self, name: str) -> Contribution:
        """Return the row of this name. KeyError where there is none."""
        return {row.name: row for row in self.rows}[name]

    def level(self, name: str, index: str) -> float:
        """Return the level of an index (rad) in the row of this name."""
        return self.row(name).figures[index][self.axis].level

    def table(self) -> DataFrame:
        """Return a table with a row for each source, index and axis: level, mean and standard deviation (rad)."""
        from starhold.studies.frames import frame_of

        return frame_of(self.records())

    def summary(self) -> dict[str, Any]:
        """Return all numbers in the types of JSON: settings, and levels (rad) by source and index."""
        proof = {} if self.proof is None else {"proof": asdict(self.proof)}
        return {
            **proof,
            **asdict(self.settings),
            "axis": self.axis,
            "required": dict(self.required),
            "met": self.met,
            "levels": {row.name: {index: self.level(row.name, index) for index in self.indices} for row in self.rows},
            "together_over_root_sum_square": {
                index: self.level(TOGETHER, index) / combined if (combined := self.level(COMBINED, index)) else None
                for index in self.indices
            },
        }

    def records(self) -> list[dict[str, Any]]:
        """Return the rows of `table`."""
        return [
            {"source": row.name, "kind": row.kind, "index": index, "axis": axis, **figures._asdict()}
            for row in self.rows
            for index, axes in row.figures.items()
            for axis, figures in axes.items()
        ]


class Source(NamedTuple):
    """A source of error in a loop, and the changes of the scenario that remove it."""

    name: str
    without: Mapping[str, Any]


def study(scenario: Scenario, entry: LawEntry, notice: Notice = SILENT) -> Budget:
    """Return the pointing error budget of a law of a scenario, from flights without any error source, with each source
    alone, and with all of them, always without faults. A source's contribution is the difference, run by run and instant by
    instant, between the errors with this source and without any. `notice` is called with the number done, the total, and the
    next flight. InputError where nothing disturbs the loop, the windows do not fit into the run, or a motion diverges."""
    required = {one.metric.upper(): one.bound for one in check_budget(scenario)}
    scenario = faultless(scenario)
    disturbing, clock = sources(scenario), _Clock.of(scenario)
    if not disturbing:
        allowed = "noise, a torque, wheel friction or another source of error"
        raise InputError(scenario.where, "", "no disturbance of the loop", allowed)
    names = (LOOP, *(source.name for source in disturbing), TOGETHER)
    flown: list[tuple[Array, Array | None]] = []
    for done, name in enumerate(names):
        notice(done, len(names), name)
        loop = without(scenario, entry, [source for source in disturbing if name not in (source.name, TOGETHER)])
        flown.append(_flown(scenario, loop, entry, clock, name))
    notice(len(names), len(names), "")
    largest = max(float(np.linalg.norm(errors, axis=-1).max()) for errors, _ in flown)
    if largest > SMALL:
        seen = f"errors up to {math.degrees(largest):.3g} deg from {clock.settings.start:g} s on"
        warnings.warn(f"{scenario.where}: {seen}, which are too large to add linearly", stacklevel=2)
    runs, instants = flown[0][0].shape[:2]
    apart = spacing(runs, instants, clock.length)
    if apart > 1:
        period, share = clock.settings.window / clock.length, shortfall(apart, clock.length)
        seen = f"relative errors are computed over windows that begin every {apart * period:g} s, not every {period:g} s"
        warnings.warn(f"{scenario.where}: {seen}: the largest may be up to {share:.1%} too small", stacklevel=2)
    still, rows = flown[0], list[Contribution]()
    for name, errors in zip(names, flown, strict=True):
        kind = "loop" if name == LOOP else "together" if name == TOGETHER else "source"
        less = (0.0, 0.0) if kind != "source" else still
        moved = (None if a is None or b is None else a - b for a, b in zip(errors, less, strict=True))
        rows.append(Contribution(name, kind, _figures(clock, *moved)))
    combined = {
        index: {axis: root_sum_square([row.figures[index][axis] for row in rows[:-1]]) for axis in axes}
        for index, axes in rows[0].figures.items()
    }
    rows.insert(-1, Contribution(COMBINED, "combined", combined))
    return Budget(scenario.name, entry.name, clock.settings, tuple(rows), required)


def faultless(scenario: Scenario) -> Scenario:
    """Return the scenario as flown for its budget, without faults."""
    return scenario.about("rigid-body").with_({"fault": None, "campaign": None, "requirement": None})


def without(scenario: Scenario, entry: LawEntry, away: Sequence[Source]) -> ClosedLoop:
    """Return the loop of a law without some sources; estimators still assume that they are present."""
    changes = {key: value for source in away for key, value in source.without.items()}
    gone = {f.part.name for f in scenario.parts if changes.get(f"part.{f.called}", ...) is None}
    changed, assuming = scenario.with_(changes), {f.called: f for f in scenario.parts if f.part.role == "estimator"}
    parts = tuple(assuming.get(fitted.called, fitted) for fitted in changed.parts)
    return build(replace(changed, parts=parts), _without_effectors(entry, gone))


def check_budget(scenario: Scenario) -> tuple[Requirement, ...]:
    """Return the requirements that the budget of a scenario decides. InputError for a requirement that is not an upper bound
    on the level of an index, such as "ape", and for an index that needs an estimator where there is none."""
    tables = tables_of(scenario, "budget")
    known = PERFORMANCE if all(fitted.role != "estimator" for fitted in scenario.parts) else MEANINGS
    return at_most(scenario, tables, dict.fromkeys([index.lower() for index in known], "rad"))


def _without_effectors(entry: LawEntry, gone: Collection[str]) -> LawEntry:
    """Return the law with removed effectors also removed from its modes."""
    module: Any = entry.law.module
    if not isinstance(module, Modes):
        return entry
    left = [mode.effectors and tuple(name for name in mode.effectors if name not in gone) for mode in module.modes]
    modes = tuple(mode._replace(effectors=kept) for mode, kept in zip(module.modes, left, strict=True))
    return replace(entry, law=make_law(replace(module, modes=modes)))


def sources(scenario: Scenario) -> tuple[Source, ...]:
    """Return the error sources of a scenario's loops: torques, moving parts without a command, friction of wheels, and the
    nonzero parameters of sensors that may be zero, except times. Actuators, estimators and sampling belong to the loop."""
    disturbing = [
        Source(key.replace("_", " "), {f"{name}.{key}": type(value)()})
        for name in ("environment", "sensor")
        for key, value in getattr(scenario.table, name)
        if value
    ]
    wheels = wheels_of(scenario)
    if wheels is not None and has_friction(wheels):
        disturbing.append(Source("wheel friction", _smooth(scenario)))
    for fitted in scenario.parts:
        key, part = f"part.{fitted.called}", fitted.part
        passive = part.role == "effector" and not part.flag("ACTS")
        if passive or (part.role == "environment" and part.hook("torque") is not None):
            disturbing.append(Source(fitted.called, {key: None}))
        elif part.role == "sensor":
            errors = _errors_of(fitted)
            disturbing += [
                Source(f"{fitted.called} {name.replace('_', ' ')}", {f"{key}.{name}": zero}) for name, zero in errors.items()
            ]
    return tuple(disturbing)


def _smooth(scenario: Scenario) -> dict[str, Any]:
    tables = [f"wheel[{place}]" for place in range(1, len(scenario.table.wheel) + 1)] or ["wheels"]
    return {f"{table}.{key}": 0.0 for table in tables for key in ("viscous", "coulomb", "static_friction")}


def _errors_of(fitted: Fitted) -> dict[str, Any]:
    """Return the parameters of a sensor that are errors, by name, with the zeros that remove them."""
    zeros: dict[str, Any] = {}
    for item, value in zip(fitted.part.fields(), fitted.params, strict=True):
        # A required parameter may be a direction, unless its bounds begin at zero.
        absent = item.gain.at_least == 0.0 if item.required else not np.any(item.default)
        if absent and _may_be_zero(item.gain) and np.any(value):
            zeros[item.name] = [0.0] * item.gain.shape[0] if item.gain.shape else 0.0
    return zeros


def _may_be_zero(gain: Parameter) -> bool:
    plain = not (gain.whole or gain.choices or gain.columns)
    # Delays and intervals belong to the loop: without them the same noise would have a different effect.
    return plain and gain.unit != "s" and gain.above is None and (gain.at_least or 0.0) <= 0.0 <= (gain.at_most or 0.0)


class _Clock(NamedTuple):
    """The sampling of errors: control steps per run and per sample, the first sample, samples per window and per drift."""

    settings: Settings
    steps: int
    every: int
    first: int
    length: int
    apart: int

    @classmethod
    def of(cls, scenario: Scenario) -> _Clock:
        """Return the times of a scenario's [budget] table. InputError where they do not fit into its runs."""
        timing, wanted = scenario.table.simulation, scenario.table.budget
        period = timing.control_period * timing.record_every
        end = wanted.end or timing.duration
        if end > timing.duration:
            raise InputError(scenario.where, "budget.end", f"{end:g} s", f"at most the run's {timing.duration:g} s")
        last = min((timing.steps - 1) // timing.record_every, math.floor(end / period + 1e-9))
        start = 0.5 * end if wanted.start is None else wanted.start
        first = math.ceil(start / period - 1e-9)
        count = last - first + 1

        def samples(key: str, given: float | None, share: float, most: int, least: int) -> int:
            if given is None:
                return min(max(least, int(share * count)), most)
            number = round(given / period)
            if not least <= number <= most:
                allowed = f"between {least * period:g} s and {most * period:g} s, of {count * period:g} s that count"
                raise InputError(scenario.where, f"budget.{key}", f"{given:g} s", allowed)
            return number

        if count < 4:
            raise InputError(scenario.where, "budget.start", f"{start:g} s", f"at most {(last - 3) * period:g} s")
        length = samples("window", wanted.window, 0.1, count - 1, 2)
        apart = samples("separation", wanted.separation, 0.5, count - length, 1)
        if count * wanted.runs > MOST:
            raise InputError(scenario.where, "budget.runs", f"{wanted.runs} of {count} samples", f"at most {MOST} in all")
        times, share = (first * period, length * period, apart * period), (wanted.confidence, wanted.interpretation)
        settings = Settings(*times, *share, wanted.runs, wanted.boresight and tuple(wanted.boresight))
        return cls(settings, last * timing.record_every + 1, timing.record_every, first, length, apart)


class _Noted(NamedTuple):
    """The error of the attitude and that of its estimate, as rotation vectors (rad, body axes)."""

    error: Any
    knowledge: Any


@cache
def _note(parts: Composition, knows: bool) -> Any:
    """Return the equations of the errors; loops that one kernel flies share one function."""
    read = sampled(parts)

    def note(seen: Any, decided: Any, carry: Any, step: Any, setup: Any, numbers: Any) -> _Noted:
        error = rotation_vector(read(decided, step, setup)["attitude_error"])
        estimate = decided.memories.estimate
        return _Noted(error, rotation_vector(relative(decided.state.attitude, estimate.attitude)) if knows else ())

    return note


def _flown(scenario: Scenario, loop: ClosedLoop, entry: LawEntry, clock: _Clock, name: str) -> tuple[Array, Array | None]:
    """Return the errors of all runs of a loop, (runs, instants, 3), and those of the estimate, None without one."""
    runs, (phase,) = clock.settings.runs, loop.phases(clock.steps)
    knows = hasattr(loop.carry().memories.estimate, "attitude")
    first = _Noted(ZERO, ZERO if knows else ())
    size = len(flatten(first))
    start = np.repeat(np.array(flatten(loop.start), dtype=float)[:, None], runs, axis=1)
    observer = Observer(_note(loop.composition(), knows), first, ())
    width = widest(len(numbers_of(loop.carry())), size)
    batch = RunningBatch(loop, carry_columns(loop, start), loop.run, width, observer, np.zeros((size, runs)))
    batch.prepare(phase)
    instants = range(clock.first * clock.every, clock.steps, clock.every)
    noted = np.empty((batch.count, batch.width, len(instants), size))

    def work(piece: range) -> None:
        done, span = 0, slice(piece.start, piece.stop)
        for place, instant in enumerate(instants):
            # Up to the sampled instant and through the step that begins there, whose errors are recorded.
            batch.fly(phase, piece, done, instant + 1 - done)
            done = instant + 1
            noted[span, :, place] = batch.noted[span].swapaxes(1, 2)

    with ThreadPool() as pool:
        pool.share(work, batch.count, 1)()
    lost = batch.carries()[places(batch.like).lost_at]
    if (lost >= 0.0).any():
        reason = f"{name}: the motion diverges at {lost[lost >= 0.0].min() * loop.period:g} s"
        raise InputError(scenario.where, f"law.{entry.name}", reason, "a law that holds the attitude")
    errors = noted.reshape(-1, len(instants), size)[:runs]
    return errors[..., :3], errors[..., 3:] if knows else None


def _figures(clock: _Clock, errors: Array | None, knowledge: Array | None) -> dict[str, dict[str, Figures]]:
    """Return the figures of each index about each axis."""
    settings, vectors = clock.settings, dict[str, Array]()
    if errors is not None:
        vectors |= indices(errors, clock.length, clock.apart)
    if knowledge is not None:
        known = indices(knowledge, clock.length, clock.apart)
        vectors |= {name: known[like] for name, like in KNOWLEDGE.items()}
    return {
        index: {
            axis: figures(values, settings.confidence, settings.interpretation)
            for axis, values in about_axes(samples, settings.boresight).items()
        }
        for index, samples in vectors.items()
    }
