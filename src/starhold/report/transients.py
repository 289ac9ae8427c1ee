"""The transient of each law against the limits of its scenario, in words and as a section of the page."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING

from starhold.report.proved import swatch

if TYPE_CHECKING:
    from starhold.studies.flight import Flight


def told(flight: Flight) -> str:
    """One line about a flight with such metrics."""
    time, rate, accelerations, fate = _cells(flight)
    return f"transient {time}; peak rate {rate}; peak acceleration {accelerations}: {fate}"


def section(flights: Sequence[Flight]) -> str:
    """The section of the page; empty where no limits were given."""
    if not all("limits_kept" in flight.metrics for flight in flights):
        return ""
    rows = "".join(
        f'<tr><th scope="row">{swatch(number)}{escape(flight.name)}</th>'
        f"{''.join(f'<td>{escape(cell)}</td>' for cell in _cells(flight))}</tr>"
        for number, flight in enumerate(flights)
    )
    heads = ("law", "transient", "peak rate", "peak accelerations x, y, z", "limits")
    head = "".join(f'<th scope="col">{name}</th>' for name in heads)
    return (
        f'<h2>The transient and its limits</h2>\n<div class="wide"><table class="text"><thead><tr>{head}</tr></thead>'
        f"<tbody>{rows}</tbody></table></div>"
    )


def _cells(flight: Flight) -> tuple[str, str, str, str]:
    found = flight.metrics
    time = "comes to no end" if found["transient_time"] is None else f"{found['transient_time']:.4g} s"
    accelerations = ", ".join(f"{math.degrees(x):.4g}" for x in found["peak_accelerations"])
    return (
        time,
        f"{math.degrees(found['peak_rate']):.4g}{_most(found['rate_limit'])} deg/s",
        f"{accelerations}{_most(found['acceleration_limit'])} deg/s²",
        "kept" if found["limits_kept"] else "exceeded",
    )


def _most(limit: float | None) -> str:
    return "" if limit is None else f" of {math.degrees(limit):.4g}"
