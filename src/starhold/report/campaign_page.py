"""The page with the outcome of a campaign; it opens offline and loads nothing."""

from __future__ import annotations

import shlex
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from starhold.report.campaign_drivers import drivers, indices
from starhold.report.campaign_plots import box, envelopes, histograms
from starhold.report.campaign_tables import again, brackets, code, dispersions, headlines, laws, metrics, named, verdicts
from starhold.report.campaign_units import Wording, headings_of
from starhold.report.campaign_words import flown_text
from starhold.report.colours import colour
from starhold.report.page_parts import document, versions

if TYPE_CHECKING:
    from starhold.campaign.results import CampaignResult
    from starhold.scenario.reading import Scenario

READING = {
    "verdict": "Met, missed or not decided, for a share of all flights and with a confidence, both set "
    "beforehand. Met: were the requirement kept by less than that share, so few failures would come up with a probability "
    "of at most 1 less the confidence (the consumer's risk). Not decided: too few runs to tell.",
    "failure probability": "Its lower and its upper bound by Clopper and Pearson's exact formula, each holding by itself "
    "with the confidence; of a campaign that stops when it knows enough, those of a confidence sequence.",
    "margin": "How far a run is on the good side of the requirement's bound; below zero it is missed. Margin kept: one that "
    "at least the share asked of all flights keeps, with the confidence, by an order statistic.",
    "known before flight": "A condition that is known before flight is not averaged over: its quarters are judged apart, "
    "and a requirement is met only if it is in each of them.",
    "5 %, median, 95 %": "Five, fifty and ninety-five in a hundred of the runs that have the metric lie below.",
    "lost, without value": "A lost run counts as one that misses every requirement on a value that it lacks.",
    "over time": "The largest value of each run in each window of time is taken; line: their median, band: 5 to 95 %, thin "
    "lines: the least and the largest of all runs that were not lost. Quantiles are right to within 3 %, the extremes are "
    "exact.",
}


def write_page(path: Path, scenario: Scenario, result: CampaignResult) -> None:
    """Write the report of a campaign as one HTML file; the same results give the same bytes."""
    path.write_text(render(scenario, result), encoding="utf-8", newline="\n")


def render(scenario: Scenario, result: CampaignResult) -> str:
    """Make the report as HTML text; whatever comes from files is escaped."""
    words = Wording.of(scenario.body, result)
    spreads, over_time = histograms(result, words), envelopes(result, words)
    sections = [
        f'<p class="note">{escape(flown_text(result))}</p>',
        headlines(result, words),
        verdicts(result, words),
        laws(result),
        metrics(result, words),
        _distributions(spreads, result),
        _over_time(over_time, result),
        again(result),
        brackets(result, words),
        drivers(result, words),
        indices(result, words),
        dispersions(result),
        _store(result, words),
        _reading(),
    ]
    data = {
        "laws": [{"name": law.law, "colour": colour(number)} for number, law in enumerate(result.laws)],
        # The comparison's script draws these, of which a campaign has none.
        "plots": [],
        "histograms": [_for_script(plot) for plot in spreads],
        "envelopes": [_for_script(plot) for plot in over_time],
    }
    return document(scenario, sections, data, ["campaign.js"], f"{versions()}.")


def _for_script(plot: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in plot.items() if key not in {"title", "notes"}}


def _switches(result: CampaignResult, more: str = "") -> str:
    """Buttons that show and hide laws in all pictures."""
    buttons = "".join(
        f'<button class="law-switch" data-law="{number}" type="button" aria-pressed="true">{named(number, law)}</button>'
        for number, law in enumerate(result.laws)
    )
    shown = buttons if len(result.laws) > 1 else ""
    return f'<p class="switch">{shown}{more}</p>' if shown or more else ""


def _distributions(plots: list[dict[str, Any]], result: CampaignResult) -> str:
    if not plots:
        return ""
    rare = '<button id="rare" type="button" aria-pressed="false">Logarithmic counts: show rare runs</button>'
    note = (
        '<p class="note">Bins of runs; dashed: what is required. Where laws have bins of their own, heights are per unit, '
        "so that areas compare.</p>"
    )
    grid = f'<div class="grid">{"".join(map(box, plots))}</div>'
    return f"<h2>Distributions</h2>\n{note}\n{_switches(result, rare)}\n{grid}"


def _over_time(plots: list[dict[str, Any]], result: CampaignResult) -> str:
    if not plots:
        return ""
    note = (
        '<p class="note">Of the runs that were not lost, the largest value in each window of time: median (line), 5 to 95 % '
        "(band), least and largest of all runs (thin lines). Drag to zoom, double-click to zoom out.</p>"
    )
    return f"<h2>Envelopes over time</h2>\n{note}\n{_switches(result)}\n{''.join(map(box, plots))}"


def _store(result: CampaignResult, words: Wording) -> str:
    folder = shlex.quote(result.folder.as_posix())
    questions = ["select law, count(*) as runs, avg(failed::int) as failed from runs group by law"]
    if found := headings_of(result, words):
        column = '"{}"'.format(found[0].replace('"', '""'))
        questions.append(f"select law, run, {column} from runs where failed order by {column} desc limit 10")
    asked = "".join(f"<p>{code(f'starhold query {folder} {shlex.quote(question)}')}</p>" for question in questions)
    return (
        "<h2>Results</h2>\n"
        f'<p>Digest (SHA-256 of the sorted results): <code class="copy">{escape(result.digest)}</code></p>\n'
        '<p class="note">The same scenario gives the same digest, whatever flies it. Every run is a row of the table '
        f"<code>runs</code>, with its inputs, metrics and margins:</p>\n{asked}"
    )


def _reading() -> str:
    items = "".join(f"<dt>{escape(what)}</dt><dd>{escape(told)}</dd>" for what, told in READING.items())
    return f'<h2>How to read this page</h2>\n<dl class="reading">{items}</dl>'
