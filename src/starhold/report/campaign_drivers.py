"""Tables tell why runs of a campaign fail and what moves metrics: drivers, and sensitivity indices."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

from starhold.campaign.verdicts import percent
from starhold.report.campaign_tables import Section, numbers
from starhold.report.campaign_units import DASH, Wording, counted, figure
from starhold.report.commands import Cell, Column, Table
from starhold.report.html_tables import table_html

if TYPE_CHECKING:
    from starhold.campaign.drivers import Drivers, FailureDriver, MetricDriver, PairDriver
    from starhold.campaign.results import CampaignResult
    from starhold.campaign.sensitivity import Morris, Sobol
    from starhold.report.campaign_units import Measure

UP, DOWN, BOTH = "213,94,0", "0,114,178", "123,63,160"
"""Red, green and blue of what grows, what falls, and what otherwise changes with an input."""


def drivers(causes: Drivers, words: Wording, most: int) -> Section:
    """Tell what makes runs of a law fail and what moves its metrics, at most so many of a kind."""
    kinds = [
        [_failure(item) for item in causes.inputs if item.significant],
        [_pair(item) for item in causes.pairs if item.significant],
        [_metric(item, words) for item in causes.metrics if item.significant],
    ]
    rows = [row for kind in kinds for row in kind[:most]]
    left = sum(map(len, kinds)) - len(rows)
    sentences = [f"{causes.failures} of {counted(causes.runs, 'run')} failed."]
    sentences += [] if rows else ["Nothing that was looked at stands out from chance."]
    sentences += [f"{counted(left, 'weaker one')} that stand out as well are left out of the table."] if left else []
    sentences += [f"{causes.remark[:1].upper()}{causes.remark[1:]}."] if causes.remark else []
    if causes.skipped:
        sentences.append(f"Not looked at, for they are constant or lack values: {', '.join(causes.skipped)}.")
    columns = [*map(Column, ("what happens", "with", "how", "strength")), *numbers("p, corrected")]
    return Section("", Table(columns, rows), " ".join(sentences))


def _failure(item: FailureDriver) -> list[Any]:
    if isinstance(item.range, str):
        how = f"most often where {item.range}"
    else:
        side = "" if item.above is None else f"; greater than in a passed run with probability {item.above:.2f}"
        how = "nine in ten failed runs from {:.4g} to {:.4g}{}".format(*item.range, side)
    return ["runs fail", item.input, how, Cell(f"distance {item.distance:.2f}", "share", item.distance), _chance(item)]


def _pair(item: PairDriver) -> list[Any]:
    how = f"most often where {item.where}"
    if item.drawn_together:
        how += "; they are drawn together, so one may stand for the other"
    share = Cell(f"{percent(item.failed)} fail there", "share", item.failed)
    return ["runs fail together", " and ".join(item.inputs), how, share, _chance(item)]


def _metric(item: MetricDriver, words: Wording) -> list[Any]:
    verb = "changes" if item.words else "grows" if item.correlation > 0.0 else "falls"
    kind = "correlation ratio" if item.words else "rank correlation"
    share = Cell(f"{kind} {item.correlation:.2f}", "share", abs(item.correlation))
    return [f"{words.measure(item.metric).heading} {verb}", item.input, DASH, share, _chance(item)]


def _chance(item: FailureDriver | PairDriver | MetricDriver) -> str:
    """A corrected p-value; below the least float there is nothing to show."""
    return f"{item.corrected:.2g}" if item.corrected > 1e-300 else "< 1e-300"


def indices(result: CampaignResult, words: Wording) -> list[Section]:
    """The sensitivity indices of each law's metrics, or why there are none; nothing where none were asked for."""
    from starhold.campaign.sensitivity import Morris, Refused

    sections: list[Section] = []
    for law in result.laws:
        for metric, outcome in law.indices.items():
            measure = words.measure(metric)
            heading = f"{law.law}: {measure.heading}"
            if isinstance(outcome, Refused):
                sections.append(Section(heading, Table([], []), f"No sensitivity indices: {outcome.reason}."))
            else:
                sections.append(
                    _morris(outcome, measure, heading) if isinstance(outcome, Morris) else _sobol(outcome, heading)
                )
    return sections


def _morris(effects: Morris, measure: Measure, heading: str) -> Section:
    most, scale = max(map(abs, effects.mu_star), default=0.0) or 1.0, measure.scale
    rows = [
        [
            effects.names[i],
            Cell(_with_width(effects.mu_star[i], effects.mu_star_width[i], scale), "share", effects.mu_star[i] / most),
            *(figure(scale * x[i]) for x in (effects.mu, effects.sigma)),
        ]
        for i in _strongest(effects.mu_star)
    ]
    note = (
        "Elementary effects from the lowest to the highest level of each input, beyond which an eighth of its probability "
    )
    note += f"lies on each side; ± holds with {percent(effects.confidence)} confidence."
    if effects.dropped:
        note += f" {effects.dropped} of {effects.trajectories} trajectories were dropped, for they hold failed runs."
    columns = [Column("input"), Column("mean magnitude μ*", measure.unit)]
    columns += numbers(f"mean μ|{measure.unit}", f"spread σ|{measure.unit}")
    return Section(heading, Table(columns, rows), note)


def _sobol(shares: Sobol, heading: str) -> Section:
    kinds = ((shares.first, shares.first_width), (shares.total, shares.total_width))
    rows = [
        [shares.names[i], *(Cell(_with_width(share[i], width[i]), "share", share[i]) for share, width in kinds)]
        for i in _strongest(shares.total)
    ]
    note = f"Shares of the metric's variance; ± holds with {percent(shares.confidence)} confidence."
    return Section(heading, Table([*map(Column, ("input", "by itself", "with all others"))], rows), note)


def _with_width(value: float, width: float, scale: float = 1.0) -> str:
    return f"{figure(scale * value, 3)} ± {figure(scale * width, 2)}"


def _strongest(values: Iterable[float]) -> Sequence[int]:
    """The places of values, the largest first, NaN last."""
    listed = list(values)
    return sorted(range(len(listed)), key=lambda i: (math.isnan(listed[i]), -listed[i]))


def picture(causes: Drivers, words: Wording) -> str:
    """Show the strengths of all inputs that stand out as colours, one row an input, one column for failure and each
    metric."""
    cells = {
        (item.input, ""): Cell(f"{item.distance:.2f}", "shade", item.distance, BOTH)
        for item in causes.inputs
        if item.significant
    }
    for item in causes.metrics:
        if item.significant:
            colour = BOTH if item.words else UP if item.correlation > 0.0 else DOWN
            text = f"{item.correlation:{'' if item.words else '+'}.2f}".replace("-", "−")
            cells[item.input, item.metric] = Cell(text, "shade", item.correlation, colour)
    if not cells:
        return ""
    metrics = list(dict.fromkeys(metric for _, metric in cells))
    columns = [Column("input"), *numbers(*(words.measure(name).heading if name else "failure" for name in metrics))]
    rows = [[name, *(cells.get((name, metric), "·") for metric in metrics)] for name in dict.fromkeys(n for n, _ in cells)]
    keys = ((UP, "grows with the input"), (DOWN, "falls with it"), (BOTH, "depends on it"))
    legend = " ".join(
        f'<span class="legend"><span class="key" style="background:rgba({colour},.6)"></span>{escape(meaning)}</span>'
        for colour, meaning in keys
    )
    return (
        f'{table_html(Table(columns, rows), "heat", fit=True)}\n<p class="note">{legend}. Failure: distance between the '
        "distributions of the input in failed and in passed runs. Metrics: rank correlation, or correlation ratio for "
        "words. A dot: does not stand out from chance.</p>"
    )
