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
    found: list[dict[str, Any]] = []
    for metric in headings_of(result, words):
        spreads = {
            number: spread
            for number, law in enumerate(result.laws)
            for spread in law.spreads
            if spread.metric == metric and _drawable(spread)
        }
        if spreads:
            found.append(_histogram(f"spread-{len(found)}", metric, spreads, result, words))
    return found


def _drawable(spread: Spread) -> bool:
    return len(spread.edges) > 1 and bool(np.isfinite(spread.edges).all()) and int(spread.counts.sum()) > 0


def _histogram(name: str, metric: str, spreads: dict[int, Spread], result: CampaignResult, words: Wording) -> dict[str, Any]:
    measure = words.measure(metric)
    edges = {number: spread.edges for number, spread in spreads.items()}
    log = all(own[0] > 0.0 for own in edges.values()) and any(map(_geometric, edges.values()))
    first = next(iter(edges.values()))
    same = all(np.array_equal(own, first) for own in edges.values())
    curves: list[dict[str, Any]] = []
    for number, spread in spreads.items():
        scaled = edges[number] * measure.scale
        share = 100.0 * spread.counts / (spread.counts.sum() + spread.missing)
        width = np.diff(np.log10(scaled)) if log else np.diff(scaled)
        values = share if same else np.divide(share, width, out=np.zeros_like(share), where=width > 0.0)
        curves.append({"law": number, "edges": rounded(scaled, 7), "values": rounded(values, 5), "share": rounded(share, 4)})
    per = "" if same else " a decade" if log else f" per {measure.unit or 'unit'}"
    low = min(float(own[0]) for own in edges.values()) * measure.scale
    high = max(float(own[-1]) for own in edges.values()) * measure.scale
    asked = [item for item in words.asked.values() if item.column == metric and math.isfinite(item.bound)]
    bounds = [item.bound * measure.scale for item in asked]
    missing = ", ".join(
        f"{result.laws[number].law} {count_text(spread.missing)}" for number, spread in spreads.items() if spread.missing
    )
    return {
        "name": name,
        "title": measure.heading,
        "notes": [f"required: {words.asks(item.name)}" for item in asked]
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
    found: list[dict[str, Any]] = []
    for name in names:
        own = {
            number: envelope
            for number, law in enumerate(result.laws)
            for envelope in law.envelopes
            if envelope.name == name and len(envelope.times)
        }
        if own:
            found.append(_envelope(f"envelope-{len(found)}", own, words))
    return found


def _envelope(name: str, own: dict[int, Envelope], words: Wording) -> dict[str, Any]:
    first = next(iter(own.values()))
    measure = plain_measure(first.name, first.unit, first.meaning)
    curves = [
        {
            "law": number,
            "times": rounded(envelope.times / words.metric_set.tick),
            **{key: rounded(values * measure.scale, 4) for key, values in _lines(envelope).items()},
        }
        for number, envelope in own.items()
    ]
    known = np.concatenate([values for envelope in own.values() for values in _lines(envelope).values()]) * measure.scale
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
