"""What the laws' derivations say, proved on the laws' and the models' own equations."""

import numpy as np
import pytest
import sympy
from flint import arb
from hypothesis import given
from hypothesis import strategies as st

from starhold.algebra.quaternion import conjugate, derivative, multiply, to_body, vector_part
from starhold.algebra.vector import ZERO, add, apply, cross, dot, gyroscopic_torque, subtract
from starhold.conformance.bench import random_measurements, random_quaternions
from starhold.laws import lyapunov, matrix_pd, pd, sliding
from starhold.laws.catalogue import catalogue
from starhold.laws.interface import Measurement, NoMemory
from starhold.parts.bodies.rigid_body import angular_acceleration
from starhold.parts.craft import Craft, make_craft, tensor
from starhold.parts.quaternion_sign import as_published, hysteresis, shortest

number = st.floats(-1.0, 1.0)
triple = st.tuples(number, number, number)


def symbols(name, count=3):
    return sympy.symbols(f"{name}1:{count + 1}", real=True)


def symbolic_body():
    """Attitude, rate, torque and a body with symbolic principal moments, at a target at rest."""
    q = (sympy.Symbol("q0", real=True), *symbols("q"))
    moments = sympy.symbols("J1:4", positive=True)
    craft = Craft(moments, tuple(1 / m for m in moments), sympy.oo, sympy.Symbol("mu"))
    zero = (sympy.Integer(0),) * 3
    measurement = Measurement(q, symbols("w"), symbols("w"), zero, zero, symbols("M"), zero, sympy.Symbol("T"))
    return measurement, craft


def slope(value, measurement, torque, craft):
    """dV/dt along the motion, from the models' equations of motion."""
    rates = [*derivative(measurement.attitude, measurement.rate), *angular_acceleration(measurement.rate, torque, craft)]
    variables = [*measurement.attitude, *measurement.rate]
    return sum(sympy.diff(value, x) * r for x, r in zip(variables, rates, strict=True))


@pytest.mark.parametrize("law", [pd, lyapunov])
def test_lyapunov_function_falls_as_damping_says(law):
    measurement, craft = symbolic_body()
    gains = law.Gains(*sympy.symbols("k_w k_q", positive=True))
    torque, _ = law.torque(measurement, gains, craft, NoMemory())
    # The law `lyapunov` knows the external torque and cancels it; `pd` is for a body free of any.
    external = measurement.external_torque if law is lyapunov else (0, 0, 0)
    found = slope(law.lyapunov(measurement, gains, craft), measurement, add(torque, external), craft)
    assert sympy.expand(found + gains.k_rate * dot(measurement.rate, measurement.rate)) == 0


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


@given(triple, triple, st.integers(0, 99))
def test_sliding_variable_falls_whatever_the_torque_below_reach(rate, disturbance, number):
    """d(s.Js/2)/dt = sum of s_i M_i - reach_i |s_i|, which is negative while |M_i| < reach_i."""
    craft = make_craft([[2.0, 0.1, -0.2], [0.1, 3.0, 0.15], [-0.2, 0.15, 4.0]])
    gains = sliding.Gains(((0.08, 0.01, 0.0), (0.01, 0.1, 0.0), (0.0, 0.0, 0.12)), (0.005, 0.006, 0.007), 0.0)
    attitude = random_quaternions(100)[number]
    measurement = Measurement(attitude, rate, rate, ZERO, ZERO, ZERO, ZERO, 0.1)
    torque, _ = sliding.torque(measurement, gains, craft, NoMemory())
    s = sliding.surface(measurement, gains)
    acceleration = angular_acceleration(rate, add(torque, disturbance), craft)
    s_rate = add(acceleration, apply(gains.surface_gain, vector_part(derivative(attitude, rate))))
    found = dot(s, apply(craft.inertia, s_rate))
    expected = dot(s, disturbance) - sum(g * abs(x) for g, x in zip(gains.switching_gain, s, strict=True))
    assert found == pytest.approx(expected, abs=1e-12)


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


def without_memory():
    """The laws that keep nothing from call to call."""
    craft = make_craft([2.0, 3.0, 4.0])
    return sorted(n for n, law in catalogue().items() if law.remember(law.examples()[0], craft, 0.1) == NoMemory())


@pytest.mark.parametrize("name", without_memory())
def test_laws_are_read_by_balls_and_symbols_too(name):
    law = catalogue()[name]
    craft = make_craft([2.0, 3.0, 4.0])

    def as_numbers(value, kind):
        return type(value)(*(as_numbers(v, kind) for v in value)) if hasattr(value, "_fields") else (
            tuple(as_numbers(v, kind) for v in value) if isinstance(value, tuple) else kind(value)
        )  # fmt: skip

    for gains in law.examples():
        for measurement in random_measurements(5):
            plain, _ = law.command(measurement, gains, craft, NoMemory())
            balls, _ = law.command(as_numbers(measurement, arb), as_numbers(gains, arb), as_numbers(craft, arb), NoMemory())
            exact, _ = law.command(
                as_numbers(measurement, sympy.Rational), as_numbers(gains, sympy.Rational), craft, NoMemory()
            )
            for x, ball, fraction in zip(plain, balls, exact, strict=True):
                assert abs(float(ball.mid()) - x) <= 1e-14
                assert ball.rad() < 1e-10
                assert abs(float(fraction) - x) <= 1e-14


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


def test_helpers_agree_on_the_error_convention():
    """The error attitude takes target axes to body axes: target * error = attitude."""
    target, attitude = random_quaternions(2)
    error = multiply(conjugate(target), attitude)
    r = (0.3, -0.2, 0.9)
    assert to_body(error, to_body(target, r)) == pytest.approx(to_body(attitude, r), abs=1e-15)
