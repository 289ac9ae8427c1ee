"""Euler's equation and the kinematics: what they conserve, exactly and along a flight."""

import math

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

from starhold.algebra.structure import move
from starhold.algebra.vector import ZERO, add, apply, cross, dot, inverse, norm, scale, subtract
from starhold.parts.bodies.rigid_body import (
    State,
    angular_acceleration,
    kinetic_energy,
    motion,
    renormalised,
)
from starhold.parts.craft import Craft, make_craft
from tests.algebra.readers import (
    agree,
    close,
    quaternions,
    reduced_by_unit_norm,
    same,
    small_vectors,
    symbols,
    vanishes,
)
from tests.equations import angular_momentum, two_body_gravity_gradient

DIAGONAL = make_craft([2.0, 3.0, 4.0], 1.0)
FULL = make_craft([[2.0, 0.1, -0.3], [0.1, 3.0, 0.2], [-0.3, 0.2, 4.0]], 1.0)
CRAFTS = pytest.mark.parametrize("craft", [DIAGONAL, FULL], ids=["diagonal", "full"])

J = symbols("j1:7")
MOMENTS = J[:3]
TENSOR = ((J[0], J[3], J[4]), (J[3], J[1], J[5]), (J[4], J[5], J[2]))
EXACT = {
    "diagonal": Craft(MOMENTS, tuple(1 / m for m in MOMENTS), sympy.oo, 1),
    "full": Craft(TENSOR, inverse(TENSOR), sympy.oo, 1),
}
BODY = pytest.mark.parametrize("body", list(EXACT))
STATE = State(symbols("q0:4"), symbols("w1:4"), symbols("x1:4"), symbols("v1:4"), symbols("u1:4"))
TORQUE = symbols("m1:4")

states = st.builds(State, quaternions, small_vectors, small_vectors, small_vectors, small_vectors)


@CRAFTS
def test_every_reader_gives_the_same(craft):
    @settings(max_examples=15)
    @given(states, small_vectors, small_vectors)
    def check(state, torque, acceleration):
        agree(motion, state, torque, acceleration, torque, craft)
        agree(motion, state, torque, acceleration, None, craft)
        agree(angular_acceleration, state.rate, torque, craft)
        agree(kinetic_energy, state.rate, craft)
        agree(angular_momentum, state, craft)
        agree(renormalised, state)

    check()


def along(expression, torque, craft):
    """The time derivative of an expression in STATE along the equations of motion."""
    rates = motion(STATE, torque, ZERO, None, craft)
    pairs = zip((*STATE.attitude, *STATE.rate), (*rates[0], *rates[1]), strict=True)
    return sum(sympy.diff(expression, x) * rate for x, rate in pairs)


@BODY
def test_eulers_equation(body):
    craft = EXACT[body]
    change = apply(craft.inertia, angular_acceleration(STATE.rate, TORQUE, craft))
    expected = subtract(TORQUE, cross(STATE.rate, apply(craft.inertia, STATE.rate)))
    assert all(vanishes(part) for part in subtract(change, expected))


@BODY
def test_the_torque_does_the_work(body):
    # E' = w.M, so without torque the energy is conserved exactly.
    craft = EXACT[body]
    change = along(kinetic_energy(STATE.rate, craft), TORQUE, craft)
    assert vanishes(change - dot(STATE.rate, TORQUE))
    assert vanishes(along(kinetic_energy(STATE.rate, craft), ZERO, craft))


@BODY
def test_the_torque_changes_the_momentum(body):
    # L' = M in inertial axes for a unit quaternion, so without torque each component of L is conserved exactly.
    craft = EXACT[body]
    momentum = angular_momentum(STATE, craft)
    turned = angular_momentum(STATE._replace(rate=apply(craft.inverse_inertia, TORQUE)), craft)
    for part, expected in zip(momentum, turned, strict=True):
        residue = sympy.numer(sympy.cancel(sympy.nsimplify(along(part, TORQUE, craft) - expected, rational=True)))
        assert reduced_by_unit_norm(residue, STATE.attitude) == 0


@BODY
def test_the_length_of_the_quaternion_is_conserved(body):
    length = sum(c * c for c in STATE.attitude)
    assert vanishes(along(length, TORQUE, EXACT[body]))


def test_the_centre_of_mass_moves_as_it_is_told():
    turning, acceleration, velocity, pull, held = motion(STATE, TORQUE, (1, 2, 3), None, EXACT["diagonal"])
    assert velocity == STATE.velocity
    assert pull == (1, 2, 3)
    assert held is None
    assert len(turning) == 4
    assert len(acceleration) == 3
    assert motion(STATE, TORQUE, (1, 2, 3), TORQUE, EXACT["diagonal"])[4] == TORQUE


def step(state, h, craft, torque=ZERO, environment=None):
    """A Runge-Kutta step made of the same equations."""

    def slope(s):
        pull, external = (ZERO, ZERO) if environment is None else environment(s.position, s.attitude, craft)
        return motion(s, add(torque, external), pull, None, craft)

    a = slope(state)
    b = slope(move(state, 0.5 * h, a))
    c = slope(move(state, 0.5 * h, b))
    d = slope(move(state, h, c))
    end = move(move(move(move(state, h / 6, a), h / 3, b), h / 3, c), h / 6, d)
    return renormalised(end)


START = State((0.5, -0.5, 0.5, 0.5), (0.4, -0.3, 0.5), ZERO, ZERO, ZERO)


@CRAFTS
def test_a_free_flight_conserves_energy_and_momentum(craft):
    state = START
    for _ in range(400):
        state = step(state, 0.02, craft)
    assert kinetic_energy(state.rate, craft) == pytest.approx(kinetic_energy(START.rate, craft), rel=1e-9)
    assert close(angular_momentum(state, craft), angular_momentum(START, craft), 1e-8)
    assert norm(subtract(state.rate, START.rate)) > 0.1
    assert math.hypot(*state.attitude) == pytest.approx(1.0, abs=1e-14)


def test_a_symmetric_body_precesses_at_the_known_rate():
    # J1 = J2: the transverse rate turns about the third axis at (J3 - J1)/J1 w3.
    craft = make_craft([2.0, 2.0, 3.0])
    state = START._replace(rate=(0.3, 0.0, 0.8))
    for _ in range(500):
        state = step(state, 0.02, craft)
    angle = 0.5 * 0.8 * 10.0
    assert close(state.rate, (0.3 * math.cos(angle), 0.3 * math.sin(angle), 0.8), 1e-8)


@pytest.mark.parametrize("axis", range(3))
def test_a_constant_torque_about_a_principal_axis_spins_up(axis):
    torque = tuple(0.2 * (i == axis) for i in range(3))
    state = START._replace(rate=ZERO, attitude=(1.0, 0.0, 0.0, 0.0))
    for _ in range(100):
        state = step(state, 0.05, DIAGONAL, torque)
    rate, angle = 0.2 / DIAGONAL.inertia[axis] * 5.0, 0.1 / DIAGONAL.inertia[axis] * 25.0
    assert close(state.rate, scale(rate / 0.2, torque), 1e-12)
    assert state.attitude[0] == pytest.approx(math.cos(0.5 * angle), abs=1e-9)
    assert state.attitude[1 + axis] == pytest.approx(math.sin(0.5 * angle), abs=1e-9)


@CRAFTS
def test_gravity_gradient_conserves_the_sum_of_both_energies_in_orbit(craft):
    # Spin, orbit and gravity gradient: spin energy plus (3 mu / 2 r5) R.J R is conserved on a circular orbit seen from
    # the orbital frame (the Jacobi integral), w being the rate relative to the frame.
    n, r = 1e-2, 1.0
    craft = craft._replace(gravity=n**2 * r**3)
    axis = (0.0, 0.0, 1.0)
    state = State((0.8, 0.6, 0.0, 0.0), (0.004, 0.007, -0.002), (r, 0.0, 0.0), (0.0, n * r, 0.0), ZERO)

    def jacobi(s):
        q, w = s.attitude, s.rate
        normal, down = body_components(q, axis), body_components(q, scale(1.0 / norm(s.position), s.position))
        slow = scale(n, normal)
        relative = subtract(w, slow)
        spin = 0.5 * dot(relative, apply(craft.inertia, relative)) - 0.5 * dot(slow, apply(craft.inertia, slow))
        return spin + 1.5 * n**2 * dot(down, apply(craft.inertia, down))

    first = jacobi(state)
    for _ in range(500):
        state = step(state, 1.0, craft, environment=two_body_gravity_gradient)
    assert math.hypot(*state.position) == pytest.approx(r, rel=1e-9)
    assert jacobi(state) == pytest.approx(first, rel=1e-7)
    assert not close(state.rate, (0.004, 0.007, -0.002), 1e-3)


def body_components(q, r):
    """q* r q by its definition."""
    a = np.array(q[1:])
    return tuple((np.array(r) - 2.0 * q[0] * np.cross(a, r) + 2.0 * np.cross(a, np.cross(a, r))).tolist())


@settings(max_examples=30)
@given(states, st.floats(-4.0, -1.0))
def test_renormalising_touches_only_the_attitude(state, exponent):
    long = state._replace(attitude=scale_four(1.0 + 10.0**exponent, state.attitude))
    clean = same(renormalised, long)
    assert clean[1:] == state[1:]
    assert abs(math.hypot(*clean.attitude) - 1.0) < 2.0 * 10.0 ** (2.0 * exponent) + 1e-15


def scale_four(c, q):
    return tuple(c * x for x in q)
