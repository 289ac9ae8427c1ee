"""The commands with scenarios of station keeping."""

import json

import pytest
import xarray as xr

from starhold.laws.catalogue import catalogue
from starhold.scenario.reading import builtin_text
from tests.running import starhold

SHORT = builtin_text("l2-deficit").replace('"4 yr"', '"1 yr"')


@pytest.fixture
def short(tmp_path):
    (tmp_path / "short.toml").write_text(SHORT)
    return tmp_path


@pytest.mark.slow
def test_compare_writes_everything_and_prints_the_table(short):
    done = starhold("compare", "short.toml", "-o", "out", cwd=short, code=0)
    out = short / "out"
    assert "2.786 as printed diverged at 288.861 days" in done.stdout
    run = xr.open_dataset(out / "deficit 0" / "run.nc", engine="h5netcdf")
    assert run.attrs["scenario"] == SHORT
    assert run["position"].attrs["units"] == "length unit"
    assert run.attrs["length_unit_m"] == 12_742_000.0
    assert float(run["time"][-1]) * run.attrs["time_unit_s"] == pytest.approx(365.25 * 86400, rel=2e-3)
    run.close()
    summary = json.loads((out / "summary.json").read_text())["laws"]
    assert summary["2.786 as printed"]["deviation"] is None
    assert {path.name for path in out.glob("*.png")} == {"projections.png", "space.png", "control.png", "deviation.png"}


def test_certifies_and_checks(short):
    done = starhold("certify", "short.toml", "-o", "sure", cwd=short, code=3)
    assert "deficit 5: refuted" in done.stdout
    assert "control = 3.43" in " ".join(done.stdout.split())
    found = json.loads((short / "sure" / "certificate.json").read_text())["certificates"]
    assert [c["outcome"] for c in found] == ["undecided", "refuted", "refuted", "refuted"]
    assert [claim["outcome"] for claim in found[1]["claims"]] == ["proved", "refuted"]
    starhold("check", "sure/certificate.json", cwd=short, code=0)
    rest = starhold("certify", "l2-equilibrium", "--law", "beside Y", "-o", "rest", cwd=short, code=0)
    assert "99.89 %" in rest.stdout


def test_lists_design_and_new(short):
    listed = starhold("laws", cwd=short).stdout
    assert all(name in listed for name in catalogue("libration-point"))
    assert "radius" in starhold("laws", "l2-circle", cwd=short).stdout
    assert "l2-nonlinear" in starhold("scenarios", cwd=short).stdout
    designed = starhold("design", "short.toml", "--law", "deficit 0", cwd=short, code=0)
    assert "peak demand (scaled): 3.43" in designed.stdout
    starhold("new", "my.toml", "--libration", cwd=short, code=0)
    assert "[libration]" in (short / "my.toml").read_text()
