"""Claims that `certify` has the kernel prove: in the file, checked again, compared with the loop, and changed."""

import copy
import json
from functools import cache

import pytest

import starhold as sh
from starhold.certification.certificate import write
from starhold.certification.certify import certify
from starhold.certification.comparison import differences
from starhold.checker import check, passed
from starhold.checker.check import BY_THE_KERNEL
from starhold.kernel.check import check as prove
from starhold.scenario.building import build
from tests.tiers import leading

LAWS = [
    ("three-laws", "lyapunov"), ("three-laws", "sliding"), ("cubesat-slew", "pd"), ("cubesat-slew", "sliding"),
    ("geostationary", "matrix-pd"), ("wheels-orbital", "wheel"),
]  # fmt: skip


@cache
def loop_of(scenario, law):
    given = sh.load(scenario)
    return build(given, given.pick(law))


@cache
def certified(scenario, law):
    return certify(loop_of(scenario, law), law)


@pytest.fixture
def written(tmp_path):
    def content(*certificates):
        write(certificates, "made", tmp_path / "certificate.json")
        return json.loads((tmp_path / "certificate.json").read_text())

    return content


@pytest.mark.parametrize(("scenario", "law"), leading(LAWS, 2))
def test_claims_carry_proofs_that_the_kernel_checks_and_the_loop_is_that_of_the_scenario(scenario, law, written):
    certificate = certified(scenario, law)
    content = written(certificate)
    kinds = {claim.kind for claim in certificate.claims if claim.proof is not None}
    assert kinds >= ({"sliding"} if law == "sliding" else {"convergence", "inertia", "sampling"})
    assert kinds & {"torque-limit", "wheels", "sliding"}
    findings = check(content)
    assert passed(findings)
    assert {finding.claim for finding in findings if finding.reason == BY_THE_KERNEL} == kinds
    assert len(prove(json.dumps(content))) == len(kinds)
    for claim in certificate.claims:
        if claim.proof is not None:
            assert differences(claim.proof.claim, loop_of(scenario, law)) == []
            assert differences(claim.proof.claim, loop_of("flexible-slew", "pd"))


def test_proofs_of_several_laws_stand_in_one_file(written):
    content = written(certified("three-laws", "lyapunov"), certified("three-laws", "sliding"))
    assert passed(check(content))
    told = [claim["proof"] for given in content["certificates"] for claim in given["claims"] if "proof" in claim]
    assert told == [*range(len(content["claims"]))]


def test_a_file_that_says_more_than_its_proofs_fails(written):
    content = written(certified("three-laws", "lyapunov"))

    def changed(change):
        other = copy.deepcopy(content)
        change(other, other["certificates"][0])
        return passed(check(other))

    assert changed(lambda file, given: None)
    assert not changed(lambda file, given: given["claims"][0].update(kind="wheels"))
    assert not changed(lambda file, given: given["claims"][0].update(numbers={}))
    assert not changed(lambda file, given: given["claims"][0].update(proof=1))
    assert not changed(lambda file, given: given["claims"][0].update(proof=99))
    assert not changed(lambda file, given: given["claims"][0].pop("proof"))
    assert not changed(lambda file, given: given["claims"].pop())
    assert not changed(lambda file, given: given.update(outcome="refuted"))
    assert not changed(lambda file, given: file["claims"].pop())
    assert not changed(lambda file, given: file["claims"][1]["numbers"].update(limit="1/1000"))
    assert not changed(lambda file, given: file["claims"][1]["numbers"].update(angle="3"))
    assert not changed(lambda file, given: file.update(programs={}))
