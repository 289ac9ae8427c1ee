"""Which inertia tensors are accepted, and how they are kept."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from starhold.algebra.structure import flatten
from starhold.algebra.vector import apply
from starhold.parts.craft import EARTH, check_inertia, make_craft, tensor

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


@pytest.mark.parametrize(
    ("inertia", "reason"),
    [
        ([1.0, 2.0, 3.003], "exceeds the sum"),
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


def test_principal_axes_are_kept_as_three_moments_and_others_as_a_matrix():
    craft = make_craft([2, 3, 4], 0.5)
    assert craft == make_craft(np.diag([2.0, 3.0, 4.0]), 0.5)
    assert craft[:4] == ((2.0, 3.0, 4.0), (0.5, 1.0 / 3.0, 0.25), 0.5, EARTH)
    assert make_craft([1, 1, 2]).torque_limit == math.inf
    full = make_craft([[2, 0.1, 0], [0.1, 3, -0.2], [0, -0.2, 4]])
    assert full.inertia == ((2.0, 0.1, 0.0), (0.1, 3.0, -0.2), (0.0, -0.2, 4.0))
    for made in (craft, full):
        assert all(type(x) is float for x in flatten(made[:4]))
        for short in made[:2]:
            np.testing.assert_allclose(apply(short, (1.0, -2.0, 0.5)), tensor(short) @ (1.0, -2.0, 0.5), rtol=1e-15)
