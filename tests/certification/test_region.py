"""The region of attraction of the modal law: what is claimed, attacked by states that nobody chose."""

import numpy as np
import pytest
from scipy.optimize import minimize

from starhold.algebra.quaternion import derivative
from starhold.algebra.vector import ZERO, add
from starhold.analysis.departure import start_inside
from starhold.analysis.trial import draw, fly_claims
from starhold.certification.certify import Wanted, certify
from starhold.certification.evidence.isotropic import Shape
from starhold.laws.interface import Measurement, NoMemory
from starhold.parts.bodies.rigid_body import angular_acceleration
from starhold.scenario.building import build
from starhold.scenario.reading import parse
from tests.making import noise
from tests.small import CRAFT

ROOT = -0.428


def loop_of(lines=f"a = {ROOT}", craft=CRAFT):
    form = "" if "phi_0" in lines else 'form = "equal"\n'
    scenario = parse(f'{craft}[[law]]\ntype = "modal"\n{form}{lines}\n', "small")
    return build(scenario, scenario.laws[0])


def claim_of(loop):
    return certify(loop).claim("region")


def falling(loop, shape, states):
    """V and V' at the columns of states, by the law's and the models' own equations."""
    found = np.empty((2, states.shape[1]))
    for lane, state in enumerate(states.T):
        q, w = tuple(state[:4].tolist()), tuple(state[4:7].tolist())
        measurement = Measurement(q, w, w, ZERO, ZERO, ZERO, ZERO, loop.period)
        torque, _ = loop.law.command(measurement, loop.gains, loop.craft, NoMemory())
        dq, dw = np.array(derivative(q, w)), np.array(angular_acceleration(w, add(torque, ZERO), loop.craft))
        step = 1e-3 / (1.0 + np.abs(dw).max() + np.abs(dq).max())
        near = [shape.value(state[:4] + k * step * dq, state[4:7] + k * step * dw) for k in (-2, -1, 1, 2)]
        # V is of the third degree, so that five points give its slope exactly.
        found[:, lane] = shape.value(state[:4], state[4:7]), np.dot([1, -8, 8, -1], near) / (12 * step)
    return found


@pytest.mark.parametrize("sign_policy", ["as_published", "hysteresis"])
def test_the_published_start_is_inside(sign_policy):
    start = 'attitude = [0.1414213562373095, 0.3, -0.5, 0.8]\nrate = ["-10 deg/s", "-7 deg/s", "11 deg/s"]'
    craft = CRAFT.replace("attitude = [1, 0, 0, 0.1]\nrate = [0, 0, 0]", start)
    loop = loop_of(f'a = {ROOT}\nquaternion_sign = "{sign_policy}"', craft)
    certificate = certify(loop)
    assert start_inside(certificate, loop) == {"region": True}
    # The start is where it is, whatever sensors with errors see.
    assert start_inside(certificate, loop.with_parts(*noise(0.0, 1e-3, 1e-3))) == {"region": True}
    claim = certificate.claim("region")
    assert Shape(**claim.witness).value(loop.start.attitude, loop.start.rate) < claim.numbers["level"]


@pytest.mark.parametrize(
    ("root", "b", "sign_policy"),
    [
        # Each root once, and each policy; the other pairs are slow.
        pytest.param(root, b, policy, marks=() if place % 3 == number else pytest.mark.slow)
        for place, (root, b) in enumerate([(ROOT, -0.01), (-2.0, -0.01), (-1.0, -0.1), (-0.4, -1.0), (-1.5, -0.7)])
        for number, policy in enumerate(["as_published", "shortest", "hysteresis"])
    ],
)
def test_v_falls_at_random_states_of_the_set_and_at_the_worst(root, b, sign_policy):
    loop = loop_of(f'a = {root}\nb = {b}\nquaternion_sign = "{sign_policy}"')
    claim = claim_of(loop)
    assert claim.outcome == "proved"
    shape, level = Shape(**claim.witness), claim.numbers["level"]
    states = draw(1000, lambda states: shape.value(states[:4], states[4:7]), level, np.random.default_rng(7))
    value, slope = falling(loop, shape, states)
    assert value.max() <= level * (1.0 + 1e-9)
    assert value.min() > 0.0
    assert slope.max() < 0.0

    def rise(x):
        q = x[:4] / np.linalg.norm(x[:4])
        v, s = falling(loop, shape, np.concatenate([q, x[4:]])[:, None])[:, 0]
        scale = abs(root) ** 3 * (np.dot(x[4:], x[4:]) / root**2 + 1.0 - q[0])
        return -s / max(scale, 1e-12) + 1e3 * max(v / level - 1.0, 0.0)

    for lane in np.argsort(-slope / np.sum(states[4:7] ** 2, axis=0))[:3]:
        worst = minimize(rise, states[:7, lane], method="Nelder-Mead", options={"maxiter": 200})
        assert worst.fun > 0.0


@pytest.mark.parametrize("inertia", ["[2.0, 3.0, 4.0]", "[[12.0, 0.5, 0.1], [0.5, 14.0, 0.2], [0.1, 0.2, 9.0]]"])
def test_the_same_for_every_inertia_and_target(inertia):
    craft = CRAFT.replace("[2.0, 3.0, 4.0]", inertia)
    orbit = '[orbit]\nposition = ["7000 km", 0, 0]\nvelocity = [0, 7500, 0]\n[target]\nmode = "orbital"\n'
    claims = [claim_of(loop_of(craft=text)) for text in (CRAFT, craft, craft + orbit)]
    assert [c.numbers for c in claims] == [claims[0].numbers] * 3
    assert [c.outcome for c in claims] == ["proved"] * 3


def test_other_spectra_are_left_undecided_and_say_so():
    for lines in ("phi_0 = -0.4\nphi_1 = -0.5\nb = -0.01", "phi_0 = [-0.4, -0.4, -0.3]\nphi_1 = -0.4\nb = -0.01"):
        claim = claim_of(loop_of(lines))
        assert claim.outcome == "undecided"
        assert "only for phi_0 = phi_1" in claim.obligations[0].evidence["reason"]


def test_what_is_asked_for_and_not_shown_is_told():
    wanted = Wanted(rate=0.1, slew_angle=1.0, inertia_tolerance=0.1)
    found = certify(loop_of(), wanted=wanted)
    assert found.outcome == "undecided"
    assert {c.kind: c.outcome for c in found.claims}["inertia"] == "undecided"
    assert {c.kind: c.outcome for c in found.claims}["region"] == "proved"


@pytest.mark.parametrize("sign_policy", ["as_published", "shortest", "hysteresis"])
def test_flights_from_the_set_do_not_contradict_it(sign_policy):
    loop = loop_of(f'a = {ROOT}\nquaternion_sign = "{sign_policy}"')
    trial = fly_claims(loop, certify(loop), flights=1000)
    assert trial is not None
    assert trial.highest_share <= 1.0 + 1e-9
