"""A filter that gives no numbers is told of, whether a law uses what it gives or not."""

import pytest
from typer.testing import CliRunner

from starhold.cli.main import app
from starhold.scenario.reading import builtin_text
from tests.texts import toml

BLANK = """
from typing import Annotated, NamedTuple

from starhold.algebra.quantity import Quantity
from starhold.algebra.scalar import divide
from starhold.algebra.vector import Vector
from starhold.parts.contract import Card, NoMemory

CARD = Card(title="Blank", summary="0 / 0", sources=("mine",), assumptions=())
ROLE = "estimator"
NEEDS = ("rate",)


class Params(NamedTuple):
    pass


class Estimate(NamedTuple):
    rate: Annotated[Vector, Quantity("rad/s", "angular velocity", "axis")]


def remember(params, state):
    return NoMemory()


def estimate(readings, memory, params, craft, period):
    blank = divide(readings.rate[0] - readings.rate[0], 0.0)
    return Estimate((blank, blank, blank)), memory


def examples():
    return [Params()]
"""
PARTS = '[sensor]\nrate_noise = 1e-6\n[[part]]\nfile = "blank.py"\n'
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
    said = "mission: no number to the end: blank_rate from 0 s on"
    assert done.exit_code == 0
    assert said in " ".join(done.stdout.split())
    assert said in (tmp_path / "out" / "report.html").read_text()
