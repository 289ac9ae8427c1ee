"""Gravity: the attraction and its torque, against point masses and as exact identities."""

import math

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from starhold.algebra.quaternion import NO_TURN, derivative, to_body
from starhold.algebra.vector import ZERO, apply, cross, dot, scale
from starhold.parts.craft import Craft, make_craft, matrix, vector
from starhold.parts.environments.gravity_gradient import gravity_gradient
from tests.algebra.readers import agree, close, components, quaternions, reduced_by_unit_norm, same, symbols, vanishes
from tests.equations import two_body, two_body_gravity_gradient

MU = 3.986e14
DIAGONAL = make_craft([2.0, 3.0, 4.0])
FULL = make_craft([[2.0, 0.1, -0.3], [0.1, 3.0, 0.2], [-0.3, 0.2, 4.0]])
WHEELED = (DIAGONAL._replace(with_rotors=(2.1, 3.2, 4.1)), DIAGONAL._replace(with_rotors=FULL.inertia))
MODELS = (two_body, two_body_gravity_gradient)

seeds = st.integers(0, 2**32 - 1)
places = st.tuples(components, components, components).filter(lambda v: math.hypot(*v) > 0.1)
positions = places.map(lambda v: scale(7.0e6 / math.hypot(*v), v))


@settings(max_examples=20)
@given(positions, quaternions)
def test_every_reader_gives_the_same(position, attitude):
    for craft in (DIAGONAL, FULL, *WHEELED):
        craft = craft._replace(torque_limit=1.0)
        for model in MODELS:
            agree(model, position, attitude, craft)
        agree(gravity_gradient, to_body(attitude, position), 1e-20, craft)


@given(positions, quaternions)
def test_attraction(position, attitude):
    size = math.hypot(*position)
    for model in (two_body, two_body_gravity_gradient):
        acceleration, _ = model(position, attitude, DIAGONAL)
        expected = scale(-MU / size**3, position)
        assert close(acceleration, expected, 1e-15 * MU / size**2)
    assert two_body(position, attitude, DIAGONAL)[1] == ZERO


def test_attraction_keeps_energy_and_angular_momentum():
    r, v = symbols("x y z"), symbols("u v w")
    mu = sympy.symbols("mu", positive=True)
    craft = Craft((1, 1, 1), (1, 1, 1), sympy.oo, mu)
    acceleration, _ = two_body(r, NO_TURN, craft)
    energy = dot(v, v) / 2 - mu / sympy.sqrt(dot(r, r))
    change = sum(sympy.diff(energy, x) * dx for x, dx in zip((*r, *v), (*v, *acceleration), strict=True))
    assert vanishes(sympy.simplify(sympy.nsimplify(change, rational=True)))
    assert all(vanishes(part) for part in cross(r, acceleration))


def cloud(seed, count=5):
    """Masses and places whose centre of mass is the origin."""
    generator = np.random.default_rng(seed)
    masses, points = generator.uniform(0.5, 2.0, count), generator.normal(size=(count, 3))
    return masses, points - masses @ points / masses.sum()


def torque_of(masses, points, centre, mu):
    """The torque about their centre of mass of the attraction of point masses at `centre` + points, body axes."""
    at = centre + points
    forces = -mu * masses[:, None] * at / np.linalg.norm(at, axis=1)[:, None] ** 3
    return np.cross(points, forces).sum(axis=0)


def inertia_of(masses, points):
    return sum(m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(masses, points, strict=True))


@given(seeds, places, quaternions)
def test_torque_is_that_of_a_small_cloud_of_masses(seed, place, attitude):
    # In units of the distance; the formula is the leading term in the size of the body, so its relative error shrinks
    # with the size, and with its square for a body that is its own mirror image.
    masses, points = cloud(seed)
    masses, points = np.concatenate([masses, masses]), np.concatenate([points, -points])
    place = scale(1.0 / math.hypot(*place), place)
    centre = np.array(to_body(attitude, place))
    errors = []
    for size in (2e-2, 1e-2):
        body = make_craft(inertia_of(masses, size * points), gravity=2.5)
        _, torque = two_body_gravity_gradient(place, attitude, body)
        wanted = torque_of(masses, size * points, centre, 2.5)
        scale_of_torque = 2.5 * size**2 * (masses * (points**2).sum(axis=1)).sum()
        errors.append(np.abs(np.array(torque) - wanted).max() / scale_of_torque)
    largest = np.linalg.norm(points, axis=1).max()
    assert errors[0] < 30.0 * (2e-2 * largest) ** 2
    assert errors[1] < 0.3 * errors[0] + 1e-10


def test_gravity_acts_on_the_rotors_too():
    place, attitude = (7.0e6, -1.0e6, 2.0e6), (0.5, 0.5, -0.1, 0.7)
    for craft in WHEELED:
        rigid = make_craft(craft.with_rotors)
        assert two_body_gravity_gradient(place, attitude, craft) == two_body_gravity_gradient(place, attitude, rigid)


def test_torque_on_a_dumbbell():
    # Two masses m at +-d on an axis that leans from the vertical by a: 3 mu/r3 J sin a cos a, turning it to the vertical.
    m, d, lean, r = 3.0, 0.5, 0.4, 7.0e6
    points = d * np.array([[math.sin(lean), 0.0, math.cos(lean)]] * 2) * [[1.0], [-1.0]]
    inertia = inertia_of(np.array([m, m]), points) + 1e-6 * np.eye(3)
    _, torque = two_body_gravity_gradient((0.0, 0.0, r), NO_TURN, make_craft(inertia))
    size = 3.0 * MU / r**3 * (2.0 * m * d * d) * math.sin(lean) * math.cos(lean)
    assert torque == pytest.approx((0.0, -size, 0.0), rel=1e-9, abs=1e-20)


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_no_torque_along_a_principal_axis(axis, sign):
    position = tuple(sign * 7.0e6 * (i == axis) for i in range(3))
    assert same(two_body_gravity_gradient, position, NO_TURN, DIAGONAL)[1] == ZERO
    turn = Rotation.from_rotvec([0.3, -0.2, 0.5])
    axes = turn.as_matrix()
    leaning = make_craft(matrix(axes @ np.diag([2.0, 3.0, 4.0]) @ axes.T))
    _, torque = two_body_gravity_gradient(vector(axes @ position), NO_TURN, leaning)
    assert close(torque, ZERO, 1e-15 * 3.0 * MU / 7.0e6**3 * 10.0)


@given(positions, quaternions)
def test_no_torque_on_a_body_with_equal_moments(position, attitude):
    assert two_body_gravity_gradient(position, attitude, make_craft([2.0, 2.0, 2.0]))[1] == ZERO


@given(positions, quaternions)
def test_torque_has_no_component_along_the_vertical(position, attitude):
    for craft in (DIAGONAL, FULL):
        _, torque = two_body_gravity_gradient(position, attitude, craft)
        vertical = scale(1.0 / math.hypot(*position), to_body(attitude, position))
        assert abs(dot(vertical, torque)) < 1e-14 * 3.0 * MU / 7.0e6**3 * 4.0
        # The body turned end for end feels the same torque.
        assert close(two_body_gravity_gradient(scale(-1.0, position), attitude, craft)[1], torque, 0.0)


def test_torque_is_the_slope_of_the_potential():
    # U = (3 mu / 2 r5) R.J R; turning the body at the rate w does the work w.M = -U'.
    q, r, w = symbols("q0:4"), symbols("r1:4"), symbols("w1:4")
    j = symbols("j1:7")
    strength = sympy.symbols("s", positive=True)
    for inertia in (j[:3], ((j[0], j[3], j[4]), (j[3], j[1], j[5]), (j[4], j[5], j[2]))):
        craft = Craft(inertia, inertia, sympy.oo, 1)
        # Body components turn as R' = -w x R; the exact quaternion kinematics say so for a unit quaternion.
        body = symbols("b1:4")
        potential = strength * dot(body, apply(inertia, body)) / 2
        change = sum(sympy.diff(potential, x) * d for x, d in zip(body, scale(-1, cross(w, body)), strict=True))
        assert vanishes(change + dot(w, gravity_gradient(body, strength, craft)))
    turned = to_body(q, r)
    for x, d in zip(turned, cross(w, turned), strict=True):
        along = sum(sympy.diff(x, c) * dc for c, dc in zip(q, derivative(q, w), strict=True))
        assert reduced_by_unit_norm(along + d, q) == 0
