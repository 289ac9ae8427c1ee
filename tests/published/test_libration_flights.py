"""The published example near L2, flown: what it shows, what it misprints, and the same motion by another integrator."""

import math
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from starhold.laws.interface import NoMemory
from starhold.laws.point import PointMeasurement
from starhold.parts.actuators.limits import LIMITS
from starhold.parts.bodies.libration_point import linear, nonlinear
from starhold.scenario.reading import builtin_text, load, parse
from starhold.simulation.lane import fly, label
from starhold.studies.compare import build, compare, fly_law
from starhold.studies.flight import Flight
from tests.making import built
from tests.tiers import leading


@cache
def flown(name: str) -> dict[str, Flight]:
    """The flights of a built-in scenario by law."""
    scenario = load(name)
    return {flight.name: flight for flight in compare(scenario)}


def in_radii(flight: Flight, metric: str) -> float:
    """A length of the metrics in Earth diameters, the radius of the circle."""
    return flight.metrics[metric] / flight.recording.attrs["length_unit_m"]


@pytest.mark.parametrize(
    ("name", "radius", "x", "share"),
    [("deficit 5", (0.974, 1.007), 0.0137, 0.27), ("deficit 10", (0.918, 1.023), 0.0476, 0.40)],
)
def test_a_deficit_bends_the_circle_as_published(name, radius, x, share):
    flight = flown("l2-deficit")[name]
    assert flight.lost is None
    assert in_radii(flight, "radius_least") == pytest.approx(radius[0], abs=2e-3)
    assert in_radii(flight, "radius_most") == pytest.approx(radius[1], abs=2e-3)
    assert in_radii(flight, "largest_x") == pytest.approx(x, rel=0.03)
    assert flight.metrics["limit_share"] == pytest.approx(share, abs=0.01)


def test_ten_years_in_the_full_problem():
    flights = flown("l2-nonlinear")
    linear, full = flights["linear model"], flights["full model"]
    for flight in (linear, full):
        assert flight.lost is None
        assert flight.recording["time"][-1] == pytest.approx(20.0 * math.pi, rel=1e-3)
        assert flight.metrics["limit_share"] == 0.0
        assert flight.metrics["deviation"] < 7e3
        assert flight.metrics["effort_per_year"] == pytest.approx(38.1, abs=0.1)
    # The linear law stands off the plane of the circle by what the field has beyond first order.
    assert linear.metrics["largest_x"] == pytest.approx(56e3, rel=0.03)
    assert full.metrics["largest_x"] < 3e3


def test_rest_is_kept_within_the_separatrices_and_lost_beyond():
    flights = flown("l2-equilibrium")
    scenario = load("l2-equilibrium")
    steep = 1.0 + 2.0 * scenario.craft.stiffness
    for name, flight in flights.items():
        saddle = scenario.pick(name).options.limit / steep
        assert (flight.lost is None) == (saddle > scenario.table.initial.position[0])
        assert np.abs(flight.recording["control"]).max() <= scenario.pick(name).options.limit * (1.0 + 1e-12)
    assert flights["beside Y"].metrics["settling_time"] < 150 * 86400
    # Beside Y the feed-forward is C - 1, beside Z it is C.
    assert flights["beside Z"].metrics["effort_per_year"] > 1.3 * flights["beside Y"].metrics["effort_per_year"]


def test_the_steepest_descent_of_the_published_v_stops_on_a_wrong_circle():
    """Its V' is zero where y' = -rate z and z' = rate y, whatever the radius."""
    text = builtin_text("l2-circle").replace("boundary_layer = 0.005", "boundary_layer = 0.005\npull = 1e-9")
    scenario = parse(text, "greedy")
    entry = scenario.pick("l2-optimal")
    assert in_radii(fly_law(scenario, entry, build(scenario, entry)), "deviation") > 0.2


PAIRS = {"l2-circle": "smooth", "l2-deficit": "deficit 10", "l2-nonlinear": "full model", "l2-equilibrium": "beside Y"}


@pytest.mark.parametrize(("scenario_name", "law"), leading(PAIRS.items(), 3))
def test_scipy_flies_the_same_in_the_limit_of_small_periods(scenario_name, law):
    loop = built(scenario_name, law)
    plant, length = loop.craft, 1.2 * math.pi
    motion = linear if loop.has("linear-gravity") else nonlinear
    limit, size = LIMITS[loop.limit], loop.saturation_limit()

    def slope(_, state):
        position, velocity = tuple(state[:3]), tuple(state[3:])
        command, _memory = loop.law.command(PointMeasurement(position, velocity, 1e-3, size), loop.gains, plant, NoMemory())
        return [*velocity, *np.add(motion(position, velocity, plant), limit(command, size))]

    start = [*loop.start.position, *loop.start.velocity]
    smooth = solve_ivp(slope, (0.0, length), start, method="DOP853", rtol=1e-10, atol=1e-12, max_step=0.02).y[:, -1]
    errors = []
    for steps in (2000, 4000, 8000):
        scaled = replace(loop, period=length / steps)
        run = label(scaled, *fly(scaled, steps, steps), steps)
        errors.append(float(np.abs(np.concatenate([run["position"][-1], run["velocity"][-1]]) - smooth).max()))
    # A control that is held is late by half a period: the error is of first order in it.
    assert errors[2] < 3e-3
    for wide, narrow in pairwise(errors):
        assert wide / narrow == pytest.approx(2.0, rel=0.12)
