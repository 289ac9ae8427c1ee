"""A filter that gives no numbers is told of, whether a law uses what it gives or not."""

import pytest
from typer.testing import CliRunner

from starhold.cli.main import app
from starhold.scenario.reading import builtin_text
from tests.parts.files import ESTIMATOR
from tests.refusals import replaced
from tests.texts import toml

BLANK = replaced(
    ESTIMATOR, "    return Estimate(rate)", "    rate = (divide(rate[0] - rate[0], 0.0),) * 3\n    return Estimate(rate)"
)
BLANK = replaced(BLANK, "NEEDS =", "from starhold.algebra.scalar import divide\n\nNEEDS =")
PARTS = '[sensor]\nrate_noise = 1e-6\n[[part]]\nfile = "blank.py"\nshare = 0.5\n'
MODES = toml("""
[[law]] name = "mission"; type = "modes"
[[law.mode]] name = "detumble"; type = "b-dot"; k = 1e-3; until = { rate_below = "0.5 deg/s" }
[[law.mode]] name = "point"; type = "pd"; k_rate = 0.006; k_attitude = 0.0008
""")


@pytest.mark.slow
def test_a_filter_without_numbers_is_told_where_no_mode_fails_by_it(tmp_path):
    """The magnetic law flies by the magnetometer, and what the filter gives is never below a level."""
    (tmp_path / "blank.py").write_text(BLANK)
    text = builtin_text("cubesat-detumble").replace('duration = "3 d"', "duration = 60.0").replace("= 60  ", "= 1  ")
    path = tmp_path / "mission.toml"
    path.write_text(text[: text.index("[[law]]")] + PARTS + MODES)
    done = CliRunner().invoke(app, ["run", str(path), "-o", str(tmp_path / "out"), "--no-certify"])
    said = "mission: not finite up to the end: blank_rate from 0 s on"
    assert done.exit_code == 0
    assert said in " ".join(done.stdout.split())
    assert said in (tmp_path / "out" / "report.html").read_text()
