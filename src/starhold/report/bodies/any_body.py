"""The report of a body without a report of its own: every recorded quantity over time."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

from starhold.report.body import PageParts
from starhold.report.figures import POINTS, Picture, over_time, without_runs
from starhold.report.page_parts import PAGE_POINTS, over_time_data, rounded
from starhold.report.plots import Curve, Plot, longest, recorded_plots, thin_times, thinning

if TYPE_CHECKING:
    from starhold.scenario.reading import Scenario
    from starhold.studies.flight import Flight


def picture(flights: Sequence[Flight], scenario: Scenario) -> Picture:
    """Return a figure of each recorded quantity, with the names, units and meanings that the body's part declares."""
    times, plots = collect(flights, POINTS)
    shown = without_runs(flights)
    return {plot.name: partial(over_time, plot, times, (), shown, scenario.name) for plot in plots}


def page(flights: Sequence[Flight], scenario: Scenario) -> PageParts:
    """Return the parts of the page: plots over time of all recorded quantities."""
    times, plots = collect(flights, PAGE_POINTS)
    return PageParts({"times": rounded(times), "plots": [over_time_data(plot, flights) for plot in plots]})


def collect(flights: Sequence[Flight], points: int) -> tuple[Curve, list[Plot]]:
    """Return times and a plot of each quantity that all flights record, with a panel per component, thinned to about
    `points` samples."""
    times = longest(flights)["time"]
    factor = thinning(len(times), points)
    return thin_times(times, factor), recorded_plots(flights, factor)
