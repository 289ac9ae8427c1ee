"""Verdicts on requirements, with number, limit and evidence, and the verdicts from one flight and from inspections."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np

from starhold.errors import InputError
from starhold.laws.modes import names_of_modes
from starhold.scenario.building import build
from starhold.scenario.checking import nearest, show
from starhold.scenario.requirement import BEGINS
from starhold.scenario.units import DECIBEL, apart
from starhold.studies.body import study_of
from starhold.studies.modes import modes_flown, stretches
from starhold.studies.requirements import (
    LOST,
    Requirement,
    Times,
    cones_of,
    orbit_of,
    read_requirements,
    tables_of,
    times_of,
)

if TYPE_CHECKING:
    from starhold.scenario.reading import LawEntry, Scenario
    from starhold.scenario.requirement import RequirementTable
    from starhold.simulation.lane import Recording
    from starhold.studies.flight import Flight

Outcome: TypeAlias = Literal["met", "missed", "not decided"]
WORST: tuple[Outcome, ...] = ("met", "not decided", "missed")
"""The outcomes from best to worst."""
DEARER, ELSEWHERE = ("proof", "campaign", "budget", "margin"), "left to starhold verify"
"""The methods that need more than one flight, with the text shown in their place."""


@dataclass(frozen=True)
class RequirementVerdict:
    """The verdict on a requirement. number, limit and margin are in `unit` (SI), or None; the requirement is met if the
    margin is 0 or more. evidence: a sentence, without its full stop, on the basis of the verdict; left_out: features of the
    loop that the evidence does not cover, which must be stated with "met"."""

    id: str
    text: str
    method: str
    verdict: Outcome
    evidence: str
    number: float | None = None
    limit: float | None = None
    unit: str = ""
    at_most: bool = True
    metric: str = ""
    left_out: tuple[str, ...] = ()
    parent: str = ""
    rationale: str = ""
    typed_unit: str = ""
    scale: float = 1.0
    """The value of one SI unit in the unit in which the limit is typed."""

    @property
    def margin(self) -> float | None:
        """The distance of the number from the limit, positive on the allowed side, or None."""
        if self.number is None or self.limit is None:
            return None
        return self.limit - self.number if self.at_most else self.number - self.limit

    @property
    def sentence(self) -> str:
        """The verdict together with what it leaves out, so that it does not claim too much."""
        return f"{self.verdict}, leaving out {'; '.join(self.left_out)}" if self.left_out else self.verdict


def undecided(table: RequirementTable, why: str, **known: Any) -> RequirementVerdict:
    """Return the verdict "not decided" on a requirement, with the reason."""
    return verdict_on(table, "not decided", why, **known)


def limits(table: RequirementTable, required: Requirement) -> dict[str, Any]:
    """Return the fields of a verdict that state its limit, in SI and in the typed unit."""
    fields: dict[str, Any] = {"limit": required.bound, "unit": required.unit, "at_most": required.at_most}
    typed = table.at_most if required.at_most else table.at_least
    if isinstance(typed, str) and required.bound:
        number, unit = apart(typed)
        if unit == DECIBEL:
            # Margins in decibels are not differences of ratios: they are shown as ratios.
            return fields
        fields |= {"typed_unit": unit, "scale": number / required.bound}
    return fields


def verdict_on(table: RequirementTable, verdict: Outcome, evidence: str, **known: Any) -> RequirementVerdict:
    """Return the verdict on the requirement of a table; known: number, limit, unit and other fields."""
    stated = {"metric": table.metric or "", "parent": table.parent or "", "rationale": table.rationale}
    fields: dict[str, Any] = stated | known
    return RequirementVerdict(table.called, table.text, table.method or "", verdict, evidence, **fields)


def compared(
    table: RequirementTable, required: Requirement, number: float | None, evidence: str, **known: Any
) -> RequirementVerdict:
    """Return the verdict from a number; None and NaN miss the limit."""
    there = None if number is None or math.isnan(number) else float(number)
    decided = verdict_on(table, "missed", evidence, number=there, **limits(table, required) | known)
    return replace(decided, verdict="met") if decided.margin is not None and decided.margin >= 0.0 else decided


def in_order(scenario: Scenario, decided: Mapping[str, RequirementVerdict]) -> tuple[RequirementVerdict, ...]:
    """Return the verdicts in the order of the file. decided: the verdicts of methods, by the tables' names in errors.
    Requirements without a method take the worst verdict of those derived from them."""
    tables = {f"requirement[{place}]": table for place, table in enumerate(scenario.table.requirement, 1)}
    by_id = {tables[key].called: verdict for key, verdict in decided.items()}

    def of(table: RequirementTable) -> RequirementVerdict:
        if table.called not in by_id:
            below = [of(one) for one in tables.values() if one.parent == table.called]
            verdict = WORST[max(WORST.index(one.verdict) for one in below)]
            named = ", ".join(f"{one.id} {one.verdict}" for one in below)
            left = tuple(dict.fromkeys(what for one in below for what in one.left_out))
            by_id[table.called] = verdict_on(table, verdict, f"derived from it: {named}", left_out=left)
        return by_id[table.called]

    return tuple(of(table) for table in tables.values())


def verdicts_of_flight(scenario: Scenario, flight: Flight) -> tuple[RequirementVerdict, ...]:
    """Return the verdicts on a scenario's requirements from an existing flight of one of its laws and from records of
    inspections; other methods are left to `starhold verify`. InputError as in `check_flight`."""
    entry = scenario.pick(flight.name)
    decided = by_flight(scenario, entry, flight.recording) | by_inspection(scenario)
    others = {key: table for method in DEARER for key, table in tables_of(scenario, method).items()}
    return in_order(scenario, decided | {key: undecided(table, ELSEWHERE) for key, table in others.items()})


# --- by inspection ----------------------------------------------------------------------------------------------------


def by_inspection(scenario: Scenario) -> dict[str, RequirementVerdict]:
    """Return the verdicts on requirements verified by inspection: met if the file of the record exists."""
    return {key: _inspected(scenario, table) for key, table in tables_of(scenario, "inspection").items()}


def _inspected(scenario: Scenario, table: RequirementTable) -> RequirementVerdict:
    if table.record is None:
        return undecided(table, "no record is named")
    try:
        with (scenario.folder / table.record).open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
    except (OSError, ValueError):
        return undecided(table, f"its record {table.record} is missing")
    return verdict_on(table, "met", f"as by record {table.record}, SHA-256 {digest}")


# --- by one flight ----------------------------------------------------------------------------------------------------


def check_flight(scenario: Scenario, entry: LawEntry) -> tuple[Requirement, ...]:
    """Return the requirements that one flight of a law decides. InputError for a metric that is not measured in flights, a
    limit in a wrong unit, an unknown mode, and times outside the flight."""
    tables, study = tables_of(scenario, "flight"), study_of(scenario.body)
    check_modes(scenario, entry, tables)
    loop = build(scenario, entry)
    try:
        meter = study.meter(scenario, loop, loop.gains, study.EXTRAS, cones_of(tables.values()))
    except ValueError as error:
        raise InputError(scenario.where, "requirement", "an exclusion-cone", str(error)) from None
    for key, table in tables.items():
        times_of(scenario, key, table, meter.steps * meter.instant)
    return read_requirements(tables, meter.units, scenario.where, orbit_of(scenario))


def check_modes(scenario: Scenario, entry: LawEntry, tables: Mapping[str, RequirementTable]) -> None:
    """Raise InputError where a requirement names a mode that the law does not have."""
    names = names_of_modes(entry.law)
    for key, table in tables.items():
        if table.in_mode is not None and table.in_mode not in names:
            allowed = nearest(table.in_mode, names) if names else f"no mode, because the law {entry.name} has none"
            raise InputError(scenario.where, f"{key}.in_mode", show(table.in_mode), allowed)


def by_flight(scenario: Scenario, entry: LawEntry, run: Recording) -> dict[str, RequirementVerdict]:
    """Return the verdicts from a recorded flight of a law. InputError as in `check_flight`."""
    tables = tables_of(scenario, "flight")
    if not tables:
        return {}
    study, cones = study_of(scenario.body), cones_of(tables.values())
    measured: dict[Any, list[dict[str, Any]]] = {}
    decided: dict[str, RequirementVerdict] = {}
    modes = names_of_modes(entry.law)
    for (key, table), required in zip(tables.items(), check_flight(scenario, entry), strict=True):
        about = times_of(scenario, key, table), modes.index(table.in_mode) + 1 if table.in_mode else None
        if table.metric == BEGINS:
            decided[key] = _begun(table, required, entry, run)
            continue
        if about not in measured:
            measured[about] = [study.measure_required(part, cones) for part in _parts(run, *about)]
        flight = f"one flight of {entry.name}{f', in its mode {table.in_mode}' if table.in_mode else ''}{about[0]}"
        decided[key] = _flown(table, required, measured[about], run.attrs.get("diverged_at"), flight)
    return decided


def _begun(table: RequirementTable, required: Requirement, entry: LawEntry, run: Recording) -> RequirementVerdict:
    """Return the verdict on the time at which a mode first begins."""
    times = [begun.time for begun in modes_flown(entry.law, run) if begun.mode == table.in_mode]
    evidence = f"one flight of {entry.name}{'' if times else f', in which the mode {table.in_mode} never begins'}"
    return compared(table, required, times[0] if times else None, evidence)


def _flown(
    table: RequirementTable, required: Requirement, parts: Sequence[Mapping[str, Any]], lost: Any, flight: str
) -> RequirementVerdict:
    if required.metric == LOST:
        verdict = "met" if lost is None else "missed"
        return verdict_on(table, verdict, flight if lost is None else f"{flight}, which is lost")
    if not parts and lost is None:
        return undecided(table, f"{flight}: it does not reach that time", **limits(table, required))
    values: list[Any] = [part.get(required.column) for part in parts]
    if not values or None in values:
        return compared(table, required, None, f"{flight}: {'it is lost' if lost is not None else 'there is no such value'}")
    return compared(table, required, (max if required.at_most else min)(values), flight)


def _parts(run: Recording, times: Times, mode: int | None) -> list[Recording]:
    """Return the parts of a recording, with at least two samples, within times since its start, or since each beginning of a
    mode, counted from 1."""
    attrs, time = run.attrs, run["time"]
    clock, period, every = attrs.get("time_unit_s", 1.0), attrs["control_period"], attrs["record_every"]
    spans = [(0, None)]
    if mode is not None:
        spans = [(one.first, one.last) for one in stretches(run) if one.mode == mode]
    parts: list[Recording] = []
    for first, last in spans:
        since = (time - first * period) * clock
        inside = (since >= times.begin * (1.0 - 1e-12)) & (since <= times.end * (1.0 + 1e-12))
        inside[: -(-first // every)] = False
        inside[len(time) if last is None else -(-last // every) :] = False
        if np.count_nonzero(inside) > 1:
            sampled = {name: values[inside] if len(values) == len(time) else values for name, values in run.arrays.items()}
            parts.append(replace(run, arrays=sampled))
    return parts
