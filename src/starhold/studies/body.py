"""The hooks through which studies handle a body, and how they are found by the body's name."""

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
"""Body axes with the directions that they must avoid, by the names of their metrics."""
NO_CONES: Cones = MappingProxyType({})
Values: TypeAlias = dict[str, tuple[Any, str]]
"""Values with their units ("1" for none), by name."""


class Issued(NamedTuple):
    """A certificate, its loop, without later faults, and the control step from which that flies."""

    certificate: Certificate
    loop: Any
    step: int = 0
    mode: int | None = None
    """The mode that it is about, in a flight with modes, counted from 1."""
    before: int | None = None
    """The previous mode, for a certificate about its hand-over."""


class BodyStudy:
    """All that flying, measuring and certifying need of a body; each module of `starhold.studies.bodies` holds one `STUDY`.
    This base class is the study of any body: it flies and measures what the part records, in the units of the recording, and
    claims nothing."""

    EXTRAS: tuple[str, ...] = ()
    """Metrics that are measured only on request."""
    CLAIMS = TRIALS = ""
    """The modules whose functions compare claims with starts, and try them by flights; "" for a body without claims."""

    def name_samples(self, scenario: Scenario, loop: Any, samples: Any, carry: Any) -> Recording:
        """Name the samples of `fly`; the attributes hold the numbers that metrics need."""
        return label(loop, samples, carry, scenario.table.simulation.record_every)

    def metrics_of(self, run: Recording) -> dict[str, Any]:
        """Measure a recorded run; `diverged_at` (s) is None for a motion that did not diverge."""
        return any_body.measure(run)

    def measure_required(self, run: Recording, cones: Cones) -> dict[str, Any]:
        """Measure a recorded run, or a part of it, for requirements: with extras and cones, as `meter` does."""
        return self.metrics_of(run)

    def meter(self, scenario: Scenario, loop: Any, gains: Any, extras: Sequence[str] = (), cones: Cones = NO_CONES) -> Meter:
        """Make the meter that measures many flights as they fly, as `metrics_of` measures recordings of every control step.
        gains: those of all lanes, with an array (lanes,) in place of each number that differs; extras: metrics that are
        measured only on request; cones: axes with the directions that they must avoid, by the names of their metrics.
        ValueError where the body lacks any of these."""
        nothing_more(extras, cones)
        clock = getattr(loop.body.module, "TIME_UNIT", "s")
        return any_body.make_meter(recorded_of(loop), scenario.table.simulation.steps, loop.period, clock)

    def metric_set(self, run: Recording) -> MetricSet:
        """Return how metrics of such runs are shown and ranked."""
        return any_body.metric_set(run)

    def state_names(self, run: Recording) -> Sequence[str]:
        """Name the recorded quantities that are integrated."""
        return [name for name in run.columns if name in run.arrays]

    def resources(self, entry: LawEntry) -> Values:
        """List the options of a law besides its gains."""
        return {}

    def compile_calls(self, loop: Any) -> None:
        """Compile the law's calls, so that `call_costs` can time them at once."""

    def call_costs(self, loop: Any, run: Recording) -> dict[str, float]:
        """Time the law's calls; empty where that is of no interest."""
        return {}

    def certify(self, scenario: Scenario, entry: LawEntry, loop: Any, pointing: bool = False) -> list[Issued]:
        """Certify one law, initially and after each change that it knows of; pointing: also how near to its target."""
        # A certificate without claims is undecided.
        return [Issued(Certificate(entry.name, {"body": scenario.body, "law": entry.law.name}, ()), loop)]

    def departures(self, issued: Issued, loop: Any, run: Recording) -> Mapping[str, tuple[Departure, ...]]:
        """Describe how a run leaves the proved claims of a certificate, by their kinds."""
        return {}

    def covered(self, issued: Issued, loop: Any, run: Recording) -> tuple[tuple[float, float], ...]:
        """Return the times (s) between which the claim about the loop as it flies covers a run, for each time that the
        claim's loop flies; empty where it never does."""
        return ()

    def ends(self, issued: Issued, loop: Any, time: float) -> int | None:
        """Return the control step at which a flight of this duration (s) has another loop than a certificate is about; None
        where it keeps it."""
        return None

    def fly_claims(self, issued: Issued) -> Trial | None:
        """Test a certificate by flights; None where it claims nothing that can be flown. Raises `BrokenClaimError`."""
        return import_module(self.TRIALS).fly_claims(issued.loop, issued.certificate) if self.TRIALS else None

    def start_inside(self, issued: Issued) -> dict[str, bool]:
        """Return, for each kind of proved claim about a set, whether the loop starts inside it."""
        return import_module(self.CLAIMS).start_inside(issued.certificate, issued.loop) if self.CLAIMS else {}


def study_of(body: str) -> BodyStudy:
    """Return the study of the body of this name, or the study for any body where it has none."""
    return body_module("starhold.studies.bodies", body).STUDY


def nothing_more(extras: Sequence[str], cones: Cones) -> None:
    """Raise ValueError for a body that has neither further metrics nor axes that could avoid a direction."""
    if cones:
        raise ValueError("a body with an attitude, because an axis is to stay out of a cone")
    if extras:
        raise ValueError(f"no further metrics; this body has no {extras[0]}")


def body_module(package: str, body: str) -> Any:
    """Return the module of a package that is named after a body, else its `any_body`."""
    name = f"{package}.{body.replace('-', '_')}"
    there = body.replace("-", "").isalnum() and find_spec(name) is not None
    return import_module(name if there else f"{package}.any_body")
