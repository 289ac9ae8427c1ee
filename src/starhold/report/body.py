"""The interface through which reports show a body, and its look-up by the body's name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from starhold.studies.body import body_module

if TYPE_CHECKING:
    from starhold.report.figures import Picture
    from starhold.scenario.reading import Scenario
    from starhold.studies.flight import Flight


class Sampling(NamedTuple):
    """The thinning of plots: two of every `factor` samples are kept. early: the number of samples of the transient where it
    is shown separately, and their factor."""

    factor: int
    early: tuple[int, int] | None = None


class PageParts(NamedTuple):
    """The parts of a page that are specific to the body: the data of its scripts (each plot in "plots" gets a box, the first
    one on the first screen), HTML, and the names of scripts among the assets."""

    data: dict[str, Any]
    views: str = ""
    """A box beside the first plot."""
    measured: str = ""
    """A section below the ranking."""
    folds: Mapping[str, str] = {}
    """Further contents of folds, by the names of these."""
    transient: float | None = None
    """The length of the transient (s) that the page can show separately, or None."""
    scripts: Sequence[str] = ()
    footer: str = ""
    sampling: Sampling | None = None
    """The thinning of curves on a page with sliders, or None."""


class BodyReport(Protocol):
    """The functions that a body's module in `starhold.report.bodies` provides for pictures and pages."""

    def picture(self, flights: Sequence[Flight], scenario: Scenario) -> Picture:
        """Return the figures."""
        ...

    def page(self, flights: Sequence[Flight], scenario: Scenario) -> PageParts:
        """Return the body's parts of the page."""
        ...


def report_of(body: str) -> BodyReport:
    """Return the report of the body of this name, or the general one if the body has no report of its own."""
    return body_module("starhold.report.bodies", body)
