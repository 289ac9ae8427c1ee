"""Flies, measures and certifies the laws of a scenario on any body."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np

from starhold.analysis.ranking import MetricSet
from starhold.analysis.rigid_body import error_angle
from starhold.loop.closed_loop import ClosedLoop
from starhold.scenario.building import build as build
from starhold.scenario.reading import Scenario
from starhold.simulation.lane import Progress, Recording, fly
from starhold.studies.body import study_of
from starhold.studies.flight import Flight
from starhold.studies.modes import epoch_of, modes_flown, never_begun
from starhold.version import __version__

Notice: TypeAlias = Callable[[str, int, int], None]
"""Called with a law's name, the number of control steps done and their total."""


def fly_law(scenario: Scenario, entry: Any, loop: Any, notice: Notice | None = None, process: str | None = None) -> Flight:
    """Return the measured flight of one law of the scenario in a loop from `build`; process: a program that commands in
    place of the law."""
    study = study_of(scenario.body)
    progress = None if notice is None else lambda done, total: notice(entry.name, done, total)
    run, carry = _flown(scenario, loop, progress, process)
    metrics = study.metrics_of(run) | _law_counters(entry, carry.memory)
    gains = {
        item.name: (item.written(value), "1" if item.gain.choices else item.gain.unit)
        for item, value in zip(entry.law.fields(), entry.gains, strict=True)
    }
    values, modes = gains | study.resources(entry), modes_flown(entry.law, run, epoch_of(scenario, entry.law))
    never = never_begun(entry.law, entry.gains, run) if modes else ()
    return Flight(entry.name, entry.law.name, run, metrics, values, study.metric_set(run), modes=modes, never=never)


def timed(scenario: Scenario, loop: Any, flight: Flight) -> Flight:
    """Return the flight with the time per call of its law among its metrics, which is accurate only on an idle machine."""
    return costing(flight, study_of(scenario.body).call_costs(loop, flight.recording))


def costing(flight: Flight, costs: dict[str, float]) -> Flight:
    """Return the flight with these times per call of its law among its metrics."""
    return replace(flight, metrics=flight.metrics | costs)


def prove(scenario: Scenario, entry: Any, loop: Any, flight: Flight, pointing: bool = False) -> Flight:
    """Return the flight with the certificates of its law and its departures from their claims; without both where the law's
    nominal model differs from the craft. pointing: whether to seek the claim about the loop as it flies, which takes
    seconds."""
    study = study_of(scenario.body)
    certified = [] if loop.nominal is not None else study.certify(scenario, entry, loop, pointing)
    left = tuple(study.departures(issued, loop, flight.recording) for issued in certified)
    covered = tuple(study.covered(issued, loop, flight.recording) for issued in certified)
    return replace(flight, certificates=tuple(issued.certificate for issued in certified), departures=left, covered=covered)


def check_step(scenario: Scenario, loop: Any, flight: Flight, progress: Progress | None = None) -> Flight:
    """Return the flight with the changes of its metrics when the integration step is halved."""
    finer = record(scenario, halved(loop), progress)
    errors = step_error(flight.recording, finer, study_of(scenario.body).state_names(finer))
    return replace(flight, metrics=flight.metrics | {"step_error": errors})


def record(scenario: Scenario, loop: Any, progress: Progress | None = None, process: str | None = None) -> Recording:
    """Return the recorded run of a loop, with the commands of a process if one is given."""
    return _flown(scenario, loop, progress, process)[0]


def _flown(
    scenario: Scenario, loop: Any, progress: Progress | None = None, process: str | None = None
) -> tuple[Recording, Any]:
    """Return the recorded run of a loop and its final carry, with the commands of a process if one is given."""
    timing = scenario.table.simulation
    if process is None:
        samples, carry = fly(loop, timing.steps, timing.record_every, progress=progress)
        return name_samples(scenario, loop, samples, carry), carry
    from starhold.link.process import LostLawError, fly_by_process

    def named(samples: Any, carry: Any) -> Recording:
        return commanded_by(process, name_samples(scenario, loop, samples, carry))

    try:
        samples, carry = fly_by_process(process, loop, timing.steps, timing.record_every, progress)
    except LostLawError as error:
        if error.flight.steps:
            error.recording = named(*error.flight.samples(timing.record_every))
        raise
    return named(samples, carry), carry


def commanded_by(process: str, run: Recording) -> Recording:
    """Return the recording of a flight commanded by a process; its attributes name the process instead of the law's
    program."""
    attrs = {name: value for name, value in run.attrs.items() if name != "law_program"}
    return replace(run, attrs=attrs | {"law_process": process})


def name_samples(scenario: Scenario, loop: Any, samples: Any, carry: Any) -> Recording:
    """Return the samples of `fly` as a recording, whose attributes suffice to measure and to repeat the run."""
    run = study_of(scenario.body).name_samples(scenario, loop, samples, carry)
    signed = {"scenario": scenario.text, "starhold_version": __version__}
    return replace(run, attrs={**signed, **run.attrs, "body": scenario.body})


def metrics_of(run: Recording) -> dict[str, Any]:
    """Return the metrics of a recorded run, without those of the law's calls."""
    return study_of(run.attrs["body"]).metrics_of(run)


def metric_set_of(run: Recording) -> MetricSet:
    """Return the rules by which the metrics of a recorded run are shown."""
    return study_of(run.attrs["body"]).metric_set(run)


def compare(scenario: Scenario, notice: Notice | None = None, pointing: bool = False) -> list[Flight]:
    """Return the flights of all laws of the scenario, in the order of the file; pointing: as in `prove`."""
    loops = [(entry, build(scenario, entry)) for entry in scenario.laws]
    return [
        timed(scenario, loop, prove(scenario, entry, loop, fly_law(scenario, entry, loop, notice), pointing))
        for entry, loop in loops
    ]


def _law_counters(entry: Any, memory: Any) -> dict[str, Any]:
    """Return the counts of an iterative law in a run: solver iterations, and calls that reached the iteration limit."""
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


def halved(loop: ClosedLoop) -> ClosedLoop:
    """Return the loop with twice as many integration steps, each half as long, and the same control steps and random
    numbers."""
    return replace(loop, substeps=2 * loop.substeps)


def step_error(run: Recording, finer: Recording, names: Iterable[str]) -> dict[str, float | None]:
    """Return the largest differences of some quantities between a run and that of the `halved` loop: the angle (rad) between
    quaternions, else norms in recorded units. All are None if one of the two diverged before the other, because then they
    cannot be compared."""
    same = len(run["time"]) == len(finer["time"])
    return {name: _difference(run, finer, name) if same else None for name in names}


def _difference(run: Recording, finer: Recording, name: str) -> float:
    ours, theirs = run[name], finer[name]
    if run.columns[name].dimension == "quaternion":
        # The vector part of conj(p) q, in which small angles keep their digits.
        p0, p, q0, q = ours[:, :1], ours[:, 1:], theirs[:, :1], theirs[:, 1:]
        scalar = np.sum(ours * theirs, axis=1, keepdims=True)
        return float(error_angle(np.hstack([scalar, p0 * q - q0 * p - np.cross(p, q)])).max())
    return float(np.linalg.norm(np.reshape(ours - theirs, (len(ours), -1)), axis=1).max())
