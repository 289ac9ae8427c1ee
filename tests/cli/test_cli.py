"""The commands as a user meets them."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest
import xarray as xr

from starhold.errors import InputError
from starhold.laws.catalogue import catalogue
from starhold.report.results import open_folder
from starhold.scenario.reading import builtin_text
from tests.certification.invariants import file as invariant_file
from tests.cli.short import SHORT
from tests.refusals import complains
from tests.running import starhold
from tests.tiers import leading


@pytest.fixture
def short(tmp_path):
    (tmp_path / "short.toml").write_text(SHORT)
    (tmp_path / "folder.toml").mkdir()
    (tmp_path / "huge.toml").write_text(SHORT.replace("duration = 20.0", "duration = 1e10"))
    return tmp_path


@pytest.mark.slow
def test_what_compare_prints_of_a_mission_fits_on_a_screen(tmp_path):
    lines = starhold("compare", "cubesat-mission", "-o", "out", cwd=tmp_path, code=0).stdout.splitlines()
    assert len(lines) <= 75
    assert max(map(len, lines)) <= 120
    assert {"settling", "overshoot"} <= set(lines[2].split()), "the table of metrics has laws as rows"


def test_compare_writes_everything_and_prints_the_table(short):
    done = starhold("compare", "short.toml", "-o", "out", cwd=short, code=0)
    out = short / "out"
    assert "Report: out/report.html" in done.stdout
    assert max(map(len, done.stdout.splitlines())) <= 120
    for name in ("lyapunov", "sliding", "mpc"):
        assert name in done.stdout
        run = xr.open_dataset(out / name / "run.nc", engine="h5netcdf")
        assert run.attrs["scenario"] == SHORT
        assert run.attrs["seed"] == 1
        assert run.attrs["starhold_version"]
        assert run["torque"].attrs["units"] == "N m"
        assert run.sizes["time"] == 201
        run.close()
    summary = json.loads((out / "summary.json").read_text())
    assert set(summary["laws"]) == {"lyapunov", "sliding", "mpc"}
    assert summary["laws"]["lyapunov"]["peak_torque"] <= 0.01
    assert len(list(out.glob("*.png"))) >= 5
    page = (out / "report.html").read_text()
    assert "</html>" in page
    assert not list(out.rglob(".writing-*"))
    # The certificates, too, of laws of which nothing is claimed among them.
    assert "Certified on this spacecraft" in done.stdout
    assert "<h2>Proofs</h2>" in page
    assert "Nothing is claimed" in page
    certificates = json.loads((out / "certificate.json").read_text())["certificates"]
    assert [one["name"] for one in certificates] == ["lyapunov", "sliding", "mpc"]
    assert ("convergence", "proved") in [(claim["kind"], claim["outcome"]) for claim in certificates[0]["claims"]]
    complains(starhold("compare", "short.toml", "-o", "out", cwd=short), "--force")


def test_what_is_forced_keeps_the_files_of_others(short):
    words = ("run", "short.toml", "--no-certify", "--pictures", "page", "-o", "out")
    starhold(*words, cwd=short, code=0)
    (short / "out" / "mine.txt").write_text("keep")
    starhold(*words, "--force", cwd=short, code=0)
    assert (short / "out" / "mine.txt").read_text() == "keep"


def test_run_flies_the_law_that_is_asked_for(short):
    starhold("run", "short.toml", "--law", "sliding", "--no-certify", "--pictures", "page", cwd=short, code=0)
    folder = short / "results" / "three-laws-sliding"
    assert (folder / "run.nc").exists()
    assert set(json.loads((folder / "summary.json").read_text())["laws"]) == {"sliding"}


def test_a_motion_that_is_lost_is_said_so(short):
    text = SHORT.replace("k_rate = 0.09", "k_rate = 900").replace('torque_limit = "0.01 N m"', "")
    (short / "wild.toml").write_text(text)
    done = starhold("run", "wild.toml", "-o", "wild", "--no-certify", "--pictures", "page", cwd=short, code=1)
    assert "lyapunov diverged at" in done.stdout
    row = json.loads((short / "wild" / "summary.json").read_text())["laws"]["lyapunov"]
    assert 0 < row["diverged_at"] < 20
    assert row["settling_time"] is None
    assert "diverged" in (short / "wild" / "report.html").read_text()


REFUSED = {
    "compare": [("no.toml", "no.toml: found no such file")],
    "run": [
        ("short.toml -o short.toml", "cannot write there"),
        ("short.toml -o /proc/here", "cannot write there"),
        ("huge.toml", "simulation.record_every: found 1,"),
        (5000 * "x", "File name too long"),
        ("short.toml -o " + 5000 * "x", "cannot write there: File name too long"),
        ("short.toml --law slidding", "did you mean sliding?"),
        ("l2-deficit --law deficit_6", "did you mean deficit"),
        ("short.toml --proof --no-certify", "run: --proof: found --no-certify too"),
        ("short.toml --proof --law-process ./law", "run: --proof: found --law-process too"),
    ],
    "laws": [("lyapunow", "did you mean lyapunov?")],
    "scenarios": [("three", "three-laws")],
    "new": [
        ("short.toml", "exists"),
        ("x.toml --from cubesat", "cubesat-slew"),
        ("no/such/folder/x.toml", "cannot be written: No such file or directory"),
        (".", "a folder"),
        ("folder.toml --force", "a folder"),
        (5000 * "x", "File name too long"),
        ("x.toml --libration --wheels", "one of the two"),
    ],
    "check-law": [("short.toml", "short.toml"), ("absent.py", "no such file")],
    "check": [("absent.json", "absent.json")],
    "design": [
        ("short.toml", "form"),
        ("geostationary --map map.jpg", "--map: found map.jpg; allowed: the name of a PNG file"),
    ],
    "failures": [("l2-deficit", "libration: found a scenario of a libration-point; allowed: here one of a rigid-body")],
    "modal-roots": [
        ("l2-deficit", "libration: found a scenario of a libration-point; allowed: here one of a rigid-body"),
        ("three-laws", "found no such table"),
        ("landing-limits --law own", "did you mean own-fit?"),
        ("no.toml", "no such file"),
    ],
    "invariant": [
        ("none.toml", "no such file"),
        ("van-der-pole", "did you mean van-der-pol?"),
        ("bad.toml", 'bad.toml: rates.y: found the function "sinh"; allowed: one of where, min'),
    ],
    "sail": [
        ("-o " + 5000 * "x", "File name too long"),
        ("-o no/such/folder.csv", "cannot be written: No such file or directory"),
        ("--radius 9**9**9_m", "--radius"),
        ("--radius 3_s", "--radius: found 3 s; allowed: a quantity in m"),
        ("--radius -2", "--radius: found -2; allowed: must be above 0"),
        ("--radius 1e9_km", "--radius: found 1e9 km; allowed: a circle smaller than"),
        ("--primaries earth-moon", "--primaries: found earth-moon; allowed: a pair with the Sun"),
        ("--primaries sun-erth", "did you mean sun-earth?"),
        ("--primaries sun-jupiter --radius 1_km", "a circle in sunlight"),
        ("--point L3", "--point: found L3; allowed: L1 or L2"),
        ("--reflectivity 1.2", "--reflectivity: found 1.2; allowed: must be at most 1"),
        ("--diffuse 0.5", "must add up to more than 0 and at most 1, not 1.5"),
        ("--mass heavy", "--mass: found heavy; allowed: a number"),
        ("--area nan", "--area: found nan; allowed: must be finite"),
    ],
}


@pytest.mark.parametrize("command", REFUSED)
def test_user_errors_are_one_line_and_exit_code_2(command, short):
    (short / "bad.toml").write_text(invariant_file(y="sinh(x)"))
    for words, said in REFUSED[command]:
        done = starhold(command, *(word.replace("_", " ") for word in words.split()), cwd=short)
        complains(done, said)
        assert len(done.stderr) < 1000


def test_new_writes_a_file_that_runs(tmp_path):
    assert starhold("new", "my.toml", "--schema", cwd=tmp_path).returncode == 0
    assert (tmp_path / "my.toml").read_text().startswith("#:schema ./starhold.schema.json")
    assert json.loads((tmp_path / "starhold.schema.json").read_text())["title"] == "starhold scenario"
    starhold("run", "my.toml", "--no-certify", "--pictures", "page", "-o", "out", cwd=tmp_path, code=0)


def test_lists(tmp_path):
    listed = starhold("laws", cwd=tmp_path).stdout
    for name in catalogue():
        assert name in listed
        assert "key" in starhold("laws", name, cwd=tmp_path).stdout
    assert "[[law.mode]]" in starhold("laws", "modes", cwd=tmp_path).stdout
    assert "cubesat-slew" in starhold("scenarios", cwd=tmp_path).stdout
    assert starhold("scenarios", "three-laws", cwd=tmp_path).stdout == builtin_text("three-laws")
    assert starhold("--version", cwd=tmp_path).stdout.startswith("starhold ")
    assert json.loads(starhold("schema", cwd=tmp_path).stdout)["type"] == "object"


HOLDER = """
import sys
from pathlib import Path
from starhold.report.results import open_folder
open_folder(Path("shared"), force=True)
print("claimed", flush=True)
sys.stdin.read()
"""


def test_a_folder_that_another_process_writes_is_refused_until_that_ends(tmp_path):
    words = [sys.executable, "-c", HOLDER]
    holder = subprocess.Popen(words, cwd=tmp_path, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert holder.stdout is not None
    assert holder.stdout.readline() == "claimed\n"
    with pytest.raises(InputError, match="another starhold"):
        open_folder(tmp_path / "shared", force=True)
    complains(
        starhold("certify", "three-laws", "--law", "lyapunov", "-o", "shared", "--force", cwd=tmp_path), "another starhold"
    )
    # Not even a crash leaves the claim behind.
    holder.kill()
    holder.communicate()
    open_folder(tmp_path / "shared", force=False)
    open_folder(tmp_path / "shared", force=False)
    assert not list((tmp_path / "shared").iterdir())


def test_warnings_and_failures_of_the_system_are_single_lines(short):
    falling = SHORT.replace("velocity = [0, 7550, 0]", "velocity = [0, 6000, 0]")
    (short / "falling.toml").write_text(falling)
    warned = starhold("run", "falling.toml", "-o", "falling", "--no-certify", "--pictures", "page", cwd=short, code=0)
    assert warned.stderr.startswith("starhold: warning: orbit.velocity: the orbit meets the Earth's surface")
    assert warned.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("failure", "said"),
    [
        (MemoryError(), "starhold: not enough memory; a larger simulation.record_every"),
        (OSError(28, "No space left on device", "out/run.nc"), "starhold: out/run.nc: No space left on device"),
    ],
)
def test_what_the_system_refuses_is_one_line(failure, said, monkeypatch, capsys):
    from starhold.cli import main

    def fail(standalone_mode):
        raise failure

    monkeypatch.setattr(main, "app", fail)
    monkeypatch.setattr(main.signal, "signal", lambda *_: None)
    monkeypatch.setattr(main.gc, "set_threshold", lambda *_: None)
    monkeypatch.setattr(main.warnings, "formatwarning", main.warnings.formatwarning)
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "1")
    assert main.run_command() == 2
    error = capsys.readouterr().err
    assert error.startswith(said)
    assert error.count("\n") == 1


@pytest.mark.slow
@pytest.mark.parametrize("number", leading([signal.SIGINT, signal.SIGTERM]))
def test_what_ends_a_command_leaves_nothing_half_written(number, short):
    (short / "long.toml").write_text(SHORT.replace("duration = 20.0", "duration = 20000000.0\nrecord_every = 10000"))
    words = [sys.executable, "-m", "starhold", "run", "long.toml", "--law", "lyapunov", "-o", "out"]
    child = subprocess.Popen(words, cwd=short, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    while not (short / "out").exists() and child.poll() is None:
        time.sleep(0.05)
    time.sleep(1.0)
    child.send_signal(number)
    _, said = child.communicate(timeout=60)
    assert child.returncode == 128 + number
    assert said.endswith("starhold: interrupted; files already written are complete\n")
    assert "Traceback" not in said
    assert os.listdir(short / "out") == []


def test_meanings_keep_what_stands_in_brackets(tmp_path):
    """Tables name scenario tables, such as [settling], which are no markup."""
    done = starhold("laws", "lyapunov", cwd=tmp_path, code=0)
    assert "that of [settling] if absent" in done.stdout
    part = starhold("parts", "magnetorquers", cwd=tmp_path, code=0)
    assert "[orbit]" in part.stdout
