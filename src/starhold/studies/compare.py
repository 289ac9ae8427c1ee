"""Flies the laws of a scenario, measures them, and writes what came of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, TypeAlias, cast

from starhold.analysis.cost import call_costs, recorded_states
from starhold.analysis.metrics import measure
from starhold.certification.certificate import FILE
from starhold.certification.certificate import write as write_certificates
from starhold.files import atomic_write
from starhold.loop.closed_loop import ClosedLoop
from starhold.report.figures import sketch as sketch
from starhold.report.results import SUMMARY, signed, write_summary
from starhold.report.transients import against_limits
from starhold.scenario.building import build
from starhold.scenario.reading import LawEntry, Scenario
from starhold.simulation.lane import Progress, Recording, fly, label
from starhold.studies.certificates import certify_law, departures_of
from starhold.studies.certificates import certify_scenario as certify_scenario
from starhold.studies.flight import Flight, gain_text

TRANSIENT = ("rate_limit", "acceleration_limit", "angle_end", "rate_end")
Notice: TypeAlias = Callable[[str, int, int], None]
"""Called with a law's name, the control steps done and those in all."""


def fly_law(scenario: Scenario, entry: LawEntry, loop: ClosedLoop, notice: Notice | None = None) -> Flight:
    """One law of the scenario, with the loop that `build` gives for it, flown and measured."""
    simulation = scenario.table.simulation
    progress = None if notice is None else lambda done, total: notice(entry.name, done, total)
    samples, carry = fly(loop, simulation.steps, simulation.record_every, progress=progress)
    recording = name_samples(scenario, loop, samples, carry)
    metrics = metrics_of(recording)
    metrics |= _law_counters(entry, carry.memory)
    gains = {item.name: gain_text(item, value) for item, value in zip(entry.law.fields(), entry.gains, strict=True)}
    return Flight(entry.name, entry.law.name, recording, metrics, gains)


def timed(loop: ClosedLoop, flight: Flight) -> Flight:
    """The flight with what a call of its law costs, told truly only where nothing else keeps the machine busy."""
    return replace(flight, metrics=flight.metrics | call_costs(loop, recorded_states(loop, flight.recording)))


def prove(scenario: Scenario, entry: LawEntry, loop: ClosedLoop, flight: Flight) -> Flight:
    """The flight with the certificates of its law, and how it leaves their claims."""
    found = certify_law(scenario, entry, loop)
    left = tuple(departures_of(issued, loop, flight.recording) for issued in found)
    return replace(flight, certificates=tuple(issued.certificate for issued in found), departures=left)


def record(scenario: Scenario, loop: ClosedLoop, progress: Progress | None = None) -> Recording:
    """The run of a loop."""
    simulation = scenario.table.simulation
    return name_samples(scenario, loop, *fly(loop, simulation.steps, simulation.record_every, progress=progress))


def name_samples(scenario: Scenario, loop: ClosedLoop, samples: Any, carry: Any) -> Recording:
    """The samples of `fly` under their names, with what they are measured by among the attributes."""
    settling, transient = scenario.table.settling, scenario.table.transient
    told = {f"settling_{name}": getattr(settling, name) for name in ("attitude_tolerance", "rate_tolerance")}
    if transient is not None:
        told |= {f"transient_{name}": getattr(transient, name) for name in TRANSIENT}
    run = label(loop, samples, carry, scenario.table.simulation.record_every)
    return signed(replace(run, attrs=run.attrs | told), scenario)


def metrics_of(run: Recording) -> dict[str, Any]:
    """The metrics of a recorded run, but for those of the law's calls."""
    told = run.attrs
    found = measure(run, told["settling_attitude_tolerance"], told["settling_rate_tolerance"])
    limits = SimpleNamespace(**{name: told.get(f"transient_{name}") for name in TRANSIENT})
    return found | against_limits(run, None if limits.angle_end is None else cast(Any, limits), found["cut_off"])


def compare(scenario: Scenario, notice: Notice | None = None) -> list[Flight]:
    """Every law of the scenario flown on it, in the order of the file."""
    loops = [(entry, build(scenario, entry)) for entry in scenario.laws]
    return [timed(loop, prove(scenario, entry, loop, fly_law(scenario, entry, loop, notice))) for entry, loop in loops]


def write(scenario: Scenario, flights: Sequence[Flight], folder: Path) -> Path:
    """Summary, certificates and page into an existing folder; returns the page's path. The runs are written as they are
    flown, by `write_run`, and the pictures by a `Painter`."""
    from starhold.report.page import write_page

    write_summary(scenario, {flight.name: flight.results() for flight in flights}, folder / SUMMARY)
    write_proved(scenario.name, flights, folder)
    page = folder / "report.html"
    with atomic_write(page) as hidden:
        write_page(hidden, scenario, flights)
    return page


def write_proved(name: str, flights: Sequence[Flight], folder: Path) -> None:
    """The flights' certificates in one file, where there are any."""
    if not any(flight.certificates for flight in flights):
        return
    with atomic_write(folder / FILE) as hidden:
        write_certificates([certificate for flight in flights for certificate in flight.certificates], name, hidden)


def _law_counters(entry: LawEntry, memory: Any) -> dict[str, Any]:
    """What an iterating law counted during the run: solver iterations and the calls that used up their budget."""
    counted = entry.law.counters(memory)
    if counted is None:
        return {}
    calls, total, worst, hits = counted[:4]
    return {
        "solver_calls": calls,
        "solver_iterations_mean": total / max(calls, 1),
        "solver_iterations_worst": worst,
        "solver_budget_hits": hits,
    }
