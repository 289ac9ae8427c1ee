"""Torque that lags or has a limit of its rate: claims with it, false ones, flights, and what each of its terms is for."""

import json
from dataclasses import replace
from fractions import Fraction
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

import starhold as sh
from starhold.analysis.departure import first_off, start_inside
from starhold.certification.assumptions import assumption
from starhold.certification.evidence.finding import certificate
from starhold.certification.proofs import pointed
from starhold.certification.subject import make_subject
from starhold.certification.unmodelled import late_torque, named
from starhold.kernel.check import check
from starhold.kernel.numbers import RefusedError
from starhold.parts.catalogue import fit
from starhold.scenario.building import build
from starhold.studies.compare import record
from tests.certification.pointing_hunt import Attack
from tests.tiers import leading

LATE = [(("lag", 0.05),), (("rate-limit", 0.1),), (("lag", 0.5),)]


@cache
def flying(part, *numbers):
    """A loop with an actuator, and its pointing claim."""
    given = sh.load("three-laws")
    loop = build(given, given.pick("lyapunov")).with_parts(fit("actuator", part, *numbers))
    claim, why = pointed(make_subject(loop))
    return loop, claim, why


def edited(claim, part="numbers", **changes):
    """The certificate of a claim with other entries."""
    one = claim.proof.claim | {part: claim.proof.claim[part] | changes}
    return json.dumps(certificate(list(claim.proof.programs.values()), [one]))


@pytest.mark.parametrize("late", leading(LATE))
def test_an_actuator_that_lags_is_in_the_claim_and_no_flight_breaks_it(late):
    loop, claim, _ = flying(*late)
    assert claim.numbers["late_torque"] > 0.0
    (whole,) = named([claim], loop, 0.0)
    assert not [name for name in whole.assumptions if name.startswith("without:actuator")]
    assert any(name.startswith("late:") for name in whole.assumptions)
    found, shares = Attack({"programs": dict(claim.proof.programs)}, claim.proof.claim, 3).worst()
    assert found == ""
    assert max(shares) > 0.1


def test_a_lag_that_makes_the_loop_unstable_is_left_out_by_name():
    loop, claim, why = flying("lag", 20.0)
    assert "late_torque" not in claim.numbers
    assert "with what is late" in why
    (whole,) = named([claim], loop, 0.0)
    assert "without:actuator lag" in whole.assumptions


@pytest.mark.parametrize(
    ("name", "factor"),
    [("rest", 0.5), ("weight", 0.1), ("weight", 10.0), ("begun", 30.0), ("kept", 7.0), ("mean", 2.3)],
)
def test_the_kernel_refuses_other_numbers_with_the_evidence(name, factor):
    _, claim, _ = flying("lag", 0.05)
    key = f"late.torque.{name}"
    with pytest.raises(RefusedError):
        check(edited(claim, **{key: str(Fraction(claim.proof.claim["numbers"][key]) * Fraction(factor))}))


def test_the_kernel_refuses_a_lag_that_nothing_limits_or_that_is_told_in_part():
    _, claim, _ = flying("rate-limit", 0.1)
    assert check(edited(claim))
    for name in ("kept", "mean", "weight", "begun", "rest"):
        numbers = {k: x for k, x in claim.proof.claim["numbers"].items() if k != f"late.torque.{name}"}
        one = claim.proof.claim | {"numbers": numbers}
        with pytest.raises(RefusedError):
            check(json.dumps(certificate(list(claim.proof.programs.values()), [one])))
    with pytest.raises(RefusedError):
        check(edited(claim, **{"late.torque.most": "1/100000"}))


def test_the_claim_of_another_lag_is_not_that_of_the_loop():
    """The kernel believes how late a torque is; the comparison with the scenario does not."""
    loop, claim, _ = flying("lag", 0.05)
    given = sh.load("three-laws")
    slower = build(given, given.pick("lyapunov")).with_parts(fit("actuator", "lag", 0.06))
    plain = build(given, given.pick("lyapunov"))
    for other, same in ((loop, True), (slower, False), (plain, False)):
        told = late_torque(other)
        numbers = claim.proof.claim["numbers"]
        kept = told and Fraction(numbers["late.torque.kept"]) >= Fraction(told.kept)
        assert bool(kept) == same


def test_a_flight_that_begins_with_another_torque_leaves_the_claim():
    class Span(dict):
        pass

    unmet = assumption("late:0.002").unmet
    assert unmet is not None
    for off, where in ((0.001, False), (0.003, True)):
        span = Span(torque=np.zeros((3, 3)), command=np.array([[off, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]))
        ((seen, _),) = unmet(span)
        assert bool(np.any(seen)) == where


def test_a_loop_that_starts_with_a_torque_further_from_its_command_does_not_start_inside():
    loop, claim, _ = flying("lag", 0.05)
    off = first_off(loop)
    run = record(sh.load("three-laws").with_({"spacecraft.actuator_lag": 0.05, "simulation.duration": 1.0}), loop)
    assert np.isclose(off, np.linalg.norm(run["torque"][0] - run["command"][0]), rtol=1e-12)
    for most, inside in ((1.001 * off, True), (0.999 * off, False)):
        told = replace(claim, numbers=claim.numbers | {"late_torque": most, "start": 0.03})
        assert start_inside(SimpleNamespace(claims=[told]), loop) == {"pointing": inside}
