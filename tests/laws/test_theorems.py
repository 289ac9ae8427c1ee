"""What the laws' derivations say, on the laws' and the models' own equations."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from starhold.algebra.vector import ZERO, add, apply, cross, gyroscopic_torque, subtract
from starhold.conformance.bench import call, random_measurements, random_quaternions
from starhold.laws import lyapunov, matrix_pd, sliding
from starhold.laws.catalogue import catalogue
from starhold.laws.interface import Measurement, NoMemory
from starhold.parts.bodies.rigid_body import angular_acceleration
from starhold.parts.craft import make_craft, tensor
from starhold.parts.quaternion_sign import as_published, hysteresis, shortest

number = st.floats(-1.0, 1.0)
triple = st.tuples(number, number, number)


@pytest.mark.parametrize("form", ["inertial", "diagonal"])
def test_matrix_gain_families_meet_their_conditions(form):
    random = np.random.default_rng(5)
    for _ in range(50):
        points = random.normal(size=(6, 3))
        inertia = np.trace(points.T @ points) * np.eye(3) - points.T @ points
        if form == "diagonal":
            inertia = np.diag(np.linalg.eigvalsh(inertia))
        craft = make_craft(inertia)
        a, b = random.uniform(0, 2, size=2)
        d = float(random.uniform(0.1, 1)) if form == "inertial" else tuple(random.uniform(0.1, 1, size=3))
        gains = matrix_pd.design(craft, matrix_pd.FORMS[form](a, b, d))
        weight = np.linalg.inv(tensor(gains.k_attitude))
        damping = weight @ tensor(gains.k_rate)
        assert np.linalg.eigvalsh(weight @ inertia + (weight @ inertia).T).min() > 0
        assert np.linalg.eigvalsh(damping + damping.T).min() > 0
        for rate in random.normal(size=(5, 3)):
            power = rate @ weight @ np.cross(rate, inertia @ rate)
            assert abs(power) < 1e-10 * np.linalg.norm(weight) * np.linalg.norm(inertia)


def test_diagonal_family_refuses_a_full_inertia():
    craft = make_craft([[2.0, 0.1, 0.0], [0.1, 3.0, 0.0], [0.0, 0.0, 4.0]])
    with pytest.raises(ValueError, match="diagonal inertia"):
        matrix_pd.design(craft, matrix_pd.FORMS["diagonal"](1.0, 1.0, (1.0, 1.0, 1.0)))


def test_known_torques_are_cancelled_so_that_v_falls_by_the_damping_alone():
    gains = lyapunov.examples()[0]
    for seen in random_measurements(50):
        power = np.dot(seen.rate, add(call(catalogue()["lyapunov"], seen, gains), seen.external_torque))
        slope = power + gains.k_attitude * np.dot(seen.attitude[1:], seen.rate)
        assert slope == pytest.approx(-gains.k_rate * np.dot(seen.rate, seen.rate), abs=1e-15)


def test_boundary_layer_is_continuous_and_ends_in_the_sign():
    assert [sliding.switch(x, 0.5) for x in (-2.0, -0.5, -0.25, 0.0, 0.25, 0.5, 2.0)] == [-1, -1, -0.5, 0, 0.5, 1, 1]
    assert [sliding.switch(x, 0.0) for x in (-1e-300, 0.0, 1e-300)] == [-1, 0, 1]


@pytest.mark.parametrize("name", ["pd", "matrix-pd", "lyapunov"])
@given(data=st.data())
def test_motion_relative_to_a_moving_target_obeys_the_equations_of_rest(name, data):
    """J w_e' + w_e x J w_e is the same function of attitude and relative rate, however the target moves."""
    law = catalogue()[name]
    craft = make_craft([[2.0, 0.1, -0.2], [0.1, 3.0, 0.15], [-0.2, 0.15, 4.0]])
    error_rate, target_rate, target_acceleration = data.draw(triple), data.draw(triple), data.draw(triple)
    attitude = random_quaternions(20)[data.draw(st.integers(0, 19))]
    for gains in law.examples():

        def left_side(turning, spinning, attitude=attitude, gains=gains):
            body_rate = add(error_rate, turning)
            moving = subtract(spinning, cross(error_rate, turning))
            measurement = Measurement(attitude, error_rate, body_rate, turning, moving, ZERO, ZERO, 0.1)
            torque, _ = law.command(measurement, gains, craft, NoMemory())
            relative = subtract(angular_acceleration(body_rate, torque, craft), moving)
            return add(apply(craft.inertia, relative), gyroscopic_torque(craft.inertia, error_rate))

        assert left_side(target_rate, target_acceleration) == pytest.approx(left_side(ZERO, ZERO), abs=1e-12)


@given(st.floats(-1, 1), st.sampled_from([-1.0, 1.0]), st.floats(0.05, 0.95))
def test_quaternion_sign_options(q0, h, width):
    rest = (1 - q0**2) ** 0.5
    q = (q0, rest, 0.0, 0.0)
    assert as_published(q, h, width) == (q, h)
    shown, _ = shortest(q, h, width)
    assert shown[0] >= 0.0
    assert shown in (q, scale_all(-1.0, q))
    shown, new = hysteresis(q, h, width)
    assert new in (-1.0, 1.0)
    assert new * q0 >= -width
    assert (new != h) == (h * q0 < -width)
    assert shown == scale_all(new, q)


def scale_all(c, q):
    return tuple(c * x for x in q)


def test_sign_at_exactly_half_a_turn_is_plus():
    assert shortest((0.0, 0.6, 0.8, 0.0), 1.0, 0.5)[0] == (0.0, 0.6, 0.8, 0.0)
