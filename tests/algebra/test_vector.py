"""Vector and matrix algebra: the identities of the theory, and agreement of every reader."""

import math

import numpy as np
import pytest
from hypothesis import assume, given

from starhold.algebra.vector import (
    IDENTITY,
    ZERO,
    add,
    apply,
    column,
    combine,
    cross,
    determinant,
    diagonal,
    dot,
    gyroscopic_torque,
    inverse,
    multiply,
    norm,
    scale,
    signs,
    skew,
    solve,
    subtract,
    times,
    transpose,
    unit,
)
from tests.algebra.readers import agree, leaves, matrices, positives, symbols, vectors, zero

A, B, C, D = (symbols(f"{name}1:4") for name in "abcd")
M = (symbols("m1:4"), symbols("m4:7"), symbols("m7:10"))
N = (symbols("n1:4"), symbols("n4:7"), symbols("n7:10"))
SYMMETRIC = ((M[0][0], M[0][1], M[0][2]), (M[0][1], M[1][1], M[1][2]), (M[0][2], M[1][2], M[2][2]))


def test_products_of_vectors():
    assert zero(add(cross(A, B), cross(B, A)))
    assert zero((dot(A, cross(A, B)), dot(B, cross(A, B))))
    assert zero(add(cross(A, cross(B, C)), add(cross(B, cross(C, A)), cross(C, cross(A, B)))))
    assert zero(subtract(cross(A, cross(B, C)), subtract(scale(dot(A, C), B), scale(dot(A, B), C))))
    assert zero(dot(cross(A, B), cross(C, D)) - dot(A, C) * dot(B, D) + dot(A, D) * dot(B, C))
    assert cross((1, 0, 0), (0, 1, 0)) == (0, 0, 1)
    assert zero(norm(A) ** 2 - dot(A, A))


def test_matrices():
    assert zero(subtract(apply(skew(A), B), cross(A, B)))
    assert zero(subtract(apply(diagonal(A), B), apply(A, B)))
    assert zero(subtract(apply(A, B), times(A, B)))
    assert zero(subtract(apply(multiply(M, N), A), apply(M, apply(N, A))))
    assert zero(subtract(column(M, A), apply(transpose(M), A)))
    assert zero(dot(A, apply(M, B)) - dot(column(M, A), B))
    assert zero(combine(1, transpose(multiply(M, N)), -1, multiply(transpose(N), transpose(M))))
    assert zero(determinant(multiply(M, N)) - determinant(M) * determinant(N))
    assert zero(determinant(diagonal(A)) - A[0] * A[1] * A[2])
    assert zero(combine(1, multiply(M, IDENTITY), -1, M))
    assert zero(subtract(apply(combine(2, M, -3, N), A), subtract(scale(2, apply(M, A)), scale(3, apply(N, A)))))


def test_inverse_is_exact():
    assert zero(combine(1, multiply(inverse(M), M), -1, IDENTITY))
    assert zero(combine(1, multiply(M, inverse(M)), -1, IDENTITY))


def test_swing_is_the_gyroscopic_torque():
    assert zero(subtract(gyroscopic_torque(SYMMETRIC, A), cross(A, apply(SYMMETRIC, A))))
    assert zero(subtract(gyroscopic_torque(B, A), cross(A, apply(B, A))))
    assert zero(subtract(gyroscopic_torque(diagonal(B), A), gyroscopic_torque(B, A)))
    # It does no work and turns no momentum into length.
    assert zero((dot(A, gyroscopic_torque(SYMMETRIC, A)), dot(apply(SYMMETRIC, A), gyroscopic_torque(SYMMETRIC, A))))
    assert zero((dot(A, gyroscopic_torque(B, A)), dot(apply(B, A), gyroscopic_torque(B, A))))


@given(vectors)
def test_lengths(a):
    assert math.isclose(norm(a), math.hypot(*a), rel_tol=4e-16)
    assert signs(a) == tuple(float((x > 0) - (x < 0)) for x in a)
    assume(a != ZERO)
    assert math.isclose(norm(unit(a)), 1.0, rel_tol=4e-16)


@given(matrices, vectors, positives)
def test_solve_inverts_apply(m, a, size):
    # Made diagonally dominant, so that it is far from singular.
    m = combine(1.0, m, size + 10.0 * max(map(abs, leaves(m))), IDENTITY)
    agree(solve, m, a)
    agree(inverse, m)
    np.testing.assert_allclose(apply(m, solve(m, a)), a, atol=1e-12 * (1.0 + max(map(abs, a))))
    d = (2.0, -3.0, 0.5)
    agree(solve, d, a)
    assert apply(d, solve(d, a)) == pytest.approx(a, rel=1e-15)
