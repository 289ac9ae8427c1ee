"""Flies the laws of a scenario of station keeping, measures them, and writes what came of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from starhold.analysis.station import BOARD, Circle, Equilibrium, goal_of, measure_station
from starhold.analysis.station_departure import station_departures
from starhold.analysis.station_trial import fly_station, station_start_inside
from starhold.certification.station import certify_station
from starhold.files import atomic_write
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.bodies.libration_point import Units
from starhold.parts.craft import vector
from starhold.report.results import SUMMARY, signed, write_summary
from starhold.report.station.figures import sketch as sketch
from starhold.scenario.building import build as build
from starhold.scenario.reading import LawEntry, Scenario
from starhold.simulation.lane import Progress, Recording, fly, label
from starhold.studies.certificates import Tried
from starhold.studies.compare import Notice, write_proved
from starhold.studies.flight import Flight, gain_text, number_text


def fly_law(scenario: Scenario, entry: LawEntry, loop: ClosedLoop, notice: Notice | None = None) -> Flight:
    """One law of the scenario, with the loop that `build` gives for it, flown and measured."""
    progress = None if notice is None else lambda done, total: notice(entry.name, done, total)
    run = record(scenario, loop, progress)
    metrics = metrics_of(run)
    gains = {item.name: gain_text(item, value) for item, value in zip(entry.law.fields(), entry.gains, strict=True)}
    limit, lag = entry.options
    gains |= {"limit": number_text(limit)} | ({"lag": number_text(lag)} if lag else {})
    return Flight(entry.name, entry.law.name, run, metrics, gains, metric_set=BOARD)


def timed(loop: ClosedLoop, flight: Flight) -> Flight:
    """The flight as it is: calls are not timed where control surfaces move within hours."""
    return flight


def prove(scenario: Scenario, entry: LawEntry, loop: ClosedLoop, flight: Flight) -> Flight:
    """The flight with the certificate of its law, and how it leaves its claims."""
    certificate = certify_station(loop, entry.name)
    left = station_departures(certificate, loop, flight.recording, scenario.table.libration.units.time)
    return replace(flight, certificates=(certificate,), departures=(left,))


def certify_scenario(scenario: Scenario, law: str | None = None) -> list[Tried]:
    """Certificates of all laws of a scenario, or of one. Raises `BrokenClaimError` where a flight contradicts one."""
    found: list[Tried] = []
    for entry in scenario.laws if law is None else (scenario.pick(law),):
        loop = build(scenario, entry)
        certificate = certify_station(loop, entry.name)
        found.append(Tried(certificate, fly_station(loop, certificate), station_start_inside(certificate, loop)))
    return found


def record(scenario: Scenario, loop: ClosedLoop, progress: Progress | None = None) -> Recording:
    """The run of a loop, scaled, with what its units are worth among its attributes."""
    timing = scenario.table.simulation
    return name_samples(scenario, loop, *fly(loop, timing.steps, timing.record_every, progress=progress))


def name_samples(scenario: Scenario, loop: ClosedLoop, samples: Any, carry: Any) -> Recording:
    """The samples of `fly` under their names, with what they are worth and measured by among the attributes."""
    units, goal = scenario.table.libration.units, goal_of(loop.gains)
    run = label(loop, samples, carry, scenario.table.simulation.record_every)
    worth = {"length_unit_m": units.length, "time_unit_s": units.time, "rate_unit_rad_per_s": units.rate}
    worth |= {"velocity_unit_m_per_s": units.velocity, "acceleration_unit_m_per_s2": units.acceleration}
    worth |= {"settling_tolerance": scenario.table.settling.tolerance}
    worth |= {"circle": [*goal]} if isinstance(goal, Circle) else {"rest": [*goal.place]}
    return signed(replace(run, attrs=run.attrs | worth), scenario)


def metrics_of(run: Recording) -> dict[str, Any]:
    """The metrics of a recorded run."""
    told = run.attrs
    units = Units(float(told["length_unit_m"]), float(told["rate_unit_rad_per_s"]))
    goal = Circle(*map(float, told["circle"])) if "circle" in told else Equilibrium(vector(told["rest"]))
    return measure_station(run, units, goal, float(told["settling_tolerance"]))


def compare(scenario: Scenario, notice: Notice | None = None) -> list[Flight]:
    """Every law of the scenario flown on it, in the order of the file."""
    loops = [(entry, build(scenario, entry)) for entry in scenario.laws]
    return [prove(scenario, entry, loop, fly_law(scenario, entry, loop, notice)) for entry, loop in loops]


def write(scenario: Scenario, flights: Sequence[Flight], folder: Path) -> Path:
    """Summary, certificates and page into an existing folder; returns the page's path."""
    from starhold.report.station.page import write_page

    write_summary(scenario, {flight.name: flight.results() for flight in flights}, folder / SUMMARY)
    write_proved(scenario.name, flights, folder)
    page = folder / "report.html"
    with atomic_write(page) as hidden:
        write_page(hidden, scenario, flights)
    return page
