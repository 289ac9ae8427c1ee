"""The command `invariant`: what is printed, what is written, the exit codes."""

import json
from fractions import Fraction

import starhold as sh
from starhold.kernel.reading import FORMAT
from tests.certification.invariants import ORIGIN, file
from tests.running import starhold


def written(folder, y="-y", theorem="region", more=""):
    (folder / "mine.toml").write_text(file("-x + x**3", y, theorem=theorem, more=f"{ORIGIN}\n{more}"), encoding="utf-8")
    return starhold("invariant", "mine.toml", "-o", "out", "--force", cwd=folder)


def test_what_is_proved(tmp_path):
    done = written(tmp_path)
    assert done.returncode == 0, done.stderr
    for word in (
        "proved",
        "region of attraction (theorem 2)",
        "come to the equilibrium",
        "no level reaches 1",
        "sums of squares",
    ):
        assert word in " ".join(done.stdout.replace("│", " ").split())
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["certificate.json", "invariant.png", "kernel.pyz"]
    content = json.loads((tmp_path / "out" / "certificate.json").read_text(encoding="utf-8"))
    assert content["format"] == FORMAT
    (claim,) = content["claims"]
    assert claim["theorem"] == "attracts"
    level = float(Fraction(claim["numbers"]["level"]))
    assert 0.99 < level < 1.0
    assert sh.invariant(tmp_path / "mine.toml").claims[0].numbers["level"] == level
    checked = starhold("check", "out/certificate.json", cwd=tmp_path, code=0)
    assert "all motions that start in {V < 0.99999} of the box stay there" in checked.stdout


def test_a_refuted_claim_ends_with_three_and_its_state(tmp_path):
    done = written(tmp_path, more="level = 2")
    assert done.returncode == 3
    assert "needed, but refuted: V is non-increasing on the set" in " ".join(done.stdout.split()).replace(" │ │ │ ", " ")
    assert (tmp_path / "out" / "invariant.png").stat().st_size > 10_000


def test_an_undecided_claim_ends_with_four(tmp_path):
    """No level of a function that vanishes nowhere has a state."""
    (tmp_path / "mine.toml").write_text(file("-x", "-y", '"x**2 + y**2 + 1"', "region", ""), encoding="utf-8")
    starhold("invariant", "mine.toml", "-o", "out", cwd=tmp_path, code=4)


def test_systems_that_come_with_it_are_listed(tmp_path):
    done = starhold("invariant", cwd=tmp_path, code=0)
    for name in ("switching", "van-der-pol", "saturated-axis", "saturated-strip", "circle", "orbit", "spin", "dead-zone"):
        assert name in done.stdout
