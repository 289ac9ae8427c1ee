"""The page for authors of laws is true: its tables are those of the code, and its laws conform, fly and are designed."""

import re
import tomllib
from dataclasses import fields as dataclass_fields

import pytest

import starhold as sh
from starhold.conformance.suite import examine, find_law
from starhold.laws.interface import Gain
from starhold.laws.interface import fields as gains_of
from tests.laws.files import FILES, PAGE
from tests.tiers import leading

BODY = {
    "name": "authors",
    "spacecraft": {"inertia": [2.0, 3.0, 4.0], "torque_limit": 0.05},
    "initial": {"angles": ["40 deg", 0, 0]},
    "simulation": {"duration": 600.0, "control_period": 0.1},
    "settling": {"attitude_tolerance": "1 deg", "rate_tolerance": "0.1 deg/s"},
}
POINT = {"name": "authors", "libration": {}, "initial": {"position": [0, 0.5, 0.1]}, "simulation": {"duration": 2.0}}


@pytest.fixture
def folder(tmp_path):
    for name, text in FILES.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


def test_its_laws_show_every_keyword_of_a_gain(folder):
    assert set(FILES) == {"my_law.py", "filtered_pid.py", "hold_point.py", "finite_time.py", "soft_start.py"}
    gains = [item.gain for name in FILES for item in gains_of(find_law(str(folder / name)).gains)]
    for keyword in dataclass_fields(Gain):
        # Rows of a file, and what a whole flight shares, are for other parts, such as `torque-table`.
        shown = any(getattr(gain, keyword.name) != keyword.default for gain in gains)
        assert shown or keyword.name in ("also", "columns", "plain", "shared"), keyword.name


@pytest.mark.parametrize("name", leading(FILES))
def test_its_laws_conform(name, folder):
    verdicts = list(examine(find_law(str(folder / name))))
    assert [verdict for verdict in verdicts if verdict.outcome == "failed"] == []


def test_its_laws_fly_from_scenarios_beside_them(folder):
    (table,) = re.findall(r"```toml\n(\[\[law\]\].*?)```", PAGE, flags=re.DOTALL)
    laws = tomllib.loads(table)["law"]
    laws.append({"file": "filtered_pid.py", "form": "bandwidth", "bandwidth": 0.05, "name": "designed"})
    laws.append({"file": "filtered_pid.py", "k_rate": 0.3, "k_attitude": 0.02, "k_integral": 1e-4, "gyroscopic": "kept"})
    laws.append({"file": "finite_time.py", "k_rate": "0.1 N m s^0.5", "k_attitude": 0.01})
    laws.append({"file": "soft_start.py", "k_rate": 0.02, "rate": 0.08, "k_attitude": 0.02, "time": 60.0})
    scenario = sh.scenario(BODY | {"law": laws}, folder=folder)
    flights = sh.compare(scenario)
    assert [flight.name for flight in flights] == ["my-law", "designed", "filtered-pid", "finite-time", "soft-start"]
    assert all(flight.metrics["settling_time"] is not None for flight in flights)
    assert flights[0].certificates[0].claim("convergence").outcome == "proved"
    (design,) = sh.design(scenario)
    assert design.inputs["angle"] == pytest.approx(0.698, abs=1e-3)
    assert design.figures["torque at the start (N m)"] == pytest.approx(0.02 * 0.342, rel=1e-3)
    bad = {"file": "filtered_pid.py", "k_rate": -1.0, "k_attitude": 0.02}
    with pytest.raises(sh.InputError, match=r"k_rate must be positive definite; --allow-unstable"):
        sh.scenario(BODY | {"law": [bad]}, folder=folder)
    held = sh.simulate(sh.scenario(POINT | {"law": [{"file": "hold_point.py", "k": 20, "lead": 0.45}]}, folder=folder))
    assert float(abs(held.position[-1]).max()) < 0.1


def test_its_package_names_the_modules_of_its_laws():
    (text,) = re.findall(r"`pyproject.toml`:\n\n```toml\n(.*?)```", PAGE, flags=re.DOTALL)
    points = tomllib.loads(text)["project"]["entry-points"]["starhold.parts"]
    assert {f"{module.rpartition('.')[2]}.py" for module in points.values()} < set(FILES)
