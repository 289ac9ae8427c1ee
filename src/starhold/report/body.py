"""The hooks through which reports show a body, and how they are found by the body's name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from starhold.studies.body import body_module

if TYPE_CHECKING:
    from starhold.report.figures import Picture
    from starhold.scenario.reading import Scenario
    from starhold.studies.flight import Flight


class Sampling(NamedTuple):
    """How plots are thinned: two of every `factor` samples are kept. early: samples of the transient where it is shown
    alone, and their factor."""

    factor: int
    early: tuple[int, int] | None = None


class PageParts(NamedTuple):
    """The parts of a page that are specific to the body: the data of its scripts (each plot in "plots" has a box, the first
    on the first screen), HTML, and the names of scripts among the assets."""

    data: dict[str, Any]
    views: str = ""
    """A box beside the first plot."""
    measured: str = ""
    """A section below the ranking."""
    folds: Mapping[str, str] = {}
    """Further contents of the folds of these names."""
    transient: float | None = None
    """The length of the transient (s) that the page can show separately, or None."""
    scripts: Sequence[str] = ()
    footer: str = ""
    sampling: Sampling | None = None
    """The thinning of curves on a page with sliders, or None."""


class BodyReport(Protocol):
    """The hooks of a body for pictures and pages, functions of its module in `starhold.report.bodies`."""

    def picture(self, flights: Sequence[Flight], scenario: Scenario) -> Picture:
        """Collect the data of the figures."""
        ...

    def page(self, flights: Sequence[Flight], scenario: Scenario) -> PageParts:
        """Make the body's parts of the page."""
        ...


def report_of(body: str) -> BodyReport:
    """Return the report of the body of this name, or the report for any body where it has none."""
    return body_module("starhold.report.bodies", body)
