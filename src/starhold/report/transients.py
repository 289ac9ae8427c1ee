"""The transient of each law compared with the limits of its scenario, as text and as a section of the page."""

import math
from collections.abc import Sequence

from starhold.report.commands import Cell, Column, Table
from starhold.report.tables import table_html
from starhold.studies.flight import Flight


def transient_text(flight: Flight) -> str:
    """Return one line about the transient of a flight."""
    time, rate, accelerations, fate = _cells(flight)
    return f"transient {time}; peak rate {rate}; peak acceleration {accelerations}: {fate}"


def section(flights: Sequence[Flight]) -> str:
    """Return the section of the page as HTML; "" where no limits were given."""
    if not all("limits_kept" in flight.metrics for flight in flights):
        return ""
    cells_of = [(number, flight, *_cells(flight)) for number, flight in enumerate(flights)]
    rows = [[Cell(flight.name, "name", number), Cell("", fate), *cells] for number, flight, *cells, fate in cells_of]
    heads = ("law", "limits", "transient", "peak rate", "peak accelerations x, y, z")
    return table_html(Table([*map(Column, heads)], rows), "cells_of tight lines")


def _cells(flight: Flight) -> tuple[str, str, str, str]:
    metrics = flight.metrics
    time = "does not end" if metrics["transient_time"] is None else f"{metrics['transient_time']:.4g} s"
    accelerations = ", ".join(f"{math.degrees(x):.4g}" for x in metrics["peak_accelerations"])
    return (
        time,
        f"{math.degrees(metrics['peak_rate']):.4g}{_most(metrics['rate_limit'])} deg/s",
        f"{accelerations}{_most(metrics['acceleration_limit'])} deg/s²",
        "kept" if metrics["limits_kept"] else "exceeded",
    )


def _most(limit: float | None) -> str:
    return "" if limit is None else f" of {math.degrees(limit):.4g}"
