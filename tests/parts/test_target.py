"""Targets: the orbital frame and tabulated attitudes, whose rates must be the derivatives of the attitudes they give."""

import math

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from starhold.algebra.quaternion import NO_TURN, derivative, relative, stretch, to_body, to_reference
from starhold.algebra.structure import move
from starhold.algebra.structured import Buffer
from starhold.algebra.vector import ZERO, cross, dot, scale, unit
from starhold.parts.craft import EARTH, make_craft
from starhold.parts.roles import Goal
from starhold.parts.targets.history import tabulate
from tests.algebra.readers import agree, angles, close, directions, from_axis_angle, quaternions, same
from tests.equations import history, inertial, orbital, two_body

CRAFT = make_craft([1.0, 1.0, 1.0])


def turn_between(p, q):
    """The rotation vector from attitude p to attitude q, in the axes of either (it is their common axis)."""
    error = relative(p, q)
    v, sign = np.array(error[1:]), math.copysign(1.0, error[0])
    size = float(np.linalg.norm(v))
    return 2.0 * math.atan2(size, abs(error[0])) / size * sign * v


def orbit(eccentricity, anomaly, axis, lean, size=7.0e6):
    """Position and velocity at a true anomaly on an orbit of semi-latus rectum `size`, in any plane."""
    speed = math.sqrt(EARTH / size)
    c, s = math.cos(anomaly), math.sin(anomaly)
    r = size / (1.0 + eccentricity * c)
    plane = from_axis_angle(axis, lean)
    return to_reference(plane, (r * c, r * s, 0.0)), to_reference(plane, (-speed * s, speed * (eccentricity + c), 0.0))


def fly(position, velocity, h):
    """Two-body motion for a time h that is short against the period: one Runge-Kutta step."""

    def slope(s):
        return s[1], two_body(s[0], NO_TURN, CRAFT)[0]

    s = (position, velocity)
    a = slope(s)
    b = slope(move(s, 0.5 * h, a))
    c = slope(move(s, 0.5 * h, b))
    d = slope(move(s, h, c))
    return move(move(move(move(s, h / 6, a), h / 3, b), h / 3, c), h / 6, d)


orbits = st.builds(orbit, st.just(0.0) | st.floats(0.0, 0.8), st.floats(0.0, 2.0 * math.pi), directions, angles)


@settings(max_examples=20)
@given(orbits, quaternions)
def test_every_reader_gives_the_same(place, before):
    position, velocity = place
    agree(inertial, before, position, velocity, 3, before)
    same(orbital, None, position, velocity, 3, before)


@given(quaternions, orbits)
def test_inertial_target_rests(fixed, place):
    assert inertial(fixed, *place, 0, NO_TURN) == Goal(fixed, ZERO, ZERO)


@given(orbits)
def test_orbital_axes_point_where_they_should(place):
    position, velocity = place
    attitude = orbital(None, position, velocity, 0, NO_TURN).attitude
    first, second, third = (to_reference(attitude, axis) for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1)))
    assert close(third, scale(-1.0, unit(position)), 2e-15)
    assert close(second, scale(-1.0, unit(cross(position, velocity))), 4e-15)
    assert close(first, cross(second, third), 4e-15)
    assert dot(first, velocity) > 0.0
    assert abs(sum(c * c for c in attitude) - 1.0) < 2e-15
    # The vehicle's own view: the centre of attraction straight ahead on the third axis.
    assert close(to_body(attitude, unit(position)), (0.0, 0.0, -1.0), 4e-15)
    assert abs(to_body(attitude, velocity)[1]) < 1e-14 * math.hypot(*velocity)


@given(orbits)
def test_orbital_rate_and_acceleration_are_derivatives_of_the_attitude(place):
    position, velocity = place
    h = 1.0
    here = orbital(None, position, velocity, 0, NO_TURN)
    ahead = orbital(None, *fly(position, velocity, h), 0, here.attitude)
    behind = orbital(None, *fly(position, velocity, -h), 0, here.attitude)
    n = math.hypot(*here.rate)
    # Central differences err by terms of the size of (n h)2, about 1e-6.
    central = turn_between(behind.attitude, ahead.attitude) / (2.0 * h)
    np.testing.assert_allclose(here.rate, central, rtol=0.0, atol=30.0 * n * (n * h) ** 2 + 1e-15)
    change = (np.array(ahead.rate) - np.array(behind.rate)) / (2.0 * h)
    np.testing.assert_allclose(here.acceleration, change, rtol=0.0, atol=100.0 * n**2 * (n * h) ** 2 + 1e-18)
    slope = (np.array(ahead.attitude) - np.array(behind.attitude)) / (2.0 * h)
    np.testing.assert_allclose(derivative(here.attitude, here.rate), slope, atol=30.0 * n * (n * h) ** 2 + 1e-15)


@given(orbits)
def test_orbital_rate_is_keplers(place):
    # h/r2 about the orbit normal; the areal velocity r2 w is that of the semi-latus rectum.
    position, velocity = place
    found = orbital(None, position, velocity, 0, NO_TURN)
    assert -found.rate[1] * dot(position, position) == pytest.approx(math.sqrt(EARTH * 7.0e6), rel=1e-13)
    assert (found.rate[0], found.rate[2], found.acceleration[0], found.acceleration[2]) == (0.0, 0.0, 0.0, 0.0)


def test_orbital_acceleration_exactly():
    # d(h/r2)/dt = -2 h (r.v)/r4 along two-body motion, in which h is constant.
    r, v = sympy.symbols("x y z", real=True), sympy.symbols("u v w", real=True)
    mu = sympy.symbols("mu", positive=True)
    r2 = dot(r, r)
    pull = scale(-mu / r2 ** sympy.Rational(3, 2), r)
    h = cross(r, v)
    rate = sympy.sqrt(dot(h, h)) / r2
    change = sum(sympy.diff(rate, x) * d for x, d in zip((*r, *v), (*v, *pull), strict=True))
    assert sympy.simplify(change + 2 * rate * dot(r, v) / r2) == 0


@given(orbits, quaternions)
def test_orbital_continues_the_attitude_it_is_given(place, before):
    found = orbital(None, *place, 0, before).attitude
    other = orbital(None, *place, 0, stretch(-1.0, found)).attitude
    assert sum(x * y for x, y in zip(found, before, strict=True)) >= -1e-15
    assert other == stretch(-1.0, found)


def test_orbital_does_not_jump_all_the_way_round():
    before, first = NO_TURN, None
    for anomaly in np.linspace(0.0, 2.0 * math.pi, 721):
        attitude = orbital(None, *orbit(0.3, anomaly, (1.0, 2.0, 3.0), 1.1), 0, before).attitude
        first = first or attitude
        assert close(attitude, before, 0.01) or before == NO_TURN
        before = attitude
    # One turn of the frame is half a turn of the quaternion: it ends opposite to where it began.
    assert close(before, stretch(-1.0, first), 1e-12)


def tumble(seed, count=9, step=0.5):
    """Times and attitudes of a motion with turns of up to a radian between them, of arbitrary signs."""
    generator = np.random.default_rng(seed)
    times = np.cumsum(generator.uniform(0.5, 1.5, count))
    attitude, attitudes = Rotation.random(rng=generator), []
    for turn in generator.normal(scale=step, size=(count, 3)):
        attitude = attitude * Rotation.from_rotvec(turn)
        attitudes.append(attitude.as_quat(scalar_first=True) * generator.choice([-1.0, 1.0]))
    return times, np.array(attitudes)


seeds = st.integers(0, 2**32 - 1)


def same_attitude(p, q, tolerance):
    return close(tuple(p), tuple(q), tolerance) or close(stretch(-1.0, tuple(p)), tuple(q), tolerance)


@settings(max_examples=30)
@given(seeds)
def test_table_passes_through_its_points(seed):
    times, attitudes = tumble(seed)
    rows = tabulate(times, attitudes, times)
    assert rows.shape == (len(times), 10)
    assert rows.flags["C_CONTIGUOUS"]
    for row, attitude in zip(rows, attitudes, strict=True):
        assert same_attitude(row[:4], attitude, 1e-12)


@settings(max_examples=30)
@given(seeds, st.floats(0.01, 0.99))
def test_table_rates_are_derivatives_of_its_attitudes(seed, share):
    # In target axes: the turn from one row to the next is measured in the axes that turn.
    times, attitudes = tumble(seed)
    h = 1e-4
    for middle in (times[0] + share * (times[-1] - times[0]), 0.5 * (times[3] + times[4])):
        rows = tabulate(times, attitudes, [middle - h, middle, middle + h])
        rate, acceleration = rows[1, 4:7], rows[1, 7:]
        central = turn_between(tuple(rows[0, :4]), tuple(rows[2, :4])) / (2.0 * h)
        np.testing.assert_allclose(rate, central, rtol=0.0, atol=1e-5)
        # The acceleration is continuous, its slope is not: over a point of the table the difference is of first order.
        change = (rows[2, 4:7] - rows[0, 4:7]) / (2.0 * h)
        np.testing.assert_allclose(acceleration, change, rtol=0.0, atol=5e-3)
        slope = (rows[2, :4] - rows[0, :4]) / (2.0 * h)
        np.testing.assert_allclose(derivative(tuple(rows[1, :4]), tuple(rate)), slope, rtol=0.0, atol=1e-5)
        # The same rate in reference axes would not do.
        aside = to_reference(tuple(rows[1, :4]), tuple(rate))
        assert not close(aside, tuple(central), 1e-4)


def test_table_of_a_coning_motion():
    # q(t) = turn about z by a t, then about the new x by a constant: the rate is constant in target axes.
    times = np.linspace(0.0, 20.0, 201)
    lean = from_axis_angle((1.0, 0.0, 0.0), 0.7)
    rate = 0.3
    attitudes = [
        (Rotation.from_rotvec([0, 0, rate * t]) * Rotation.from_quat(lean, scalar_first=True)).as_quat(scalar_first=True)
        for t in times
    ]
    rows = tabulate(times, attitudes, np.linspace(5.0, 15.0, 37))
    expected = to_body(lean, (0.0, 0.0, rate))
    np.testing.assert_allclose(rows[:, 4:7], np.tile(expected, (37, 1)), atol=1e-6)
    np.testing.assert_allclose(rows[:, 7:], 0.0, atol=1e-4)


@settings(max_examples=30)
@given(seeds)
def test_table_has_no_jumps_and_starts_on_the_side_it_is_given(seed):
    times, attitudes = tumble(seed)
    rows = tabulate(times, attitudes, np.linspace(times[0], times[-1], 400))
    # Of q and -q the first attitude given is kept, as the fixed attitude of an inertial target is.
    np.testing.assert_allclose(rows[0, :4], attitudes[0], atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(rows[:, :4], axis=1), 1.0, atol=1e-14)
    assert (np.sum(rows[1:, :4] * rows[:-1, :4], axis=1) > 0.9).all()


def test_table_goes_through_full_turns():
    times = np.linspace(0.0, 10.0, 41)
    attitudes = Rotation.from_rotvec(np.outer(times, [0.0, 0.0, 4.0 * math.pi / 10.0])).as_quat(scalar_first=True)
    rows = tabulate(times, attitudes, np.linspace(0.0, 10.0, 101))
    np.testing.assert_allclose(rows[50, :4], (-1.0, 0.0, 0.0, 0.0), atol=1e-12)
    np.testing.assert_allclose(rows[-1, :4], (1.0, 0.0, 0.0, 0.0), atol=1e-12)
    np.testing.assert_allclose(rows[:, 4:7], np.tile((0.0, 0.0, 0.4 * math.pi), (101, 1)), atol=1e-10)


@pytest.mark.parametrize(
    "samples", [[-0.1, 1.0], [0.0, 10.1], [-1.0], [11.0], [1.0, 12.0, 3.0], [1.0, -2.0, 3.0], [1.0, math.nan, 2.0]]
)
def test_times_not_covered_are_refused(samples):
    times, attitudes = np.linspace(0.0, 10.0, 5), [NO_TURN] * 5
    with pytest.raises(ValueError, match="the target history covers 0 to 10 s"):
        tabulate(times, attitudes, samples)


@pytest.mark.parametrize(
    ("times", "attitudes"),
    [
        ([0.0, 2.0, 1.0, 3.0], [NO_TURN] * 4),
        ([0.0, 1.0, 1.0, 3.0], [NO_TURN] * 4),
        ([0.0, 1.0, 3.0], [NO_TURN] * 4),
        ([0.0, 1.0, 3.0], [NO_TURN, (0.0, 0.0, 0.0, 0.0), NO_TURN]),
        ([0.0, 1.0, 3.0], [NO_TURN, (math.nan, 0.0, 0.0, 1.0), NO_TURN]),
    ],
)
def test_tables_that_mean_nothing_are_refused(times, attitudes):
    with pytest.raises(ValueError, match=r"."):
        tabulate(times, attitudes, [0.0, 0.5])


@settings(max_examples=10)
@given(seeds, st.integers(0, 19))
def test_history_reads_the_row_of_the_step(seed, step):
    times, attitudes = tumble(seed)
    table = tabulate(times, attitudes, np.linspace(times[0], times[-1], 20))
    found = history(Buffer(table.ravel().tolist()), ZERO, ZERO, step, None)
    assert list(found.attitude + found.rate + found.acceleration) == table[step].tolist()
    assert type(found) is Goal
