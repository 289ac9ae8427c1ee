"""A review shows what is known, rests on the same flights as the verdicts, and names what is not known."""

import hashlib
import re

import pytest

import starhold as sh
from starhold.campaign import verify
from starhold.report.document import Figure, Section, pages_of
from starhold.studies import compare
from tests.refusals import complains, refused
from tests.report.reader import Reader
from tests.required import ALL, ERROR, MANY, PHASE, PROOF, SETTLES, turn
from tests.running import starhold

WHEELS = {"layout": "pyramid", "inertia": 1e-3, "torque_limit": "50 mN m", "momentum_limit": "0.4 N m s"}
PARENT = {"id": "S", "text": "It points | <b> [red]"}
REQUIRED = [PARENT, SETTLES | {"at_most": 1, "parent": "S"}, PHASE, ERROR, MANY, PROOF, {"id": "i", "method": "inspection"}]


def test_a_review_tells_all_that_is_known_and_computes_each_once(monkeypatch, tmp_path):
    used = []

    def counted(module, name):
        function = getattr(module, name)
        monkeypatch.setattr(module, name, lambda *given, **more: used.append(name) or function(*given, **more))

    for module, name in ((compare, "fly"), (verify, "fly_campaign"), (verify.budgets, "study"), (verify, "linear_of")):
        counted(module, name)
    counted(type(verify.study_of("rigid-body")), "certify")
    scenario = turn(*REQUIRED, wheels=WHEELS)
    found = sh.review(scenario, folder=tmp_path / "pack")
    assert sorted(used) == sorted(["fly", "fly_campaign", "study", "linear_of", "certify"])
    monkeypatch.undo()
    page = (tmp_path / "pack" / "review.html").read_text(encoding="utf-8")
    text = (tmp_path / "pack" / "review.md").read_text(encoding="utf-8")
    read = Reader(page)
    ids, links, sources = ({given[key] for _, given in read.tags if key in given} for key in ("id", "href", "src"))
    assert {link.removeprefix("#") for link in links} <= ids
    assert all(source.startswith("data:image/png;base64,") for source in sources)
    assert len(sources) == text.count("\n[Figure ") == 3
    assert set(re.findall(r"\]\(#([^)]*)\)", text)) <= ids
    # Both say the same: the digests, each verdict's evidence, the peak of each wheel, and blanks.
    shown, campaign = "".join(read.words), found.evidence.campaign
    peaks = abs(found.evidence.flight.recording["wheel_momentum"]).max(axis=0)
    digest = hashlib.sha256(scenario.text.encode()).hexdigest()
    told = [digest, campaign.digest, *(one.evidence for one in found.verdicts), *(f"{peak:.4g}" for peak in peaks)]
    told += ["who accepts the input data", "settles is missed: one flight of pd.", "i is not decided: no record is named."]
    told += [campaign.laws[0].verdicts[0].outcome, "rigid bearings", "Gaussian"]
    plain = re.sub(r"\\(.)", r"\1", text)
    for one in told:
        assert one in shown
        assert one in plain
    assert PARENT["text"] in shown
    assert "There is no" not in shown
    # Rows of the table of certificates: each claim with what it leaves out.
    claims = [claim for one in found.evidence.issued for claim in one.certificate.claims]
    lines = text.partition("Certificates\n")[2].partition("\n## ")[0].splitlines()
    assert len([line for line in lines if line.startswith("| pd ")]) == len(claims)
    assert sum("the sensor gaussian" in line for line in lines) >= 1


@pytest.mark.slow
def test_what_a_scenario_lacks_is_open(tmp_path):
    (tmp_path / "bare.toml").write_text(turn(campaign=None, budget=None).text, encoding="utf-8")
    done = starhold("review", "bare.toml", "-o", "pack", cwd=tmp_path, code=4)
    for line in ("Nothing is required", "There is no pointing budget", "No campaign is flown"):
        assert f". {line}" in done.stdout
    text = (tmp_path / "pack" / "review.md").read_text(encoding="utf-8")
    points = text.partition("Open points\n")[2].partition("\n## ")[0]
    assert "has no \\[budget\\] table" in points
    assert "has no \\[campaign\\] table" in points
    assert "There is no momentum budget" in text
    complains(starhold("review", "bare.toml", "-o", "pack", cwd=tmp_path), "results already there")
    with refused("results already there (review.html)"):
        sh.review(tmp_path / "bare.toml", folder=tmp_path / "pack")
    sh.review(tmp_path / "bare.toml", folder=tmp_path / "again")
    assert (tmp_path / "again" / "review.md").read_text(encoding="utf-8") == text


@pytest.mark.parametrize(
    ("required", "changes", "line"),
    [
        ([PHASE | {"at_least": "3 s"}], {}, 'requirement[1].at_least: found "3 s"'),
        ([MANY], {"campaign": None}, "campaign: found no [campaign] table"),
        (ALL, {"campaign": {"over": {"law.pd.k": [1]}}}, "campaign"),
        ([], {"campaign": {"runs": 3, "over": {"wheels.inertia": {"distribution": "uniform", "share": 0.1}}}}, "campaign"),
    ],
)
def test_a_mistake_is_told_before_anything_is_flown(monkeypatch, tmp_path, required, changes, line):
    monkeypatch.setattr(verify, "fly_law", None)
    with refused(line):
        sh.review(turn(*required, **changes), folder=tmp_path / "pack")


def test_another_body_is_reviewed_too(tmp_path):
    scenario = sh.load("l2-circle")
    found = sh.review(scenario, folder=tmp_path)
    assert found.verdicts == sh.verify(scenario)
    assert isinstance(found.evidence.linear, str)
    assert "Margins exist only for laws that rotate a body." in (tmp_path / "review.md").read_text(encoding="utf-8")


def test_a_document_is_safe_in_both_forms():
    from matplotlib.figure import Figure as Drawn

    sections = [Section("A & <b>", ["a|b *c* <i>", Figure("It is 1 < 2", Drawn)]), Section("Next", ["[x](y)"], True)]
    page, text = pages_of("T <", sections, "end")
    assert "<i>" not in page.partition("<main")[2]
    assert "a\\|b \\*c\\* \\<i\\>" in text
    assert "\\[x\\](y)" in text
    assert "**Figure 1.** It is 1 \\< 2." in text
