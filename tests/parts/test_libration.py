"""Motion near libration points: against published numbers, many digits, and the three-body problem in inertial axes."""

import math

import mpmath
import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from starhold.algebra.vector import ZERO, add, scale
from starhold.parts.bodies.libration_point import (
    EARTH_DIAMETER,
    POINTS,
    PRIMARIES,
    Libration,
    PointState,
    linear,
    make_libration,
    motion,
    nonlinear,
)
from tests.algebra.readers import components, symbols, vanishes

EARTH_L2 = PRIMARIES["sun-earth"].point()
POINTS_OF_ALL = [(name, point) for name in PRIMARIES for point in POINTS]

places = st.tuples(components, components, components)
sizes = st.floats(-9.0, 4.0).map(lambda e: 10.0**e)


@pytest.mark.parametrize(
    ("name", "point", "distance", "stiffness"),
    [
        # D. L. Richardson, Analytic Construction of Periodic Orbits about the Collinear Points, 1980.
        ("sun-earth", "L1", -0.01001090475, 4.0610735668),
        ("sun-earth", "L2", 0.01007824, 3.940522),
        # W. S. Koon, M. W. Lo, J. E. Marsden, S. D. Ross, Dynamical Systems, the Three-Body Problem and Mission Design.
        ("earth-moon", "L1", -0.15093, 5.1476),
        ("earth-moon", "L2", 0.16783, 3.1904),
        ("earth-moon", "L3", -1.99291, 1.0107),
    ],
)
def test_points_and_stiffness_as_published(name, point, distance, stiffness):
    pair = PRIMARIES[name]
    plant = pair.point(point)
    assert plant.from_smaller * EARTH_DIAMETER / pair.separation == pytest.approx(distance, rel=3e-5)
    assert plant.stiffness == pytest.approx(stiffness, rel=2e-5)
    assert plant.rate == 1.0


@pytest.mark.parametrize(("name", "days"), [("sun-earth", 365.256), ("sun-mars", 686.98), ("sun-jupiter", 4332.6)])
def test_periods(name, days):
    assert PRIMARIES[name].period == pytest.approx(86400.0 * days, rel=1e-4)


@pytest.mark.parametrize("point", POINTS)
@pytest.mark.parametrize("ratio", [1.0, 0.3, 1e-2, 3e-6, 1e-12])
def test_every_digit_of_the_place(point, ratio):
    with mpmath.workdps(60):
        part = mpmath.mpf(ratio) / (1 + mpmath.mpf(ratio))

        def unbalanced(x):
            return x - (1 - part) * (x + part) / abs(x + part) ** 3 - part * (x - 1 + part) / abs(x - 1 + part) ** 3

        plant = make_libration(1.0, ratio, 1.0, point, 1.0)
        x = mpmath.findroot(unbalanced, 1 - part + mpmath.mpf(plant.from_smaller))
        stiffness = (1 - part) / abs(x + part) ** 3 + part / abs(x - 1 + part) ** 3
        assert plant.from_smaller == pytest.approx(float(x - 1 + part), rel=5e-16)
        assert plant.from_larger == pytest.approx(float(x + part), rel=5e-16)
        assert plant.stiffness == pytest.approx(float(stiffness), rel=3e-15)
        assert plant.stiffness > 1.0


def test_only_the_ratio_of_the_masses_and_the_unit_of_length_count():
    pair = PRIMARIES["earth-moon"]
    other = make_libration(1e-11 * pair.larger, 1e-11 * pair.smaller, 1.0, "L2", EARTH_DIAMETER / pair.separation)
    assert other == pytest.approx(pair.point("L2"), rel=1e-14)


@pytest.mark.parametrize(("name", "point"), POINTS_OF_ALL)
def test_nothing_acts_at_the_point_itself(name, point):
    plant = PRIMARIES[name].point(point)
    assert nonlinear(ZERO, ZERO, plant) == linear(ZERO, ZERO, plant) == ZERO


@pytest.mark.parametrize(("name", "point"), POINTS_OF_ALL)
@given(places.filter(lambda v: math.hypot(*v) > 1e-3), sizes)
@settings(max_examples=20)
def test_full_accuracy_at_any_distance(name, point, direction, size):
    """Against the plain formula in 80 digits."""
    plant = PRIMARIES[name].point(point)
    position = scale(size, direction)
    with mpmath.workdps(80):
        r = [mpmath.mpf(x) for x in position]
        acceleration = [r[0], r[1], mpmath.mpf(0)]
        for distance, pull in ((plant.from_larger, plant.pull_larger), (plant.from_smaller, plant.pull_smaller)):
            d = mpmath.mpf(distance)
            mass, away = mpmath.mpf(pull) * abs(d) ** 3, mpmath.sqrt((d + r[0]) ** 2 + r[1] ** 2 + r[2] ** 2)
            for i, here in enumerate((d + r[0], r[1], r[2])):
                acceleration[i] -= mass * here / away**3 - (pull * d if i == 0 else 0)
        room = 3e-14 * float(mpmath.norm(acceleration) + mpmath.norm(r))
        for found, true in zip(nonlinear(position, ZERO, plant), acceleration, strict=True):
            assert abs(found - float(true)) <= room


def test_the_linear_model_is_the_derivative_of_the_nonlinear_one():
    r, v = symbols("x y z"), symbols("u v w")
    larger, smaller = sympy.symbols("l s", positive=True)
    a, b = sympy.symbols("a b", real=True, nonzero=True)
    rate = sympy.symbols("Omega", positive=True)
    plant = Libration(rate, larger + smaller, a, b, larger, smaller)
    rest = dict.fromkeys((*r, *v), 0)
    for full, simple in zip(nonlinear(r, v, plant), linear(r, v, plant), strict=True):
        derived = sum(sympy.diff(full, x).subs(rest) * x for x in (*r, *v))
        assert vanishes(derived - simple)


def flown(field, plant, position, velocity, until, **settings):
    def rates(time, x):
        return [*x[3:], *field(tuple(x[:3].tolist()), tuple(x[3:].tolist()), plant)]

    return solve_ivp(rates, (0.0, until), [*position, *velocity], method="DOP853", rtol=1e-13, atol=1e-13, **settings)


@pytest.mark.parametrize(("name", "point"), [("earth-moon", "L1"), ("earth-moon", "L3"), ("sun-earth", "L2")])
def test_the_three_body_problem_in_inertial_axes(name, point):
    """Two bodies on circles, the craft drawn by both by Newton's law; lengths in units of the separation."""
    pair = PRIMARIES[name]
    plant = make_libration(pair.larger, pair.smaller, 1.0, point, 1.0)
    share = pair.smaller / (pair.larger + pair.smaller)
    origin = plant.from_larger - share
    size = 0.1 * abs(plant.from_smaller)
    position, velocity, until = scale(size, (0.3, -0.5, 0.4)), scale(size, (0.2, 0.6, -0.3)), 2.0

    def turned(angle, v):
        c, s = math.cos(angle), math.sin(angle)
        return np.array([c * v[0] - s * v[1], s * v[0] + c * v[1], v[2]])

    def rates(time, x):
        bodies = (1.0 - share, turned(time, (-share, 0.0, 0.0))), (share, turned(time, (1.0 - share, 0.0, 0.0)))
        pull = sum(-mass * (x[:3] - place) / np.linalg.norm(x[:3] - place) ** 3 for mass, place in bodies)
        return [*x[3:], *pull]

    place = add(position, (origin, 0.0, 0.0))
    start = [*place, *add(velocity, (-place[1], place[0], 0.0))]
    end = solve_ivp(rates, (0.0, until), start, method="DOP853", rtol=1e-13, atol=1e-15).y[:3, -1]
    ours = flown(nonlinear, plant, position, velocity, until).y[:3, -1]
    assert turned(-until, end) - [origin, 0.0, 0.0] == pytest.approx(ours, abs=1e-8 * size)


def test_units():
    units = PRIMARIES["sun-earth"].units()
    assert units.length == EARTH_DIAMETER
    assert 2.0 * math.pi * units.time == pytest.approx(365.256 * 86400.0, rel=1e-4)
    assert units.acceleration * units.time**2 == pytest.approx(units.velocity * units.time) == pytest.approx(EARTH_DIAMETER)
    # Half a day; the 0.0014 of the published study counts years, not its own unit of time.
    assert 12.0 * 3600.0 / units.time == pytest.approx(0.0086, abs=5e-5)
    assert 12.0 * 3600.0 / PRIMARIES["sun-earth"].period == pytest.approx(0.0014, abs=5e-5)


def test_the_control_pushes_and_lags():
    state = PointState(ZERO, ZERO, (1.0, 0.0, 0.0))
    assert motion(state, linear(ZERO, ZERO, EARTH_L2), (-2.0, 4.0, 0.0)) == (ZERO, (1.0, 0.0, 0.0), (-2.0, 4.0, 0.0))
    assert motion(state, (0.5, 0.0, 1.0), None) == (ZERO, (1.5, 0.0, 1.0), None)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ((0.0, 1.0, 1.0), "larger mass must be positive"),
        ((1.0, math.nan, 1.0), "smaller mass must be positive"),
        ((1.0, 0.5, math.inf), "separation must be positive"),
        ((1.0, 0.5, 1.0, "L2", 0.0), "length must be positive"),
        ((1.0, 2.0, 1.0), "larger mass comes first"),
        ((1.0, 0.5, 1.0, "L4"), "L1, L2, L3, not L4"),
    ],
)
def test_what_is_no_pair_is_refused(given, said):
    with pytest.raises(ValueError, match=said):
        make_libration(*given)
