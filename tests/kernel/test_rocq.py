"""What the kernel checked, printed for Rocq, which checks it again by rules that it has proved itself."""

import re
import shutil
from dataclasses import replace
from fractions import Fraction
from importlib import resources

import numpy as np
import pytest

from generators import lemmas as documented
from starhold.certification.rocq import _taken, printed
from starhold.kernel.check import check
from starhold.kernel.polynomials import Poly, var
from starhold.kernel.reading import Told
from starhold.kernel.rules import Contracts, Definite, Exceeds, Persists, Sum
from tests.kernel.certificates import contents, text

SECONDS = 100
"""What a lemma may take by the clock: the longest take less than 1 s of a processor that others may use as well."""
LIBRARY = {"ClassicalDedekindReals.sig_forall_dec", "FunctionalExtensionality.functional_extensionality_dep"}
"""What Rocq's own library takes for granted of the real numbers."""


RULES = resources.files("starhold.certification").joinpath("rocq.v").read_text(encoding="utf-8")
PROVED = "From Coq Require Import Reals ZArith List.\nRequire Import rules.\nImport ListNotations.\nOpen Scope R_scope.\n"
"""What stands in place of the rules where they are proved already."""
LEMMA = re.compile(r"^(?:Definition (claim\w+)_evidence := .*\n)?Lemma (claim\w+) :(?:.*\n)*?Qed\.\n", re.MULTILINE)


@pytest.fixture(scope="module")
def rules(tmp_path_factory):
    """The folder with the rules, which coqc has accepted."""
    if shutil.which("coqc") is None:
        pytest.skip("coqc, the compiler of Rocq, is not installed here")
    folder = tmp_path_factory.mktemp("rules")
    (folder / "rules.v").write_text(RULES)
    assert documented.refusal(folder / "rules.v")[0] == ""
    return folder


def refusal(lemmas, folder, rules=None, seconds=SECONDS):
    """What coqc says against a file, of which the rules may be proved already; nothing where it accepts all of it."""
    assert lemmas.startswith(RULES)
    if rules is not None:
        lemmas = PROVED + lemmas.removeprefix(RULES)
    (folder / "lemmas.v").write_text(f"Set Default Timeout {seconds}.\n{lemmas}")
    return documented.refusal(folder / "lemmas.v", *(() if rules is None else ("-Q", str(rules), "")))[0]


def lemmas_of(text):
    """The lemmas of a file by their names, each under the name that none has; nothing but the rules stands beside them."""
    beside = LEMMA.sub("", text.removeprefix(RULES))
    assert re.fullmatch(r"(\n|\(\* [^()*\"]* \*\)\n|Definition v(\d+) := v \2\.\n)*", beside)
    found = {match[2]: match[0] for match in LEMMA.finditer(text)}
    assert len(found) == text.count(documented.COUNTED)
    return {name: re.sub(rf"\b{name}(_evidence)?\b", r"claim\1", lemma) for name, lemma in found.items()}


@pytest.fixture(scope="module")
def small():
    (proved,) = check(text(contents("three-laws", "lyapunov", 0)))
    return proved, printed([proved])


def test_every_obligation_is_a_lemma_under_its_name(small):
    proved, lemmas = small
    for name, _ in proved.shown:
        assert re.search(rf"\n\(\* {re.escape(name)} \*\)\n(Lemma|Definition) claim", lemmas)
    assert lemmas.count("\nLemma claim0_") >= len(proved.shown)
    assert not re.search(r"Admitted|Axiom|Parameter|admit", lemmas)


def test_short_squares_leave_little_of_a_positive_matrix_and_none_are_of_another():
    rng = np.random.default_rng(0)
    half = rng.integers(-(2**40), 2**40, size=(12, 15)).astype(object)
    gram = half @ half.T
    s, r, taken = _taken([[Fraction(x) for x in row] for row in gram])
    u = np.array([[0] * k + row for k, row in enumerate(taken)], dtype=object)
    rest = gram - 2**s * (u.T @ u)
    assert np.abs(u).max() < 2**40
    assert np.abs(rest[np.triu_indices(12, 1)]).max() <= 2**r < rest.diagonal().min() / 11
    gram[5, 5] = gram[4, 4] = abs(gram[4, 5]) - 1
    assert _taken([[Fraction(x) for x in row] for row in gram]) == (0, 0, [])


@pytest.mark.slow
def test_rocq_accepts_a_small_certificate_from_the_axioms_of_its_library_alone(small, tmp_path):
    if shutil.which("coqc") is None:
        pytest.skip("coqc, the compiler of Rocq, is not installed here")
    _, lemmas = small
    every = ", ".join(re.findall(r"^Lemma (claim\w+)", lemmas, re.MULTILINE))
    said = refusal(f"{lemmas}\nDefinition every := ({every}).\nPrint Assumptions every.", tmp_path)
    assert set(re.findall(r"^([\w.]+)", said, re.MULTILINE)) == {"Axioms", *LIBRARY}


def with_rule(small, rule, evidence):
    """A file about one obligation."""
    claim = replace(small[0].claim, evidence=Told("evidence", {"step": evidence}))
    return printed([small[0]._replace(claim=claim, obligations=(("step", rule),))])


x, y = var("x"), var("y")
SMALL = {
    "a form with a premise and a relation": (
        Sum(x * x * x + 2 * y + Fraction(1, 3), [x], [y - x * x], [Poly({(): Fraction(1, 4)})]),
        {
            "numbers": ["1"],
            "cofactors": [{"": "2"}],
            "parts": [
                {"of": [0], "z": ["x"], "gram": [["1"]]},
                {"of": [], "z": ["", "x"], "gram": [["1/12", "0"], ["0", "2"]]},
            ],
        },
    ),
    "a definite matrix": (Definite([[Fraction(2), Fraction(1, 3)], [Fraction(1, 3), Fraction(1, 5)]]), None),
    "a matrix that is hardly definite": (
        Definite([[Fraction(1), Fraction(1)], [Fraction(1), 1 + Fraction(1, 10**60)]]),
        None,
    ),
    "a larger number": (Exceeds(Fraction(2, 3), Fraction(-3, 7)), None),
    "a motion that contracts": (
        Contracts([[Fraction(1, 2), Fraction(1)], [Fraction(0), Fraction(1, 3)]], Fraction(9, 10)),
        [["1", "1/2"], ["1/2", "9"]],
    ),
    "a flow that contracts": (
        Contracts([[Fraction(-1, 2), Fraction(1)], [Fraction(0), Fraction(-1, 3)]], flow=True),
        [["1", "0"], ["0", "9"]],
    ),
    "motions that persist": (
        Persists([[Fraction(3, 2), Fraction(1, 3)], [Fraction(0), Fraction(1, 2)]]),
        [["1", "1/3"], ["1/3", "1/9"]],
    ),
}
FALSE = {
    "another sum": ("a form with a premise and a relation", r"<= num 12 \* x \* x", "<= num 11 * x * x"),
    "no premise": ("a form with a premise and a relation", r"0 <= num 1 \* x -> ", ""),
    "another relation": ("a form with a premise and a relation", r"num 1 \* y \+", "num 2 * y +"),
    "a greater bound": ("a form with a premise and a relation", r"num 3 <=", "num 5 <="),
    "a matrix that is not definite": ("a definite matrix", r"\(\|6\|\)", "(|1|)"),
    "a matrix that vanishes somewhere": ("a matrix that is hardly definite", r"01a\|\)", "000|)"),
    "a larger denominator": ("a larger number", r"/ num 3\.", "/ num (-3)."),
    "a smaller number": ("a larger number", r"num 2 /", "num (-2) /"),
    "a negative square": ("a form with a premise and a relation", r"\(\|12\|\)", "(|(-12)|)"),
    "a multiple that is negative": ("a form with a premise and a relation", r"Shown 1 ", "Shown (-1) "),
}


@pytest.mark.slow
def test_rocq_accepts_each_kind_of_obligation_as_the_kernel_does(small, rules, tmp_path):
    for rule, evidence in SMALL.values():
        rule.check(evidence)
        assert refusal(with_rule(small, rule, evidence), tmp_path, rules) == ""


@pytest.mark.slow
@pytest.mark.parametrize("name", FALSE)
def test_rocq_refuses_what_the_kernel_did_not_decide(name, small, rules, tmp_path):
    """What is said, or its evidence, is changed to what is false."""
    of, given, other = FALSE[name]
    lemmas = with_rule(small, *SMALL[of])
    place = lemmas.index("(* step *)")
    changed, count = re.subn(given, other, lemmas[place:])
    assert count == 1, lemmas[place:]
    assert "lemmas.v" in refusal(lemmas[:place] + changed, tmp_path, rules)


@pytest.mark.slow
def test_rocq_refuses_a_changed_certificate_and_evidence_that_does_not_show_it(small, rules, tmp_path):
    """The statement is changed to what is false, alone and with its evidence alike."""
    _, lemmas = small
    place = lemmas.index("(* V is non-increasing *)")
    end = lemmas.index("Qed.", place)
    said = lemmas.index("Lemma", place)
    number = re.search(r"<= num (\w+)", lemmas[said:end])[1]
    for first in (place, said):
        other = lemmas[:first] + re.sub(rf"\b{number}\b", f"(-{number})", lemmas[first:end]) + lemmas[end:]
        assert "lemmas.v" in refusal(other, tmp_path, rules)


def test_the_table_has_every_example():
    stored = documented.json.loads(documented.STORED.read_text())
    assert [*stored] == documented.names()


@pytest.fixture(scope="module")
def accepted():
    """The lemmas that coqc has accepted of the examples before."""
    return set()


@pytest.mark.slow
@pytest.mark.parametrize("name", documented.names())
def test_rocq_accepts_all_that_is_proved_of_an_example(name, accepted, rules, tmp_path):
    """Of every law, mode and hand-over, and after faults: the files of the table in the documentation, and no other."""
    files = {path.name: path.read_text(encoding="utf-8") for path in documented.certify(name, tmp_path)}
    stored = documented.json.loads(documented.STORED.read_text())[name]
    lemmas = {file: lemmas_of(text) for file, text in files.items()}
    new = {lemma for found in lemmas.values() for lemma in found.values()} - accepted
    places = sorted({int(k) for lemma in new for k in re.findall(r"\bv(\d+) ", lemma)})
    named = (re.sub(r"\bclaim(_evidence)?\b", rf"claim{k}\1", lemma) for k, lemma in enumerate(sorted(new)))
    assert refusal("\n".join([RULES, *(f"Definition v{k} := v {k}." for k in places), *named]), tmp_path, rules) == ""
    accepted |= new
    assert {file: len(found) for file, found in lemmas.items()} == {file: of["lemmas"] for file, of in stored.items()}
