"""The design of a sail as a user meets it."""

import csv

import pytest

from tests.refusals import complains
from tests.running import starhold


def test_sail_prints_the_design_and_writes_the_table(tmp_path):
    words = ("sail", "--area", "200 m^2", "--reflectivity", "0.83", "--diffuse", "5 %", "-o", "out.csv")
    done = starhold(*words, cwd=tmp_path, code=0)
    for said in (
        "C = 3.94052 Ω²",
        "best rate √(C − 2Ω²) = 1.393 Ω, period 262.2 days",
        "2Ω√(C − Ω²) = 3.4296 Ω² × radius = 1.7323e-06 m/s²",
        "98.69 % of the Sun's disc",
        "0.6026 m²/kg, 180.8 m² for 300 kg",
        "margin of 200 m²: 1.106",
        "11467.8",
        "Table: out.csv",
    ):
        assert said in done.stdout
    rows = list(csv.DictReader((tmp_path / "out.csv").read_text().splitlines()))
    assert len(rows) == 7 * 7
    best = [row for row in rows if row["specular"] == "0.83" and row["rate"].startswith("1.393")]
    assert float(best[0]["area_per_mass"]) == pytest.approx(0.6026, abs=1e-4)
    assert min(float(row["peak"]) for row in rows) == float(best[0]["peak"])
    complains(starhold(*words, cwd=tmp_path), "a file that exists")
    assert starhold(*words, "--force", cwd=tmp_path).returncode == 0


def test_another_pair_and_point(tmp_path):
    done = starhold("sail", "--primaries", "sun-mars", "--point", "L1", "--radius", "7000 km", cwd=tmp_path, code=0)
    assert "C = 4.02872 Ω²" in done.stdout
    assert "100 % of the Sun's disc" in done.stdout
    assert list(tmp_path.iterdir()) == []
