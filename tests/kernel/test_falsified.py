"""Claims that are false are refused, with a counter-example that holds when it is computed otherwise."""

import math
from dataclasses import replace

import numpy as np
import pytest

from starhold.algebra.quaternion import derivative
from starhold.analysis.trial import BrokenClaimError, fly_claims
from starhold.certification.certificate import Certificate
from starhold.certification.certify import Wanted, certify
from starhold.laws import lqr, matrix_pd, pd, sliding
from starhold.laws.interface import Measurement, NoMemory
from starhold.parts.bodies.rigid_body import angular_acceleration
from starhold.parts.environments.gravity_gradient import gravity_gradient
from tests.certification.loops import FULL, LOPSIDED, PRINCIPAL, UNEVEN, loop_of

STILL = (0.0, 0.0, 0.0)


def refutation(certificate, kind):
    claim = certificate.claim(kind)
    assert claim.outcome == "refuted"
    assert certificate.outcome == "refuted"
    return claim.refutation().evidence


def seen_at(state):
    w = tuple(state["rate"])
    return Measurement(tuple(state["attitude"]), w, w, STILL, STILL, STILL, STILL, 0.1)


def slope(loop, state):
    """V' by a central difference of the law's V along the loop's motion."""
    measurement = seen_at(state)
    torque, _ = loop.law.command(measurement, loop.gains, loop.craft, NoMemory())
    turn, spin = (
        derivative(measurement.attitude, measurement.rate),
        angular_acceleration(measurement.rate, torque, loop.craft),
    )

    def value(h):
        q = tuple(a + h * b for a, b in zip(measurement.attitude, turn, strict=True))
        w = tuple(a + h * b for a, b in zip(measurement.rate, spin, strict=True))
        return loop.law.lyapunov(measurement._replace(attitude=q, rate=w), loop.gains, loop.craft)

    return (value(1e-6) - value(-1e-6)) / 2e-6


def test_unbalanced_weights_are_not_global():
    loop = loop_of("lqr", lqr.design(PRINCIPAL, LOPSIDED), PRINCIPAL)
    evidence = refutation(certify(loop, "", Wanted(rate=math.inf)), "convergence")
    assert evidence["V'"] > 0.0
    assert slope(loop, evidence["state"]) == pytest.approx(evidence["V'"], rel=1e-4)
    # What does hold is told when nothing more is asked for.
    assert certify(loop).claim("convergence").outcome == "proved"
    assert math.radians(3.0) < certify(loop).claim("convergence").numbers["slew_angle"] < math.pi


@pytest.mark.parametrize(
    "gains",
    [
        matrix_pd.Gains((0.09, -0.09, 0.09), (0.01, 0.01, 0.01)),
        matrix_pd.Gains((0.09, 0.09, 0.09), (0.01, 0.01, -0.01)),
        matrix_pd.Gains((0.09, 0.09, 0.09), ((0.01, 0.02, 0.0), (0.02, 0.01, 0.0), (0.0, 0.0, 0.01))),
    ],
)
def test_indefinite_gains(gains):
    loop = loop_of("matrix-pd", gains, PRINCIPAL)
    evidence = refutation(certify(loop), "convergence")
    if "V" in evidence:
        assert loop.law.lyapunov(seen_at(evidence["state"]), gains, PRINCIPAL) == pytest.approx(evidence["V"], rel=1e-6)
        assert evidence["V"] <= 0.0
    else:
        assert slope(loop, evidence["state"]) > 0.0


@pytest.mark.parametrize("gains", [pd.Gains(-0.09, 0.009), pd.Gains(0.09, -0.009)])
@pytest.mark.parametrize("law", ["pd", "lyapunov"])
def test_wrong_sign_of_a_gain(law, gains):
    loop = loop_of(law, loop_of(law, gains).law.gains(*gains[:2]))
    certificate = certify(loop)
    evidence = refutation(certificate, "convergence")
    assert evidence.get("V'", 1.0) > 0.0
    assert evidence.get("V", -1.0) < 0.0
    # The sampled loop is unstable too, which its eigenvalue shows.
    assert np.hypot(*refutation(certificate, "sampling")["eigenvalue"]) >= 1.0


def test_singular_stiffness_is_not_decided():
    loop = loop_of("matrix-pd", matrix_pd.Gains((0.09, 0.09, 0.09), (0.01, 0.01, 0.0)))
    assert certify(loop).claim("convergence").outcome == "undecided"


def test_switching_torque_below_the_gravity_gradient():
    loop = loop_of("sliding", sliding.Gains((0.08, 0.08, 0.08), (1e-7, 1e-7, 1e-7)))
    evidence = refutation(certify(loop), "sliding")
    r = np.linalg.norm(evidence["position"])
    torque = gravity_gradient(tuple(evidence["position"]), 3.0 * FULL.gravity / r**5, FULL)
    axis = evidence["axis"] - 1
    assert torque[axis] > evidence["reach"]
    s = sliding.surface(seen_at(evidence["state"]), loop.gains)
    u, _ = sliding.torque(seen_at(evidence["state"]), loop.gains, FULL, NoMemory())
    pushed = angular_acceleration(
        tuple(evidence["state"]["rate"]), tuple(a + b for a, b in zip(u, torque, strict=True)), FULL
    )
    q_rate = derivative(tuple(evidence["state"]["attitude"]), tuple(evidence["state"]["rate"]))[1:]
    s_rate = np.array(pushed) + 0.08 * np.array(q_rate)
    momentum = np.array(FULL.inertia) @ s_rate
    assert s[axis] > 0.0
    assert momentum[axis] > 0.0


def test_switching_torque_below_the_disturbance():
    loop = loop_of("sliding", sliding.Gains((0.08, 0.08, 0.08), (5e-3, 5e-3, 5e-3)))
    assert certify(loop).claim("sliding").outcome == "proved"
    assert refutation(certify(loop, "", Wanted(disturbance=0.01)), "sliding")["torque"] > 5e-3


def test_surface_that_does_not_hold_the_target():
    loop = loop_of("sliding", sliding.Gains((0.08, -0.08, 0.08), (5e-3, 5e-3, 5e-3)))
    evidence = refutation(certify(loop), "sliding")
    assert np.array(evidence["axis"]) @ np.diag([0.08, -0.08, 0.08]) @ np.array(evidence["axis"]) < 0.0


@pytest.mark.parametrize("kind", ["axis", "norm"])
def test_torque_limit_ignored(kind):
    loop = loop_of("lqr", lqr.design(PRINCIPAL, UNEVEN), PRINCIPAL, limit=kind)
    assert certify(loop, "", Wanted(slew_angle=math.radians(40.0))).claim("torque-limit").outcome == "proved"
    claim = certify(loop, "", Wanted(slew_angle=math.radians(120.0))).claim("torque-limit")
    assert claim.outcome == "refuted"
    state = claim.refutation().evidence["state"]
    u = np.array(loop.law.command(seen_at(state), loop.gains, PRINCIPAL, NoMemory())[0])
    assert (np.linalg.norm(u) if kind == "norm" else np.abs(u).max()) > PRINCIPAL.torque_limit
    value = loop.law.lyapunov(seen_at(state), loop.gains, PRINCIPAL)
    # The state is in the set: no higher than a body at rest turned by 120 degrees.
    assert value <= 2.0 * (1.0 - math.cos(math.radians(60.0))) * (1.0 + 1e-9)


def test_inertia_outside_the_box():
    """Beyond the largest box the claim is not made, and an inertia is told for which the proof's function rises."""
    gains = lqr.design(PRINCIPAL, lqr.FormII((1e-3,) * 3 + (1.0, 30.0, 4.0), (1e3,) * 3))
    loop = loop_of("lqr", gains, PRINCIPAL)
    largest = certify(loop).claim("inertia")
    assert largest.outcome == "proved"
    tolerance = largest.numbers["tolerance"]
    assert 0.0 < tolerance < 1.0
    assert certify(loop, "", Wanted(inertia_tolerance=tolerance * 0.99)).claim("inertia").outcome == "proved"
    refused = certify(loop, "", Wanted(inertia_tolerance=min(1.0, tolerance * 1.05))).claim("inertia")
    assert refused.outcome == "undecided"
    assert f"{100.0 * tolerance:.3g} %" in refused.obligations[0].evidence["reason"]


def test_period_that_is_too_long():
    loop = loop_of("pd", pd.Gains(9.0, 1.0), PRINCIPAL, period=1.0)
    assert abs(complex(*refutation(certify(loop), "sampling")["eigenvalue"])) > 1.0


def test_flights_catch_a_claim_that_is_too_strong():
    """The certifier's own test: a set ten times as large as what is proved is contradicted by the flights."""
    loop = loop_of("lqr", lqr.design(PRINCIPAL, UNEVEN), PRINCIPAL)
    certificate = certify(loop, "too strong")
    proved = certificate.claim("torque-limit")
    stretched = {**proved.numbers, "start": 10.0 * proved.numbers["start"], "level": 10.0 * proved.numbers["level"]}
    claim = replace(proved, numbers=stretched)
    with pytest.raises(BrokenClaimError, match="too strong: a flight from the certified set needs"):
        fly_claims(loop, Certificate("too strong", certificate.subject, (claim,)), flights=256)


def test_flights_catch_a_loop_that_does_not_converge():
    good = loop_of("pd", pd.Gains(0.09, 0.009), PRINCIPAL)
    bad = loop_of("pd", pd.Gains(-0.09, 0.009), PRINCIPAL)
    with pytest.raises(BrokenClaimError):
        fly_claims(bad, certify(good, "wrong"), flights=256)
