"""The commands `campaign`, `query` and `rerun`, as a user runs them."""

import io
import json
import math
import shutil
import socket
from functools import partial

import pandas as pd
import pytest

from starhold.campaign import engines
from tests.refusals import complains
from tests.running import starhold
from tests.texts import toml

SMALL = toml("""
name = "small"

[spacecraft] inertia = [2.0, 3.0, 4.0]; torque_limit = 0.3

[initial] attitude = [0.9, 0.1, -0.3, 0.2]

[sensor] rate_noise = 1e-4

[simulation] duration = 8.0; control_period = 0.2; seed = 7

[settling] attitude_tolerance = 0.05; rate_tolerance = 0.02

[campaign] runs = 24

[campaign.over] "initial.rate" = { distribution = "shell", high = "4 deg/s" }
"law.pd.k_rate" = { distribution = "uniform", low = 1.5, high = 2.5 }

[[requirement]] method = "campaign"; id = "effort"; metric = "final_rate_error"; at_most = "60 deg/s"; share = 0.5

[[law]] type = "pd"; k_rate = 2.0; k_attitude = 0.8

[[law]] type = "lyapunov"; k_rate = 1.6; k_attitude = 0.7
""")
LAWS = ("pd", "lyapunov")


def listed(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """A campaign that was flown, and what was printed of it."""
    place = tmp_path_factory.mktemp("campaign")
    (place / "small.toml").write_text(SMALL)
    return place, starhold("campaign", "small.toml", "--threads", "2", "-o", "out", cwd=place)


@pytest.fixture
def place(flown, tmp_path):
    """A copy of it that may be changed."""
    shutil.copytree(flown[0], tmp_path, dirs_exist_ok=True)
    return tmp_path


def flies(place, *words, text=SMALL):
    (place / "small.toml").write_text(text)
    return starhold("campaign", "small.toml", "--law", "pd", "--no-search", "--threads", "1", *words, cwd=place)


def test_a_campaign_is_flown_told_and_kept(flown):
    place, done = flown
    assert (done.returncode, done.stderr) == (0, "")
    out = place / "out"
    totals = json.loads((out / "campaign.json").read_text())
    assert totals["runs"] == dict.fromkeys(LAWS, 24)
    assert totals["verdicts"] == {law: {"effort": "met"} for law in LAWS}
    for text in ("24 runs of 2 laws", f"digest {totals['digest']}", "Report: out/report.html", "48 runs flown", "rerun out"):
        assert text in done.stdout
    names = listed(out)
    for law in LAWS:
        assert f"worst-{law}-effort.toml" in names
        assert any(name.startswith(f"recorded/{law}-") for name in names)
        assert any(name.startswith(f"runs/{law}/000000000-000000023.") for name in names)
    assert {"manifest.json", "campaign.json", "report.html"} <= {*names}
    assert not [name for name in names if ".writing-" in name]


def test_what_is_missed_and_what_is_not_decided_have_codes_of_their_own(tmp_path):
    missed = flies(tmp_path, "-o", "missed", text=SMALL.replace('"60 deg/s"', '"1e-9 deg/s"'))
    assert (missed.returncode, missed.stderr) == (3, "")
    assert "missed" in missed.stdout
    undecided = flies(tmp_path, "--runs", "8", "-o", "open", text=SMALL.replace("share = 0.5", "share = 0.999"))
    assert (undecided.returncode, undecided.stderr) == (4, "")
    assert "not decided" in undecided.stdout
    nothing = flies(tmp_path, "--runs", "1", "-o", "none", text=WITHOUT)
    assert (nothing.returncode, nothing.stderr) == (0, "")
    assert "has no requirements" in nothing.stdout
    assert not list((tmp_path / "none").glob("worst-*"))


def test_a_folder_that_holds_a_campaign_is_refused_and_force_clears_it(place):
    before = listed(place / "out")
    complains(flies(place, "-o", "out"), "a campaign already there (manifest.json)", "--resume")
    assert listed(place / "out") == before
    (place / "out" / "notes.txt").write_text("mine")
    done = flies(place, "--runs", "9", "--force", "-o", "out")
    assert (done.returncode, done.stderr) == (0, "")
    names = listed(place / "out")
    assert "notes.txt" in names
    assert not [name for name in names if "lyapunov" in name or name.startswith("worst-")]
    (chunk,) = (name for name in names if name.startswith("runs/"))
    assert chunk.startswith("runs/pd/000000000-000000008.")


def test_results_of_other_commands_are_not_removed_unasked(tmp_path):
    for name in ("report.html", "worst-of-mine.toml"):
        folder = tmp_path / name[:5]
        folder.mkdir()
        (folder / name).write_text("mine")
        complains(flies(tmp_path, "-o", folder.name), f"results already there ({name})", "--force")
        assert listed(folder) == [name]
    assert flies(tmp_path, "--runs", "2", "--force", "-o", "worst").returncode in (0, 4)
    assert "worst-of-mine.toml" not in listed(tmp_path / "worst")


@pytest.mark.slow
def test_resume_flies_what_is_missing_and_no_more(place):
    out = place / "out"
    digest = json.loads((out / "campaign.json").read_text())["digest"]

    def resume(*words):
        return starhold(
            "campaign", "small.toml", "--no-search", "--resume", "--threads", "1", *words, "-o", "out", cwd=place
        )

    nothing = resume()
    assert (nothing.returncode, nothing.stderr) == (0, "")
    assert "runs flown in" not in nothing.stdout
    assert f"digest {digest}" in nothing.stdout
    (spoiled,) = (out / "runs" / "pd").glob("*.parquet")
    spoiled.write_bytes(spoiled.read_bytes()[:-1])
    told = starhold("query", "out", "select count(*) as n from runs", "--csv", cwd=place)
    assert told.stdout == "n\n24\n"
    assert told.stderr.count("\n") == 1
    assert "its bytes were changed; runs 0 to 23 are left out" in told.stderr
    again = resume()
    assert "24 runs flown in" in again.stdout
    assert f"digest {digest}" in again.stdout
    more = resume("--runs", "30")
    assert "12 runs flown in" in more.stdout
    assert json.loads((out / "campaign.json").read_text())["runs"] == dict.fromkeys(LAWS, 30)
    assert f"digest {digest}" not in more.stdout
    complains(resume("--runs", "29"), "campaign.runs: 29, was 30")
    # What is the same is no change, whether or not the file says it.
    assert resume("--runs", "30", "--seed", "1").returncode == 0


def test_runs_are_asked_in_sql(flown):
    place, _ = flown

    def ask(sql, *words):
        return starhold("query", "out", sql, *words, cwd=place)

    shown = ask("select law, count(*) as n, 0.5 as half, null as nil from runs group by law order by law")
    assert (shown.returncode, shown.stderr) == (0, "")
    head, _, *rows = (line.replace("┃", "│").split("│") for line in shown.stdout.splitlines())
    assert [[cell.strip() for cell in row] for row in (head, *rows)] == [
        ["law", "n", "half", "nil"],
        ["lyapunov", "24", "0.5", "—"],
        ["pd", "24", "0.5", "—"],
    ]
    csv = ask("select run, \"law.pd.k_rate\" as k from runs where law = 'pd' order by run", "--csv")
    assert csv.stdout.splitlines()[0] == "run,k"
    assert len(csv.stdout.splitlines()) == 25
    assert all(1.5 <= float(line.split(",")[1]) <= 2.5 for line in csv.stdout.splitlines()[1:])
    assert "the first 60 of 2304 rows" in ask("select a.run from runs a, runs b").stdout


@pytest.mark.slow
def test_a_run_is_flown_again_and_its_file_flies_the_same(flown, tmp_path):
    place, _ = flown
    done = starhold("rerun", str(place / "out"), "7", "--law", "lyapunov", "-o", "seven", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert "The same bits as in the campaign." in done.stdout
    assert {"run.nc", "scenario.toml", "report.html", "summary.json"} <= {*listed(tmp_path / "seven")}
    words = ("run", "seven/scenario.toml", "--law", "lyapunov", "--no-certify", "--pictures", "none", "-o", "own")
    assert starhold(*words, cwd=tmp_path).returncode == 0
    (again, own) = (json.loads((tmp_path / name / "summary.json").read_text())["laws"] for name in ("seven", "own"))
    metrics = again["lyapunov"]
    assert len(metrics) > 20
    # What a call costs is measured by `run` alone.
    assert metrics == {name: value for name, value in own["lyapunov"].items() if not name.startswith("cost_")}
    sql = "select * from runs where law = 'lyapunov' and run = 7"
    stored = pd.read_csv(io.StringIO(starhold("query", "out", sql, "--csv", cwd=place).stdout)).iloc[0]
    for name in ("final_rate_error", "effort", "peak_torque"):
        assert math.isclose(metrics[name], stored[name], rel_tol=1e-12), name
    complains(starhold("rerun", str(place / "out"), "7", "--law", "lyapunov", "-o", "seven", cwd=tmp_path), "--force")


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["24"], "no run 24 of pd; allowed: 0 to 23"),
        (["--", "-1"], "no run -1 of pd"),
        (["99999999999999999999999"], "no run 99999999999999999999999"),
        (["3", "--law", "lqr"], 'law: found "lqr"; allowed: one of lyapunov, pd'),
        (["3", "--law", "../pd"], "law: found"),
    ],
)
def test_runs_that_are_none_are_refused(flown, words, told):
    complains(starhold("rerun", "out", *words, cwd=flown[0]), told)


WITHOUT = SMALL[: SMALL.index("[[requirement")] + SMALL[SMALL.index("[[law") :]
BAD = {
    "zero runs by option": (SMALL, ["--runs", "0"], ["campaign.runs", "at least 1"]),
    "two engines": (SMALL, ["--threads", "2", "--workers", "2"], ["workers", "beside threads"]),
    "runs that no design has": (SMALL, ["--sampling", "morris", "--runs", "23"], ["campaign.runs", "20 or 25"]),
    "no TOML": ("campaign = [", [], ["not TOML"]),
    "nothing to draw": (
        WITHOUT.partition("[campaign")[0] + "[[law]]\n" + WITHOUT.partition("[[law]]\n")[2],
        [],
        ["no [campaign]"],
    ),
}


@pytest.mark.parametrize("case", list(BAD))
def test_bad_input_is_complains(tmp_path, case):
    text, words, told = BAD[case]
    (tmp_path / "small.toml").write_text(text)
    done = starhold("campaign", "small.toml", *words, "-o", "out", cwd=tmp_path)
    complains(done, *told)
    assert done.stdout == ""
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_a_scheduler_that_does_not_answer_is_complains(tmp_path, monkeypatch):
    monkeypatch.setattr(engines, "Scheduler", partial(engines.Scheduler, patience=1.0))
    with socket.socket() as nobody:
        nobody.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{nobody.getsockname()[1]}"
        (tmp_path / "small.toml").write_text(SMALL)
        done = starhold("campaign", "small.toml", "--scheduler", address, "-o", "out", cwd=tmp_path)
    complains(done, address, "no Dask scheduler answers")
    # Nothing is left that stands in the way of the next attempt, and nothing is lost that --force would write over.
    assert not (tmp_path / "out").exists()
    done = starhold("campaign", "small.toml", "--scheduler", "nonsense", "-o", "new", cwd=tmp_path)
    complains(done, "nonsense: no Dask scheduler answers")


def test_a_folder_that_cannot_be_written_is_complains(tmp_path):
    (tmp_path / "file").touch()  # a folder below a file cannot be made, even by root
    complains(flies(tmp_path, "-o", "file/out"), "cannot write there")
    complains(flies(tmp_path, "-o", "file"), "cannot write there")
