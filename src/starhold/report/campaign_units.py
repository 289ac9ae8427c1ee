"""The wording of campaigns: metrics and requirements in the units of the other pages, shares, counts, and the sentences that
summarize a campaign, each with its assumption."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from starhold.analysis.ranking import Measure, MetricSet
from starhold.campaign.verdicts import percent
from starhold.certification.wording import listed
from starhold.report.text import plain_measure
from starhold.studies.body import body_module

if TYPE_CHECKING:
    from starhold.campaign.results import Bracket, CampaignResult, LawResult
    from starhold.campaign.verdicts import Verdict
    from starhold.studies.requirements import Requirement


DASH = "—"
LOST = "lost"
"""The name that replaces a metric in the requirement that a motion does not diverge."""
INDEPENDENT = "random"
"""The sampling whose draws are independent of each other."""


@dataclass(frozen=True)
class Wording:
    """The data for showing a campaign's numbers: the body's metrics, the requirements by name, and the SI units of metrics
    by name."""

    metric_set: MetricSet
    requirements: Mapping[str, Requirement]
    units: Mapping[str, str]

    @classmethod
    def of(cls, body: str, result: CampaignResult) -> Wording:
        """Return the wording for a campaign on the body of this name, whose analysis names the metrics."""
        known = getattr(body_module("starhold.analysis", body), "METRICS", None) or MetricSet({}, ())
        units = {spread.metric: spread.unit for law in result.laws for spread in law.spreads}
        return cls(known, {item.name: item for item in result.requirements}, units)

    def measure(self, metric: str, unit: str | None = None) -> Measure:
        """Return the measure that shows a metric as on the other pages, else in its SI unit, angles in degrees."""
        known = self.metric_set.measures.get(metric)
        return known or plain_measure(metric, self.units.get(metric, "1") if unit is None else unit)

    def required(self, name: str) -> Measure:
        """Return the measure that shows the metric of the requirement of this name."""
        return self.measure(self.requirements[name].column if name in self.requirements else name)

    def is_loss(self, name: str) -> bool:
        """Return whether the requirement of this name demands that the motion does not diverge."""
        return name in self.requirements and self.requirements[name].column == LOST

    def asks(self, name: str) -> str:
        """Return the demand of the requirement of this name in words; "" where only the name is known."""
        if name not in self.requirements:
            return ""
        item, measure = self.requirements[name], self.required(name)
        if self.is_loss(name):
            return "the motion does not diverge"
        return f"{measure.heading} at {'most' if item.at_most else 'least'} {with_unit(item.bound, measure)}"

    def called(self, name: str) -> str:
        """Return the name of a requirement together with its demand."""
        asks = self.asks(name)
        return f"{name}: {asks}" if asks and name != self.requirements[name].metric else asks or name

    def margin(self, name: str, value: float | None) -> str:
        """Return a margin of the requirement of this name with its unit; the margin of a run without a value is minus
        infinity."""
        if value is None:
            return DASH
        if self.is_loss(name):
            return "lost" if value < 0.0 else "not lost"
        return "no value" if math.isinf(value) else with_unit(value, self.required(name))


def figure(value: float, digits: int = 4) -> str:
    """Return a number with a few digits, a whole number with up to seven; a dash for NaN."""
    if math.isnan(value):
        return DASH
    if math.isinf(value):
        return "∞" if value > 0.0 else "−∞"
    return f"{value:.0f}" if 10.0**digits <= abs(value) < 1e7 else f"{value:.{digits}g}"


def with_unit(value: float, measure: Measure) -> str:
    """Return an SI value in a measure's unit, with the unit."""
    return f"{figure(value * measure.scale)} {measure.unit}".rstrip()


def worst_text(bracket: Bracket, measure: Measure) -> str:
    """Return the worst value flown of a metric, as the first part of a bracket."""
    if math.isnan(bracket.flown):
        return "lost, or without a value"
    return f"{with_unit(bracket.flown, measure)} {order(bracket)} true"


CONTRADICTED = "Contradicted by a flight, which is an error in starhold: please report it with the scenario file."


def order(bracket: Bracket) -> str:
    """Return the sign between the parts of a bracket, from the flown value to the proved one."""
    return "≤" if bracket.at_most else "≥"


def few_percent(share: float) -> str:
    """Return a bound on a failure probability in percent with three digits."""
    return f"{figure(100.0 * share, 3)} %"


def count_text(number: int) -> str:
    """Return a count with separated thousands."""
    return f"{number:,}".replace(",", "\N{NARROW NO-BREAK SPACE}") if number >= 10_000 else str(number)


def headings_of(result: CampaignResult, words: Wording) -> list[str]:
    """Return the metrics of a campaign: those of the body first, in its order, then the others."""
    metrics = dict.fromkeys(spread.metric for law in result.laws for spread in law.spreads)
    known: list[str] = [metric for metric in words.metric_set.measures if metric in metrics]
    return [*known, *(metric for metric in metrics if metric not in known)]


def bounds_text(verdict: Verdict) -> str:
    """Return the known bounds on the failure probability as text."""
    if verdict.lower is None or verdict.upper is None:
        return DASH
    return f"{figure(100.0 * verdict.lower, 3)} to {few_percent(verdict.upper)}"


def counted(number: int, what: str) -> str:
    """Return a count with its noun, whose plural ends in s."""
    return f"{count_text(number)} {what}{'' if number == 1 else 's'}"


SAMPLINGS = {
    "random": "independent random draws",
    "sobol": "Sobol' points",
    "latin-hypercube": "a Latin hypercube",
    "morris": "a Morris design",
    "saltelli": "a Saltelli design",
}


def outcome_of(law: LawResult) -> str:
    """Return the overall outcome of a law's verdicts; empty where nothing is required."""
    outcomes = {verdict.outcome for verdict in law.verdicts}
    return next((outcome for outcome in ("missed", "not decided", "met") if outcome in outcomes), "")


def headline(law: LawResult, sampling: str, words: Wording) -> str:
    """Return one or two sentences, without the law's name, on whether a law meets its requirements, with the evidence."""
    outcome = outcome_of(law)
    chosen = [verdict for verdict in law.verdicts if verdict.outcome == outcome]
    if outcome == "met":
        return _met(chosen, words)
    if outcome == "missed":
        return _missed(chosen, len(law.verdicts), words)
    if outcome == "not decided":
        return _open(chosen, len(law.verdicts), sampling, words)
    lost = "no run was" if not law.lost else f"{count_text(law.lost)} of {counted(law.runs, 'run')} were"
    return f"has no requirements, so nothing is judged; {lost} lost."


def flown_text(result: CampaignResult) -> str:
    """Return a sentence on the numbers of runs and laws and on the sampling."""
    laws = "one law" if len(result.laws) == 1 else f"each of {len(result.laws)} laws, all of which fly the same draws"
    return f"{counted(result.runs, 'run')} of {laws}; the dispersions are sampled by {sampled(result.sampling)}."


def sampled(sampling: str) -> str:
    """Return a sampling in words."""
    return SAMPLINGS.get(sampling, sampling)


def _provided(verdicts: list[Verdict]) -> str:
    stopped = ", and it holds whenever the campaign was stopped" if any(v.until_decided for v in verdicts) else ""
    return f"provided that flights are independent draws from the stated dispersions{stopped}."


def _met(verdicts: list[Verdict], words: Wording) -> str:
    what = "meets what is required" if len(verdicts) == 1 else f"meets all {len(verdicts)} requirements"
    shares = listed([f"at least {percent(verdict.share)} {_keep(verdict, words)}" for verdict in verdicts])
    return f"{what}: of all flights {shares}, shown with {_confidences(verdicts)}, {_provided(verdicts)}"


def _missed(verdicts: list[Verdict], total: int, words: Wording) -> str:
    # A verdict of "missed" has bounds.
    shortfalls = listed([_shortfall(verdict, words) for verdict in verdicts])
    return f"misses {_some(len(verdicts), total)}: {shortfalls}. Shown with {_confidences(verdicts)}, {_provided(verdicts)}"


def _shortfall(verdict: Verdict, words: Wording) -> str:
    lower, part = verdict.lower or 0.0, verdict.worst_part
    may = f"(at most {few_percent(1.0 - verdict.share)} may)"
    if part is not None and not lower > 1.0 - verdict.share:
        return f"more than {few_percent(part.lower or 0.0)} of flights with {part.name} {_miss(verdict, words)} {may}"
    return f"more than {few_percent(lower)} of all flights {_miss(verdict, words)} {may}"


def _open(verdicts: list[Verdict], total: int, sampling: str, words: Wording) -> str:
    if sampling != INDEPENDENT or not all(verdict.independent for verdict in verdicts):
        seen = listed([f"{percent(verdict.observed)} {_keep(verdict, words)}" for verdict in verdicts])
        return f"is not judged, because runs by {sampled(sampling)} are not independent; of those flown {seen}."
    questions: list[str] = []
    for verdict in verdicts:
        part, one = verdict.worst_part, verdict.failures == 1
        lacking = ("is lost" if one else "are lost") if words.is_loss(verdict.name) else ("misses it" if one else "miss it")
        seen = f"{count_text(verdict.failures)} of {counted(verdict.runs, 'run')} {lacking}"
        if part is not None and part.outcome != "met":
            seen += f", {count_text(part.failures)} of the {count_text(part.runs)} with {part.name}"
        if verdict.more:
            seen += f"; about {counted(verdict.more, 'further run')} without a failure would show it"
        questions.append(f"whether {percent(verdict.share)} of all flights {_keep(verdict, words)} ({seen})")
    return (
        f"leaves {_some(len(verdicts), total)} open: {listed(questions)}. This is to be shown with "
        f"{_confidences(verdicts)}, {_provided(verdicts)}"
    )


def _keep(verdict: Verdict, words: Wording) -> str:
    return "are not lost" if words.is_loss(verdict.name) else f"meet {verdict.name}"


def _miss(verdict: Verdict, words: Wording) -> str:
    return "are lost" if words.is_loss(verdict.name) else f"miss {verdict.name}"


def _some(count: int, total: int) -> str:
    return "what is required" if total == 1 else f"{count} of {total} requirements"


def _confidences(verdicts: list[Verdict]) -> str:
    levels = list(dict.fromkeys(percent(verdict.confidence) for verdict in verdicts))
    return f"{listed(levels)} confidence{' each' if len(verdicts) > 1 and len(levels) == 1 else ''}"
