"""How near proved bounds are to the worst that a search finds: never beneath it, and not far above."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some
from scipy.linalg import expm

from starhold.algebra.polynomial import Polynomial, exact
from starhold.algebra.quaternion import derivative
from starhold.algebra.vector import ZERO, add, apply, cross
from starhold.certification.certify import Wanted, certify
from starhold.certification.gyroscopic import crossed, gyroscopic_torque
from starhold.certification.matrices import floats, identity, number, plus, rows
from starhold.certification.motion import RATE, Motion
from starhold.certification.subject import make_subject
from starhold.laws.interface import Measurement, NoMemory
from starhold.parts.bodies.rigid_body import angular_acceleration
from starhold.trace.calling import Compiled
from tests.certification.loops import free, tensor, textbook
from tests.kernel.oracle import number as number_of
from tests.kernel.oracle import run

LOOPS = textbook()
STEPS = 1500


def motion_of(loop):
    """Compiled: attitude and rate after a step under a constant torque from outside, by the classical Runge-Kutta method."""

    def slope(q, w, push):
        u, _ = loop.law.command(Measurement(q, w, w, ZERO, ZERO, ZERO, ZERO, 0.1, ZERO), loop.gains, loop.craft, NoMemory())
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
        ("pd-0", 1e-4, 1.3, 1.3),
        ("pd-0", 5e-4, 1.4, 1.8),
        pytest.param("pd-1", 1e-3, 1.25, 1.25, marks=pytest.mark.slow),
        ("lyapunov-0", 1e-4, 1.3, 1.3),
        pytest.param("lyapunov-1", 1e-3, 1.25, 1.25, marks=pytest.mark.slow),
        ("lqr-I", 1e-4, 1.15, 1.2),
        ("lqr-I-gyroscopic-left", 5e-4, 2.4, 4.0),
        pytest.param("lqr-II-uneven", 1e-4, 1.2, 1.2, marks=pytest.mark.slow),
        pytest.param("lqr-numeric", 1e-3, 1.3, 1.3, marks=pytest.mark.slow),
        ("matrix-pd-inertial", 1e-4, 1.3, 1.3),
    ],
)
def test_ends_against_the_worst_disturbance_found(name, torque, angle, rate):
    loop = free(LOOPS[name])
    claim = certify(loop, name, Wanted(disturbance=torque)).claim("pointing")
    assert claim.outcome == "proved"
    assert claim.numbers["torque"] == torque
    found = worst_ends(loop, torque)
    assert 1.0 <= claim.numbers["angle"] / found[0] <= angle
    assert 1.0 <= claim.numbers["rate"] / found[1] <= rate


def largest_torque(loop, claim, level, kind):
    """The largest torque in norm, or on an axis, that a random search finds on {V <= level}, by the V of the proof."""
    found = claim.proof.claim
    V, J = claim.proof.programs[found["programs"]["lyapunov"]], np.array(tensor(loop.craft.inertia))
    numbers = {name: number_of(x) for name, x in found["subject"].items()}
    for name, matrix in (("inertia", J), ("inverse_inertia", np.linalg.inv(J))):
        numbers |= {f"craft.{name}.{i}.{k}": matrix[i, k] for i in range(3) for k in range(3)}
    random = np.random.default_rng(2)

    def command(q, w):
        return loop.law.command(Measurement(q, w, w, ZERO, ZERO, ZERO, ZERO, 0.1, ZERO), loop.gains, loop.craft, NoMemory())[
            0
        ]

    torque = Compiled(command, (1.0, 0.0, 0.0, 0.0), ZERO)

    def value(q, w):
        state = {f"measurement.attitude.{k}": x for k, x in enumerate(q)} | {
            f"measurement.rate.{k}": x for k, x in enumerate(w)
        }
        return run(V, numbers | state)[0]

    rest = value(np.eye(4)[:1].T, np.zeros((3, 1)))

    def size(x):
        axes, way = (part / np.linalg.norm(part, axis=0) for part in (x[:3], x[3:6]))
        # A turn to a share of the level, then the rate in the given direction at which V is the level.
        low, high = 0.0 * x[6], np.full(x.shape[1], np.pi)
        for _ in range(40):
            half = 0.25 * (low + high)
            below = value(np.vstack([np.cos(half), np.sin(half) * axes]), 0.0 * way) - rest < level * 0.5 * (
                1.0 + np.sin(x[6])
            )
            low, high = np.where(below, 2.0 * half, low), np.where(below, high, 2.0 * half)
        q = np.vstack([np.cos(0.5 * low), np.sin(0.5 * low) * axes])
        still, one, other = (value(q, s * way) for s in (0.0, 1.0, -1.0))
        a, b, c = 0.5 * (one + other) - still, 0.5 * (one - other), still - rest - level
        u = torque.over(np.vstack([q, (np.sqrt(b * b - 4.0 * a * c) - b) / (2.0 * a) * way]))
        return np.linalg.norm(u, axis=0) if kind == "norm" else np.abs(u).max(axis=0)

    x = random.normal(size=(7, 20_000))
    x = x[:, np.argsort(size(x))[-64:]]
    best = size(x)
    for _ in range(400):
        tried = x + random.normal(size=x.shape) * 10.0 ** random.uniform(-3.5, -0.5, size=x.shape[1])
        sizes = size(tried)
        x, best = np.where(sizes > best, tried, x), np.maximum(best, sizes)
    return float(best.max())


@pytest.mark.parametrize(
    ("name", "kind", "share"),
    [
        ("lyapunov-0", "norm", 0.96),
        ("lyapunov-0", "axis", 0.95),
        ("lyapunov-1", "norm", 0.98),
        ("lyapunov-1", "axis", 0.98),
        ("wheel-0", "norm", 0.96),
        ("lqr-I", "norm", 0.98),
        ("lqr-I", "axis", 0.97),
        ("lqr-I-gyroscopic-left", "axis", 0.97),
        pytest.param("lqr-I-gyroscopic-left", "norm", 0.97, marks=pytest.mark.slow),
        pytest.param("lqr-III", "axis", 0.998, marks=pytest.mark.slow),
        pytest.param("lqr-III", "norm", 0.97, marks=pytest.mark.slow),
        ("pd-0", "norm", 0.998),
        ("pd-0", "axis", 0.998),
        ("matrix-pd-inertial", "norm", 0.87),
        pytest.param("matrix-pd-inertial", "axis", 0.87, marks=pytest.mark.slow),
    ],
)
def test_the_level_under_a_torque_limit_against_the_largest_that_is_safe(name, kind, share):
    """No state within the level needs more torque than the limit, and one within level/share does."""
    loop = replace(LOOPS[name], limit=kind)
    claim = certify(loop, name).claim("torque-limit")
    assert claim.outcome == "proved"
    limit, level = claim.numbers["limit"], claim.numbers["level"]
    assert largest_torque(loop, claim, level, kind) <= limit * (1.0 + 1e-12)
    assert largest_torque(loop, claim, level / share, kind) > limit


MOMENTS = some.tuples(*[some.floats(0.5, 1.5)] * 3)


def gyroscopic(A):
    w = tuple(Polynomial.variable(name) for name in RATE)
    return list(cross(w, apply(tuple(map(tuple, A)), w)))


@settings(max_examples=20)
@given(MOMENTS)
def test_the_bound_of_the_gyroscopic_torque_is_sharp(moments):
    """Half the range of the moments over |w|2, and (J3 - J1)/(2 sqrt(J1 J3)) over w.Jw (Kantorovich)."""
    J = rows(np.diag(moments))
    low, high = min(moments), max(moments)
    found = [gyroscopic_torque(gyroscopic(J), metric) for metric in (identity(3), J)]
    sharp = (high - low) / 2.0, (high - low) / (2.0 * math.sqrt(low * high))
    for bound, least in zip(found, sharp, strict=True):
        assert least * (1.0 - 1e-12) <= number(bound.most) <= least * (1.0 + 1e-5) + 1e-9


@settings(max_examples=20)
@given(some.lists(some.integers(-3, 3), min_size=18, max_size=18), MOMENTS)
def test_no_rate_exceeds_the_bound_of_quadratic_forms(entries, moments):
    """For forms of any kind, and for w x Aw with any A, from which A comes back up to a multiple of the unit matrix."""
    names = [(a, b) for k, a in enumerate(RATE) for b in RATE[k:]]
    own = [Polynomial({m: exact(c) for m, c in zip(names, entries[k : k + 6], strict=True) if c}) for k in (0, 6, 12)]
    A = rows(np.reshape(np.array(entries[:9], dtype=float), (3, 3)))
    P = rows(np.diag(moments))
    w = np.random.default_rng(0).normal(size=(3, 2000))
    w /= np.sqrt(np.array(moments) @ w**2)
    for parts in (own, gyroscopic(A)):
        values = dict(zip(RATE, w, strict=True))
        sizes = [sum((number(c) * values[a] * values[b] for (a, b), c in p.terms.items()), 0.0 * w[0]) for p in parts]
        assert np.linalg.norm(sizes, axis=0).max() <= number(gyroscopic_torque(parts, P).most) * (1.0 + 1e-12)
    forms = [[[part.slope(a).slope(b).at({}) / 2 for b in RATE] for a in RATE] for part in gyroscopic(A)]
    assert crossed(forms) == plus(A, identity(3, A[0][0]), -1)
