"""The study of a craft near a libration point."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, final

from starhold.analysis.libration_point import METRICS, CircleGoal, EquilibriumGoal, goal_of, make_meter, measure
from starhold.parts.bodies.libration_point import Units
from starhold.parts.craft import vector
from starhold.studies.body import NO_CONES, BodyStudy, Cones, Issued, Values, nothing_more

if TYPE_CHECKING:
    from starhold.analysis.departure import Departure
    from starhold.analysis.meter import Meter
    from starhold.analysis.ranking import MetricSet
    from starhold.loop.closed_loop import ClosedLoop
    from starhold.scenario.reading import LawEntry, Scenario
    from starhold.simulation.lane import Recording


@final
class LibrationPointStudy(BodyStudy):
    """Runs are scaled, their units in SI among the attributes; metrics are in SI. Calls are not timed, because control
    surfaces move within hours."""

    CLAIMS = TRIALS = "starhold.analysis.libration_point_claims"

    def name_samples(self, scenario: Scenario, loop: ClosedLoop, samples: Any, carry: Any) -> Recording:
        units, goal = scenario.table.libration.units, goal_of(loop.gains)
        run = super().name_samples(scenario, loop, samples, carry)
        worth = {"length_unit_m": units.length, "time_unit_s": units.time, "rate_unit_rad_per_s": units.rate}
        worth |= {"velocity_unit_m_per_s": units.velocity, "acceleration_unit_m_per_s2": units.acceleration}
        worth |= {"settling_tolerance": scenario.table.settling.tolerance}
        worth |= {"circle": [*goal]} if isinstance(goal, CircleGoal) else {"rest": [*goal.place]}
        return replace(run, attrs=run.attrs | worth)

    def metrics_of(self, run: Recording) -> dict[str, Any]:
        attrs = run.attrs
        units = Units(float(attrs["length_unit_m"]), float(attrs["rate_unit_rad_per_s"]))
        goal = CircleGoal(*map(float, attrs["circle"])) if "circle" in attrs else EquilibriumGoal(vector(attrs["rest"]))
        return measure(run, units, goal, float(attrs["settling_tolerance"]))

    def meter(
        self, scenario: Scenario, loop: ClosedLoop, gains: Any, extras: Sequence[str] = (), cones: Cones = NO_CONES
    ) -> Meter:
        nothing_more(extras, cones)
        units, tolerance = scenario.table.libration.units, scenario.table.settling.tolerance
        steps = scenario.table.simulation.steps
        return make_meter(steps, loop.period, loop.limit, units, goal_of(gains), tolerance)

    def metric_set(self, run: Recording) -> MetricSet:
        return METRICS

    def state_names(self, run: Recording) -> tuple[str, ...]:
        return ("position", "velocity")

    def resources(self, entry: LawEntry) -> Values:
        return {"limit": (entry.options.limit, "1")} | ({"lag": (entry.options.lag, "1")} if entry.options.lag else {})

    def certify(self, scenario: Scenario, entry: LawEntry, loop: ClosedLoop, pointing: bool = False) -> list[Issued]:
        from starhold.certification.station import certify_station

        return [Issued(certify_station(loop, entry.name), loop)]

    def departures(self, issued: Issued, loop: ClosedLoop, run: Recording) -> dict[str, tuple[Departure, ...]]:
        from starhold.analysis.libration_point_claims import departures

        return departures(issued.certificate, loop, run, float(run.attrs["time_unit_s"]))


STUDY = LibrationPointStudy()
