"""Runs against limits on rate and acceleration: metrics, plots and the section of the page."""

import math
from dataclasses import replace
from typing import Any

import pytest

from starhold.analysis.rigid_body import measure
from starhold.analysis.transient import Limits
from starhold.analysis.transient import against_limits as measure_against
from starhold.report.attitude_plots import collect
from starhold.report.page import render
from starhold.report.transients import section, transient_text
from starhold.scenario.reading import Scenario, parse
from starhold.simulation.lane import Recording
from starhold.studies.flight import Flight
from tests.report import flown

LIMITS = '[transient]\nrate_limit = 0.2\nacceleration_limit = "0.5 deg/s^2"\nangle_end = 3.0\nrate_end = 1.0\n'


def against_limits(run: Recording, table: Any) -> dict[str, Any]:
    """Metrics of a run against the limits of a [transient] table."""
    limits, ends = Limits(table.rate_limit, table.acceleration_limit), (table.angle_end, table.rate_end)
    return measure_against(run, limits, measure(run, 1e-3, 1e-5, transient=ends))


def limited(table: str = LIMITS) -> tuple[Scenario, list[Flight]]:
    """The short scenario with such a table, and its flights with their metrics."""
    head, rest = flown.text().split("[[law]]", 1)
    scenario = parse(f"{head}{table}[[law]]{rest}", "test")
    flights: list[Flight] = []
    for flight in flown.flights():
        metrics = flight.metrics | against_limits(flight.recording, scenario.table.transient)
        flights.append(replace(flight, metrics=metrics))
    return scenario, flights


def test_limits_that_are_not_given_are_null_and_kept() -> None:
    _, flights = limited("[transient]\n")
    found = flights[0].metrics
    assert (found["rate_limit"], found["acceleration_limit"], found["limits_kept"]) == (None, None, True)
    assert found["transient_time"] is None
    assert transient_text(flights[0]).startswith("transient does not end; peak rate")
    assert " of " not in transient_text(flights[0])


def test_an_end_that_is_reached_at_the_very_end_does_not_count() -> None:
    scenario, flights = limited()
    run = flights[0].recording
    time = flights[0].metrics["transient_time"]
    assert time is not None
    count = math.ceil(time / 0.1 / 0.95) + 1
    short = Recording({name: values[:count] for name, values in run.arrays.items()}, run.attrs)
    found = against_limits(short, scenario.table.transient)
    assert (found["transient_time"], found["cut_off"][-1]) == (None, "transient_time")


def test_the_plot_shows_norm_components_and_the_limits_that_matter() -> None:
    scenario, flights = limited()
    (plot,) = collect(flights, 2000, scenario).further
    assert plot.name == "transient"
    assert [panel.label for panel in plot.panels] == ["norm, deg/s", "x, deg/s²", "y, deg/s²", "z, deg/s²"]
    assert plot.panels[0].levels == pytest.approx((math.degrees(0.2),))
    assert plot.panels[1].levels == pytest.approx((-0.5, 0.5))
    assert plot.panels[0].curves[0][0] == pytest.approx(math.degrees(math.hypot(0.04, 0.03, 0.02)))
    far = limited(LIMITS.replace("0.2", "6"))[0]
    assert collect(flights, 2000, far).further[0].panels[0].levels == ()
    assert collect(flights, 2000, limited("[transient]\n")[0]).further[0].panels[1].levels == ()


def test_the_page_tells_every_law_against_the_limits() -> None:
    scenario, flights = limited()
    odd = [replace(flights[0], name="<b>odd</b>"), *flights[1:]]
    page = section(odd)
    assert "&lt;b&gt;odd&lt;/b&gt;" in page
    assert "<b>odd" not in page
    assert f"{math.degrees(flights[0].metrics['peak_rate']):.4g} of 11.46 deg/s" in page
    whole = render(scenario, flights)
    assert section(flights) in whole
    assert "largest component of the rate&#x27;s derivative" in whole
    assert "largest component of the rate" not in render(flown.scenario(), flown.flights())


def test_flights_without_limits_have_no_section() -> None:
    assert section(flown.flights()) == ""
    plots: Any = collect(flown.flights(), 2000, flown.scenario())
    assert plots.further == ()
