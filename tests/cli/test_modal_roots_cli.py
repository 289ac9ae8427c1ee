"""The search for modal roots, and a run against limits, as a user meets them."""

import json
import math
import tomllib

import pytest

from starhold.scenario.reading import builtin_text, parse
from tests.refusals import complains
from tests.running import starhold

COARSE = builtin_text("landing-limits").replace('step = "5 deg"', 'step = "30 deg"').replace("step = 0.001", "step = 0.05")


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "coarse.toml").write_text(COARSE)
    (tmp_path / "few.toml").write_text(COARSE.replace('step = "30 deg"', 'step = "85 deg"'))
    return tmp_path


def test_modal_roots_writes_a_table_and_a_picture_and_prints_a_law_to_paste(folder):
    done = starhold("modal-roots", "coarse.toml", "-o", "out", cwd=folder, code=0)
    assert sorted(path.name for path in (folder / "out").iterdir()) == ["modal-roots.csv", "modal-roots.png"]
    assert len((folder / "out" / "modal-roots.csv").read_text().splitlines()) == 7
    assert "published: off by" in done.stdout
    pasted = done.stdout[done.stdout.index("[[law]]") : done.stdout.index("Table:")]
    assert tomllib.loads(pasted)["law"][0]["form"] == "fit"
    assert parse(COARSE[: COARSE.index("[[law]]")] + pasted, "pasted").laws[0].gains.phi_0[0] == pytest.approx(
        -0.85, abs=0.06
    )
    complains(starhold("modal-roots", "coarse.toml", "-o", "out", cwd=folder), "results already there (modal-roots.csv)")
    assert starhold("modal-roots", "few.toml", "-o", "out", "--force", cwd=folder).returncode == 0
    assert len((folder / "out" / "modal-roots.csv").read_text().splitlines()) == 4


@pytest.mark.slow
def test_a_run_shows_its_transient_against_the_limits(folder):
    done = starhold("run", "landing", "--law", "rounded", "--no-certify", "-o", "out", cwd=folder, code=0)
    assert "of 30 deg/s; peak acceleration 2.068, 16.34, 16.14 of 50 deg/s²: kept" in done.stdout
    row = json.loads((folder / "out" / "summary.json").read_text())["laws"]["rounded"]
    assert row["transient_time"] == pytest.approx(22.92, abs=0.01)
    assert math.degrees(row["rate_limit"]) == pytest.approx(30.0)
    assert row["limits_kept"] is True
    assert (folder / "out" / "transient.png").stat().st_size > 10_000
    page = (folder / "out" / "report.html").read_text()
    assert "<h3>transient</h3>" in page
    assert '"name":"transient"' in page
    assert "-3 to -0.001, 3000 values" in page


def test_the_python_interface_gives_what_the_command_prints(folder):
    import starhold as sh

    found = sh.modal_roots(folder / "coarse.toml")
    assert [round(math.degrees(angle)) for angle in found.angles] == [10, 40, 70, 100, 130, 160]
    assert found.roots == pytest.approx([-1.55, -1.1, -0.95, -0.75, -0.55, -0.45], abs=0.06)
