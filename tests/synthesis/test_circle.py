"""What a circle about a libration point asks of control and sail: formulas against the equations of motion."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize, minimize_scalar

from starhold.algebra.vector import norm
from starhold.parts.bodies.libration_point import EARTH_DIAMETER, PRIMARIES, linear, nonlinear
from starhold.synthesis.circle import Station, best_rate, demand, peak_required, rates_held, required, time_on_limit

PAIR = PRIMARIES["sun-earth"]
PLANT = PAIR.point()
PUBLISHED = PLANT._replace(stiffness=3.94)
HERE = Station(PAIR, "L2", EARTH_DIAMETER)
CLEAR = Station(PAIR, "L2", 2.0e7)

rates = st.floats(0.0, 4.0)


@pytest.mark.parametrize("radius", [0.5, 1.0, 3.0])
def test_the_best_rate_and_the_peak_demand_by_optimisation(radius):
    """Over the phase of the circle and its rate, with nothing but the equations of motion."""

    def peak(rate):
        around = [norm(required(phase, rate, radius, PUBLISHED)) for phase in np.linspace(0.0, 2.0 * math.pi, 721)]
        start = 2.0 * math.pi * int(np.argmax(around)) / 720.0
        best = minimize(lambda x: -norm(required(float(x[0]), rate, radius, PUBLISHED)), [start], tol=1e-12)
        return -best.fun

    found = minimize_scalar(peak, bounds=(0.1, 3.0), method="bounded", options={"xatol": 1e-8})
    assert found.x == pytest.approx(best_rate(PUBLISHED), abs=1e-4)
    assert found.fun == pytest.approx(3.429 * radius, abs=5e-4 * radius)


@given(rates, st.sampled_from(["sun-earth", "sun-jupiter", "earth-moon"]), st.sampled_from(["L1", "L2"]))
@settings(max_examples=20)
def test_the_peak_demand_at_any_rate(rate, name, point):
    plant = PRIMARIES[name].point(point)
    assert peak_required(rate, 2.0, plant) == pytest.approx(2.0 * demand(rate, plant), rel=1e-12)
    assert demand(rate, plant) >= demand(best_rate(plant), plant) * (1.0 - 1e-15)


def test_at_l3_no_rate_is_best():
    with pytest.raises(ValueError, match="no rate is best here"):
        best_rate(PAIR.point("L3"))


@given(st.floats(1.0001, 3.0))
def test_rates_that_are_held(share):
    resource = share * demand(best_rate(PLANT), PLANT)
    low, high = rates_held(resource, PLANT)
    assert demand(high, PLANT) == pytest.approx(resource)
    assert low < best_rate(PLANT) < high
    if low > 0.0:
        assert demand(low, PLANT) == pytest.approx(resource)
    assert rates_held(0.999 * demand(best_rate(PLANT), PLANT), PLANT) is None


@given(st.floats(0.0, 1.2), st.floats(0.3, 3.0))
@settings(max_examples=25)
def test_time_on_the_limit_by_going_round(share, rate):
    resource = share * demand(rate, PLANT)
    phases = (np.arange(2000) + 0.5) * (2.0 * math.pi / 2000)
    above = np.mean([norm(required(phase, rate, 1.0, PLANT)) > resource for phase in phases.tolist()])
    assert time_on_limit(resource, rate, PLANT) == pytest.approx(above, abs=3e-3)


def test_in_the_full_problem_a_circle_of_earth_size_asks_for_one_percent_more():
    assert HERE.peak_full(linear) == pytest.approx(HERE.peak(), rel=1e-12)
    assert HERE.peak_full(nonlinear) / HERE.peak() - 1.0 == pytest.approx(0.0108, abs=1e-4)
    small = Station(PAIR, "L2", 1e3, full_pressure=1.0)
    assert small.peak_full(nonlinear) == pytest.approx(small.peak(), rel=1e-5)


def test_area_per_kilogram_as_published():
    """0.6 to 1 m2/kg: of a mirror 0.5, and in inverse proportion to the reflectivity."""
    plain = Station(PAIR, "L2", 2.0e7, full_pressure=4.5e-6)
    per_diameter = [plain.area_per_mass(specular=part) * EARTH_DIAMETER / 2.0e7 for part in (1.0, 0.83, 0.5)]
    assert per_diameter == pytest.approx([0.5, 0.6, 1.0], rel=0.01)
    assert HERE.margin(HERE.area_per_mass() * 300.0, 300.0) == pytest.approx(1.0)
    assert HERE.period() / 86400.0 == pytest.approx(365.2568 / 1.39303, rel=1e-5)
    assert HERE.pressure == pytest.approx(0.987 * 4.45e-6, rel=1e-3)


def test_the_light_at_the_earth():
    """The Earth's disc is a little smaller there than the Sun's, so its diameter is not quite enough for the whole Sun."""
    assert HERE.light(0.0) == pytest.approx(0.158, abs=1e-3)
    assert HERE.light(EARTH_DIAMETER) == pytest.approx(0.987, abs=1e-3)
    assert HERE.clear_radius == pytest.approx(1.3447e7, rel=1e-3)
    assert HERE.light(HERE.clear_radius) == pytest.approx(1.0, abs=1e-9)
    assert HERE.light(0.99 * HERE.clear_radius) < 1.0
    between = Station(PAIR, "L1", EARTH_DIAMETER)
    assert between.light(0.0) == 1.0
    assert between.clear_radius == 0.0


@pytest.mark.parametrize("missing", [-0.2, -0.05, 0.0, 0.02, 0.05, 0.1, 0.5])
@pytest.mark.parametrize("station", [HERE, CLEAR])
def test_what_a_deficit_leaves(station, missing):
    left = station.deficit(missing)
    share = 1.0 - missing
    assert left.radius == pytest.approx(share * station.radius)
    assert left.light == station.light(left.radius)
    assert (left.rates is None) == (missing > 0.0)
    assert (left.on_limit > 0.0) == (missing > 0.0)

    def spare(radius):
        return share * station.light(radius) / station.light(station.radius) - radius / station.radius

    assert spare(left.radius_dimmed) == pytest.approx(0.0, abs=1e-9)
    above = np.linspace(left.radius_dimmed * 1.0001, 3.0 * station.radius, 400).tolist()
    assert max(spare(radius) for radius in above) < 0.0
