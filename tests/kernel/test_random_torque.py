"""Random torques in the claim about the loop that flies: what is proved of them, simulations, flights, and false claims."""

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from scipy.linalg import solve_discrete_lyapunov

from starhold.certification.certify import Wanted, certify
from starhold.certification.comparison import differences
from starhold.certification.evidence import noise
from starhold.certification.evidence.attitude import Loop
from starhold.certification.evidence.finding import read
from starhold.certification.subject import make_subject
from starhold.certification.unmodelled import driven_errors
from starhold.certification.wording import sentence
from starhold.kernel.check import check
from starhold.kernel.held import Held
from starhold.kernel.loops import AttitudeLoop
from starhold.kernel.numbers import RefusedError
from starhold.kernel.theorems.noise import DEVIATION
from starhold.laws import lyapunov
from starhold.parts.catalogue import fit
from tests.certification.attack import flown
from tests.certification.loops import free, loop_of
from tests.kernel.certificates import contents, failing, flying, radii_of, text
from tests.kernel.oracle import Oracle, number
from tests.tiers import leading

TORQUE = "noise.torque"


def shaken():
    """A certificate of a loop with a random torque, and its claim."""
    content = contents("flying", "shaken")
    return content, content["claims"][0]


def test_deviations_are_hardly_above_those_of_the_motion():
    _, claim = shaken()
    oracle = Oracle({"programs": flying("shaken").by_digest}, claim)
    A, B = oracle.held()[0], oracle.shaken()
    exact = solve_discrete_lyapunov(A, B @ B.T)
    for place, part in ((2, slice(3)), (3, slice(3, 6))):
        ratio = number(claim["evidence"]["deviations"][place]) / math.sqrt(np.linalg.eigvalsh(exact[part, part])[-1])
        assert 1.0 < ratio < 1.001
    # The filter is told without errors.
    assert claim["numbers"]["noise.attitude"] != "0"
    assert number(claim["numbers"]["noise.attitude"]) < 1e-12


@pytest.mark.parametrize("name", leading(["shaken", "noisy"]))
def test_a_random_torque_takes_the_motion_out_of_its_radii_no_more_often_than_is_claimed(name, monkeypatch):
    """Alone, and with the noise of a filter, in many spans of 2000 samples."""
    loop = flying(name).loop
    monkeypatch.setattr(noise, "RARELY", Fraction(3, 10))
    monkeypatch.setattr(noise, "samples_of", lambda loop: 2000)
    loop = loop if name == "shaken" else loop.with_parts(fit("environment", "random-torque", 2e-6))
    found = Loop(make_subject(loop))
    numbers, evidence = radii_of(found)
    claim = found.claim("points", [], None, **numbers, period=loop.period) | {"evidence": evidence}
    oracle = Oracle({"programs": found.by_digest}, claim)
    most, radii = oracle.largest_errors(2000, [oracle.held()] * 1000), oracle.radii()
    assert (most > radii)[2:].any(axis=0).mean() <= 0.3
    torques = np.random.default_rng(4).normal(scale=2e-6, size=(1000, 2000, 3))
    assert (np.linalg.norm(torques, axis=2).max(axis=1) > oracle.numbers[TORQUE]).mean() <= 0.3 * noise.SHARES[0] + 0.01
    # A radius of the quantile itself is at most 1.75 times smaller: samples on end are like one another.
    assert radii[3, 0] < 1.75 * np.quantile(most[3], 1.0 - 0.3 * noise.SHARES[3])


def test_a_radius_that_random_torques_leave_more_often_fails_the_share_alone():
    content, claim = shaken()
    claim["numbers"][TORQUE] = str(Fraction(number(claim["numbers"][TORQUE]) * 0.6))
    assert failing(claim, content["programs"]) == {"share"}


@pytest.mark.parametrize("lost", [("share", "samples", "every"), (DEVIATION,)])
def test_a_random_torque_without_a_share_or_a_deviation_is_refused(lost):
    content, claim = shaken()
    assert check(text(content))
    for name in lost:
        del claim["numbers"][name]
    with pytest.raises(RefusedError):
        check(text(content))


def test_a_claim_for_a_share_is_about_the_random_torque_of_its_loop():
    _, claim = shaken()
    loop = flying("shaken").loop
    assert differences(claim, loop) == []
    (fitted,) = loop.used("environment")
    stronger = loop.with_parts(fit("environment", "random-torque", 1.001 * fitted.params.deviation))
    assert differences(claim, stronger) == [f"{DEVIATION} is exceeded"]
    del claim["numbers"][DEVIATION], claim["numbers"][TORQUE]
    assert differences(claim, loop) == [f"{DEVIATION} is exceeded"]


def test_two_random_torques_are_as_one_of_both():
    loop = flying("shaken").loop
    both = replace(loop, parts=(*loop.parts, replace(fit("environment", "random-torque", 1.5e-6), name="second")))
    assert driven_errors(both).torque == pytest.approx(2.5e-6)
    assert driven_errors(both).parts == both.used("environment")


@pytest.mark.slow
def test_flights_end_as_near_as_is_proved():
    loop = free(loop_of("lyapunov", lyapunov.examples()[0], sign_policy="shortest"))
    loop = loop.with_parts(fit("environment", "random-torque", 1e-4))
    certificate = certify(loop, "shaken", Wanted(alone=True))
    claim = certificate.claim("pointing")
    assert (claim.outcome, claim.left_out) == ("proved", [])
    assert "in at least 99.73 % of spans" in sentence(claim, certificate.subject)
    assert "random ones of up to 0.0006491 N m" in sentence(claim, certificate.subject)
    # A claim of half of it would be broken.
    assert 0.5 < flown(loop, claim, np.random.default_rng(1)) <= 1.0


def test_it_is_a_push_but_for_what_it_does_linearly():
    """In levels and in what is not linear it is a torque from outside, of its radius; near the target noise has the rest."""
    loop, (claim,) = flying("shaken"), flying("shaken").claims
    most, outside = (Fraction(str(claim["numbers"][name])) for name in (TORQUE, "outside"))
    bounded = claim["numbers"] | {TORQUE: "0", "outside": str(outside + most)}
    end = Fraction(claim["evidence"]["levels"][-1]["end"])
    tubes = []
    for numbers in (claim["numbers"], bounded):
        held = Held(AttitudeLoop(read(claim | {"numbers": numbers}, loop.by_digest), remembers=True))
        tubes.append((held, held.tube(held.region(end))))
    assert tubes[0][1].push == tubes[1][1].push > most
    assert tubes[0][1].drift == tubes[1][1].drift
    sizes = [[b for _, b in held.linear(region)] for held, region in tubes]
    assert [y - x for x, y in zip(*sizes, strict=True)] == [most, most, 0]
