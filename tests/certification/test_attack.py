"""An attempt to break what is proved: ten million random states, then the worst of them optimised."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.optimize import minimize

from starhold.algebra.polynomial import exact
from starhold.algebra.quaternion import NO_TURN, derivative
from starhold.algebra.vector import ZERO, add
from starhold.analysis.trial import draw
from starhold.certification.frame import take_apart, take_cross
from starhold.certification.matrices import floats, number
from starhold.certification.motion import Motion
from starhold.certification.potential import Spring
from starhold.certification.subject import make_subject
from starhold.laws.interface import Measurement, NoMemory
from starhold.parts.bodies.rigid_body import angular_acceleration
from starhold.trace.calling import Compiled
from tests.certification.loops import certified, textbook

LOOPS = textbook()
NAMES = sorted(name for name in LOOPS if not name.startswith("sliding"))
STATES = -(-10_000_000 // len(LOOPS))


@cache
def motion_of(name):
    """Compiled: the derivative of a state and the torque, from the law's and the models' equations."""
    loop = LOOPS[name]

    def motion(q, w, push):
        measurement = Measurement(q, w, w, ZERO, ZERO, ZERO, ZERO, 0.1, ZERO)
        u, _ = loop.law.command(measurement, loop.gains, loop.craft, NoMemory())
        return derivative(q, w), angular_acceleration(w, add(u, push), loop.craft), u

    return Compiled(motion, NO_TURN, ZERO, ZERO)


def moved(loop, states, push=None):
    name = next(name for name, known in LOOPS.items() if known is loop)
    push = np.zeros((3, states.shape[1])) if push is None else push
    return motion_of(name).over(np.vstack([states[:7], push]))


class Function:
    """V + epsilon q.Jw of a claim, its derivative and what sizes the derivative, in floats."""

    def __init__(self, loop, witness):
        stiffness = witness["stiffness"]
        motion = Motion(make_subject(loop), None if stiffness is None else exact(stiffness))
        frame = take_apart(motion)
        self.P, self.s, self.epsilon = floats(frame.P), number(frame.potential.top), witness["epsilon"]
        self.J = floats(take_cross(motion).J) if self.epsilon else np.zeros((3, 3))
        self.frame = frame

    def value(self, states):
        q, w = states[:4], states[4:7]
        return 0.5 * np.einsum("ik,ij,jk->k", w, self.P, w) + self.frame.potential.of(q)

    def climb(self, q, rates):
        """The derivative of the attitude's part of V."""
        if not self.frame.potential.even:
            return -self.s / 2.0 * rates[0]
        return 2.0 * np.einsum("ik,ij,jk->k", q, floats(self.frame.potential.N), rates[1:4])

    def slope(self, states, rates):
        """(V + epsilon C)' and the sum of the sizes of its parts, of which rounding takes a share."""
        w, q = states[4:7], states[1:4]
        parts = (
            np.einsum("ik,ij,jk->k", w, self.P, rates[4:7]),
            self.climb(q, rates),
            self.epsilon * np.einsum("ik,ij,jk->k", rates[1:4], self.J, w),
            self.epsilon * np.einsum("ik,ij,jk->k", q, self.J, rates[4:7]),
        )
        lengths = np.linalg.norm(w, axis=0) * np.linalg.norm(self.P, 2) * np.linalg.norm(rates[4:7], axis=0)
        return sum(parts), lengths + sum(abs(part) for part in parts)


def worst_first(loop, score, states):
    """The states with the highest score, improved by an optimiser that leaves the attitude of unit length."""
    best = states[:, np.argsort(score(states))[-6:]]
    size = np.abs(best[4:7]).max() + 1e-12
    found = [states]
    for start in best.T:

        def climb(x):
            q = x[:4] / np.linalg.norm(x[:4])
            return -float(score(np.concatenate([q, x[4:7] * size])[:, None])[0])

        x0 = np.concatenate([start[:4], start[4:7] / size])
        end = minimize(climb, x0, method="Nelder-Mead", options={"maxiter": 600}).x
        found.append(np.concatenate([end[:4] / np.linalg.norm(end[:4]), end[4:7] * size, np.zeros(9)])[:, None])
    return np.concatenate(found, axis=1)


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_no_proved_obligation_breaks(name):
    loop = LOOPS[name]
    certificate = certified(name)
    random = np.random.default_rng(11)
    for claim in certificate.claims:
        assert claim.outcome == "proved"
        if claim.kind in ("convergence", "torque-limit"):
            function = Function(loop, claim.witness)
            level = claim.numbers["level"]
            reach = 50.0 * function.s if level is None else min(level, 1e6 * function.s)
            states = draw(STATES // 3, function.P, function.frame.potential, reach, random)
            # Some near rest, where the derivative is smallest.
            states[4:7, ::3] *= 10.0 ** random.uniform(-9, 0, size=states[4:7, ::3].shape[1])
            attack(loop, claim, function, states)


def attack(loop, claim, function, states):
    def rising(x):
        slope, size = function.slope(x, moved(loop, x))
        return slope / np.maximum(size, 1e-300)

    states = worst_first(loop, rising, states)
    assert rising(states).max() <= 1e-13
    if claim.kind == "torque-limit":
        inside = states[:, function.value(states) <= (claim.numbers["level"] or np.inf)]
        assert np.abs(moved(loop, inside)[7:]).max() <= loop.craft.torque_limit * (1.0 + 1e-12)


@pytest.mark.parametrize(
    ("kind", "numbers", "witness"),
    [
        ("torque-limit", {"level": 10.0}, {}),
        ("convergence", {}, {"stiffness": 3.0}),
        ("convergence", {}, {"epsilon": 300.0}),
    ],
)
def test_the_attack_breaks_what_is_false(kind, numbers, witness):
    """Claims made too strong by these factors, with the same states as the proved ones."""
    loop = LOOPS["lqr-III"]
    claim = certified("lqr-III").claim(kind)
    strong = replace(
        claim,
        numbers={k: v * numbers[k] if k in numbers else v for k, v in claim.numbers.items()},
        witness={k: v * witness[k] if k in witness else v for k, v in claim.witness.items()},
    )
    function = Function(loop, strong.witness)
    level = strong.numbers["level"]
    level = 50.0 * function.s if level is None else level
    states = draw(20_000, function.P, function.frame.potential, level, np.random.default_rng(1))
    with pytest.raises(AssertionError):
        attack(loop, strong, function, states)


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(set(LOOPS) - set(NAMES)))
def test_no_proved_surface_breaks(name):
    """s.Js' <= sum of |s_i| (torque_i - reach_i) outside the layer, for any torque within the bounds."""
    loop = LOOPS[name]
    certificate = certified(name, disturbance=1e-3)
    claim = certificate.claim("sliding")
    assert claim.outcome == "proved"
    random = np.random.default_rng(12)
    J = np.array(loop.craft.inertia)
    K = np.diag(loop.gains.surface_gain) if np.ndim(loop.gains.surface_gain) == 1 else np.array(loop.gains.surface_gain)
    states = draw(STATES, J, Spring(0.05), 0.5, random)
    states[4:7] *= 10.0 ** random.uniform(-6, 0, size=states.shape[1])
    s = states[4:7] + K @ states[1:4]
    push = np.array(claim.numbers["torque"])[:, None] * np.sign(s)
    rates = moved(loop, states, push)
    slope = np.einsum("ik,ij,jk->k", s, J, rates[4:7] + K @ rates[1:4])
    outside = (np.abs(s) > loop.gains.boundary_layer).all(axis=0)
    assert outside.sum() > STATES // 4
    promised = -np.abs(s).sum(axis=0) * claim.numbers["margin"]
    assert (slope[outside] <= promised[outside] + 1e-12).all()
    # On the surface the angle falls.
    on_it = np.einsum("ik,ij,jk->k", -states[1:4], K, states[1:4])
    assert (on_it[np.linalg.norm(states[1:4], axis=0) > 1e-8] < 0.0).all()
