"""The claims of built-in attitude scenarios, shown by evidence that the kernel accepts, run by itself."""

import json
import math
import subprocess
import sys
from fractions import Fraction

import numpy as np
import pytest

from starhold.certification.certificate import kernel_bundle
from starhold.kernel.check import check, main
from starhold.kernel.numbers import WORK, Account
from starhold.kernel.sentences import ASSUMPTIONS
from tests.kernel.certificates import LAWS, contents, found, text
from tests.kernel.oracle import Oracle, number
from tests.tiers import fewer, leading


@pytest.fixture(scope="session")
def bundle(tmp_path_factory):
    path = tmp_path_factory.mktemp("kernel") / "kernel.pyz"
    path.write_bytes(kernel_bundle())
    return path


@pytest.mark.parametrize(("scenario", "law"), leading(LAWS, 3))
def test_every_claim_is_proved_by_the_kernel_alone(scenario, law, bundle, tmp_path):
    content = contents(scenario, law)
    path = tmp_path / "certificate.json"
    path.write_text(text(content))
    done = subprocess.run([sys.executable, "-I", "-S", bundle, path], capture_output=True, text=True, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.count("proved: ") == len(content["claims"])
    for claim in content["claims"]:
        assert Oracle(content, claim).holds()
    check(text(content))
    assert WORK - Account.left < WORK / 3


@pytest.mark.slow
def test_where_motions_of_laws_that_clip_or_jump_end_is_found():
    """As far as the certifier proved it that had no kernel."""
    ends, limited, *_ = contents("by hand", "clipped")["claims"]
    assert "level" not in ends["numbers"]
    assert limited["numbers"] == {"limit": str(Fraction(0.01))}
    (shortest, *_), (jumping, *_) = (contents("by hand", law)["claims"] for law in ("near", "jumping"))
    assert number(shortest["numbers"]["level"]) > 0.98 * 2.0
    assert number(jumping["numbers"]["start.rate"]) > 0.98 * 59.1967
    (torque,) = (c for c in contents("by hand", "near")["claims"] if "limit.norm" in c["numbers"])
    assert number(torque["numbers"]["level"]) > 0.98 * 0.41815


@pytest.mark.slow
def test_strict_functions_and_limits_of_the_norm_are_found():
    assert contents("by hand", "strict")["claims"][0]["theorem"] == "converges strictly"
    norm = [c for c in contents("by hand", "norm")["claims"] if c["theorem"] != "points"]
    (limited,) = (c for c in norm if "limit.norm" in c["numbers"])
    assert 0.98 * 0.006 < number(limited["numbers"]["level"]) < 0.0063
    for law in ("strict", "norm", "near", "jumping", "clipped")[: fewer(5, 2)]:
        content = contents("by hand", law)
        assert len(check(text(content))) == len(content["claims"])
        assert all(Oracle(content, claim).holds() for claim in content["claims"])


@pytest.mark.parametrize(
    ("scenario", "law", "limit", "order"),
    [
        ("three-laws", "lyapunov", "limit", np.inf),
        ("by hand", "norm", "limit.norm", 2),
        ("by hand", "near", "limit.norm", 2),
    ],
)
def test_levels_are_nearly_the_largest(scenario, law, limit, order):
    """On the border of the set the torque comes near its limit."""
    content = contents(scenario, law, 1)
    (claim,) = content["claims"]
    oracle = Oracle(content, claim)
    worst = max(np.linalg.norm(oracle.law(q, w, *oracle.environment())[0], order) for q, w in edge(oracle))
    assert 0.98 * oracle.numbers[limit] < worst <= oracle.numbers[limit] * (1 + 1e-9)


def edge(oracle):
    """States on the border of the set where its torque is largest: turned, and turning on, about one axis."""
    level, target, zero = oracle.numbers["level"], np.eye(4)[0], np.zeros(3)
    V0 = oracle.lyapunov(target, zero)
    for axis in np.eye(3):
        for angle in np.linspace(0, oracle.numbers["angle"], 60):
            q = np.concatenate([[math.cos(angle / 2)], math.sin(angle / 2) * axis])
            yield q, axis * math.sqrt((level - oracle.lyapunov(q, zero) + V0) / (oracle.lyapunov(target, axis) - V0))


def test_sentences_name_what_they_assume():
    for proved in check(text(contents("three-laws", "lyapunov"))):
        assert set(proved.statement.assumptions) <= ASSUMPTIONS.keys()
        assert len(set(proved.statement.assumptions)) == len(proved.statement.assumptions)
    assert "0.01 N m about any axis" in check(text(contents("three-laws", "lyapunov", 1)))[0].statement.text


def test_refusal_is_one_line(capsys, tmp_path):
    path = tmp_path / "c.json"
    for broken in ("", "[", "{}", "[" * 100_000, '{"a": 1, "a": 2}', "\x00", json.dumps({"format": "other"}), "1" * 50):
        path.write_text(broken)
        assert main([str(path)]) == 1
        (line,) = capsys.readouterr().out.splitlines()
        assert line.startswith("refused: ")
    path.write_bytes(b"\xff\xfe")
    assert main([str(path)]) == 1


def test_found_says_why_a_law_has_no_claim():
    assert "depends on more than the state" in found("wheels-orbital", "uncompensated").failed["converges"]
