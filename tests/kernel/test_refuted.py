"""What refutes a claim about an attitude loop: found, checked, computed otherwise, changed, and with a premise dropped."""

import copy
import json
import math
import random
from dataclasses import replace
from fractions import Fraction
from functools import cache

import numpy as np
import pytest

from starhold.analysis.trial import BrokenClaimError, fly_claims
from starhold.certification.certificate import Certificate, write
from starhold.certification.certify import Wanted, certify
from starhold.certification.comparison import differences
from starhold.certification.evidence.attitude import Loop
from starhold.certification.evidence.claims import find_claims
from starhold.certification.evidence.finding import certificate as of_claims
from starhold.certification.evidence.refuted import REFUTING, against_far, find_refuted
from starhold.certification.proofs import proved_claims
from starhold.certification.subject import make_subject
from starhold.checker import check_file, passed
from starhold.kernel.check import check
from starhold.kernel.numbers import RefusedError
from starhold.kernel.reading import read_certificate
from starhold.kernel.theorems import THEOREMS, refuted
from starhold.laws import lqr, matrix_pd, pd
from starhold.laws.sliding import Gains as Sliding
from starhold.parts.environments.gravity_gradient import gravity_gradient
from tests.certification.loops import FULL, LOPSIDED, PRINCIPAL, UNEVEN, loop_of
from tests.kernel.certificates import text
from tests.kernel.mutations import refusals
from tests.kernel.oracle import Oracle, run
from tests.making import built
from tests.tiers import WHOLE, leading

SKEWED = ((0.01, 0.02, 0.0), (0.02, 0.01, 0.0), (0.0, 0.0, 0.01))
FAR = Wanted(slew_angle=math.radians(120.0))
CASES = {
    "rises near": ("matrix-pd", matrix_pd.Gains((0.09, -0.09, 0.09), (0.01,) * 3), Wanted(), {}, "convergence"),
    "not positive": ("matrix-pd", matrix_pd.Gains((0.09,) * 3, (0.01, 0.01, -0.01)), Wanted(), {}, "convergence"),
    "indefinite": ("matrix-pd", matrix_pd.Gains((0.09,) * 3, SKEWED), Wanted(), {}, "convergence"),
    "anywhere": ("lqr", lqr.design(PRINCIPAL, LOPSIDED), Wanted(rate=math.inf), {}, "convergence"),
    "axis": ("lqr", lqr.design(PRINCIPAL, UNEVEN), FAR, {}, "torque-limit"),
    "norm": ("lqr", lqr.design(PRINCIPAL, UNEVEN), FAR, {"limit": "norm"}, "torque-limit"),
    "slow": ("pd", pd.Gains(9.0, 1.0), Wanted(), {"period": 1.0}, "sampling"),
    "pushed by gravity": ("sliding", Sliding((0.08,) * 3, (1e-7,) * 3), Wanted(), {}, "sliding"),
    "pushed": ("sliding", Sliding((0.08,) * 3, (5e-3,) * 3), Wanted(disturbance=0.01), {}, "sliding"),
    "led away": ("sliding", Sliding((0.08, -0.08, 0.08), (5e-3,) * 3), Wanted(), {}, "sliding"),
    "at any attitude": ("lqr", lqr.design(PRINCIPAL, LOPSIDED), Wanted(rate=1.0), {}, "convergence"),
}


@cache
def made(name):
    """The loop, what is wanted of it, and what was found."""
    law, gains, wanted, changes, _ = CASES[name]
    loop = loop_of(law, gains, FULL if law == "sliding" else PRINCIPAL, **changes)
    found = find_claims(make_subject(loop, wanted.disturbance), wanted.slew_angle)
    find_refuted(found, wanted.slew_angle, wanted.rate)
    return loop, wanted, found


def content_of(name):
    """A certificate with the refutation alone."""
    _, _, found = made(name)
    against = [claim for claim in found.claims if claim["theorem"] in REFUTING]
    kind = CASES[name][4]
    chosen = next(c for c in against if check(text(of_claims(found.programs, [c])))[0].statement.label == kind)
    return copy.deepcopy(of_claims(found.programs, [chosen]))


class Against(Oracle):
    """Tries a refutation in floats."""

    def told(self, turn="turn", rate="rate", size=1.0):
        t, w = (size * np.array([self.numbers.get(f"{name}.{k}", 0.0) for k in range(3)]) for name in (turn, rate))
        return np.append(1.0 - t @ t, 2.0 * t) / (1.0 + t @ t), w

    def free(self, q, w):
        return self.law(q, w, *[np.zeros(3)] * 4)

    def height(self, q, w):
        return self.lyapunov(q, w) - self.lyapunov(np.eye(4)[0], np.zeros(3))

    def holds(self, tries=40):
        (q, w), n = self.told(), self.numbers
        fed = q[0] >= -1e-9 and self.body()
        match self.claim["theorem"]:
            case "V rises":
                return fed and self.rises(q, w) and np.linalg.norm(w) <= n.get("fastest", math.inf) * (1.0 + 1e-9)
            case "V rises near the target":
                return fed and self.rises(q, w) and self.rises(*self.told(size=1e-2))
            case "V is negative":
                return fed and self.height(q, w) < 0.0 and self.height(*self.told(size=1e-2)) < 0.0
            case "asks for more than the limit":
                rest, still = self.told("rest", "none")
                u = np.abs(self.free(q, w)[0])
                over = u.max() >= n["limit"] if "limit" in n else np.linalg.norm(u) >= n["limit.norm"]
                turned = 2.0 * math.acos(min(rest[0], 1.0)) <= n["angle"] * (1.0 + 1e-6)
                return fed and over and turned and self.height(q, w) <= self.height(rest, still) * (1.0 + 1e-9)
            case "does not settle between samples":
                return self.body() and np.abs(np.linalg.eigvals(self.step(n["period"]))).max() >= 1.0 - 1e-9
            case "is pushed off its surface":
                i = next(k for k in range(3) if f"outside.{k}" in n)
                s, moved = self.surface(q, w)
                return fed and s[i] > 0.0 and moved[i] + n[f"outside.{i}"] > 0.0
        s, _ = self.surface(q, np.zeros(3))
        return fed and s @ q[1:] < 0.0

    def rises(self, q, w):
        return self.slope(q, w, self.free(q, w)[1])[0] > 0.0

    def step(self, h):
        """A step of the motion near rest by differences."""
        rows, size = [], 1e-6
        for k in range(6):
            x = size * np.eye(6)[k]
            u = self.free(np.append(1.0, x[3:]), x[:3])[0]
            a = np.linalg.solve(self.J, u)
            rows.append(np.append(x[:3] + h * a, x[3:] + h * x[:3] / 2.0 + h * h * a / 4.0) / size)
        return np.array(rows).T

    def surface(self, q, w):
        def s(q, w):
            return run(self.programs["surface"], self.inputs(q, w, *[np.zeros(3)] * 4)[0])

        if "law" not in self.programs:
            return s(q, w), None
        T, h = self.free(q, w)[1], 1e-6
        qd = 0.5 * np.concatenate([[-w @ q[1:]], q[0] * w + np.cross(q[1:], w)])
        wd = np.linalg.solve(self.J, T)
        return s(q, w), self.J @ (s(q + h * qd, w + h * wd) - s(q - h * qd, w - h * wd)) / (2.0 * h)


@pytest.mark.parametrize("name", leading(CASES, 4))
def test_what_is_false_is_refuted_and_the_refutation_holds_when_computed_otherwise(name, tmp_path):
    loop, wanted, _ = made(name)
    content = content_of(name)
    (shown,) = check(text(content))
    assert shown.statement.refutes
    assert Against(content, content["claims"][0]).holds()
    found = certify(loop, name, wanted)
    claim = found.claim(CASES[name][4])
    assert claim.outcome == found.outcome == "refuted"
    evidence, against = claim.refutation().evidence, Against({"programs": claim.proof.programs}, claim.proof.claim)
    assert evidence
    if "state" in evidence:
        q, w = against.told()
        assert evidence["state"] == {"attitude": pytest.approx(q), "rate": pytest.approx(w)}
        if "V" in evidence:
            assert evidence["V"] == pytest.approx(against.height(q, w), rel=1e-6)
        if "V'" in evidence:
            assert evidence["V'"] == pytest.approx(against.slope(q, w, against.free(q, w)[1])[0], rel=1e-4)
    assert np.hypot(*evidence.get("eigenvalue", (1.0, 0.0))) >= 1.0
    assert differences(claim.proof.claim, loop) == []
    write([found], "made", tmp_path / "c.json")
    findings = check_file(tmp_path / "c.json")
    assert passed(findings)
    reasons = [f.reason for f in findings if f.claim == claim.kind]
    assert reasons == [f"refuted by the kernel: {shown.statement.text}"]


def test_a_refutation_is_none_of_another_loop():
    content = content_of("axis")["claims"][0]
    assert differences(content, loop_of("lqr", lqr.design(PRINCIPAL, LOPSIDED), PRINCIPAL))
    loop, _, _ = made("axis")
    wider = replace(loop, craft=loop.craft._replace(torque_limit=2.0 * loop.craft.torque_limit))
    assert "limit is lower" in differences(content, wider)


def test_a_file_cannot_call_a_refutation_a_proof(tmp_path):
    loop, wanted, _ = made("slow")
    path = tmp_path / "c.json"
    write([certify(loop, "slow", wanted)], "made", path)
    content = json.loads(path.read_text())
    given = content["certificates"][0]
    for claim in given["claims"]:
        claim["outcome"] = {"refuted": "proved", "proved": "refuted"}.get(claim["outcome"], claim["outcome"])
    for outcome in ("proved", "refuted"):
        given["outcome"] = outcome
        path.write_text(json.dumps(content))
        assert not passed(check_file(path))


def test_what_holds_is_not_refuted():
    for law, gains, wanted in (
        ("pd", pd.Gains(0.09, 0.009), Wanted()),
        ("sliding", Sliding((0.08,) * 3, (5e-3,) * 3), Wanted()),
        ("lqr", lqr.design(PRINCIPAL, UNEVEN), Wanted(slew_angle=math.radians(40.0))),
    ):
        claims, _ = proved_claims(make_subject(loop_of(law, gains, PRINCIPAL)), wanted.slew_angle, wanted.rate)
        assert all(claim.outcome == "proved" for claim in claims.values())


def test_a_bound_of_the_torque_alone_refutes_no_surface():
    """Where the gravity gradient's bound exceeds what is switched, but the torque nowhere does, nothing is decided."""
    loop = loop_of("sliding", Sliding((0.08,) * 3, (5e-3,) * 3), FULL)
    modelled = float(Fraction(str(max(make_subject(loop).modelled))))
    found = certify(loop, "", Wanted(disturbance=5e-3 - 0.999999 * modelled)).claim("sliding")
    assert found.outcome == "undecided"


def test_gravity_is_told_where_it_pushes_more_than_is_switched():
    loop, wanted, _ = made("pushed by gravity")
    evidence = certify(loop, "", wanted).claim("sliding").refutation().evidence
    torque = gravity_gradient(evidence["position"], 3.0 * FULL.gravity / np.linalg.norm(evidence["position"]) ** 5, FULL)
    assert torque[evidence["axis"] - 1] > evidence["reach"]


def test_singular_stiffness_is_not_decided():
    loop = loop_of("matrix-pd", matrix_pd.Gains((0.09,) * 3, (0.01, 0.01, 0.0)))
    assert certify(loop).claim("convergence").outcome == "undecided"


@pytest.mark.slow
def test_a_larger_box_of_inertias_than_the_largest_is_not_claimed():
    gains = lqr.design(PRINCIPAL, lqr.FormII((1e-3,) * 3 + (1.0, 30.0, 4.0), (1e3,) * 3))
    loop = loop_of("lqr", gains, PRINCIPAL)
    tolerance = certify(loop).claim("inertia").numbers["tolerance"]
    assert 0.0 < tolerance < 1.0
    less, more = (certify(loop, "", Wanted(inertia_tolerance=s * tolerance)).claim("inertia") for s in (0.99, 1.05))
    assert (less.outcome, more.outcome) == ("proved", "undecided")
    assert f"{100.0 * tolerance:.3g} %" in more.obligations[0].evidence["reason"]


def test_flights_catch_a_claim_that_is_too_strong():
    """A set ten times as large as what is proved, or another loop, is contradicted by the flights."""
    loop = loop_of("lqr", lqr.design(PRINCIPAL, UNEVEN), PRINCIPAL)
    certificate = certify(loop, "too strong")
    proved = certificate.claim("torque-limit")
    stretched = proved.numbers | {name: 10.0 * proved.numbers[name] for name in ("start", "level")}
    strong = Certificate("too strong", certificate.subject, (replace(proved, numbers=stretched),))
    with pytest.raises(BrokenClaimError, match="too strong: a flight from the certified set needs"):
        fly_claims(loop, strong, flights=256)
    good, bad = (loop_of("pd", pd.Gains(damping, 0.009), PRINCIPAL) for damping in (0.09, -0.09))
    with pytest.raises(BrokenClaimError):
        fly_claims(bad, certify(good, "wrong"), flights=256)


def test_a_clipped_law_that_speeds_up_is_refuted_by_its_piece_around_the_target():
    loop = loop_of("pd", pd.Gains(-0.09, 0.009, 1), PRINCIPAL)
    claims, _ = proved_claims(make_subject(loop))
    claim = claims["convergence"]
    assert claim.outcome == "refuted"
    assert Against({"programs": claim.proof.programs}, claim.proof.claim).holds()


# --- premises ---------------------------------------------------------------------------------------------------------


def edited(name, theorem=None, **numbers):
    content = content_of(name)
    claim = content["claims"][0]
    claim["theorem"] = theorem or claim["theorem"]
    told = {key.replace("_", "."): x for key, x in numbers.items()}
    claim["numbers"] |= {key: x for key, x in told.items() if x is not None}
    claim["numbers"] = {key: x for key, x in claim["numbers"].items() if told.get(key, x) is not None}
    return content


DEMANDED = {
    "fed back": lambda: edited("led away", turn_1="2"),
    "turns faster": lambda: edited("at any attitude", fastest="1/2"),
    "V is larger": lambda: edited("axis", rest_0="0", rest_1="0", rest_2="1/10"),
}
OBLIGED = {
    "V is non-increasing": lambda: edited("anywhere", rate_0="1/1000", rate_1="0", rate_2="0"),
    "V is non-increasing near the target": lambda: edited("anywhere", "V rises near the target"),
    "V is least on target": lambda: edited("not positive", turn_0="1", rate_2="1/100"),
    "V is least on target near it": lambda: edited("not positive", turn_0="1", rate_2="1/8"),
    "turned no further": lambda: edited("axis", angle="1"),
    "torque": lambda: edited("axis", limit="1"),
    "step": lambda: edited("slow", period="1/100"),
    "reach 0": lambda: edited("pushed", outside_0="1/1000"),
    "beside the surface": lambda: edited("pushed", turn_0="-1/2", rate_0="0"),
    "q0 grows on the surface": lambda: edited("led away", turn_0="1/2", turn_1="0"),
}


@pytest.mark.parametrize("premise", DEMANDED)
def test_a_false_refutation_is_refused_for_the_one_premise_that_fails(premise, monkeypatch):
    content = DEMANDED[premise]()
    with pytest.raises(RefusedError, match=premise):
        check(text(content))
    monkeypatch.setattr(refuted, "demand", lambda truth, otherwise: None)
    assert check(text(content))
    assert not Against(content, content["claims"][0]).holds()


@pytest.mark.parametrize("premise", OBLIGED)
def test_a_false_refutation_is_refused_for_the_one_obligation_that_fails(premise):
    content = OBLIGED[premise]()
    with pytest.raises(RefusedError):
        check(text(content))
    (claim,), failed = read_certificate(text(content)), set()
    for name, obligation in THEOREMS[claim.theorem](claim):
        try:
            obligation.check(claim.evidence.get(name))
        except RefusedError:
            failed.add(name)
    claim.close()
    # V of this law is larger near the target than quadratic forms tell of it: where it is positive it is so there too.
    assert failed == {premise} | ({f"{premise} near it"} if premise == "V is least on target" else set())
    assert not Against(content, content["claims"][0]).holds()


# --- mutations --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", leading(CASES, 5))
def test_nothing_false_is_accepted(name):
    count = 200 if WHOLE else 20

    def true(content, claim):
        return Against(content, claim).holds()

    assert refusals(content_of(name), random.Random(name), count, true) > count / 4


def test_where_v_rises_nowhere_nothing_is_refuted():
    loop = Loop(make_subject(built("three-laws", "lyapunov")))
    assert not against_far(loop, 0.1)
