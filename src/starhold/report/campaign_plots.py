"""The pictures of a campaign's page as data for its script: histograms of metrics, envelopes over time."""

from __future__ import annotations

import math
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from starhold.report.campaign_units import Wording, count_text, headings_of, plain_measure
from starhold.report.page_parts import rounded

if TYPE_CHECKING:
    from starhold.campaign.envelopes import Envelope
    from starhold.campaign.results import CampaignResult, Spread

FLAT = 1e-3
"""Edges of bins whose ratios agree to this are those of a logarithmic scale."""
DECADES = 2.0
"""Quantities over time that span more powers of ten than this are drawn on a logarithmic scale."""
DEEPEST = 12.0
"""No more powers of ten are shown of a quantity over time."""
NEAR = 1.0
"""A bound farther from all values than so many times their range is not drawn."""


def histograms(result: CampaignResult, words: Wording) -> list[dict[str, Any]]:
    """Make a plot for each metric of which some law has a histogram."""
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
    """Tell whether bins are equal on a logarithmic scale and not on a linear one."""
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
    """Make a plot over time for each quantity, all laws in it."""
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
        span, ticks = [round(low - 0.05 * (high - low), 4), round(high + 0.05 * (high - low), 4)], _ticks(high - low)
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


def _ticks(decades: float) -> int:
    return max(1, math.ceil(decades / 6.0))


def _lines(envelope: Envelope) -> dict[str, NDArray[np.float64]]:
    return {key: getattr(envelope, key) for key in ("least", "low", "median", "high", "most")}


def box(plot: dict[str, Any]) -> str:
    """Make the place of a plot, which the script fills."""
    notes = "".join(f"<span>{escape(note)}</span>" for note in plot["notes"])
    return f'<div class="plot"><h3>{escape(plot["title"])}{notes}</h3><div id="{plot["name"]}"></div></div>'
