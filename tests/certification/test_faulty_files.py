"""What a file of certificates says is checked: kinds and proofs of its claims, its outcome, digests of its programs."""

import copy

import pytest

from tests.certification.edits import claims_of, reasons, with_kinds


@pytest.fixture
def content(made):
    return copy.deepcopy(made("pd-0"))


def test_a_kind_stands_for_one_claim_and_one_proof(content):
    claims = content["certificates"][0]["claims"]
    claims.append(claims[0] | {"proof": len(content["claims"])})
    content["claims"].append(content["claims"][claims[0]["proof"]])
    assert reasons(with_kinds(content)) == ["two claims are of the same kind"]
    claims[-1]["kind"] = "equilibrium"
    assert f"the proof is of another kind of claim: {claims[0]['kind']}" in reasons(with_kinds(content))


@pytest.mark.parametrize("pointing", [False, True])
def test_beside_a_loop_that_points_as_it_flies_undecided_claims_do_not_count(content, pointing):
    claims = claims_of(content)
    claims["sampling"] |= {"outcome": "undecided"}
    if pointing:
        claims["inertia"]["kind"] = "pointing"
    wrong = "the outcome does not follow from the claims"
    assert content["certificates"][0]["outcome"] == "proved"
    assert (wrong in reasons(with_kinds(content))) != pointing
    content["certificates"][0]["outcome"] = "undecided"
    assert (wrong in reasons(with_kinds(content))) == pointing
