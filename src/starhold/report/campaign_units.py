"""How the numbers of a campaign are shown: metrics and requirements in the units of the other pages, shares, counts."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from starhold.analysis.ranking import Measure, MetricSet
from starhold.studies.body import body_module

if TYPE_CHECKING:
    from starhold.campaign.requirements import Requirement
    from starhold.campaign.results import Bracket, CampaignResult
    from starhold.campaign.verdicts import Verdict

DASH = "—"
LOST = "lost"
"""What stands for the metric in the requirement that a motion is not lost."""
INDEPENDENT = "random"
"""The sampling whose draws are independent of each other."""


@dataclass(frozen=True)
class Wording:
    """How a campaign's numbers are shown: its body's metrics, the requirements by name, the SI units of metrics by name."""

    metric_set: MetricSet
    requirements: Mapping[str, Requirement]
    units: Mapping[str, str]

    @classmethod
    def of(cls, body: str, result: CampaignResult) -> Wording:
        """Make the wording for a campaign on the body of this name, whose analysis names the metrics."""
        known = getattr(body_module("starhold.analysis", body), "METRICS", None) or MetricSet({}, ())
        units = {spread.metric: spread.unit for law in result.laws for spread in law.spreads}
        return cls(known, {item.name: item for item in result.requirements}, units)

    def measure(self, metric: str, unit: str | None = None) -> Measure:
        """Tell how a metric is shown: as on the other pages, else in the unit (SI) that it has, angles in degrees."""
        known = self.metric_set.measures.get(metric)
        return known or plain_measure(metric, self.units.get(metric, "1") if unit is None else unit)

    def required(self, name: str) -> Measure:
        """Tell how the metric of the requirement of this name is shown."""
        return self.measure(self.requirements[name].column if name in self.requirements else name)

    def is_loss(self, name: str) -> bool:
        """Tell whether the requirement of this name is that the motion is not lost."""
        return name in self.requirements and self.requirements[name].column == LOST

    def asks(self, name: str) -> str:
        """Tell what the requirement of this name asks for; empty where only the name is known."""
        if name not in self.requirements:
            return ""
        item, measure = self.requirements[name], self.required(name)
        if self.is_loss(name):
            return "the motion is not lost"
        return f"{measure.heading} at {'most' if item.at_most else 'least'} {with_unit(item.bound, measure)}"

    def called(self, name: str) -> str:
        """Name the requirement of this name, and say what it asks for."""
        asks = self.asks(name)
        return f"{name}: {asks}" if asks and name != self.requirements[name].metric else asks or name

    def margin(self, name: str, value: float | None) -> str:
        """Show a margin of the requirement of this name, with its unit; it is minus infinity where a run has no value."""
        if value is None:
            return DASH
        if self.is_loss(name):
            return "lost" if value < 0.0 else "not lost"
        return "no value" if math.isinf(value) else with_unit(value, self.required(name))


def plain_measure(name: str, unit: str, meaning: str = "") -> Measure:
    """Tell how a quantity is shown of which only the unit (SI) is known; angles in degrees."""
    heading = name.replace("_", " ")
    if unit == "rad" or unit.startswith("rad/"):
        return Measure(heading, f"deg{pretty_unit(unit[3:])}", meaning, 180.0 / math.pi)
    return Measure(heading, "" if unit == "1" else pretty_unit(unit), meaning)


def pretty_unit(unit: str) -> str:
    """Show a unit with raised exponents."""
    return unit.replace("^2", "²").replace("^3", "³")


def figure(value: float, digits: int = 4) -> str:
    """Show a number with a few digits, and whole up to seven of them; a dash where there is none."""
    if math.isnan(value):
        return DASH
    if math.isinf(value):
        return "∞" if value > 0.0 else "−∞"
    return f"{value:.0f}" if 10.0**digits <= abs(value) < 1e7 else f"{value:.{digits}g}"


def with_unit(value: float, measure: Measure) -> str:
    """Show an SI value in a measure's unit, which is named."""
    return f"{figure(value * measure.scale)} {measure.unit}".rstrip()


def worst_text(bracket: Bracket, measure: Measure) -> str:
    """Show the worst of a metric, the largest value or the least, as the first part of a bracket."""
    if math.isnan(bracket.flown):
        return "lost, or without a value"
    return f"{with_unit(bracket.flown, measure)} {order(bracket)} true"


CONTRADICTED = "Contradicted by a flight, which is a fault of starhold: please report it with the scenario file."


def order(bracket: Bracket) -> str:
    """The sign between the parts of a bracket, from what is flown to what is proved."""
    return "≤" if bracket.at_most else "≥"


def few_percent(share: float) -> str:
    """Show a bound of a failure probability with three digits."""
    return f"{figure(100.0 * share, 3)} %"


def count_text(number: int) -> str:
    """Show a count with its thousands set apart."""
    return f"{number:,}".replace(",", "\N{NARROW NO-BREAK SPACE}") if number >= 10_000 else str(number)


def headings_of(result: CampaignResult, words: Wording) -> list[str]:
    """List the metrics of a campaign: those of the body first, in its order, then the others as they come."""
    metrics = dict.fromkeys(spread.metric for law in result.laws for spread in law.spreads)
    known: list[str] = [metric for metric in words.metric_set.measures if metric in metrics]
    return [*known, *(metric for metric in metrics if metric not in known)]


def bounds_text(verdict: Verdict) -> str:
    """Show the bounds between which the failure probability lies, as far as they are known."""
    if verdict.lower is None or verdict.upper is None:
        return DASH
    return f"{figure(100.0 * verdict.lower, 3)} to {few_percent(verdict.upper)}"


def counted(number: int, what: str) -> str:
    """Show a count and its noun, whose plural ends in s."""
    return f"{count_text(number)} {what}{'' if number == 1 else 's'}"
