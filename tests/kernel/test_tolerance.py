"""The claim about the loop that flies with an inertia near the given one: what that adds is a torque from outside."""

import copy
import random
from dataclasses import replace
from fractions import Fraction
from functools import cache

import numpy as np
import pytest

import starhold as sh
from starhold.certification.certify import Wanted, certify
from starhold.certification.comparison import differences
from starhold.certification.evidence.attitude import Loop
from starhold.certification.evidence.claims import floats
from starhold.certification.evidence.finding import certificate, read
from starhold.certification.evidence.pointing import Pushed
from starhold.certification.subject import make_subject
from starhold.certification.unmodelled import Pushes
from starhold.certification.wording import sentence
from starhold.kernel.check import check
from starhold.kernel.held import Held
from starhold.kernel.loops import AttitudeLoop
from starhold.kernel.numbers import Account, RefusedError, rational
from starhold.kernel.regions import RATE, TURN
from starhold.parts.craft import tensor
from starhold.parts.environments.gravity_gradient import gravity_gradient
from tests.kernel.certificates import rekeyed, text
from tests.kernel.flights import along, moved
from tests.kernel.mutations import refusals
from tests.kernel.oracle import is_kept
from tests.making import built
from tests.tiers import fewer

MOMENTS, TOLERANCE, FAR, OUTSIDE = [2.0, 3.0, 4.0], 0.03, 0.08, 1e-5
LAW = {"type": "lyapunov", "k_rate": 0.5, "k_attitude": 0.05}


def loop_of(**tables):
    given = {"name": "off", "spacecraft": {"inertia": MOMENTS}, "law": [LAW]}
    given |= {"simulation": {"duration": "1 min", "control_period": 0.1}}
    return built(sh.scenario(given | tables))


@cache
def pointing():
    subject = make_subject(loop_of())
    loop = Loop(replace(subject, tolerance=TOLERANCE))
    assert Pushed(loop, Pushes(OUTSIDE)).find(np.radians(45.0)), loop.failed
    return certificate(loop.programs, loop.claims)


def off(rng, J, tolerance):
    """Inertias no entry of which is off by more than the tolerance, most of them by as much."""
    half = np.triu(rng.choice([-1.0, 1.0], size=(3, 3)))
    return J + tolerance * np.sqrt(np.outer(np.diagonal(J), np.diagonal(J))) * (half + np.triu(half, 1).T)


def test_the_claim_says_by_how_much_the_inertia_may_be_off():
    (proved,) = check(text(pointing()))
    assert f"with every J_ik off by up to {TOLERANCE} sqrt(J_ii J_kk)" in proved.statement.text
    assert "inertia-near" in proved.statement.assumptions
    assert "inertia-as-given" not in proved.statement.assumptions


@pytest.mark.parametrize("share", [1.5, 9.0])
def test_a_larger_tolerance_needs_another_proof(share):
    worse = copy.deepcopy(pointing())
    worse["claims"][0]["numbers"]["tolerance"] = str(Fraction(TOLERANCE) * Fraction(share))
    with pytest.raises(RefusedError, match="the inertia is known too badly" if share > 5.0 else None):
        check(text(worse))


def test_a_law_that_does_nothing_is_refused():
    """What the inertia adds to a linear acceleration is nothing where there is none."""
    content = copy.deepcopy(pointing())
    (claim,) = content["claims"]
    program = content["programs"][claim["programs"]["law"]]
    program["steps"].append(["constant", "0"])
    program["outputs"] = [len(program["inputs"]) + len(program["steps"]) - 1] * 3
    with pytest.raises(RefusedError, match="V decreases by a share"):
        check(text(rekeyed(content)))


def held(tolerance):
    """The loop, on which nothing acts but what its inertia is off by."""
    Account.left = 10**12
    loop = Loop(make_subject(loop_of()))
    own = Pushed(loop, Pushes(0.0))
    n = {"period": 0.1, "outside": 1e-14, "error": 1e-14, "tolerance": tolerance}
    return Held(AttitudeLoop(read(own.claim(own.leans[1][1], n), loop.by_digest)))


def after(x, J, period=0.1, parts=8):
    """The states (w, q) a period later."""
    q, w = np.concatenate([[np.sqrt(1.0 - (x[TURN] ** 2).sum(0))], x[TURN]]), x[RATE]
    J0 = np.diag(MOMENTS)
    command = -LAW["k_rate"] * w - LAW["k_attitude"] * q[1:] + np.cross(w, J0 @ w, axis=0)
    for _ in range(parts):
        q, w = moved(J, np.linalg.inv(J), q, w, command, period / parts)
    return np.concatenate([w, q[1:]])


@pytest.mark.parametrize("kept", [True, False])
def test_what_the_inertia_adds_is_in_the_linear_motion_of_a_period(kept, monkeypatch):
    motion, rng, most = held(FAR), np.random.default_rng(3), 0.0
    if not kept:
        monkeypatch.setattr(Held, "load", lambda *_: Fraction(0))
    tube = motion.tube(motion.region(Fraction(1, 10**8)))
    pushes, ways = motion.linear(tube), np.concatenate([np.eye(6), rng.normal(size=(60, 6))])
    bound = sum(np.linalg.norm(ways @ floats(B), axis=1) * float(b) for B, b in pushes)
    X = np.linalg.cholesky(floats(tube.region.X))
    for _ in range(20):
        x = X @ along(rng.normal(size=(6, 200)))
        left = after(x, off(rng, np.diag(MOMENTS), FAR)) - floats(motion.near.A) @ x
        most = max(most, float((np.abs(ways @ left) / bound[:, None]).max()))
    assert (most <= 1.0) == kept


@pytest.mark.parametrize("kept", [True, False])
def test_what_the_inertia_adds_is_in_what_v_changes_in_a_period(kept, monkeypatch):
    motion, rng, most = held(FAR), np.random.default_rng(3), -np.inf
    if not kept:
        monkeypatch.setattr("starhold.kernel.held.outweighed", lambda Q, *_: Q)
        monkeypatch.setattr(Held, "load", lambda *_: Fraction(0))
    tube = motion.tube(motion.region(Fraction(1, 10**5)))
    Q, _, F, push, rest, _ = motion.fall(tube)
    Q, F, G, s = floats(Q), floats(F), floats(motion.G), float(motion.s)

    def height(x):
        return s * (1.0 - np.sqrt(1.0 - (x[TURN] ** 2).sum(0))) + (x * (G @ x)).sum(0)

    X = np.linalg.cholesky(floats(tube.region.X))
    for _ in range(40):
        x = X @ along(rng.normal(size=(6, 400)))
        x *= np.minimum(np.sqrt(1e-5 * 0.999 / height(x)), 1.0)
        change = height(after(x, off(rng, np.diag(MOMENTS), FAR))) - height(x)
        bound = 0.1 * (float(push) * np.linalg.norm(F @ x, axis=0) + float(rest) - (x * (Q @ x)).sum(0))
        most = max(most, float(((change - bound) / height(x)).max()))
    assert (most <= 0.0) == kept


def test_the_gravity_gradient_on_what_the_inertia_is_off_by_is_from_outside():
    orbit = {"orbit": {"altitude": "400 km", "inclination": "50 deg"}, "environment": {"gravity_gradient": True}}
    loop, rng = loop_of(**orbit), np.random.default_rng(5)
    subject = make_subject(loop)
    uncertain = replace(subject, tolerance=TOLERANCE)
    more = uncertain.against(uncertain.envelope(False)).outside - subject.against(subject.envelope(False)).outside
    J, size = tensor(loop.craft.inertia), float(np.linalg.norm(loop.start.position))
    worst = 0.0
    for _ in range(2000):
        d = off(rng, J, TOLERANCE) - J
        n = tuple(along(rng.normal(size=(3, 1)))[:, 0])
        craft = loop.craft._replace(inertia=tuple(map(tuple, d.tolist())))
        worst = max(worst, float(np.linalg.norm(gravity_gradient(n, 3.0 * loop.craft.gravity / size**3, craft))))
    assert 0.4 * more < worst <= more


def test_a_wanted_tolerance_is_in_the_claim_and_left_out_by_name_where_nothing_is_proved():
    kept, without = (
        certify(loop_of(), "", Wanted(pointing=True, alone=True, inertia_tolerance=x)) for x in (TOLERANCE, 0.9)
    )
    claims = [one.claim("pointing") for one in (kept, without)]
    assert [claim.outcome for claim in claims] == ["proved", "proved"]
    assert rational(claims[0].proof.claim["numbers"]["tolerance"]) == Fraction(TOLERANCE)
    assert "every entry of the inertia off by up to 3 %" in sentence(claims[0], kept.subject)
    assert "inertia-as-given" in claims[1].assumptions
    # A proof of what the gravity gradient does to the inertia as given is none of what it does to others.
    pulled = loop_of(orbit={"altitude": "400 km", "inclination": "50 deg"}, environment={"gravity_gradient": True})
    proof = certify(pulled, "", Wanted(pointing=True, alone=True, inertia_tolerance=0.01)).claim("pointing").proof.claim
    assert differences(proof, pulled) == []
    less = proof | {"numbers": proof["numbers"] | {"outside": str(rational(proof["numbers"]["outside"]) * Fraction(9, 10))}}
    assert differences(less, pulled) == ["outside is exceeded"]


@pytest.mark.slow
def test_nothing_false_is_accepted():
    count = fewer(100)
    assert refusals(pointing(), random.Random(7), count, is_kept) > count / 2
