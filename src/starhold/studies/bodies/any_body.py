"""The study of a body that has none of its own: what its part records is flown and measured, and nothing is claimed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, final

from starhold.analysis.any_body import make_meter, measure, metric_set, recorded_of
from starhold.certification.certificate import Certificate
from starhold.simulation.lane import label
from starhold.studies.body import NO_CONES, BodyStudy, Cones, Issued, Values, nothing_more

if TYPE_CHECKING:
    from starhold.analysis.departure import Departure
    from starhold.analysis.meter import Meter
    from starhold.analysis.ranking import MetricSet
    from starhold.analysis.trial import Trial
    from starhold.scenario.reading import LawEntry, Scenario
    from starhold.simulation.lane import Recording


@final
class AnyBodyStudy:
    """Metrics have the units of the recording."""

    def name_samples(self, scenario: Scenario, loop: Any, samples: Any, carry: Any) -> Recording:
        return label(loop, samples, carry, scenario.table.simulation.record_every)

    def metrics_of(self, run: Recording) -> dict[str, Any]:
        return measure(run)

    def meter(self, scenario: Scenario, loop: Any, gains: Any, extras: Sequence[str] = (), cones: Cones = NO_CONES) -> Meter:
        nothing_more(extras, cones)
        clock = getattr(loop.body.module, "TIME_UNIT", "s")
        return make_meter(recorded_of(loop), scenario.table.simulation.steps, loop.period, clock)

    def metric_set(self, run: Recording) -> MetricSet:
        return metric_set(run)

    def state_names(self, run: Recording) -> list[str]:
        return [name for name in run.columns if name in run.arrays]

    def resources(self, entry: LawEntry) -> Values:
        return {}

    def call_costs(self, loop: Any, run: Recording) -> dict[str, float]:
        return {}

    def certify(self, scenario: Scenario, entry: LawEntry, loop: Any) -> list[Issued]:
        # A certificate without claims is undecided.
        return [Issued(Certificate(entry.name, {"body": scenario.body, "law": entry.law.name}, ()), loop)]

    def departures(self, issued: Issued, loop: Any, run: Recording) -> dict[str, tuple[Departure, ...]]:
        return {}

    def fly_claims(self, issued: Issued) -> Trial | None:
        return None

    def start_inside(self, issued: Issued) -> dict[str, bool]:
        return {}


STUDY: BodyStudy = AnyBodyStudy()
