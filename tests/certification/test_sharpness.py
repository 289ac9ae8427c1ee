"""How near proved bounds are to the worst that a search finds: never beneath it, and not far above."""

import numpy as np
import pytest
from scipy.linalg import expm

from starhold.algebra.quaternion import derivative
from starhold.algebra.vector import ZERO, add
from starhold.certification.certify import Wanted, certify
from starhold.certification.matrices import floats
from starhold.certification.motion import Motion
from starhold.certification.subject import make_subject
from starhold.laws.interface import NoMemory, Seen
from starhold.models.rigid_body import angular_acceleration
from starhold.trace.calling import Compiled
from tests.certification.loops import free, tensor, textbook

LOOPS = textbook()
STEPS = 1500


def motion_of(loop):
    """Compiled: attitude and rate after a step under a constant torque from outside, by the classical Runge-Kutta method."""

    def slope(q, w, push):
        u, _ = loop.law.torque(Seen(q, w, w, ZERO, ZERO, ZERO, ZERO, 0.1, ZERO), loop.gains, loop.craft, NoMemory())
        return *derivative(q, w), *angular_acceleration(w, add(u, push), loop.craft)

    def step(q, w, push, h):
        x = (*q, *w)

        def moved(k, share):
            return tuple(a + share * h * b for a, b in zip(x, k, strict=True))

        k1 = slope(q, w, push)
        k2 = slope((y := moved(k1, 0.5))[:4], y[4:], push)
        k3 = slope((y := moved(k2, 0.5))[:4], y[4:], push)
        k4 = slope((y := moved(k3, 1.0))[:4], y[4:], push)
        return tuple(a + h / 6.0 * (b + 2.0 * c + 2.0 * d + e) for a, b, c, d, e in zip(x, k1, k2, k3, k4, strict=True))

    return Compiled(step, (1.0, 0.0, 0.0, 0.0), ZERO, ZERO, 0.1)


def worst_ends(loop, torque, directions=24):
    """The largest angle and rate that torques of this size bring about from rest on target: each that is worst for the
    linear loop and one direction of rate or attitude at the end, of full size all the time, flown in the full loop."""
    rate, attitude = (floats(gain) for gain in Motion(make_subject(loop)).linear())
    inverse = np.linalg.inv(tensor(loop.craft.inertia))
    A = np.block([[-inverse @ rate, -inverse @ attitude], [0.5 * np.eye(3), np.zeros((3, 3))]])
    h = 12.0 / (STEPS * -np.linalg.eigvals(A).real.max())
    random = np.random.default_rng(0)
    wanted = np.vstack([np.eye(3), random.normal(size=(directions, 3))])
    ends = np.concatenate([np.hstack([wanted, 0.0 * wanted]), np.hstack([0.0 * wanted, wanted])]).T
    step, middle = expm(A.T * h), expm(A.T * h / 2.0)
    costates = [middle @ ends]
    for _ in range(STEPS - 1):
        costates.append(step @ costates[-1])
    states = np.zeros((7, ends.shape[1]))
    states[0] = 1.0
    motion = motion_of(loop)
    for costate in reversed(costates):
        push = inverse @ costate[:3]
        push *= torque / np.maximum(np.linalg.norm(push, axis=0), 1e-300)
        states = motion.over(np.vstack([states, push, np.full(ends.shape[1], h)]))
        states[:4] /= np.linalg.norm(states[:4], axis=0)
    angles = 2.0 * np.arctan2(np.linalg.norm(states[1:4], axis=0), states[0])
    return float(angles.max()), float(np.linalg.norm(states[4:7], axis=0).max())


@pytest.mark.parametrize(
    ("name", "torque", "angle", "rate"),
    [
        ("pd-0", 1e-4, 1.25, 1.25),
        ("pd-0", 5e-4, 1.3, 1.7),
        pytest.param("pd-1", 1e-3, 1.25, 1.25, marks=pytest.mark.slow),
        ("lyapunov-0", 1e-4, 1.2, 1.2),
        pytest.param("lyapunov-1", 1e-3, 1.25, 1.25, marks=pytest.mark.slow),
        ("lqr-I", 1e-4, 1.15, 1.2),
        ("lqr-I-gyroscopic-left", 5e-4, 1.2, 1.25),
        pytest.param("lqr-II-uneven", 1e-4, 1.2, 1.2, marks=pytest.mark.slow),
        pytest.param("lqr-numeric", 1e-3, 1.3, 1.3, marks=pytest.mark.slow),
        ("matrix-pd-inertial", 1e-4, 1.2, 1.2),
    ],
)
def test_ends_against_the_worst_disturbance_found(name, torque, angle, rate):
    loop = free(LOOPS[name])
    claim = certify(loop, name, Wanted(disturbance=torque)).claim("disturbance")
    assert claim.outcome == "proved"
    assert claim.numbers["torque"] == torque
    found = worst_ends(loop, torque)
    assert 1.0 <= claim.numbers["angle"] / found[0] <= angle
    assert 1.0 <= claim.numbers["rate"] / found[1] <= rate
