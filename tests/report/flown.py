"""Flights for the tests of the report: short runs of built-in scenarios."""

from __future__ import annotations

from functools import cache

import numpy as np
import xarray as xr

from starhold.analysis.metrics import measure
from starhold.report.flight import Flight
from starhold.scenario.building import build
from starhold.scenario.reading import Scenario, builtin_text, parse
from starhold.simulation.lane import simulate

HOSTILE = '</script><script>alert("ruse")</script><b>$x_1$ & co'


@cache
def text() -> str:
    """Twenty seconds of the three laws without the predictive one."""
    return builtin_text("three-laws").split('[[law]]\ntype = "mpc"')[0].replace("duration = 600.0", "duration = 20.0")


def scenario(name: str = "three-laws", description: str = "A turn & a <half>") -> Scenario:
    """The short scenario under another name and description."""
    head, rest = text().split("[spacecraft]", 1)
    assert 'name = "three-laws"' in head
    return parse(f"name = '{name}'\ndescription = '{description}'\n[spacecraft]{rest}", "test")


@cache
def flights() -> tuple[Flight, ...]:
    """The laws of the short scenario, flown."""
    found = scenario()
    table = found.table
    made: list[Flight] = []
    for entry in found.laws:
        run = simulate(build(found, entry), table.simulation.steps, table.simulation.record_every).load()
        metrics = measure(run, table.settling.attitude_tolerance, table.settling.rate_tolerance)
        made.append(Flight(entry.name, entry.law.name, run, metrics, {"k_rate": "0.09 N m s", "reach": "<5> mN m"}))
    return tuple(made)


def lost(name: str = "wild") -> Flight:
    """A run that ends after a third of the others' time, faster and faster."""
    first = flights()[0]
    run: xr.Dataset = first.run.isel(time=slice(0, 67)).copy(deep=True)
    run["rate_error"].values[:] = np.exp(np.linspace(0.0, 20.0, 67))[:, None]
    run.attrs["diverged_at"] = 6.7
    return Flight(name, "pd", run, measure(run, 2e-3, 1e-3), {})


def still() -> Flight:
    """A run at rest on target: all errors and torques are zero."""
    first = flights()[0]
    run: xr.Dataset = first.run.copy(deep=True)
    run["attitude_error"].values[:] = (1.0, 0.0, 0.0, 0.0)
    run["rate_error"].values[:] = 0.0
    run["torque"].values[:] = 0.0
    return Flight("still", "pd", run, measure(run, 2e-3, 1e-3), {})


def renamed(flight: Flight, name: str) -> Flight:
    """The same flight under another name."""
    return Flight(name, flight.law, flight.run, flight.metrics, flight.gains)
