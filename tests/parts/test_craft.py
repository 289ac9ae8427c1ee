"""Which inertia tensors are accepted, and how they are kept."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from starhold.algebra.vector import apply
from starhold.parts.craft import EARTH, check_inertia, make_craft, matrix, tensor, vector

seeds = st.integers(0, 2**32 - 1)
sizes = st.floats(-6.0, 6.0).map(lambda e: 10.0**e)


def cloud_inertia(masses, places):
    """The inertia tensor of point masses about their centre of mass."""
    places = places - masses @ places / masses.sum()
    return sum(m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(masses, places, strict=True))


@given(seeds, st.integers(4, 12), sizes)
def test_every_cloud_of_masses_is_a_body(seed, count, size):
    generator = np.random.default_rng(seed)
    inertia = cloud_inertia(generator.uniform(0.1, 10.0, count), size * generator.normal(size=(count, 3)))
    craft = make_craft(inertia)
    np.testing.assert_allclose(tensor(craft.inertia), inertia, rtol=1e-9)
    np.testing.assert_allclose(tensor(craft.inverse_inertia) @ inertia, np.eye(3), atol=1e-9)


@given(seeds, sizes)
def test_flat_bodies_reach_the_triangle_inequality(seed, size):
    generator = np.random.default_rng(seed)
    places = size * generator.normal(size=(6, 3)) * (1.0, 1.0, 0.0)
    turn = Rotation.random(rng=generator).as_matrix()
    inertia = cloud_inertia(generator.uniform(0.5, 2.0, 6), places)
    check_inertia(inertia)
    check_inertia(turn @ inertia @ turn.T)


def test_a_rotated_tensor_is_a_body_in_spite_of_rounding():
    # Some products of inertia cancel to rounding errors, which are not symmetric.
    moments, unequal = np.array([2.0, 3.0, 4.0]), 0
    for turns in itertools.product((0, 30, 45, 60, 90, 120, 135, 180), repeat=3):
        turn = Rotation.from_euler("ZYX", turns, degrees=True).as_matrix()
        rotated = turn @ np.diag(moments) @ turn.T
        unequal += not np.allclose(rotated, rotated.T, rtol=1e-3, atol=0.0)
        inertia = check_inertia(rotated)
        np.testing.assert_array_equal(inertia, inertia.T)
        np.testing.assert_allclose(np.linalg.eigvalsh(inertia), moments, rtol=1e-14)
    assert unequal > 0


@given(seeds, sizes)
def test_what_no_body_has_is_refused(seed, size):
    generator = np.random.default_rng(seed)
    turn = Rotation.random(rng=generator).as_matrix()
    a, b = generator.uniform(0.5, 2.0, 2)

    def tensor_of(*moments):
        full = turn @ np.diag(size * np.array(moments)) @ turn.T
        return 0.5 * (full + full.T)

    with pytest.raises(ValueError, match="exceeds the sum"):
        check_inertia(tensor_of(a, b, (a + b) * 1.001))
    check_inertia(tensor_of(a, b, (a + b) * 0.999))
    with pytest.raises(ValueError, match="positive definite"):
        check_inertia(tensor_of(a, b, -0.001))
    unsymmetric = tensor_of(a, b, max(a, b))
    unsymmetric[0, 1] += 1e-3 * size
    with pytest.raises(ValueError, match="symmetric"):
        check_inertia(unsymmetric)


@pytest.mark.parametrize(
    ("inertia", "reason"),
    [
        ([1.0, 2.0, 3.5], "exceeds the sum"),
        ([1.0, 2.0, 0.0], "positive definite"),
        ([-1.0, 2.0, 2.0], "positive definite"),
        ([[1, 5, 0], [5, 1, 0], [0, 0, 1]], "positive definite"),
        ([[1, 0.1, 0], [0.2, 1, 0], [0, 0, 1]], "symmetric"),
        ([1.0, math.nan, 1.0], "finite"),
        ([1.0, math.inf, 1.0], "finite"),
        ([[1, 0, 0], [0, 1, 0], [0, 0, math.nan]], "finite"),
        ([1.0, 2.0], "shape"),
        ([1.0, 2.0, 3.0, 4.0], "shape"),
        (5.0, "shape"),
        (np.ones((2, 2)), "shape"),
        (np.ones((3, 3, 1)), "shape"),
        ([], "shape"),
    ],
)
def test_refusals_say_why(inertia, reason):
    with pytest.raises(ValueError, match=reason):
        make_craft(inertia)


@pytest.mark.parametrize("limit", [0.0, -1.0, -math.inf, math.nan])
def test_the_torque_limit_must_be_positive(limit):
    with pytest.raises(ValueError, match="torque limit"):
        make_craft([2.0, 3.0, 4.0], limit)


def test_principal_axes_are_kept_as_three_moments():
    craft = make_craft([2, 3, 4], 0.5)
    assert craft == make_craft(np.diag([2.0, 3.0, 4.0]), 0.5)
    assert craft.inertia == (2.0, 3.0, 4.0)
    assert craft.inverse_inertia == (0.5, 1.0 / 3.0, 0.25)
    assert craft.torque_limit == 0.5
    assert craft.gravity == EARTH
    assert make_craft([1, 1, 1]).torque_limit == math.inf
    assert all(type(x) is float for x in (*craft.inertia, *craft.inverse_inertia, craft.torque_limit, craft.gravity))
    np.testing.assert_array_equal(tensor(craft.inertia), np.diag([2.0, 3.0, 4.0]))


def test_other_axes_are_kept_as_a_matrix():
    full = [[2.0, 0.1, 0.0], [0.1, 3.0, -0.2], [0.0, -0.2, 4.0]]
    craft = make_craft(full)
    assert craft.inertia == matrix(full)
    assert all(type(x) is float for row in (*craft.inertia, *craft.inverse_inertia) for x in row)
    np.testing.assert_array_equal(tensor(craft.inertia), full)


@given(seeds)
def test_both_kinds_of_storage_act_alike(seed):
    generator = np.random.default_rng(seed)
    moments = generator.uniform(2.0, 3.0, 3)
    a = vector(generator.normal(size=3))
    craft = make_craft(moments)
    for short in (craft.inertia, craft.inverse_inertia):
        np.testing.assert_allclose(apply(short, a), tensor(short) @ a, rtol=1e-15)
    np.testing.assert_allclose(apply(craft.inverse_inertia, apply(craft.inertia, a)), a, rtol=1e-15)
