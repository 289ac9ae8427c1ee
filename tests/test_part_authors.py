"""The page for authors of parts is true: its tables are those of the code, and its parts conform and fly together."""

import re
import tomllib
from pathlib import Path

import pytest

import starhold as sh
from starhold.conformance.parts import examine_part, find_part
from tests.parts.files import FILES, PAGE

ROOT = Path(__file__).parents[1]
PARTS = {"sunlight": "environment", "drifting_tracker": "sensor", "rate_from_attitude": "estimator"}
PARTS |= {"dead_zone": "actuator", "flexible_panel": "effector"}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    for name, text in FILES.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_it_tells_all_that_a_part_may_add():
    """What the code asks a part for by name."""
    asked: set[str] = set()
    for path in (ROOT / "src").rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        asked |= set(re.findall(r"\.(?:hook|flag)\(\"(\w+)\"\)", text))
        if path.parent.name in ("parts", "loop"):
            asked |= set(re.findall(r"getattr\([\w.]*module, \"(\w+)\"", text))
    assert {"prepare", "bound", "FIRST", "ACTS"} < asked
    assert {name for name in asked if f"`{name}" not in PAGE} == set()


@pytest.mark.parametrize("name", ["sunlight", "drifting_tracker", "rate_from_attitude"])
def test_its_parts_conform(name, folder):
    """The others are examined where one file is told of."""
    part = find_part(f"{name}.py")
    assert part.role == PARTS[name]
    verdicts = list(examine_part(part))
    assert [verdict for verdict in verdicts if verdict.outcome == "failed"] == []


@pytest.mark.slow
def test_its_parts_fly_together(folder):
    scenario = sh.load("own.toml")
    run = sh.simulate(scenario)
    assert float(abs(run.deflection).max()) > 1e-4
    error = run["rate_from_attitude_rate"] - run["rate"]
    assert 1e-5 < float(abs(error[100:]).max()) < 5e-3
    # A command is none, or at least as wide as the dead zone is, which the torque shows.
    torque = abs(run.torque.values[1:-1])
    assert (torque[torque > 0.0] >= 1e-5).all()
    assert (torque == 0.0).any()


@pytest.mark.slow
def test_claims_say_of_its_parts_what_it_tells(folder):
    (certificate,) = sh.certify("own.toml")
    for claim in certificate.claims:
        away = {name for name in claim.assumptions if name.startswith("without:")}
        assert "without:sensor drifting-tracker" in away
        assert ("without:effector panel" in away) == (claim.kind != "appendages")
        assert any("sunlight" in name for name in away) == (claim.kind not in ("pointing", "appendages"))
    pushed = certificate.claim("pointing")
    assert pushed.outcome == "proved"
    assert pushed.numbers["torque"] == pytest.approx(20e-6 * 0.05)


def test_its_package_names_the_modules_of_its_parts():
    (text,) = re.findall(r"`pyproject.toml`:\n\n```toml\n(.*?)```", PAGE, flags=re.DOTALL)
    points = tomllib.loads(text)["project"]["entry-points"]["starhold.parts"]
    assert {module.rpartition(".")[2] for module in points.values()} < set(PARTS)
