"""The modal law against placement of the seven-state system at each step, its closed loop, and the published landing."""

import math

import numpy as np
import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st

from starhold.algebra.quaternion import to_body
from starhold.algebra.vector import ZERO, add, cross, gyroscopic_torque
from starhold.conformance.bench import random_quaternions
from starhold.laws import modal
from starhold.laws.interface import Measurement, NoMemory
from starhold.parts.bodies.rigid_body import angular_acceleration
from starhold.parts.craft import make_craft, tensor
from starhold.parts.environments.gravity_gradient import gravity_gradient
from starhold.scenario.reading import parse
from starhold.synthesis.pole_placement import place, reached
from tests.refusals import refused
from tests.small import CRAFT
from tests.tiers import fewer

INERTIA = ((12.0, -1.5, 0.7), (-1.5, 15.0, 2.0), (0.7, 2.0, 9.0))
MU = 3.986e14
ROOT = (-0.428, -0.428, -0.428)


def matrix(v):
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def at(attitude, rate, torque=ZERO, position=ZERO):
    """What the law sees at a target at rest."""
    return Measurement(tuple(attitude), tuple(rate), tuple(rate), ZERO, ZERO, tuple(torque), tuple(position), 0.1)


def symbolic_torque(craft, position):
    """Gravity gradient and gyroscopic torque as expressions of q0, q and w, with their Jacobian (3, 7)."""
    state = sympy.symbols("q0 q1:4 w1:4", real=True)
    quaternion, rate = state[:4], state[4:]
    strength = 3.0 * MU / math.hypot(*position) ** 5
    known = gravity_gradient(to_body(quaternion, position), strength, craft)
    total = sympy.Matrix([g - s for g, s in zip(known, gyroscopic_torque(craft.inertia, rate), strict=True)])
    return sympy.lambdify(state, [sympy.Matrix(known), total, total.jacobian(state)])


def linear_motion(attitude, rate, inertia, jacobian):
    """A (7, 7) and B (7, 3) of x = (q0 - 1, q, w) at a state."""
    a, b, w = np.zeros((7, 7)), np.zeros((7, 3)), np.asarray(rate)
    a[0, 1:4], a[1:4, 0] = -0.5 * w, 0.5 * w
    a[1:4, 4:] = 0.5 * (np.eye(3) + matrix(attitude[1:]))
    a[4:], b[4:] = np.linalg.solve(inertia, jacobian), np.linalg.inv(inertia)
    return a, b


def test_places_the_poles_of_the_motion_at_every_step():
    """u = -(M - M_x x) - K x, K from general placement on symbolic Jacobians, for any spectra and inertia."""
    random = np.random.default_rng(11)
    craft = make_craft(INERTIA, gravity=MU)
    j, position = tensor(craft.inertia), (3e6, -4e6, 5e6)
    model = symbolic_torque(craft, position)
    for attitude in random_quaternions(fewer(60), 12):
        rate = random.normal(size=3) * 10.0 ** random.uniform(-2.0, 0.0)
        phi_0, phi_1 = (-np.diag(random.uniform(0.2, 2.0, 3)) + 0.1 * random.normal(size=(3, 3)) for _ in range(2))
        b = -random.uniform(0.01, 0.3)
        known, total, jacobian = (np.asarray(x, dtype=float) for x in model(*attitude, *rate))
        a, inputs = linear_motion(attitude, rate, j, jacobian)
        lever = j @ np.linalg.solve(np.eye(3) + matrix(attitude[1:]), rate)
        spectra = [phi_0, phi_1, [[b * rate @ rate]]]
        gain = place(a, inputs, spectra=spectra, directions=[None, None, lever[:, None]]).K
        x = np.array([attitude[0] - 1.0, *attitude[1:], *rate])
        wanted = -(total.ravel() - jacobian @ x) - gain @ x
        gains = modal.Gains(tuple(map(tuple, phi_0.tolist())), tuple(map(tuple, phi_1.tolist())), b)
        found, _ = modal.torque(at(attitude, rate, known.ravel()), gains, craft, NoMemory())
        np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-10 * np.abs(wanted).max())
        poles = np.sort_complex(np.concatenate([np.linalg.eigvals(phi_0), np.linalg.eigvals(phi_1), [b * rate @ rate]]))
        np.testing.assert_allclose(np.sort_complex(reached(a, inputs, gain)), poles, rtol=0, atol=1e-8)


@given(st.integers(0, 10_000))
def test_closed_loop_is_the_published_one_whatever_the_inertia(seed):
    """w' = 2 a w - 2 a^2 D^-1 q + k D^-1 w, relative to a target that turns as well."""
    random = np.random.default_rng(seed)
    turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
    inertia = turn @ np.diag(random.uniform(1.0, 1.9, 3)) @ turn.T
    craft = make_craft(tuple(map(tuple, (0.5 * (inertia + inertia.T)).tolist())), gravity=MU)
    vectors = [tuple(random.normal(size=3).tolist()) for _ in range(6)]
    measurement = Measurement(random_quaternions(1, seed)[0], *vectors[:5], ZERO, 0.1, vectors[5])
    a, b = -random.uniform(0.1, 3.0), -random.uniform(0.001, 0.5)
    torque, _ = modal.torque(measurement, modal.Gains((a, a, a), (a, a, a), b), craft, NoMemory())
    outside = add(
        add(torque, measurement.external_torque), tuple(-x for x in cross(measurement.body_rate, measurement.wheel_momentum))
    )
    absolute = angular_acceleration(measurement.body_rate, outside, craft)
    found = np.array(absolute) - np.array(measurement.target_acceleration)
    q0, q, w = measurement.attitude[0], np.array(measurement.attitude[1:]), np.array(measurement.rate)
    inverse = np.linalg.inv(np.eye(3) + matrix(q))
    k = 2 * a * (1 - 2 * a * b) * (q0 - 1) + 0.5 * (1 - 8 * a * b) * (w @ q) + b * q0 * (w @ w)
    wanted = 2 * a * w - 2 * a * a * inverse @ q + k * inverse @ w
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-11 * (1.0 + np.abs(wanted).max() + np.abs(absolute).max()))


def test_needs_no_rate():
    """At w = 0 the scalar part has no pole of its own: the pair is uncontrollable there, and the law goes on smoothly."""
    craft, gains = make_craft((2.0, 3.0, 4.0)), modal.Gains(ROOT, ROOT, -0.01)
    attitude = (0.5, 0.5, -0.5, 0.5)
    still, _ = modal.torque(at(attitude, ZERO), gains, craft, NoMemory())
    a, inputs = linear_motion(attitude, ZERO, np.diag(craft.inertia), np.zeros((3, 7)))
    with pytest.raises(ValueError, match="no input moves s = 0"):
        place(a, inputs, [-0.428] * 7)
    np.testing.assert_allclose(still, -2.0 * 0.428**2 * np.array(craft.inertia) * attitude[1:], rtol=1e-14)
    crept, _ = modal.torque(at(attitude, (1e-12, -1e-12, 1e-12)), gains, craft, NoMemory())
    np.testing.assert_allclose(crept, still, rtol=0, atol=1e-11)


PAIR = "phi_0 = -0.1\nphi_1 = [[-1, 3, 0], [-3, {}, 0], [0, 0, -1]]\nb = -0.01"


@pytest.mark.parametrize(
    ("lines", "reason"),
    [
        ('form = "equal"\na = 0.1', "phi_0 has the root 0.1 1/s, which is not stable"),
        ('form = "equal"\na = 0.0', "phi_0 has the root 0 1/s, which is not stable"),
        ('form = "equal"\na = -0.1\nb = 0.01', "b = 0.01 s gives the scalar part a root that is not stable"),
        (PAIR.format(1.5), "phi_1 has a root with a real part of zero or more"),
        ("phi_0 = -0.1\nphi_1 = [-1, -2]\nb = -0.01", "phi_1"),
        ('form = "fit"\nangle = 4.0', "angle"),
    ],
)
def test_unstable_or_miscounted_spectra_are_refused(lines, reason):
    law = f'[[law]]\ntype = "modal"\n{lines}\n'
    with refused(reason, start="small.toml: law[1]"):
        parse(CRAFT + law, "small.toml")
    if "not stable" in reason:
        assert parse(CRAFT + law, "small.toml", allow_unstable=True).laws[0].name == "modal"


def test_complex_pairs_are_as_good_as_real_roots():
    law = f'[[law]]\ntype = "modal"\n{PAIR.format(0.5)}\n'
    assert parse(CRAFT + law, "small").laws[0].gains.phi_0 == (-0.1, -0.1, -0.1)


def test_fit_takes_the_piece_of_the_angle():
    published = {10: -1.564, 45: -1.054, 85: -0.896, 90: -0.858, 135: -0.548, 180: -0.376}
    for angle, root in published.items():
        gains = modal.design(make_craft((1.0, 1.0, 1.0)), modal.Fit(math.radians(angle)))
        assert gains.phi_0 == gains.phi_1
        assert abs(gains.phi_0[0] / root - 1.0) < 0.01
