"""The hooks by which studies know a body, and how they are found by the body's name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import import_module
from importlib.util import find_spec
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from starhold.analysis import any_body
from starhold.analysis.meter import recorded_of
from starhold.certification.certificate import Certificate
from starhold.simulation.lane import label

if TYPE_CHECKING:
    from starhold.analysis.departure import Departure
    from starhold.analysis.meter import Meter
    from starhold.analysis.ranking import MetricSet
    from starhold.analysis.trial import Trial
    from starhold.scenario.reading import LawEntry, Scenario
    from starhold.simulation.lane import Recording

Cones: TypeAlias = Mapping[str, Any]
"""Body axes with the directions that they are to stay away from, by the names of their metrics."""
NO_CONES: Cones = MappingProxyType({})
Values: TypeAlias = dict[str, tuple[Any, str]]
"""Values with their units ("1" for none), by name."""


class Issued(NamedTuple):
    """A certificate, the loop, without faults to come, that it speaks of, and the control step from which on that flies."""

    certificate: Certificate
    loop: Any
    step: int = 0
    mode: int | None = None
    """The mode that it speaks of, in a flight of modes, counted from 1."""
    before: int | None = None
    """The mode before, of a certificate about how that hands over."""


class BodyStudy:
    """All that flying, measuring and certifying ask of a body; `starhold.studies.bodies` holds one `STUDY` a module. As it
    stands it is the study of any body: what its part records is flown and measured, in the units of the recording, and
    nothing is claimed."""

    EXTRAS: tuple[str, ...] = ()
    """Metrics that are measured only where they are asked for."""

    def name_samples(self, scenario: Scenario, loop: Any, samples: Any, carry: Any) -> Recording:
        """Name the samples of `fly`; the attributes hold the numbers that metrics need."""
        return label(loop, samples, carry, scenario.table.simulation.record_every)

    def metrics_of(self, run: Recording) -> dict[str, Any]:
        """Measure a recorded run; `diverged_at` (s) is None for a motion that was not lost."""
        return any_body.measure(run)

    def measure_required(self, run: Recording, cones: Cones) -> dict[str, Any]:
        """Measure a recorded run, or a part of it, as requirements ask: with extras and cones, as `meter` does."""
        return self.metrics_of(run)

    def meter(self, scenario: Scenario, loop: Any, gains: Any, extras: Sequence[str] = (), cones: Cones = NO_CONES) -> Meter:
        """Make the meter that measures many flights along their way, as `metrics_of` does recordings of every control step.
        gains: those of all lanes, with an array (lanes,) in place of each number that differs; extras: metrics that are
        measured only where they are asked for; cones: axes with the directions that they are to stay away from, by the names
        of their metrics. ValueError where the body has no such thing."""
        nothing_more(extras, cones)
        clock = getattr(loop.body.module, "TIME_UNIT", "s")
        return any_body.make_meter(recorded_of(loop), scenario.table.simulation.steps, loop.period, clock)

    def metric_set(self, run: Recording) -> MetricSet:
        """Return how metrics of such runs are shown and ranked."""
        return any_body.metric_set(run)

    def state_names(self, run: Recording) -> Sequence[str]:
        """Name the recorded quantities that the integration gives."""
        return [name for name in run.columns if name in run.arrays]

    def resources(self, entry: LawEntry) -> Values:
        """List what a law has beside its gains."""
        return {}

    def compile_calls(self, loop: Any) -> None:
        """Make code of the law's calls, so that `call_costs` times them at once."""

    def call_costs(self, loop: Any, run: Recording) -> dict[str, float]:
        """Time the law's calls; empty where that is not worth telling."""
        return {}

    def certify(self, scenario: Scenario, entry: LawEntry, loop: Any, pointing: bool = False) -> list[Issued]:
        """Certify one law, as it starts and after each change that it knows of; pointing: how near to its target, too."""
        # A certificate without claims is undecided.
        return [Issued(Certificate(entry.name, {"body": scenario.body, "law": entry.law.name}, ()), loop)]

    def departures(self, issued: Issued, loop: Any, run: Recording) -> Mapping[str, tuple[Departure, ...]]:
        """Tell how a run leaves the proved claims of a certificate, by their kinds."""
        return {}

    def fly_claims(self, issued: Issued) -> Trial | None:
        """Try a certificate by flights, None where it claims nothing that can be flown. Raises `BrokenClaimError`."""
        return None

    def start_inside(self, issued: Issued) -> dict[str, bool]:
        """Tell, for each kind of proved claim about a set, whether the loop's start lies in it."""
        return {}


def study_of(body: str) -> BodyStudy:
    """The study of a body of this name, or that of any body where there is none of its own."""
    return body_module("starhold.studies.bodies", body).STUDY


def nothing_more(extras: Sequence[str], cones: Cones) -> None:
    """ValueError for a body that has neither further metrics nor axes that could stay away from anything."""
    if cones:
        raise ValueError("a body with an attitude, for an axis that is to stay out of a cone")
    if extras:
        raise ValueError(f"no further metrics; {extras[0]} is none of this body")


def body_module(package: str, body: str) -> Any:
    """The module of a package that is named for a body, else its `any_body`."""
    name = f"{package}.{body.replace('-', '_')}"
    there = body.replace("-", "").isalnum() and find_spec(name) is not None
    return import_module(name if there else f"{package}.any_body")
