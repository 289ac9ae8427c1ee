"""What the kernel checked, printed for Rocq, which checks it again by rules that it has proved itself."""

import json
import re
import shutil
import subprocess
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from starhold.certification.invariant import builtin_names, certify, load, write
from starhold.certification.rocq import _taken, printed
from starhold.kernel.check import check
from starhold.kernel.reading import Told
from starhold.kernel.rules import Persists
from tests.kernel.certificates import LAWS, contents, text
from tests.kernel.stations import flown, proof

SECONDS = 100
"""What a lemma may take by the clock: the longest take about 2 s of a processor that others may use as well."""
FLOWN = [
    ("l2-circle", "smooth"), ("l2-circle", "relay"), ("l2-deficit", "deficit 5"), ("l2-nonlinear", "full model"),
    ("l2-equilibrium", None),
]  # fmt: skip


def accepted(lemmas, folder, seconds=SECONDS):
    """What coqc says against a file; nothing where it accepts all of it."""
    if shutil.which("coqc") is None:
        pytest.skip("coqc, the compiler of Rocq, is not installed here")
    (folder / "lemmas.v").write_text(f"Set Default Timeout {seconds}.\n{lemmas}")
    done = subprocess.run(["coqc", "lemmas.v"], cwd=folder, capture_output=True, text=True)
    assert (done.returncode == 0) == (not done.stderr), done.stderr
    return done.stderr


@pytest.fixture(scope="module")
def small():
    (proved,) = check(text(contents("three-laws", "lyapunov", 0)))
    return proved, printed([proved])


def test_every_obligation_is_a_lemma_under_its_name(small):
    proved, lemmas = small
    for name, _ in proved.shown:
        assert f"\n(* {name} *)\nLemma " in lemmas
    assert lemmas.count("\nLemma claim0_") >= len(proved.shown)
    assert not re.search(r"Admitted|Axiom|Parameter|admit", lemmas)


def test_short_squares_leave_little_of_a_positive_matrix_and_none_are_of_another():
    rng = np.random.default_rng(0)
    half = rng.integers(-(2**40), 2**40, size=(12, 15)).astype(object)
    gram = half @ half.T
    m, error, taken = _taken([[Fraction(x) for x in row] for row in gram])
    u = np.array(taken, dtype=object)
    rest = gram - m * (u.T @ u)
    assert np.abs(u).max() < 2**40
    assert np.abs(rest[np.triu_indices(12, 1)]).max() <= error < rest.diagonal().min() / 11
    gram[5, 5] = gram[4, 4] = abs(gram[4, 5]) - 1
    assert _taken([[Fraction(x) for x in row] for row in gram]) == (0, 0, [])


@pytest.mark.slow
def test_rocq_accepts_a_small_certificate_and_refuses_a_changed_one(small, tmp_path):
    _, lemmas = small
    assert accepted(lemmas, tmp_path) == ""
    place = lemmas.index("(* V is non-increasing *)")
    said = re.compile(r"<= \((\d+)\)").search(lemmas, place)
    other = f"{lemmas[: said.start()]}<= (-{said[1]}){lemmas[said.end() :]}"
    assert "lemmas.v" in accepted(other, tmp_path)


@pytest.mark.slow
def test_rocq_refuses_evidence_that_does_not_show_it(small, tmp_path):
    """The statement and the evidence are changed alike, to what is false."""
    _, lemmas = small
    place = lemmas.index("(* V is non-increasing *)")
    end = lemmas.index("Qed.", place)
    number = re.compile(r"<= \((\d+)\)").search(lemmas, place)[1]
    other = lemmas[:place] + lemmas[place:end].replace(number, f"-{number}") + lemmas[end:]
    assert "Cannot" in (told := accepted(other, tmp_path)) or "unify" in told or "type" in told


@pytest.mark.slow
def test_rocq_accepts_that_motions_persist(small, tmp_path):
    A, P = [[Fraction(3, 2), Fraction(1, 3)], [Fraction(0), Fraction(1, 2)]], [["1", "1/3"], ["1/3", "1/9"]]
    rule = Persists(A)
    rule.check(P)
    claim = replace(small[0].claim, evidence=Told("evidence", {"step": P}))
    lemmas = printed([replace(small[0], claim=claim, obligations=(("step", rule),))])
    assert lemmas.count("\nLemma claim0_") == 2
    assert accepted(lemmas, tmp_path) == ""


@pytest.mark.slow
@pytest.mark.parametrize(("scenario", "law"), LAWS)
def test_rocq_accepts_what_is_proved_of_attitude_laws(scenario, law, tmp_path):
    assert accepted(printed(check(text(contents(scenario, law)))), tmp_path) == ""


@pytest.mark.slow
@pytest.mark.parametrize("name", ["body", "moving", "noisy"])
def test_rocq_accepts_what_is_proved_of_pointing(name, tmp_path):
    assert accepted(printed(check(text(contents("flying", name)))), tmp_path) == ""


@pytest.mark.slow
@pytest.mark.parametrize(("scenario", "law"), FLOWN)
def test_rocq_accepts_what_is_proved_of_station_keeping(scenario, law, tmp_path):
    assert accepted(printed(check(json.dumps(proof(flown(scenario, law))))), tmp_path) == ""


@pytest.mark.slow
@pytest.mark.parametrize("name", builtin_names())
def test_rocq_accepts_what_is_proved_of_invariant_sets(name, tmp_path):
    write(certify(load(name)), tmp_path / "certificate.json")
    assert accepted(printed(check((tmp_path / "certificate.json").read_text())), tmp_path) == ""
