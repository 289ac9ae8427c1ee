"""Direction cosines and Tait-Bryan angles: exact identities, round trips at every attitude, scipy as a witness."""

import itertools
import math

from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from starhold.algebra import vector
from starhold.algebra.cosines import from_angles, from_quaternion, to_angles, to_quaternion
from starhold.algebra.quaternion import multiply, nearer, normalise, to_body
from starhold.algebra.vector import apply, combine, determinant, transpose
from tests.algebra.readers import angles, close, from_axis_angle, quaternions, symbols, zero

P, Q, R = symbols("p0:4"), symbols("q0:4"), symbols("r1:4")
N2 = sum(c * c for c in Q)


def test_orthogonality_is_exact():
    # A A^T = |q|4 E and det A = |q|6 for every quaternion, so A is a rotation for a unit one.
    a = from_quaternion(Q)
    identity = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
    assert zero(combine(1, vector.multiply(a, transpose(a)), -(N2**2), identity))
    assert zero(combine(1, vector.multiply(transpose(a), a), -(N2**2), identity))
    assert zero(determinant(a) - N2**3)


def test_homomorphism_and_action_are_exact():
    # First P, then Q about the axes already turned: the matrices multiply from the left.
    assert zero(combine(1, from_quaternion(multiply(P, Q)), -1, vector.multiply(from_quaternion(Q), from_quaternion(P))))
    difference = vector.subtract(apply(from_quaternion(Q), R), to_body(Q, R))
    assert zero(vector.subtract(difference, vector.scale(N2 - 1, R)))


def distance(p, q):
    """The largest difference of components between q and the nearer of p and -p."""
    return max(abs(x - y) for x, y in zip(nearer(p, q), q, strict=True))


@settings(max_examples=300)
@given(quaternions)
def test_round_trip_at_every_attitude(q):
    back = to_quaternion(from_quaternion(q))
    assert distance(back, q) < 1e-15
    assert max(back) == max(map(abs, back)) or max(map(abs, back)) - max(back) < 1e-15


def test_round_trip_where_the_largest_component_ties():
    for components in itertools.product((-1.0, 0.0, 1.0), repeat=4):
        if any(components):
            q = normalise(components)
            back = to_quaternion(from_quaternion(q))
            assert distance(back, q) < 1e-15
            assert close(from_quaternion(back), from_quaternion(q), 1e-15)


@given(angles, st.floats(-0.5 * math.pi, 0.5 * math.pi), angles)
def test_angles_are_the_intrinsic_turns_about_z_y_x(yaw, pitch, roll):
    q = from_angles(yaw, pitch, roll)
    witness = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_quat(scalar_first=True).tolist()
    assert distance(tuple(witness), q) < 2e-15
    turns = [from_axis_angle((0, 0, 1), yaw), from_axis_angle((0, 1, 0), pitch), from_axis_angle((1, 0, 0), roll)]
    assert close(q, multiply(multiply(turns[0], turns[1]), turns[2]), 2e-15)


@given(quaternions)
def test_angles_round_trip(q):
    yaw, pitch, roll = to_angles(q)
    assert -math.pi <= yaw <= math.pi
    assert -0.5 * math.pi <= pitch <= 0.5 * math.pi
    assert -math.pi <= roll <= math.pi
    near_gimbal_lock = math.cos(pitch) < 1e-3
    assert distance(from_angles(yaw, pitch, roll), q) < (3e-7 if near_gimbal_lock else 1e-12)


@given(angles, angles, st.sampled_from((-1.0, 1.0)), st.sampled_from((0.0, 1e-16, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5)))
def test_gimbal_lock(yaw, roll, sign, short_by):
    q = from_angles(yaw, sign * (0.5 * math.pi - short_by), roll)
    found = to_angles(q)
    assert distance(from_angles(*found), q) < 3e-7
    assert abs(abs(found[1]) - (0.5 * math.pi - short_by)) < 3e-8
    if short_by <= 1e-9:
        assert found[2] == 0.0
