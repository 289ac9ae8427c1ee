"""Unit quaternions: the group, its action on vectors, its kinematics; scipy as an independent witness."""

import math

import numpy as np
import pytest
import sympy
from hypothesis import assume, given, settings
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
from starhold.algebra.vector import ZERO, add, cross, dot, norm, scale, subtract
from tests.algebra.readers import (
    agree,
    angles,
    close,
    directions,
    from_axis_angle,
    numbers,
    quaternions,
    reduced_by_unit_norm,
    rotation,
    same,
    small_vectors,
    symbols,
    vectors,
    zero,
)

P, Q, S = (symbols(f"{name}0:4") for name in "pqs")
R, W = symbols("r1:4"), symbols("w1:4")


def length2(q):
    return sum(c * c for c in q)


def minus(a, b):
    return tuple(x - y for x, y in zip(a, b, strict=True))


fours = st.tuples(numbers, numbers, numbers, numbers)


@settings(max_examples=30)
@given(quaternions, quaternions, vectors, numbers)
def test_every_reader_gives_the_same(p, q, r, c):
    for operation in (multiply, relative, nearer):
        agree(operation, p, q)
    for operation in (conjugate, normalise, renormalise, vector_part):
        agree(operation, q)
    # Squares of less vanish.
    if all(x == 0.0 or abs(x) > 1e-150 for x in q):
        agree(half_angle_sine, q)
    for operation in (to_body, to_reference, derivative):
        agree(operation, q, r)
    agree(stretch, c, q)


@settings(max_examples=30)
@given(st.tuples(*[st.floats()] * 4), st.tuples(*[st.floats()] * 4), st.tuples(*[st.floats()] * 3))
def test_compiled_equals_floats_for_any_float(p, q, r):
    for operation in (multiply, relative, nearer):
        same(operation, p, q)
    for operation in (to_body, to_reference, derivative):
        same(operation, q, r)
    for operation in (conjugate, renormalise, half_angle_sine):
        same(operation, q)


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


@given(quaternions, quaternions, quaternions)
def test_group_axioms_of_floats(p, q, s):
    assert close(multiply(multiply(p, q), s), multiply(p, multiply(q, s)), 2e-15)
    assert multiply(q, NO_TURN) == q
    assert multiply(NO_TURN, q) == q
    assert close(multiply(q, conjugate(q)), NO_TURN, 1e-15)
    assert conjugate(conjugate(q)) == q
    assert abs(length2(multiply(p, q)) - 1.0) < 4e-15
    witness = (rotation(p) * rotation(q)).as_matrix()
    np.testing.assert_allclose(rotation(multiply(p, q)).as_matrix(), witness, rtol=0.0, atol=4e-15)


@given(directions, st.floats(-15.0, -5.0))
def test_small_turns_keep_their_relative_accuracy(axis, exponent):
    angle = 10.0**exponent
    n = scale(1.0 / math.hypot(*axis), axis)
    q = from_axis_angle(axis, angle)
    assert math.isclose(half_angle_sine(q), 0.5 * angle, rel_tol=1e-10)
    # The turn of a turn by its own axis doubles; a small error quaternion keeps all its digits.
    twice = vector_part(multiply(q, q))
    assert close(twice, scale(angle, n), 1e-10 * angle)
    assert close(subtract(to_reference(q, R0), R0), scale(angle, cross(n, R0)), 2e-15 + angle**2)


R0 = (0.3, -0.7, 0.2)


@given(directions, st.sampled_from((0.0, 1e-15, 1e-12, 1e-8, -1e-12, -1e-8)), small_vectors)
def test_half_turns(axis, short_by, r):
    n = scale(1.0 / math.hypot(*axis), axis)
    q = from_axis_angle(axis, math.pi - short_by)
    mirrored = subtract(scale(2.0 * dot(n, r), n), r)
    assert close(to_body(q, r), mirrored, 4e-15 + 2.0 * abs(short_by))
    assert close(to_reference(q, r), mirrored, 4e-15 + 2.0 * abs(short_by))
    assert abs(q[0]) <= 1e-15 + abs(short_by)


@given(quaternions, small_vectors, small_vectors)
def test_action_is_an_isometry_and_its_inverse_undoes_it(q, r, s):
    body, other = to_body(q, r), to_body(q, s)
    assert close(to_reference(q, body), r, 4e-15)
    assert close(to_body(q, to_reference(q, r)), r, 4e-15)
    assert close(to_body(conjugate(q), r), to_reference(q, r), 1e-15)
    assert abs(dot(body, other) - dot(r, s)) < 6e-15
    assert close(cross(body, other), to_body(q, cross(r, s)), 6e-15)
    assert to_body(stretch(-1.0, q), r) == body
    assert to_body(NO_TURN, r) == r
    assert to_body(q, ZERO) == ZERO


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


@given(quaternions, small_vectors)
def test_derivative_against_finite_differences(q, rate):
    assume(norm(rate) > 1e-3)
    h = 1e-4

    def after(t):
        return multiply(q, from_axis_angle(rate, norm(rate) * t))

    central = tuple((x - y) / (2.0 * h) for x, y in zip(after(h), after(-h), strict=True))
    assert close(derivative(q, rate), central, 1e-8)
    assert abs(sum(x * y for x, y in zip(q, derivative(q, rate), strict=True))) < 1e-15


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


@given(quaternions, st.floats(-6.0, -2.0), st.sampled_from((-1.0, 1.0)))
def test_renormalise_and_normalise_keep_the_direction(q, exponent, sign):
    e = sign * 10.0**exponent
    long = stretch(math.sqrt(1.0 + e), q)
    again = renormalise(long)
    assert abs(math.sqrt(length2(again)) - (1.0 - 0.375 * e * e)) < abs(e) ** 3 + 1e-15
    assert close(normalise(long), q, 1e-15)
    assert close(normalise(again), q, 1e-15)


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


def test_batches_of_scipy_rotations():
    generator = np.random.default_rng(7)
    for q, r in zip(generator.normal(size=(50, 4)).tolist(), generator.normal(size=(50, 3)).tolist(), strict=True):
        q, r = normalise(tuple(q)), tuple(r)
        assert close(to_body(q, r), tuple(rotation(q).inv().apply(r)), 4e-15)
        assert close(add(to_body(q, r), to_body(q, scale(-1.0, r))), ZERO, 0.0)
