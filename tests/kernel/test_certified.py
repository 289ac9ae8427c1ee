"""Claims that `certify` has the kernel prove: in the file, checked again, compared with the loop, and changed."""

import copy
import json
from functools import cache

import pytest

from starhold.certification.certificate import write
from starhold.certification.certify import certify
from starhold.checker import check, passed
from tests.making import built


@cache
def loop_of(scenario, law):
    return built(scenario, law)


@cache
def certified(scenario, law):
    return certify(loop_of(scenario, law), law)


@pytest.fixture
def written(tmp_path):
    def content(*certificates):
        write(certificates, "made", tmp_path / "certificate.json")
        return json.loads((tmp_path / "certificate.json").read_text())

    return content


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
    for key in ("numbers", "assumptions", "obligations", "witness"):
        assert not changed(lambda file, given, key=key: given["claims"][0].update({key: {}})), key
    assert not changed(lambda file, given: given["claims"][0].update(proof=1))
    assert not changed(lambda file, given: given["claims"][0].update(proof=99))
    assert not changed(lambda file, given: given["claims"][0].pop("proof"))
    assert not changed(lambda file, given: given["claims"].pop())
    assert not changed(lambda file, given: given.update(outcome="refuted"))
    assert not changed(lambda file, given: file["claims"].pop())
    assert not changed(lambda file, given: file["claims"][1]["numbers"].update(limit="1/1000"))
    assert not changed(lambda file, given: file["claims"][1]["numbers"].update(angle="3"))
    assert not changed(lambda file, given: file.update(programs={}))
