"""Files that the checker cannot read, or reads and refuses, and the limits of its work."""

import copy
import json
from time import process_time

import pytest

from starhold.certification.certificate import write
from starhold.certification.certify import certify
from starhold.checker import check, check_file, passed
from starhold.errors import InputError
from starhold.laws import pd
from tests.certification.edits import content_at, edited, reasons
from tests.certification.loops import FULL, loop_of
from tests.refusals import refused
from tests.tiers import leading


def test_unknown_keys_fail_everywhere(made):
    content = made("pd-0")
    places = [(), ("certificates", 0), ("certificates", 0, "claims", 0)]
    places += [("claims", 0), *(("claims", 0, part) for part in ("subject", "numbers", "evidence"))]
    for path in places:
        changed = copy.deepcopy(content)
        content_at(changed, path)["more"] = 1.0
        assert not passed(check(changed)), path


def test_a_file_that_cannot_be_read_is_the_users_error(tmp_path):
    with refused():
        check_file(tmp_path / "none.json")
    for bad in (b"{", b"", b"\xff\xfe", b"[" * 100_000):
        (tmp_path / "bad.json").write_bytes(bad)
        with refused():
            check_file(tmp_path / "bad.json")


def test_a_readable_file_with_a_fault_fails(tmp_path, made):
    content = made("pd-0")
    plain = json.dumps(content)
    path = tmp_path / "c.json"
    path.write_text(plain, encoding="utf-8")
    assert passed(check_file(path))
    twice = plain.replace('"scenario": "made"', '"scenario": "made", "scenario": "made"')
    period = f'"control_period": {content["certificates"][0]["subject"]["control_period"]}'
    assert period in plain
    texts = [twice, plain.replace(period, '"control_period": NaN'), plain.replace(period, '"control_period": 1e999')]
    for text in [*texts, plain.replace("certificate 3", "certificate 4"), "[]", "null", '"x"']:
        path.write_text(text, encoding="utf-8")
        assert not passed(check_file(path)), text[:60]


@pytest.mark.parametrize("kind", ["", "invariant "])
def test_a_file_of_an_earlier_version_is_refused_in_one_line(made, kind):
    content = {**made("pd-0"), "format": f"starhold {kind}certificate 1"}
    assert reasons(content) == [f"the format is 'starhold {kind}certificate 1', of an earlier version: certify again"]


def test_limits_of_a_file_are_refused_each_with_its_line(tmp_path, made):
    path = tmp_path / "c.json"
    plain = made("pd-0")
    deep = inner = []
    for _ in range(900):
        inner.append([])
        inner = inner[0]
    (reason,) = reasons(edited(plain, ("convergence", "proof"), deep))
    assert reason == "the file is nested more than 32 deep"
    for text, told in (("[" * 100_000, "nested more than 32 deep"), ('{"x": ' + "1" * 5000 + "}", "more than 1000 digits")):
        path.write_text(text, encoding="utf-8")
        with pytest.raises(InputError, match=told):
            check_file(path)
    with pytest.raises(InputError, match="is larger than 64 MiB"):
        check_file("/dev/zero")


@pytest.mark.parametrize("name", ["\ud800", "a\x1b[31mb", "a\nb", "x" * 1001])
def test_a_name_that_cannot_be_written_fails(made, name):
    content = made("pd-0")
    content["certificates"][0]["name"] = name
    assert reasons(content) == ["the certificate has a value that is not allowed under name"]


@pytest.mark.parametrize("size", leading([1e-300, 1e104, 1e-30, 1e30]))
def test_gains_of_any_size_are_certified_and_checked_in_time(tmp_path, size):
    loop = loop_of("pd", pd.Gains(0.09 * size, 0.009 * size), FULL)
    begun = process_time()
    write([certify(loop)], "made", tmp_path / "c.json")
    assert passed(check_file(tmp_path / "c.json")), [f for f in check_file(tmp_path / "c.json") if f.verdict == "fails"]
    # It takes a second; without a limit of the digits the roots of the sampled loop alone took minutes.
    assert process_time() - begun < 20.0
