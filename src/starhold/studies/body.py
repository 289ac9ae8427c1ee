"""The interface through which studies handle a body, and its look-up by the body's name."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
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
"""Values and their units ("1" for dimensionless), by name."""


Notice: TypeAlias = Callable[[int, int, str], None]
"""Called with the number of items done, their total, and the name of the next one."""
SILENT: Notice = lambda done, total, name: None  # noqa: E731


class Issued(NamedTuple):
    """A certificate, its loop without later faults, and the control step at which this loop begins to fly."""

    certificate: Certificate
    loop: Any
    step: int = 0
    mode: int | None = None
    """The mode that the certificate is about, counted from 1, for a law with modes."""
    before: int | None = None
    """The previous mode, for a certificate about its hand-over."""


class BodyStudy:
    """The interface to a body for flights, metrics and certificates; each module of `starhold.studies.bodies` holds one
    `STUDY`. This base class serves any body: it flies and measures the recorded quantities in their recorded units, and
    claims nothing."""

    EXTRAS: tuple[str, ...] = ()
    """Metrics that are measured only on request."""
    CLAIMS = TRIALS = ""
    """The modules with the functions that compare claims with initial states, and test them by flights; "" for a body
    without claims."""

    def name_samples(self, scenario: Scenario, loop: Any, samples: Any, carry: Any) -> Recording:
        """Return the samples of `fly` as a recording, with the numbers that metrics need among its attributes."""
        return label(loop, samples, carry, scenario.table.simulation.record_every)

    def metrics_of(self, run: Recording) -> dict[str, Any]:
        """Return the metrics of a recorded run; `diverged_at` (s) is None for a motion that did not diverge."""
        return any_body.measure(run)

    def measure_required(self, run: Recording, cones: Cones) -> dict[str, Any]:
        """Return the metrics of a recorded run, or of a part of it, for requirements: with extras and cones as in
        `meter`."""
        return self.metrics_of(run)

    def meter(self, scenario: Scenario, loop: Any, gains: Any, extras: Sequence[str] = (), cones: Cones = NO_CONES) -> Meter:
        """Return the meter that computes the metrics of many flights in the kernel; they equal those of `metrics_of` for
        recordings of every control step. gains: those of all lanes, with an array (lanes,) in place of each number that
        differs; extras: metrics measured only on request; cones: axes with the directions that they must avoid, by the names
        of their metrics. ValueError where the body lacks any of these."""
        nothing_more(extras, cones)
        clock = getattr(loop.body.module, "TIME_UNIT", "s")
        return any_body.make_meter(recorded_of(loop), scenario.table.simulation.steps, loop.period, clock)

    def metric_set(self, run: Recording) -> MetricSet:
        """Return the rules by which the metrics of such runs are shown and ranked."""
        return any_body.metric_set(run)

    def state_names(self, run: Recording) -> Sequence[str]:
        """Return the names of the recorded quantities that are integrated states."""
        return [name for name in run.columns if name in run.arrays]

    def resources(self, entry: LawEntry) -> Values:
        """Return the options of a law besides its gains, with units."""
        return {}

    def compile_calls(self, loop: Any) -> None:
        """Compile the law's calls in advance, so that `call_costs` need only time them."""

    def call_costs(self, loop: Any, run: Recording) -> dict[str, float]:
        """Return the times of the law's calls; empty where they are of no interest."""
        return {}

    def certify(self, scenario: Scenario, entry: LawEntry, loop: Any, pointing: bool = False) -> list[Issued]:
        """Return the certificates of one law, initially and after each change that it knows of; pointing: whether to prove
        the pointing bound too."""
        # A certificate without claims is undecided.
        return [Issued(Certificate(entry.name, {"body": scenario.body, "law": entry.law.name}, ()), loop)]

    def departures(self, issued: Issued, loop: Any, run: Recording) -> Mapping[str, tuple[Departure, ...]]:
        """Return the departures of a run from the proved claims of a certificate, by kind of claim."""
        return {}

    def covered(self, issued: Issued, loop: Any, run: Recording) -> tuple[tuple[float, float], ...]:
        """Return the intervals (s) in which the claim about the loop as it flies covers a run, one for each time that the
        claim's loop flies; empty where it never does."""
        return ()

    def ends(self, issued: Issued, loop: Any, time: float) -> int | None:
        """Return the control step at which the loop of a flight of this duration (s) ceases to be the certificate's, or
        None."""
        return None

    def fly_claims(self, issued: Issued) -> Trial | None:
        """Test a certificate by flights; None where it claims nothing that can be flown. Raises `BrokenClaimError`."""
        return import_module(self.TRIALS).fly_claims(issued.loop, issued.certificate) if self.TRIALS else None

    def start_inside(self, issued: Issued) -> dict[str, bool]:
        """Return, for each kind of proved claim about a set, whether the loop starts inside it."""
        return import_module(self.CLAIMS).start_inside(issued.certificate, issued.loop) if self.CLAIMS else {}


def study_of(body: str) -> BodyStudy:
    """Return the study of the body of this name, or the general one if the body has no study of its own."""
    return body_module("starhold.studies.bodies", body).STUDY


def nothing_more(extras: Sequence[str], cones: Cones) -> None:
    """Raise ValueError for a body that has neither further metrics nor axes that could avoid a direction."""
    if cones:
        raise ValueError("a body with an attitude, because an axis is to stay out of a cone")
    if extras:
        raise ValueError(f"no further metrics; this body has no {extras[0]}")


def body_module(package: str, body: str) -> Any:
    """Return the module of a package named after a body, or by default its `any_body`."""
    name = f"{package}.{body.replace('-', '_')}"
    there = body.replace("-", "").isalnum() and find_spec(name) is not None
    return import_module(name if there else f"{package}.any_body")
