"""The report of a body that has none of its own: every recorded quantity over time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple, final

from starhold.report.body import BodyReport, PageParts
from starhold.report.figures import POINTS, over_time, without_runs
from starhold.report.page_parts import POINTS as PAGE_POINTS
from starhold.report.page_parts import over_time as over_time_data
from starhold.report.page_parts import rounded
from starhold.report.plots import Curve, Plot, recorded_plots, thin_times, thinning

if TYPE_CHECKING:
    from starhold.scenario.reading import Scenario
    from starhold.studies.flight import Flight


class RecordedPicture(NamedTuple):
    """A figure for each recorded quantity."""

    times: Curve
    plots: list[Plot]
    flights: list[Flight]
    name: str

    def makers(self) -> dict[str, Callable[[], Any]]:
        return {plot.name: partial(over_time, plot, self.times, (), self.flights, self.name) for plot in self.plots}


@final
class AnyBodyReport:
    """Plots over time, with the names, units and meanings that the body's part declares."""

    def picture(self, flights: Sequence[Flight], scenario: Scenario) -> RecordedPicture:
        return RecordedPicture(*collect(flights, POINTS), without_runs(flights), scenario.name)

    def page(self, flights: Sequence[Flight], scenario: Scenario) -> PageParts:
        times, plots = collect(flights, PAGE_POINTS)
        return PageParts({"times": rounded(times), "plots": [over_time_data(plot, flights) for plot in plots]})


REPORT: BodyReport = AnyBodyReport()


def collect(flights: Sequence[Flight], points: int) -> tuple[Curve, list[Plot]]:
    """Times, and a plot of each quantity that all flights record, a panel for each component; thinned to about `points`."""
    longest = max((flight.recording["time"] for flight in flights), key=len)
    factor = thinning(len(longest), points)
    return thin_times(longest, factor), recorded_plots(flights, factor)
