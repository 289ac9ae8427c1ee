"""Euler's equation and the kinematics: what they conserve, exactly; flights are in `loop/test_motion.py`."""

import math

import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

from starhold.algebra.quaternion import to_reference
from starhold.algebra.vector import ZERO, apply, cross, dot, inverse, subtract
from starhold.parts.bodies.rigid_body import State, angular_acceleration, kinetic_energy, motion, renormalised
from starhold.parts.craft import Craft
from tests.algebra.readers import quaternions, reduced_by_unit_norm, same, small_vectors, symbols, vanishes

J = symbols("j1:7")
MOMENTS = J[:3]
TENSOR = ((J[0], J[3], J[4]), (J[3], J[1], J[5]), (J[4], J[5], J[2]))
DIAGONAL = Craft(MOMENTS, tuple(1 / m for m in MOMENTS), sympy.oo, 1)
CRAFTS = pytest.mark.parametrize("craft", [DIAGONAL, Craft(TENSOR, inverse(TENSOR), sympy.oo, 1)], ids=["diagonal", "full"])
STATE = State(symbols("q0:4"), symbols("w1:4"), symbols("x1:4"), symbols("v1:4"), symbols("u1:4"))
TORQUE = symbols("m1:4")


def along(expression, torque, craft):
    """The time derivative of an expression in STATE along the equations of motion."""
    rates = motion(STATE, torque, ZERO, None, craft)
    pairs = zip((*STATE.attitude, *STATE.rate), (*rates[0], *rates[1]), strict=True)
    return sum(sympy.diff(expression, x) * rate for x, rate in pairs)


@CRAFTS
def test_eulers_equation(craft):
    change = apply(craft.inertia, angular_acceleration(STATE.rate, TORQUE, craft))
    expected = subtract(TORQUE, cross(STATE.rate, apply(craft.inertia, STATE.rate)))
    assert all(vanishes(part) for part in subtract(change, expected))


@CRAFTS
def test_the_torque_does_the_work_and_the_quaternion_keeps_its_length(craft):
    # E' = w.M, so without torque the energy is conserved exactly.
    assert vanishes(along(kinetic_energy(STATE.rate, craft), TORQUE, craft) - dot(STATE.rate, TORQUE))
    assert vanishes(along(sum(c * c for c in STATE.attitude), TORQUE, craft))


def test_inertial_axes_turn_as_the_rate_says():
    # (R v)' = R (w x v) for a unit quaternion: with Euler's equation the momentum R J w changes by the torque alone.
    vectors = symbols("a1:4"), cross(STATE.rate, symbols("a1:4"))
    for part, turned in zip(*(to_reference(STATE.attitude, v) for v in vectors), strict=True):
        assert reduced_by_unit_norm(along(part, TORQUE, DIAGONAL) - turned, STATE.attitude) == 0


def test_the_centre_of_mass_and_the_torque_move_as_they_are_told():
    for rate in (None, TORQUE):
        assert motion(STATE, TORQUE, (1, 2, 3), rate, DIAGONAL)[2:] == (STATE.velocity, (1, 2, 3), rate)


@settings(max_examples=30)
@given(st.builds(State, quaternions, *[small_vectors] * 4), st.floats(-4.0, -1.0))
def test_renormalising_touches_only_the_attitude(state, exponent):
    long = state._replace(attitude=tuple((1.0 + 10.0**exponent) * x for x in state.attitude))
    clean = same(renormalised, long)
    assert clean[1:] == state[1:]
    assert abs(math.hypot(*clean.attitude) - 1.0) < 2.0 * 10.0 ** (2.0 * exponent) + 1e-15
