"""Certificates as a user meets them: what is printed, what is written, the exit codes."""

import json
import re
import subprocess
import sys
from fractions import Fraction

import pytest

from tests.refusals import complains
from tests.running import starhold
from tests.small import CRAFT, MPC, PD, WEAK


@pytest.fixture(scope="module")
def proved(tmp_path_factory):
    """A folder with a scenario and its certificate, and what was printed."""
    folder = tmp_path_factory.mktemp("proved")
    (folder / "small.toml").write_text(CRAFT + PD)
    return folder, starhold("certify", "small.toml", "-o", "out", cwd=folder)


def outcomes(path):
    content = json.loads(path.read_text())
    assert content["format"] == "starhold certificate 3"
    return {c["name"]: {claim["kind"]: claim["outcome"] for claim in c["claims"]} for c in content["certificates"]}


def test_certify_writes_a_certificate(proved):
    folder, done = proved
    assert done.returncode == 0, done.stderr
    found = outcomes(folder / "out" / "certificate.json")
    assert set(found) == {"pd"}
    assert set(found["pd"].values()) == {"proved"}
    assert {"convergence", "torque-limit", "inertia", "sampling"} <= set(found["pd"])
    for word in ("proved", "converges", "within the torque limit", "flown", "starhold check"):
        assert word in done.stdout
    assert sorted(path.name for path in (folder / "out").iterdir()) == ["certificate.json", "kernel.pyz"]
    whole = starhold("certify", "small.toml", "--why", "-o", "whole", cwd=folder).stdout
    assert "assuming: rigid body" in whole
    assert "(exact identity" in whole
    assert "assuming" not in done.stdout


def test_check_passes_what_certify_wrote_and_fails_what_was_changed(proved):
    folder, _ = proved
    content = json.loads((folder / "out" / "certificate.json").read_text())
    good = starhold("check", "out/certificate.json", cwd=folder, code=0)
    assert " 0 fail" in good.stdout
    assert good.stdout.startswith("The programs of its proofs were not compared with those of a scenario.")
    same = starhold("check", "out/certificate.json", "--scenario", "small.toml", cwd=folder, code=0)
    assert same.stdout.startswith("The programs of its proofs are those of small.toml.")
    (folder / "other.toml").write_text((CRAFT + PD).replace("k_attitude = 0.009", "k_attitude = 0.008"))
    other = starhold("check", "out/certificate.json", "--scenario", "other.toml", cwd=folder, code=1)
    assert other.stdout.startswith("another loop  pd: gains.k_attitude is another number")
    alone = subprocess.run(
        [sys.executable, "-I", "-S", "out/kernel.pyz", "out/certificate.json"], cwd=folder, capture_output=True, text=True
    )
    assert alone.returncode == 0
    assert alone.stdout.count("proved: ") == len(content["claims"])
    limit = next(claim for claim in content["certificates"][0]["claims"] if claim["kind"] == "torque-limit")
    content["claims"][limit["proof"]]["numbers"]["limit"] = "1/1000"
    (folder / "changed.json").write_text(json.dumps(content))
    bad = starhold("check", "changed.json", cwd=folder, code=1)
    assert "fails" in bad.stdout
    complains(starhold("check", "absent.json", cwd=folder))


def test_a_refuted_claim_prints_its_state(tmp_path):
    (tmp_path / "weak.toml").write_text(CRAFT + '[certify]\ndisturbance = "1e-5 N m"\n' + WEAK)
    done = starhold("certify", "weak.toml", "-o", "out", cwd=tmp_path, code=3)
    assert "refuted" in done.stdout
    assert outcomes(tmp_path / "out" / "certificate.json")["weak"]["sliding"] == "refuted"
    content = json.loads((tmp_path / "out" / "certificate.json").read_text())
    against = next(claim["numbers"] for claim in content["claims"] if claim["theorem"] == "is pushed off its surface")
    rate = ", ".join(f"{float(Fraction(against[f'rate.{k}'])):.4g}" for k in range(3))
    assert f"w = ({rate}) rad/s" in " ".join(done.stdout.replace("│", " ").split())


def test_what_nobody_can_prove_is_undecided(tmp_path):
    (tmp_path / "mpc.toml").write_text(CRAFT + MPC)
    done = starhold("certify", "mpc.toml", "-o", "out", cwd=tmp_path, code=4)
    assert "no claim" in done.stdout
    assert outcomes(tmp_path / "out" / "certificate.json") == {"mpc": {}}


def test_compare_begins_with_the_loop_as_it_flies_once_that_is_asked_for(tmp_path):
    (tmp_path / "small.toml").write_text(CRAFT + PD + MPC)

    def first_rows(*options):
        words = ("compare", "small.toml", "--pictures", "none", "--force", "-o", "out", *options)
        rows = starhold(*words, cwd=tmp_path, code=0).stdout.split("Certified on this spacecraft")[1].splitlines()
        given = json.loads((tmp_path / "out" / "certificate.json").read_text())["certificates"]
        kinds = {one["name"]: [claim["kind"] for claim in one["claims"]] for one in given}
        found = {name: next(" ".join(row.split()) for row in rows if row.startswith(f"  {name} ")) for name in kinds}
        return found, kinds, [one["subject"].get("no_pointing") for one in given]

    rows, kinds, reasons = first_rows()
    assert rows["pd"] == "pd not sought pointing as it flies: --proof, or starhold certify, looks for it"
    assert rows["mpc"] == rows["pd"].replace("pd", "mpc")
    assert ("pointing" in kinds["pd"], reasons) == (False, ["not sought", "not sought"])
    rows, kinds, reasons = first_rows("--proof")
    assert rows["pd"].startswith("pd proved within ")
    assert rows["mpc"].startswith("mpc proved within ")
    assert ("pointing" in kinds["pd"], reasons) == (True, [None, None])
    starhold("check", "out/certificate.json", cwd=tmp_path, code=0)


@pytest.mark.slow
def test_certify_says_why_a_claim_is_about_no_larger_start(tmp_path):
    done = starhold("certify", "cubesat-slew", "--law", "pd", "--why", "-o", "out", cwd=tmp_path)
    (subject,) = (one["subject"] for one in json.loads((tmp_path / "out" / "certificate.json").read_text())["certificates"])
    assert re.fullmatch(r"from [0-9.]+ deg at [0-9.e-]+ deg/s: .*(limit|found)", subject["no_larger_start"])
    assert f"not proved of a larger start: {subject['no_larger_start']}" in " ".join(done.stdout.split())


def test_certify_says_why_nothing_is_proved_of_the_loop_as_it_flies(tmp_path):
    (tmp_path / "weak.toml").write_text(CRAFT + WEAK)
    done = starhold("certify", "weak.toml", "-o", "out", cwd=tmp_path)
    (subject,) = (one["subject"] for one in json.loads((tmp_path / "out" / "certificate.json").read_text())["certificates"])
    assert subject["no_pointing"] not in ("", "not sought")
    assert f"  not proved: pointing as it flies: {subject['no_pointing']}" in done.stdout.splitlines()


@pytest.mark.parametrize(
    ("line", "key"),
    [
        ('rate = "-1 deg/s"', "certify.rate"),
        ('rate = "anything"', "certify.rate"),
        ('slew_angle = "181 deg"', "certify.slew_angle"),
        ("inertia_tolerance = 1.5", "certify.inertia_tolerance"),
        ("disturbance = -1e-5", "certify.disturbance"),
        ("speed = 1.0", "certify.speed"),
    ],
)
def test_bad_wishes_are_one_line_and_exit_code_2(line, key, tmp_path):
    (tmp_path / "bad.toml").write_text(CRAFT + f"[certify]\n{line}\n" + PD)
    complains(starhold("certify", "bad.toml", "-o", "out", cwd=tmp_path), key)
    assert not (tmp_path / "out").exists()
