"""The page with the outcome of a campaign; it opens offline and loads nothing."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from starhold.campaign.again import fly_again
from starhold.campaign.verdicts import percent
from starhold.files import atomic_write
from starhold.report import campaign_tables as tables
from starhold.report.campaign_drivers import drivers, indices, picture
from starhold.report.campaign_plots import box, envelopes, histograms
from starhold.report.campaign_tables import Section
from starhold.report.campaign_units import Wording, headings_of
from starhold.report.campaign_words import flown_text, headline, outcome_of
from starhold.report.html_tables import code, note, pill, table_html
from starhold.report.page_parts import document, versions
from starhold.report.plots import colour
from starhold.report.proved import swatch
from starhold.report.results import PAGE, write_run

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


MOST_AGAIN, MOST_DRIVERS = 25, 10
"""Runs worth flying again that are listed of a law, and its drivers of a kind."""
NBSP = "\N{NO-BREAK SPACE}"


def write_page(path: Path, scenario: Scenario, result: CampaignResult) -> None:
    """Write the report of a campaign as one HTML file; the same results give the same bytes."""
    path.write_text(render(scenario, result), encoding="utf-8", newline="\n")


def render(scenario: Scenario, result: CampaignResult) -> str:
    """Make the report as HTML text; whatever comes from files is escaped."""
    words = Wording.of(scenario.body, result)
    spreads, over_time = histograms(result, words), envelopes(result, words)
    required = tables.verdicts(result, words)
    sections = [
        note(flown_text(result)),
        *_headlines(result, words),
        _shown(required) or f"<h2>Verdicts</h2>{note('The campaign requires nothing, so there are no verdicts.')}",
        _in_words(result) if required else "",
        _shown(tables.runs(result), fit=True),
        _shown(tables.metrics(result, words)),
        _distributions(spreads, result),
        _over_time(over_time, result),
        _shown(tables.again(result, MOST_AGAIN)),
        _shown(tables.brackets(result, words)),
        *_drivers(result, words),
        *_indices(result, words),
        _shown(tables.dispersions(result)),
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


def _shown(section: Section | None, level: int = 2, fit: bool = False) -> str:
    """A section as HTML; nothing where there is none."""
    if section is None:
        return ""
    head = f"<h{level}>{escape(section.heading)}</h{level}>\n" if section.heading else ""
    return f"{head}{table_html(section.table, fit=fit) if section.table.rows else ''}\n{note(section.note)}"


def _headlines(result: CampaignResult, words: Wording) -> Iterator[str]:
    """Sum up the verdicts of each law in a sentence."""
    for number, law in enumerate(result.laws):
        text = escape(headline(law, result.sampling, words).replace(" %", f"{NBSP}%"))
        yield f'<p class="said">{pill(outcome_of(law))}<span><b>{swatch(number)}{escape(law.law)}</b> {text}</span></p>'


def _in_words(result: CampaignResult) -> str:
    items = "".join(
        f"<li>{swatch(number)}{escape(f'{law.law}: {verdict.sentence()}')}</li>"
        for number, law in enumerate(result.laws)
        for verdict in law.verdicts
    )
    return f'<details><summary>The verdicts in words</summary><ul class="note">{items}</ul></details>'


def _drivers(result: CampaignResult, words: Wording) -> Iterator[str]:
    """Show what makes runs of each law fail and what moves its metrics, as a picture and as a table."""
    from starhold.campaign.drivers import RISK

    looked = [(number, law) for number, law in enumerate(result.laws) if law.drivers is not None]
    if looked:
        yield "<h2>What drives failures and metrics</h2>"
        yield note(
            "Shown is what stands out from chance: all tests of a law are corrected together, so that with "
            f"{percent(1.0 - RISK)} confidence nothing is shown by chance, if inputs were drawn independently. Numbers of "
            "inputs are in the units of their keys."
        )
    for number, law in looked:
        assert law.drivers is not None
        yield f"<h3>{swatch(number)}{escape(law.law)}</h3>\n{picture(law.drivers, words)}"
        yield _shown(drivers(law.drivers, words, MOST_DRIVERS))


def _indices(result: CampaignResult, words: Wording) -> Iterator[str]:
    sections = indices(result, words)
    yield "<h2>Sensitivity indices</h2>" if sections else ""
    yield from (_shown(section, 3, fit=True) for section in sections)


def _for_script(plot: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in plot.items() if key not in {"title", "notes"}}


def _switches(result: CampaignResult, more: str = "") -> str:
    """Buttons that show and hide laws in all pictures."""
    pressed = 'type="button" aria-pressed="true"'
    buttons = "".join(
        f'<button class="law-switch" data-law="{number}" {pressed}>{swatch(number)}{escape(law.law)}</button>'
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
    if headings := headings_of(result, words):
        column = '"{}"'.format(headings[0].replace('"', '""'))
        questions.append(f"select law, run, {column} from runs where failed order by {column} desc limit 10")
    examples = "".join(f"<p>{code(f'starhold query {folder} {shlex.quote(question)}')}</p>" for question in questions)
    return (
        "<h2>Results</h2>\n"
        f'<p>Digest (SHA-256 of the sorted results): <code class="copy">{escape(result.digest)}</code></p>\n'
        '<p class="note">The same scenario gives the same digest, whatever flies it. Every run is a row of the table '
        f"<code>runs</code>, with its inputs, metrics and margins:</p>\n{examples}"
    )


def _reading() -> str:
    items = "".join(f"<dt>{escape(what)}</dt><dd>{escape(meaning)}</dd>" for what, meaning in READING.items())
    return f'<h2>How to read this page</h2>\n<dl class="reading">{items}</dl>'


RECORDED = "recorded"
"""The folder of recordings."""


def write_campaign(scenario: Scenario, result: CampaignResult) -> Path:
    """Fly again and record the runs of a campaign that are worth looking at, and write its page; returns the page's path."""
    for law in result.laws:
        for again in law.again:
            flown = fly_again(result.folder, again.run, law.law)
            write_run(flown.flight.recording, result.folder / RECORDED / f"{law.law}-{again.run}.nc")
    page = result.folder / PAGE
    with atomic_write(page) as hidden:
        write_page(hidden, scenario, result)
    return page
