"""Unit quaternions: the group, its action on vectors, its kinematics; scipy as an independent witness."""

import math

import pytest
import sympy
from hypothesis import assume, given
from hypothesis import strategies as st

from starhold.algebra.quaternion import (
    NO_TURN,
    conjugate,
    derivative,
    half_angle_sine,
    multiply,
    nearer,
    normalise,
    relative,
    renormalise,
    stretch,
    to_body,
    to_reference,
    vector_part,
)
from starhold.algebra.vector import cross, dot
from tests.algebra.readers import (
    angles,
    close,
    directions,
    from_axis_angle,
    numbers,
    quaternions,
    reduced_by_unit_norm,
    rotation,
    small_vectors,
    symbols,
    zero,
)

P, Q, S = (symbols(f"{name}0:4") for name in "pqs")
R, W = symbols("r1:4"), symbols("w1:4")


def length2(q):
    return sum(c * c for c in q)


def minus(a, b):
    return tuple(x - y for x, y in zip(a, b, strict=True))


fours = st.tuples(numbers, numbers, numbers, numbers)


def test_group_axioms_are_exact():
    assert zero(minus(multiply(multiply(P, Q), S), multiply(P, multiply(Q, S))))
    assert multiply((1, 0, 0, 0), Q) == Q
    assert multiply(Q, (1, 0, 0, 0)) == Q
    assert zero(minus(multiply(Q, conjugate(Q)), (length2(Q), 0, 0, 0)))
    assert zero(minus(multiply(conjugate(Q), Q), (length2(Q), 0, 0, 0)))
    assert zero(minus(conjugate(multiply(P, Q)), multiply(conjugate(Q), conjugate(P))))
    assert zero(length2(multiply(P, Q)) - length2(P) * length2(Q))
    i, j, k = (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)
    assert multiply(i, j) == k
    assert multiply(j, k) == i
    assert multiply(k, i) == j
    assert multiply(i, i) == (-1, 0, 0, 0)


@given(quaternions, quaternions, small_vectors)
def test_action_agrees_with_scipy(p, q, r):
    assert close(to_body(q, r), tuple(rotation(q).inv().apply(r)), 3e-15)
    assert close(to_reference(q, r), tuple(rotation(q).apply(r)), 3e-15)
    # Body components after the turn p, then q about the axes already turned.
    assert close(to_body(multiply(p, q), r), to_body(q, to_body(p, r)), 6e-15)


def test_action_is_the_conjugation_exactly():
    # q* r q for a unit quaternion; what is left over is proportional to q.q - 1.
    by_definition = vector_part(multiply(multiply(conjugate(Q), (0, *R)), Q))
    for a, b in zip(by_definition, to_body(Q, R), strict=True):
        assert reduced_by_unit_norm(a - b, Q) == 0
    back = vector_part(multiply(multiply(Q, (0, *R)), conjugate(Q)))
    for a, b in zip(back, to_reference(Q, R), strict=True):
        assert reduced_by_unit_norm(a - b, Q) == 0


def along(expression, q, rate):
    """The time derivative of an expression in Q along q' = derivative(Q, W)."""
    return sum(sympy.diff(expression, c) * d for c, d in zip(q, derivative(q, rate), strict=True))


def test_kinematics_exactly():
    assert zero(dot(vector_part(Q), vector_part(derivative(Q, W))) + Q[0] * derivative(Q, W)[0])
    assert zero(minus(derivative(Q, W), stretch(sympy.Rational(1, 2), multiply(Q, (0, *W)))))
    # A vector fixed in space turns backwards in body axes, one fixed in the body turns with it.
    for side, sign, action in ((to_body(Q, R), -1, to_body), (to_reference(Q, R), 1, to_reference)):
        turned = cross(W, side) if action is to_body else action(Q, cross(W, R))
        for x, y in zip(side, turned, strict=True):
            assert reduced_by_unit_norm(along(x, Q, W) - sign * y, Q) == 0


@given(quaternions, quaternions, small_vectors)
def test_relative(p, q, r):
    error = relative(p, q)
    assert close(relative(q, q), NO_TURN, 1e-15)
    assert relative(NO_TURN, q) == q
    assert close(multiply(p, error), q, 2e-15)
    assert close(to_body(error, to_body(p, r)), to_body(q, r), 8e-15)
    assert relative(stretch(-1.0, p), q) == stretch(-1.0, error)
    assert close(relative(q, p), conjugate(error), 1e-15)


@given(quaternions, quaternions)
def test_nearer_picks_the_same_attitude_on_the_side_asked_for(p, q):
    chosen = nearer(q, p)
    assert chosen in (q, stretch(-1.0, q))
    assert sum(x * y for x, y in zip(chosen, p, strict=True)) >= -1e-16
    assert nearer(chosen, chosen) == chosen


def test_renormalise_error_law():
    # |q|2 = 1 + e becomes 1 - 3/4 e2 + 1/4 e3 exactly, so |q| errs by 3/8 e2.
    n2 = length2(Q)
    e = n2 - 1
    quarter = sympy.Rational(1, 4)
    assert zero(length2(renormalise(Q)) - (1 - 3 * quarter * e**2 + quarter * e**3))


@given(fours)
def test_normalise(q):
    assume(any(q))
    assert abs(length2(normalise(q)) - 1.0) < 1e-15
    assert close(stretch(math.sqrt(length2(q)), normalise(q)), q, 1e-15 * math.sqrt(length2(q)))


@given(directions, angles)
def test_half_angle(axis, angle):
    q = from_axis_angle(axis, angle)
    assert half_angle_sine(q) == pytest.approx(abs(math.sin(0.5 * angle)), rel=1e-14, abs=1e-150)
    assert 2.0 * math.atan2(half_angle_sine(q), abs(q[0])) == pytest.approx(rotation(q).magnitude(), rel=1e-14, abs=1e-15)
