"""Reaction wheels: allocation against linear algebra and linear programs, motion against the conservation laws."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from starhold.parts.craft import bare_inertia
from starhold.parts.effectors.layouts import nasa_standard, pyramid, three_orthogonal
from starhold.parts.effectors.wheel_units import WHEEL_UNITS
from starhold.parts.effectors.wheels import (
    BAND,
    CREEP,
    allocate,
    allocate_peak,
    axial_inertia,
    lose,
    make_wheels,
    motor,
    with_facets,
)
from tests.making import HUB, flown, hub, rotors
from tests.tiers import fewer, leading

finite = st.floats(-1.0, 1.0)
torques = st.tuples(finite, finite, finite)
HEXAGON = tuple((math.cos(a), math.sin(a), 0.7) for a in np.arange(6) * math.pi / 3.0)
DEGENERATE = {
    "four in a plane": (*three_orthogonal(), (1.0, 1.0, 0.0), (1.0, -2.0, 0.0)),
    "two planes": (*three_orthogonal(), (1.0, 1.0, 0.0), (0.0, 1.0, 1.0), (1.0, 2.0, 1.0)),
    "doubled": three_orthogonal() * 2,
    "opposed": (*three_orthogonal(), (-1.0, 0.0, 0.0), (0.0, 0.0, 2.0)),
    "doubled in a plane": (*three_orthogonal(), (1.0, 1.0, 0.0), (1.0, 0.0, 0.0), (-1.0, -1.0, 0.0)),
    "nearly parallel": (*three_orthogonal(), (1.0, 1e-5, 0.0), (1.0, 1.0, 1e-6)),
}
LAYOUTS = {"orthogonal": three_orthogonal(), "pyramid": pyramid(), "nasa": nasa_standard(), "hexagon": HEXAGON, **DEGENERATE}


def simple(axes, **more):
    return with_facets(make_wheels(axes, **{"inertia": 0.01, "torque_limit": 0.1, "momentum_limit": 5.0} | more))


def random_axes(seed, count):
    return np.random.default_rng(seed).normal(size=(count, 3))


def random_wheels(seed, count):
    try:
        return simple(random_axes(seed, count))
    except ValueError:
        assume(False)
        raise


def least_peak(axes, torque):
    """The optimum of: minimise t, -sum a_i tau_i = torque, |tau_i| <= t."""
    n = len(axes)
    sides = np.vstack([np.hstack([np.eye(n), -np.ones((n, 1))]), np.hstack([-np.eye(n), -np.ones((n, 1))])])
    given_torque = np.hstack([-np.array(axes).T, np.zeros((3, 1))])
    found = linprog([0.0] * n + [1.0], sides, np.zeros(2 * n), given_torque, torque, (None, None), method="highs")
    assert found.success
    return found.fun


def total(taus, wheels):
    return -np.array(taus) @ np.array(wheels.axes)


@settings(max_examples=60)
@given(st.integers(0, 10**6), st.integers(3, 6), torques)
def test_least_squares_is_the_pseudoinverse(seed, count, torque):
    wheels = random_wheels(seed, count)
    taus = allocate(torque, wheels)
    matrix_ = np.array(wheels.axes).T
    room = 1e-14 * np.linalg.cond(matrix_) ** 2
    np.testing.assert_allclose(total(taus, wheels), torque, rtol=0.0, atol=room)
    np.testing.assert_allclose(taus, -np.linalg.pinv(matrix_) @ np.array(torque), rtol=0.0, atol=room)


@settings(max_examples=120)
@given(st.integers(0, 10**6), st.integers(3, 7), torques)
def test_least_peak_is_the_optimum_of_the_linear_program(seed, count, torque):
    assume(max(map(abs, torque)) > 1e-3)
    wheels = random_wheels(seed, count)
    taus = allocate_peak(torque, wheels)
    condition = np.linalg.cond(np.array(wheels.axes))
    np.testing.assert_allclose(total(taus, wheels), torque, rtol=0.0, atol=1e-13 * condition**2)
    assert max(map(abs, taus)) == pytest.approx(least_peak(wheels.axes, torque), rel=1e-7, abs=1e-9)


@pytest.mark.parametrize("layout", leading(LAYOUTS, 3))
def test_least_peak_of_special_layouts_is_least_odd_and_continuous(layout):
    wheels = simple(LAYOUTS[layout])
    signs = [np.array(s, dtype=float) for s in itertools.product((-1, 0, 1), repeat=3) if any(s)]
    some = [*signs, *random_axes(1, 60), *np.array(wheels.axes)]
    for torque in some:
        taus = allocate_peak(tuple(torque.tolist()), wheels)
        np.testing.assert_allclose(total(taus, wheels), torque, rtol=0.0, atol=1e-9 if "nearly" in layout else 1e-13)
        assert max(map(abs, taus)) == pytest.approx(least_peak(wheels.axes, torque), rel=1e-8)
    steepest = 1e6 if "nearly" in layout else 20.0
    for a, b in itertools.pairwise(random_axes(2, fewer(12, 4))):
        way = [tuple((a + (b - a) * s).tolist()) for s in np.linspace(0.0, 1.0, 400)]
        taus = np.array([allocate_peak(torque, wheels) for torque in way])
        assert np.abs(np.diff(taus, axis=0)).max() <= steepest * np.linalg.norm(b - a) / 400
        np.testing.assert_allclose(allocate_peak(tuple(-x for x in way[7]), wheels), -taus[7], rtol=0.0, atol=1e-12)


def test_where_the_peak_leaves_a_choice_the_next_largest_is_least_too():
    """A torque mostly along z, whose one wheel sets the peak: the four in the xy plane share the rest."""
    wheels = simple(DEGENERATE["four in a plane"])
    taus = allocate_peak((0.3, 0.1, 5.0), wheels)
    assert abs(taus[2]) == pytest.approx(5.0)
    flat = [0, 1, 3, 4]
    plane = np.vstack([np.array(wheels.axes)[flat] * (1.0, 1.0, 0.0), [[0.0, 0.0, 1.0]]])
    assert max(abs(taus[k]) for k in flat) == pytest.approx(least_peak(plane, (0.3, 0.1, 0.0)), rel=1e-9)


def test_parallel_wheels_share_alike():
    taus = allocate_peak((0.4, 0.0, 0.2), simple(DEGENERATE["doubled"]))
    assert taus == pytest.approx((-0.2, 0.0, -0.1, -0.2, 0.0, -0.1))
    taus = allocate_peak((0.4, 0.1, 0.2), simple(DEGENERATE["opposed"]))
    assert taus == pytest.approx((-0.2, -0.1, -0.1, 0.2, -0.1))


def test_layouts():
    axes = np.array(pyramid())
    np.testing.assert_allclose(axes.T @ axes, np.eye(3) * 4.0 / 3.0, atol=1e-15)
    for layout in (three_orthogonal(), pyramid(), pyramid(0.3), nasa_standard()):
        np.testing.assert_allclose(np.linalg.norm(layout, axis=1), 1.0, rtol=1e-15)
    skewed = np.array(nasa_standard())
    np.testing.assert_allclose(skewed[:3] @ skewed[3], np.sqrt(1.0 / 3.0))
    assert np.array(pyramid(0.3))[:, 2] == pytest.approx(math.sin(0.3))
    # The pyramid serves the body axes alike: half of the wheels' strength more than three orthogonal ones.
    wheels = simple(pyramid())
    for axis in np.eye(3).tolist():
        assert max(map(abs, allocate_peak(tuple(axis), wheels))) == pytest.approx(math.sqrt(3.0) / 4.0)
    for elevation in (0.0, -0.1, 2.0, math.nan):
        with pytest.raises(ValueError, match="elevation"):
            pyramid(elevation)


# Motors and friction.


def alone(command, momentum, rate=(0.0, 0.0, 0.0), **more):
    wheels = simple(three_orthogonal(), **more)
    return motor((command, 0.0, 0.0), (momentum, 0.0, 0.0), rate, wheels)[0]


def test_motor_within_its_limits():
    assert alone(0.05, 0.0) == 0.05
    assert alone(0.3, 0.0) == 0.1
    assert alone(-0.3, 2.0) == -0.1
    assert alone(0.3, 5.0) == 0.0
    assert alone(-0.3, -5.0) == 0.0
    assert alone(0.3, -5.0) == 0.1
    assert alone(0.3, 6.0) == 0.0
    assert alone(0.3, 5.0 * (1.0 - 0.5 * BAND)) == pytest.approx(0.05)
    assert alone(7.0, 1e9, torque_limit=math.inf, momentum_limit=math.inf) == 7.0
    assert math.isnan(alone(math.nan, 0.0))


def test_friction():
    friction = {"viscous": 1e-4, "coulomb": 2e-3}
    assert alone(0.0, 1.0, **friction) == pytest.approx(-(1e-2 + 2e-3))
    assert alone(0.0, -1.0, **friction) == pytest.approx(1e-2 + 2e-3)
    assert alone(0.0, 0.0, **friction) == 0.0
    assert alone(0.0, 0.01 * 0.5 * CREEP, **friction) == pytest.approx(-(0.5e-4 + 1e-3))
    # It is the speed relative to the body that rubs: here the rotor is at rest in the body.
    assert alone(0.0, 0.02, rate=(2.0, 0.0, 0.0), **friction) == 0.0
    assert alone(0.0, 0.0, rate=(2.0, 0.0, 0.0), **friction) == pytest.approx(2e-4 + 2e-3)
    assert alone(0.3, 5.0, **friction) == pytest.approx(-(5e-2 + 2e-3))


# Flights without torque from outside; momentum is kept in `wheels/test_flights.py`.


def flight(steps, limit=5e-324, **more):
    """A body on a pyramid of wheels, whose law commands at most so much."""
    wheels = simple(pyramid(), inertia=0.002, torque_limit=0.02, momentum_limit=0.4, **more)
    own = rotors(wheels, (0.3, -0.2, 0.1, 0.25))
    return wheels, flown(hub(own, rate=(0.01, -0.005, 0.008), limit="axis", command_limit=limit), steps)


def test_friction_alone_takes_energy():
    wheels, run = flight(20000, viscous=1e-6, coulomb=1e-4)
    body = bare_inertia(HUB, axial_inertia(wheels))
    energy = 0.5 * np.einsum("ti,ij,tj->t", run["rate"], body, run["rate"])
    energy += 0.5 * (run["wheel_momentum"] ** 2).sum(axis=1) / 0.002
    assert (np.diff(energy) <= 1e-13 * energy[0]).all()
    assert energy[-1] < 0.2 * energy[0]
    relative = run["wheel_momentum"][-1] / 0.002 - np.array(wheels.axes) @ run["rate"][-1]
    assert np.abs(relative).max() < 0.01 * CREEP


# Loss of a wheel.


def test_a_lost_wheel_takes_no_part():
    wheels = simple(pyramid(), viscous=1e-4)
    rest = lose(wheels, 1)
    assert rest.torque_limit == (0.1, 0.0, 0.1, 0.1)
    assert rest.axes == wheels.axes
    for torque in random_axes(5, 20):
        wanted = tuple(torque.tolist())
        for rule in (allocate, allocate_peak):
            taus = rule(wanted, with_facets(rest))
            assert taus[1] == 0.0
            np.testing.assert_allclose(total(taus, rest), torque, atol=1e-14)
    h_rate = motor((1.0,) * 4, (1.0,) * 4, (0.0,) * 3, rest)
    assert h_rate[1] == pytest.approx(-1e-4 * 1.0 / 0.01)
    assert lose(rest, 1) == rest
    assert make_wheels(pyramid(), 0.01, (0.1, 0.0, 0.1, 0.1), 5.0, 1e-4) == rest


def test_a_loss_that_leaves_a_direction_without_authority():
    with pytest.raises(ValueError, match=r"without wheel 3 the others give no torque about the body direction \(0, 0, 1\)"):
        lose(simple(three_orthogonal()), 2)
    with pytest.raises(ValueError, match=r"without wheel 4 the others give .* \(0, 1, 0\): three"):
        lose(simple(nasa_standard(), torque_limit=(1.0, 0.0, 1.0, 1.0)), 3)
    for index in (-1, 4):
        with pytest.raises(ValueError, match="there is no wheel"):
            lose(simple(pyramid()), index)


# What is refused.

FLAT = ((1.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 1.0, 1.0), (1.0, -3.0, 1.0))


@pytest.mark.parametrize(
    ("axes", "message"),
    [
        (((1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), "axis of wheel 2 .* not 0"),
        (((1.0, 0.0, 0.0), (0.0, math.nan, 0.0), (0.0, 0.0, 1.0)), "axis of wheel 2 .* not nan"),
        (((1.0, 0.0), (0.0, 1.0)), r"shape \(2, 2\)"),
        ((), "shape"),
        (FLAT, r"the wheels give no torque about the body direction \(0.707, 0, -0.707\): three independent"),
        (((0.0, 0.0, 2.0), (1.0, 0.0, 0.0)), r"direction \(0, 1, 0\)"),
        (((1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (2.0, 0.0, 0.0)), r"direction \(0, [01], [01]\) and \(0, [01], [01]\)"),
        (((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (1.0, 1.0, 1e-3)), r"\(.*, 1\): the condition number of the axes is 2.\d+e\+03"),
    ],
)
def test_axes_that_are_refused(axes, message):
    with pytest.raises(ValueError, match=message):
        simple(axes)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"inertia": 0.0}, "rotor inertia of wheel 1 must be positive and finite, not 0"),
        ({"inertia": math.inf}, "rotor inertia of wheel 1"),
        ({"torque_limit": (0.1, -0.1, 0.1)}, "torque limit of wheel 2 must be zero or more, not -0.1"),
        ({"torque_limit": math.nan}, "torque limit of wheel 1 .* not nan"),
        ({"torque_limit": 0.0}, "the working wheels give no torque at all"),
        ({"momentum_limit": 0.0}, "momentum limit of wheel 1 must be positive, not 0"),
        ({"viscous": -1.0}, "viscous friction of wheel 1 must be zero or more and finite, not -1"),
        ({"coulomb": (0.0, 0.0, math.inf)}, "Coulomb friction of wheel 3"),
        ({"coulomb": (0.0, 0.0)}, r"Coulomb friction: one number or 3 are needed, not an array of shape \(2,\)"),
    ],
)
def test_numbers_that_are_refused(more, message):
    with pytest.raises(ValueError, match=message):
        simple(three_orthogonal(), **more)


def test_body_inertia():
    wheels = simple(three_orthogonal(), inertia=(0.1, 0.2, 0.3))
    np.testing.assert_allclose(bare_inertia((1.0, 1.1, 1.2), axial_inertia(wheels)), np.diag([0.9, 0.9, 0.9]))
    with pytest.raises(ValueError, match=r"more inertia than the craft: .* -0.1, 0.1, 0.2"):
        bare_inertia((0.3, 0.3, 0.2), axial_inertia(wheels))
    with pytest.raises(ValueError, match="symmetric"):
        bare_inertia(np.array([[1.0, 0.5, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), axial_inertia(wheels))


def test_catalogue():
    units = list(WHEEL_UNITS.values())
    assert list(WHEEL_UNITS) == [unit.name for unit in units]
    assert [unit.momentum_limit for unit in units] == sorted(unit.momentum_limit for unit in units)
    for unit in units:
        assert unit.maker
        assert unit.source
        assert (unit.inertia is None) == (unit.top_speed is None)
    assert WHEEL_UNITS["HR16-100"].inertia == pytest.approx(100.0 / (100.0 * 2.0 * math.pi))
