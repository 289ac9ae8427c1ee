"""The part of a campaign's page that tells why runs fail and what moves metrics: drivers, and sensitivity indices."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING

from starhold.campaign.verdicts import percent
from starhold.report.campaign_tables import named, small, table
from starhold.report.campaign_units import DASH, Wording, counted, figure

if TYPE_CHECKING:
    from starhold.campaign.drivers import Drivers, FailureDriver, MetricDriver, PairDriver
    from starhold.campaign.results import CampaignResult, LawResult
    from starhold.campaign.sensitivity import Morris, Sobol
    from starhold.report.campaign_units import Measure

MOST = 10
"""Drivers of a kind that the table of a law shows."""
UP, DOWN, BOTH = "213,94,0", "0,114,178", "123,63,160"
"""Red, green and blue of what grows, what falls, and what otherwise changes with an input."""


def drivers(result: CampaignResult, words: Wording) -> str:
    """Show what makes runs of each law fail and what moves its metrics, as a picture and as a table."""
    from starhold.campaign.drivers import RISK

    told = [_law(number, law, law.drivers, words) for number, law in enumerate(result.laws) if law.drivers is not None]
    if not told:
        return ""
    return (
        "<h2>What drives failures and metrics</h2>\n"
        '<p class="note">Shown is what stands out from chance: all tests of a law are corrected together, so that with '
        f"{percent(1.0 - RISK)} confidence nothing is shown by chance, if inputs were drawn independently. Numbers of "
        f"inputs are in the units of their keys.</p>\n{''.join(told)}"
    )


def _law(number: int, law: LawResult, found: Drivers, words: Wording) -> str:
    head = f"<h3>{named(number, law)}</h3>"
    failed = f"{found.failures} of {counted(found.runs, 'run')} failed. "
    notes = [f"{found.remark[:1].upper()}{found.remark[1:]}."] if found.remark else []
    if found.skipped:
        notes.append(f"Not looked at, for they are constant or lack values: {', '.join(found.skipped)}.")
    rows, left = _rows(found, words)
    if not rows:
        notes.insert(0, "Nothing that was looked at stands out from chance.")
    more = f"{counted(left, 'weaker one')} that stand out as well are left out of the table. " if left else ""
    note = small_note(f"{failed}{more}{' '.join(notes)}".strip())
    if not rows:
        return head + note
    columns = ("what happens", "with", "how", "strength", "p, corrected")
    return f"{head}\n{note}\n{_picture(found, words)}\n{table(columns, rows, 'text drivers')}\n"


def _rows(found: Drivers, words: Wording) -> tuple[list[str], int]:
    """The rows of the table, and how many more there would be."""
    singles = [item for item in found.inputs if item.significant]
    pairs = [item for item in found.pairs if item.significant]
    moved = [item for item in found.metrics if item.significant]
    rows = [_failure_row(item) for item in singles[:MOST]]
    rows += [_pair_row(item) for item in pairs[:MOST]]
    rows += [_metric_row(item, words) for item in moved[:MOST]]
    return rows, sum(max(0, len(items) - MOST) for items in (singles, pairs, moved))


def _failure_row(item: FailureDriver) -> str:
    if isinstance(item.range, str):
        how = f"most often where {item.range}"
    else:
        low, high = item.range
        side = "" if item.above is None else f"; greater than in a passed run with probability {item.above:.2f}"
        how = f"nine in ten failed runs from {low:.4g} to {high:.4g}{side}"
    return _row("runs fail", item.input, how, item.distance, f"distance {item.distance:.2f}", item.corrected)


def _pair_row(item: PairDriver) -> str:
    how = f"most often where {item.where}"
    if item.drawn_together:
        how += "; they are drawn together, so one may stand for the other"
    told = f"{percent(item.failed)} fail there"
    return _row("runs fail together", " and ".join(item.inputs), how, item.failed, told, item.corrected)


def _metric_row(item: MetricDriver, words: Wording) -> str:
    verb = "changes" if item.words else "grows" if item.correlation > 0.0 else "falls"
    kind = "correlation ratio" if item.words else "rank correlation"
    heading = f"{words.measure(item.metric).heading} {verb}"
    return _row(heading, item.input, "", abs(item.correlation), f"{kind} {item.correlation:.2f}", item.corrected)


def _row(what: str, inputs: str, how: str, share: float, told: str, p: float) -> str:
    chance = f"{p:.2g}" if p > 1e-300 else "< 1e-300"
    return (
        f"<tr><td>{escape(what)}</td><td>{escape(inputs)}</td><td>{escape(how) or DASH}</td>"
        f'{bar(share, escape(told))}<td class="number">{chance}</td></tr>'
    )


def bar(share: float, inside: str) -> str:
    """Make a cell with a bar below its HTML; the share is that of the cell's width, from 0 to 1."""
    width = 100.0 * min(max(share, 0.0), 1.0) if math.isfinite(share) else 0.0
    return f'<td class="bar">{inside}<i style="width:{width:.1f}%"></i></td>'


def _picture(found: Drivers, words: Wording) -> str:
    """The strengths of all inputs that stand out as colours, one row an input, one column for failure and each metric."""
    moved = [item for item in found.metrics if item.significant]
    cells = {(item.input, ""): _heat(item.distance, BOTH, "") for item in found.inputs if item.significant}
    for item in moved:
        colour = BOTH if item.words else UP if item.correlation > 0.0 else DOWN
        cells[item.input, item.metric] = _heat(item.correlation, colour, "" if item.words else "+")
    if not cells:
        return ""
    columns = list(dict.fromkeys(metric for _, metric in cells))
    head = ["input", *(escape(words.measure(name).heading) if name else "failure" for name in columns)]
    nothing = '<td class="nothing">·</td>'
    rows = [
        f'<tr><th scope="row">{escape(name)}</th>{"".join(cells.get((name, metric), nothing) for metric in columns)}</tr>'
        for name in dict.fromkeys(name for name, _ in cells)
    ]
    return (
        f'{table(head, rows, "heat", fit=True)}\n<p class="note">{_key(UP, "grows with the input")} '
        f"{_key(DOWN, 'falls with it')} {_key(BOTH, 'depends on it')}. Failure: distance between the distributions of the "
        "input in failed and in passed runs. Metrics: rank correlation, or correlation ratio for words. A dot: does not "
        "stand out from chance.</p>"
    )


def _key(colour: str, meaning: str) -> str:
    return f'<span class="legend"><span class="key" style="background:rgba({colour},.6)"></span>{meaning}</span>'


def _heat(value: float, colour: str, sign: str) -> str:
    shown = f"{value:{sign}.2f}".replace("-", "−")
    return f'<td style="background:rgba({colour},{0.05 + 0.65 * min(abs(value), 1.0):.2f})">{shown}</td>'


def indices(result: CampaignResult, words: Wording) -> str:
    """Show the sensitivity indices of each law's metrics, or why there are none; nothing where none were asked for."""
    from starhold.campaign.sensitivity import Morris, Refused

    told: list[str] = []
    for number, law in enumerate(result.laws):
        for metric, found in law.indices.items():
            measure = words.measure(metric)
            if isinstance(found, Refused):
                body = small_note(found.sentence())
            else:
                body = _morris(found, measure) if isinstance(found, Morris) else _sobol(found)
            told.append(f"<h3>{named(number, law)}: {escape(measure.heading)}</h3>\n{body}")
    if not told:
        return ""
    return f"<h2>Sensitivity indices</h2>\n{''.join(told)}"


def small_note(text: str) -> str:
    """Show a text as a note, escaped."""
    return f'<p class="note">{escape(text)}</p>'


def _morris(found: Morris, measure: Measure) -> str:
    most = max(map(abs, found.mu_star), default=0.0) or 1.0
    unit = small(measure.unit)
    rows = [
        f'<tr><th scope="row">{escape(found.names[i])}</th>'
        f"{bar(found.mu_star[i] / most, _with_width(found.mu_star[i], found.mu_star_width[i], measure.scale))}"
        f"<td>{figure(measure.scale * found.mu[i])}</td><td>{figure(measure.scale * found.sigma[i])}</td></tr>"
        for i in _strongest(found.mu_star)
    ]
    note = (
        "Elementary effects from the lowest to the highest level of each input, beyond which an eighth of its probability "
    )
    note += f"lies on each side; ± holds with {percent(found.confidence)} confidence."
    if found.dropped:
        note += f" {found.dropped} of {found.trajectories} trajectories were dropped, for they hold failed runs."
    head = ("input", f"mean magnitude μ*{unit}", f"mean μ{unit}", f"spread σ{unit}")
    return table(head, rows, "indices", fit=True) + small_note(note)


def _sobol(found: Sobol) -> str:
    rows = [
        f'<tr><th scope="row">{escape(found.names[i])}</th>'
        f"{bar(found.first[i], _with_width(found.first[i], found.first_width[i]))}"
        f"{bar(found.total[i], _with_width(found.total[i], found.total_width[i]))}</tr>"
        for i in _strongest(found.total)
    ]
    note = f"Shares of the metric's variance; ± holds with {percent(found.confidence)} confidence."
    return table(("input", "by itself", "with all others"), rows, "indices shares", fit=True) + small_note(note)


def _with_width(value: float, width: float, scale: float = 1.0) -> str:
    return f"{figure(scale * value, 3)} ± {figure(scale * width, 2)}"


def _strongest(values: Iterable[float]) -> Sequence[int]:
    """The places of values, the largest first, NaN last."""
    listed = list(values)
    return sorted(range(len(listed)), key=lambda i: (math.isnan(listed[i]), -listed[i]))
