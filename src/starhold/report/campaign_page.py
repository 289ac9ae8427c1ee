"""The page with the outcome of a campaign, self-contained for offline use, and recordings of selected runs."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from starhold.campaign.again import fly_again
from starhold.campaign.verdicts import percent
from starhold.files import write_text
from starhold.report import campaign_tables as tables
from starhold.report.campaign_tables import drivers, indices, picture
from starhold.report.campaign_units import Wording, count_text, flown_text, headings_of, headline, outcome_of
from starhold.report.page_parts import beside, document, fold, plot_box, rounded, versions
from starhold.report.plots import colour
from starhold.report.results import PAGE, write_run
from starhold.report.tables import code, note, pill, swatch, table_html
from starhold.report.text import plain_measure

if TYPE_CHECKING:
    from starhold.campaign.envelopes import Envelope
    from starhold.campaign.results import CampaignResult, Spread
    from starhold.report.commands import Table
    from starhold.scenario.reading import Scenario


FLAT = 1e-3
"""The tolerance within which the ratios of bin edges must agree for a logarithmic scale."""
DECADES = 2.0
"""Quantities over time that span more powers of ten than this are drawn on a logarithmic scale."""
DEEPEST = 12.0
"""The largest number of powers of ten shown for a quantity over time."""
NEAR = 1.0
"""A bound is not drawn if its distance from all values exceeds this multiple of their range."""


def histograms(result: CampaignResult, words: Wording) -> list[dict[str, Any]]:
    """Return a plot for each metric that has a histogram for some law."""
    plots: list[dict[str, Any]] = []
    for metric in headings_of(result, words):
        spreads = {
            number: spread
            for number, law in enumerate(result.laws)
            for spread in law.spreads
            if spread.metric == metric and _drawable(spread)
        }
        if spreads:
            plots.append(_histogram(f"spread-{len(plots)}", metric, spreads, result, words))
    return plots


def _drawable(spread: Spread) -> bool:
    return len(spread.edges) > 1 and bool(np.isfinite(spread.edges).all()) and int(spread.counts.sum()) > 0


def _histogram(name: str, metric: str, spreads: dict[int, Spread], result: CampaignResult, words: Wording) -> dict[str, Any]:
    measure = words.measure(metric)
    edges = {number: spread.edges for number, spread in spreads.items()}
    log = all(bins[0] > 0.0 for bins in edges.values()) and any(map(_geometric, edges.values()))
    first = next(iter(edges.values()))
    same = all(np.array_equal(bins, first) for bins in edges.values())
    curves: list[dict[str, Any]] = []
    for number, spread in spreads.items():
        scaled = edges[number] * measure.scale
        share = 100.0 * spread.counts / (spread.counts.sum() + spread.missing)
        width = np.diff(np.log10(scaled)) if log else np.diff(scaled)
        values = share if same else np.divide(share, width, out=np.zeros_like(share), where=width > 0.0)
        curves.append({"law": number, "edges": rounded(scaled, 7), "values": rounded(values, 5), "share": rounded(share, 4)})
    per = "" if same else " a decade" if log else f" per {measure.unit or 'unit'}"
    low = min(float(bins[0]) for bins in edges.values()) * measure.scale
    high = max(float(bins[-1]) for bins in edges.values()) * measure.scale
    required = [item for item in words.requirements.values() if item.column == metric and math.isfinite(item.bound)]
    bounds = [item.bound * measure.scale for item in required]
    missing = ", ".join(
        f"{result.laws[number].law} {count_text(spread.missing)}" for number, spread in spreads.items() if spread.missing
    )
    return {
        "name": name,
        "metric": metric,
        "title": measure.heading,
        "notes": [f"required: {words.asks(item.name)}" for item in required]
        + ([f"runs without a value: {missing}"] if missing else []),
        "xlabel": measure.unit or measure.heading,
        "ylabel": f"% of runs{per}",
        "log": log,
        "curves": curves,
        "levels": rounded([bound for bound in bounds if _near(bound, low, high, log)]),
    }


def _geometric(edges: NDArray[np.float64]) -> bool:
    """Return whether bins are equal on a logarithmic scale and not on a linear one."""
    widths, ratios = np.diff(edges), np.diff(np.log(edges)) if edges[0] > 0.0 else np.array([math.inf])
    even = float(np.ptp(ratios)) <= FLAT * float(np.abs(ratios).max()) if np.isfinite(ratios).all() else False
    return even and float(np.ptp(widths)) > FLAT * float(widths.max())


def _near(bound: float, low: float, high: float, log: bool) -> bool:
    if log:
        if bound <= 0.0:
            return False
        bound, low, high = math.log10(bound), math.log10(low), math.log10(high)
    reach = NEAR * (high - low)
    return low - reach <= bound <= high + reach


def envelopes(result: CampaignResult, words: Wording) -> list[dict[str, Any]]:
    """Return a plot over time for each quantity, with all laws."""
    names = list(dict.fromkeys(envelope.name for law in result.laws for envelope in law.envelopes))
    plots: list[dict[str, Any]] = []
    for name in names:
        by_law = {
            number: envelope
            for number, law in enumerate(result.laws)
            for envelope in law.envelopes
            if envelope.name == name and len(envelope.times)
        }
        if by_law:
            plots.append(_envelope(f"envelope-{len(plots)}", by_law, words))
    return plots


def _envelope(name: str, by_law: dict[int, Envelope], words: Wording) -> dict[str, Any]:
    first = next(iter(by_law.values()))
    measure = plain_measure(first.name, first.unit, first.meaning)
    curves = [
        {
            "law": number,
            "times": rounded(envelope.times / words.metric_set.tick),
            **{key: rounded(values * measure.scale, 4) for key, values in _lines(envelope).items()},
        }
        for number, envelope in by_law.items()
    ]
    known = np.concatenate([values for envelope in by_law.values() for values in _lines(envelope).values()]) * measure.scale
    known = known[np.isfinite(known) & (known > 0.0)]
    span = ticks = None
    if len(known) and math.log10(float(known.max()) / float(known.min())) > DECADES:
        high = math.log10(float(known.max()))
        low = max(math.log10(float(known.min())), high - DEEPEST)
        margin, ticks = 0.05 * (high - low), max(1, math.ceil((high - low) / 6.0))
        span = [round(low - margin, 4), round(high + margin, 4)]
    return {
        "name": name,
        "title": measure.heading,
        "notes": [first.meaning] if first.meaning else [],
        "xlabel": f"time, {words.metric_set.clock}",
        "ylabel": measure.unit or measure.heading,
        "log": span is not None,
        "span": span,
        "ticks": ticks,
        "curves": curves,
    }


def _lines(envelope: Envelope) -> dict[str, NDArray[np.float64]]:
    return {key: getattr(envelope, key) for key in ("least", "low", "median", "high", "most")}


READING = {
    "verdict": (
        "Met, missed or not decided, for a share of all flights and with a confidence, both fixed beforehand. Met: if "
        "less than that share met the requirement, so few failures would occur with a probability of at most 1 minus "
        "the confidence (the consumer's risk). Not decided: too few runs."
    ),
    "failure probability": "Its lower and upper bounds by Clopper and Pearson's exact formula, each valid "
    "with the confidence; for a campaign that stops early, the bounds of a confidence sequence.",
    "margin": (
        "The distance of a run from the requirement's bound, negative if it misses. Margin kept: a margin that "
        "at least the required share of all flights has, with the confidence, by an order statistic."
    ),
    "known before flight": "A condition that is known before flight is not averaged over: its quartiles are judged "
    "separately, and a requirement is met only if each of them meets it.",
    "5 %, median, 95 %": "Five, fifty and ninety-five per cent of the runs that have the metric lie below.",
    "lost, without value": "A lost run counts as missing every requirement on a value that it lacks.",
    "over time": "The largest value of each run in each window of time counts. Line: the median; band: 5 to 95 %; "
    "thin lines: the minimum and maximum over all runs that were not lost. Quantiles are accurate to within 3 %, the "
    "extremes are exact.",
}


MOST_AGAIN, MOST_DRIVERS = 25, 10
"""The largest numbers of runs worth flying again listed for a law, and of drivers of each kind."""
NBSP = "\N{NO-BREAK SPACE}"


def render(scenario: Scenario, result: CampaignResult) -> str:
    """Return the report of a campaign as HTML; equal results give equal text. Text from files is escaped."""
    words = Wording.of(scenario.body, result)
    spreads, over_time = histograms(result, words), envelopes(result, words)
    required = tables.verdicts(result, words)
    bound = {item.column for item in words.requirements.values()}
    leads = [*over_time[:1], *sorted(spreads, key=lambda plot: plot["metric"] not in bound)[:1]]
    sections = [
        table_html(required, "told tight") if required else note("Nothing is required, so there are no verdicts."),
        _switches(result),
        beside(*(plot_box(plot, 2) for plot in leads)),
        *_headlines(result, words),
        fold("Verdicts in words", note(required.note) + _in_words(result) if required else ""),
        fold("Runs", _shown(tables.runs(result)._replace(title=""), fit=True)),
        fold("Distributions", _distributions([plot for plot in spreads if plot not in leads])),
        fold("Envelopes over time", _over_time([plot for plot in over_time if plot not in leads])),
        _folded(tables.metrics(result, words)),
        _folded(tables.again(result, MOST_AGAIN)),
        _folded(tables.brackets(result, words)),
        _folded(tables.claims(result, words)),
        fold("What drives failures and metrics", "".join(_drivers(result, words))),
        fold("Sensitivity indices", "".join(_shown(table, fit=True) for table in indices(result, words))),
        _folded(tables.dispersions(result)),
        fold("Results", _store(result, words)),
        fold("How to read this page", _reading()),
    ]
    data = {
        "laws": [{"name": law.law, "colour": colour(number)} for number, law in enumerate(result.laws)],
        # The comparison's script draws these elements, which a campaign does not have.
        "plots": [],
        "histograms": [_for_script(plot) for plot in spreads],
        "envelopes": [_for_script(plot) for plot in over_time],
    }
    outcomes = "".join(
        f"<span>{swatch(number)}{escape(law.law)} {pill(outcome_of(law))}</span>" for number, law in enumerate(result.laws)
    )
    return document(scenario, sections, data, ["campaign.js"], f"{versions()}.", flown_text(result), outcomes)


def _folded(table: Table | None) -> str:
    """Return a table as a fold that the reader may open."""
    return "" if table is None else fold(table.title, _shown(table._replace(title="")))


def _shown(table: Table, fit: bool = False) -> str:
    """Return a table with its title and its note as HTML."""
    head = f"<h3>{escape(table.title)}</h3>\n" if table.title else ""
    return f"{head}{table_html(table, fit=fit) if table.rows else ''}\n{note(table.note)}"


def _headlines(result: CampaignResult, words: Wording) -> Iterator[str]:
    """Yield a sentence with the verdicts on each law."""
    for number, law in enumerate(result.laws):
        text = escape(headline(law, result.sampling, words).replace(" %", f"{NBSP}%"))
        yield f'<p class="said">{pill(outcome_of(law))}<span><b>{swatch(number)}{escape(law.law)}</b> {text}</span></p>'


def _in_words(result: CampaignResult) -> str:
    items = "".join(
        f"<li>{swatch(number)}{escape(f'{law.law}: {verdict.sentence()}')}</li>"
        for number, law in enumerate(result.laws)
        for verdict in law.verdicts
    )
    return f'<ul class="note">{items}</ul>'


def _drivers(result: CampaignResult, words: Wording) -> Iterator[str]:
    """Yield the drivers of failures and of metrics for each law, as a picture and as a table."""
    from starhold.campaign.drivers import RISK

    looked = [(number, law) for number, law in enumerate(result.laws) if law.drivers is not None]
    if looked:
        yield note(
            "Only statistically significant inputs are shown: all tests of a law are corrected together, so with "
            f"{percent(1.0 - RISK)} confidence none is shown by chance, if inputs were drawn independently. Numbers of "
            "inputs are in the units of their keys."
        )
    for number, law in looked:
        assert law.drivers is not None
        yield f"<h3>{swatch(number)}{escape(law.law)}</h3>\n{picture(law.drivers, words)}"
        yield _shown(drivers(law.drivers, words, MOST_DRIVERS))


def _for_script(plot: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in plot.items() if key not in {"title", "notes", "metric"}}


def _switches(result: CampaignResult) -> str:
    """Return buttons that show and hide laws in all pictures; "" for a single law."""
    pressed = 'type="button" aria-pressed="true"'
    buttons = "".join(
        f'<button class="law-switch" data-law="{number}" {pressed}>{swatch(number)}{escape(law.law)}</button>'
        for number, law in enumerate(result.laws)
    )
    return f'<p class="switch">{buttons}</p>' if len(result.laws) > 1 else ""


def _distributions(plots: list[dict[str, Any]]) -> str:
    if not plots:
        return ""
    rare = '<button id="rare" type="button" aria-pressed="false">Logarithmic counts: show rare runs</button>'
    note = (
        '<p class="note">Histograms of runs; dashed: the requirement. Where laws have different bins, heights are per unit, '
        "so that areas compare.</p>"
    )
    grid = f'<div class="grid">{"".join(map(plot_box, plots))}</div>'
    return f'{note}\n<p class="switch">{rare}</p>\n{grid}'


def _over_time(plots: list[dict[str, Any]]) -> str:
    if not plots:
        return ""
    note = (
        '<p class="note">The largest value in each window of time of the runs that were not lost: median (line), 5 to 95 % '
        "(band), least and largest of all runs (thin lines). Drag to zoom, double-click to zoom out.</p>"
    )
    return f"{note}\n{''.join(map(plot_box, plots))}"


def _store(result: CampaignResult, words: Wording) -> str:
    folder = shlex.quote(result.folder.as_posix())
    questions = ["select law, count(*) as runs, avg(failed::int) as failed from runs group by law"]
    if headings := headings_of(result, words):
        column = '"{}"'.format(headings[0].replace('"', '""'))
        questions.append(f"select law, run, {column} from runs where failed order by {column} desc limit 10")
    examples = "".join(f"<p>{code(f'starhold query {folder} {shlex.quote(question)}')}</p>" for question in questions)
    return (
        f'<p>Digest (SHA-256 of the sorted results): <code class="copy">{escape(result.digest)}</code></p>\n'
        '<p class="note">The same scenario gives the same digest on any machine. Every run is a row of the table '
        f"<code>runs</code>, with its inputs, metrics and margins:</p>\n{examples}"
    )


def _reading() -> str:
    items = "".join(f"<dt>{escape(what)}</dt><dd>{escape(meaning)}</dd>" for what, meaning in READING.items())
    return f'<dl class="reading">{items}</dl>'


RECORDED = "recorded"
"""The folder of recordings."""


def write_campaign(scenario: Scenario, result: CampaignResult) -> Path:
    """Fly the selected runs of a campaign again, store their recordings, and write the campaign's page; return its path."""
    for law in result.laws:
        for again in law.again:
            flown = fly_again(result.folder, again.run, law.law)
            write_run(flown.flight.recording, result.folder / RECORDED / f"{law.law}-{again.run}.nc")
    page = result.folder / PAGE
    write_text(page, render(scenario, result))
    return page
