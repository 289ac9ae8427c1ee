"""The page says of each law what is proved, what is not and why, and nothing of a certificate is taken for markup."""

import re
from dataclasses import replace
from functools import cache

import pytest

from starhold.certification.assumptions import WITHOUT, texts
from starhold.certification.certificate import Certificate, Claim, Obligation
from starhold.certification.certify import Wanted, certify
from starhold.certification.obligations import OBLIGATIONS
from starhold.certification.wording import HEADINGS, methods, sentence
from starhold.report.answer import proofs
from starhold.report.page import render
from starhold.report.proved import section
from starhold.scenario.building import build
from starhold.scenario.reading import parse
from tests.making import built
from tests.report import flown
from tests.report.reader import Reader
from tests.small import CRAFT, MPC, PD, WEAK


@cache
def certificates() -> tuple[Certificate, ...]:
    """Everything proved, one claim refuted, no claim."""
    scenario = parse(CRAFT + PD + WEAK + MPC, "test")
    wanted = {"mpc": Wanted()}
    more = Wanted(disturbance=1e-5)
    return tuple(certify(build(scenario, one), one.name, wanted.get(one.name, more)) for one in scenario.laws)


def told(*given: Certificate) -> Reader:
    """The section about certificates."""
    first = flown.flights()[0]
    return Reader(section([replace(first, name=c.name, certificates=(c,)) for c in given]))


def plain(text: str) -> str:
    return re.sub(r"\s+", " ", text)


def outcomes(reader: Reader) -> list[str]:
    return [str(attrs["class"]).split()[1] for _, attrs in reader.tags if str(attrs.get("class")).startswith("outcome ")]


@pytest.mark.slow
def test_every_claim_is_told_with_its_obligations_and_assumptions() -> None:
    certificate = certificates()[0]
    assert {claim.kind for claim in certificate.claims} == {"convergence", "torque-limit", "pointing", "inertia", "sampling"}
    found = told(certificate)
    text = plain(found.text).lower()
    for claim in certificate.claims:
        assert HEADINGS[claim.kind].lower() in text
        assert sentence(claim, certificate.subject).lower() in text
        assert methods(claim).lower() in text
        for obligation in claim.obligations:
            assert OBLIGATIONS[obligation.name].lower() in text
        for assumption in texts(claim.assumptions):
            assert assumption.lower() in text
    assert sum("data-claim" in attrs for _, attrs in found.tags) == len(certificate.claims)
    assert set(outcomes(found)) == {"proved"}
    assert "starhold check certificate.json" in text


@pytest.mark.slow
def test_numbers_of_the_proof_are_shown() -> None:
    certificate = certificates()[0]
    text = plain(told(certificate).text)
    limit, sampling = certificate.claim("torque-limit"), certificate.claim("sampling")
    assert limit is not None
    assert sampling is not None
    assert f"V at the start, at most {limit.numbers['start']:.6g}" in text
    assert f"{sampling.numbers['longest']:.6g} s" in text
    real, imaginary = sampling.numbers["eigenvalues"][0]
    assert f"{real:.6g} ± {abs(imaginary):.3g} i" in text
    assert "None" not in text


def test_a_refuted_claim_shows_the_state_that_refutes_it() -> None:
    certificate = certificates()[1]
    claim = certificate.claim("sliding")
    assert claim is not None
    assert claim.outcome == "refuted"
    refuted = claim.refutation()
    assert refuted is not None
    found = told(certificate)
    # One for the claim and one for the obligation.
    assert outcomes(found).count("refuted") == 2
    rate = ", ".join(f"{x:.4g}" for x in refuted.evidence["state"]["rate"])
    assert f"w = ({rate}) rad/s" in plain(found.text)
    # Measurement without opening anything.
    page = section([replace(flown.flights()[0], certificates=(certificate,))])
    summaries = re.findall(r"<summary>.*?</summary>", page, flags=re.DOTALL)
    assert any(rate in summary for summary in summaries)


def test_a_law_without_claims_says_so() -> None:
    found = told(certificates()[2])
    assert "Nothing is claimed" in found.text
    assert "not sought" in found.text


def test_pages_begin_with_why_nothing_is_claimed_of_the_loop_as_it_flies() -> None:
    certificate = certify(built(parse(CRAFT + PD, "test")), "pd")
    found = told(certificate)
    assert plain(found.text).index("not sought") < plain(found.text).index("Converges")
    for text in (found.text, Reader(proofs([replace(flown.flights()[0], certificates=(certificate,))])).text):
        assert "not sought" in plain(text)
        assert "--proof, or starhold certify, looks for it" in plain(text)


def test_flights_without_certificates_have_no_section() -> None:
    assert section(flown.flights()) == ""
    assert "<h2>Proofs</h2>" not in render(flown.scenario(), flown.flights())


def test_what_certificates_hold_is_no_markup() -> None:
    obligation = Obligation("form", flown.HOSTILE, "undecided", {"reason": flown.HOSTILE})
    claim = Claim("convergence", {"everything": True}, {}, (f"{WITHOUT}{flown.HOSTILE}",), (obligation,))
    subject = {"quaternion_sign": "as_published"}
    found = told(Certificate(flown.HOSTILE, subject, (claim,)))
    assert not any(tag == "script" for tag, _ in found.tags)
    assert found.text.count(flown.HOSTILE) >= 5
    assert outcomes(found) == ["undecided", "undecided"]


@pytest.mark.parametrize("kind", sorted(HEADINGS))
def test_every_kind_of_claim_can_be_told_where_it_is_undecided(kind: str) -> None:
    numbers = {
        "convergence": {"rate_everywhere": 0.1, "everything": False},
        "torque-limit": {"limit": 0.1, "kind": "axis", "level": 0.0, "start": 0.0, "slew_angle": 0.0, "rate": 0.0},
        "inertia": {"tolerance": 0.4},
        "pointing": {"torque": 1e-3},
        "appendages": {"torque": 1e-3},
        "sampling": {"period": 1.0, "radius": 1.2, "eigenvalues": [[1.2, 0.0]], "longest": None, "every_shorter": False},
        "wheels": {"momentum": 0.1},
        "region": {},
        "circle": {},
        "equilibrium": {},
        "saturated-axis": {"limit": 1.0, "width": 0.1, "reach": 100.0, "boundary": 0.11},
        "control-limit": {"kind": "norm", "limit": 3.5},
        "hand-over": {"rate": 0.1, "angle": None},
        "detumbling": {},
        "sliding": {"torque": [0.0, 0.0, 0.0], "margin": 1e-3},
    }[kind]
    claim = Claim(kind, numbers, {}, (), (Obligation("form", "exact identity", "undecided", {"reason": "why not"}),))
    found = told(Certificate("law", {"quaternion_sign": "shortest"}, (claim,)))
    assert outcomes(found) == ["undecided"] * 2
    assert "why not" in found.text
