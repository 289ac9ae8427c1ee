"""The page of a comparison; it opens offline and loads nothing."""

from collections.abc import Sequence
from html import escape
from pathlib import Path

from starhold.report.body import report_of
from starhold.report.living import living_data
from starhold.report.page_parts import (
    columns_list,
    document,
    law_data,
    laws_table,
    lost_alarm,
    over_time_heading,
    plot_box,
    ranking,
    settings,
    versions,
)
from starhold.report.proved import section as proved
from starhold.scenario.reading import Scenario
from starhold.studies.flight import Flight


def write_page(path: Path, scenario: Scenario, flights: Sequence[Flight]) -> None:
    """Write the report of a scenario's flights as one HTML file; the same flights give the same bytes."""
    path.write_text(render(scenario, flights), encoding="utf-8", newline="\n")


def render(scenario: Scenario, flights: Sequence[Flight]) -> str:
    """The report as HTML text. Whatever comes from files is escaped."""
    parts = report_of(scenario.body).page(flights, scenario)
    living = "the page of this body has none" if parts.sampling is None else living_data(scenario, flights, parts.sampling)
    grounded = (
        f'<p class="note">Nothing here can be flown again with sliders: {escape(living)}.</p>'
        if isinstance(living, str)
        else ""
    )
    sections = [
        lost_alarm(flights),
        ranking(flights),
        parts.measured,
        proved(flights),
        *parts.views,
        over_time_heading(parts.transient),
        grounded,
        *(plot_box(plot) for plot in parts.data["plots"] if "planes" not in plot),
        laws_table(flights),
        parts.units,
        settings(scenario, parts.settings),
        columns_list(flights),
    ]
    data, moved = {"laws": law_data(flights), **parts.data}, None if isinstance(living, str) else living
    return document(scenario, sections, data, parts.scripts, f"{versions()}{parts.footer}.", moved)
