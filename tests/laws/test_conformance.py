"""Every law passes every check of the conformance suite, and broken laws do not."""

from functools import cache
from importlib.metadata import EntryPoint
from pathlib import Path
from unittest.mock import patch

import pytest

from starhold.conformance.bench import sample_loop
from starhold.conformance.bodies import rigid_body
from starhold.conformance.bodies.rigid_body import CHECKS, can_be_certified, keeps_units
from starhold.conformance.suite import examine
from starhold.laws.catalogue import _installed, catalogue, from_file
from starhold.parts.bodies.libration_point import PRIMARIES
from starhold.simulation.lane import fly
from tests.refusals import refused, replaced
from tests.tiers import WHOLE, fewer

LAWS = {**catalogue(), **catalogue("libration-point")}
GOOD = Path(catalogue()["pd"].module.__file__).read_text()


CERTIFIED = {"lyapunov", "lqr", "matrix-pd", "sliding", "wheel", "modal"}
"""Laws whose certificates tests of certification hold against numbers."""


@cache
def verdicts(name):
    """What is found of a law with its first gains, without what other tests find of its certificates; where the whole is
    asked for, with all that it has as examples."""
    law, given = LAWS[name], LAWS[name].examples()
    left = {can_be_certified} if name in CERTIFIED and not WHOLE else set()
    with (
        patch.object(law.module, "examples", lambda: given[: fewer(len(given), len(given))]),
        patch.object(rigid_body, "CHECKS", [check for check in CHECKS if check not in left]),
    ):
        return list(examine(law))


@pytest.mark.parametrize("name", LAWS)
def test_law_conforms(name):
    assert [verdict for verdict in verdicts(name) if verdict.outcome == "failed"] == []


def test_examine_reports_each_check_once():
    assert len(verdicts("pd")) == len(CHECKS) == len({v.name for v in verdicts("pd")})
    assert {v.outcome for v in verdicts("pd")} == {"passed"}


def test_forms_of_station_laws_say_where_they_give_no_gains():
    plant = PRIMARIES["sun-earth"].point("L2")._replace(stiffness=1.9)
    kinds = [(law, kind) for law in catalogue("libration-point").values() for kind in law.forms.values()]
    kinds = [(law, kind) for law, kind in kinds if "radius" in kind._fields]
    assert len(kinds) >= 2
    for law, kind in kinds:
        with pytest.raises(ValueError, match="no rate has a least demand"):
            law.design(plant, kind(radius=1.0))


BROKEN = {
    "wrong unit": ('Gain("N m s", above', 'Gain("N m", above', "keeps_units"),
    "torque at rest": ("craft), feedback)", "craft), add(feedback, (1e-9, 0.0, 0.0)))", "rests_on_target"),
    "anti-damping": (
        "scale(gains.k_rate, measurement.rate)",
        "scale(-gains.k_rate, measurement.rate)",
        "decreases_lyapunov",
    ),
    "wrong sign of stiffness": ("scale(gains.k_attitude", "scale(-gains.k_attitude", "decreases_lyapunov"),
    "even in q": (
        "vector_part(measurement.attitude)",
        "scale(measurement.attitude[0], vector_part(measurement.attitude))",
        "quaternion_sign",
    ),
    "not finite": (
        "subtract(tracking_torque(measurement, craft), feedback)",
        "subtract(scale(0.0 / (1.0 - measurement.attitude[0] * measurement.attitude[0]), measurement.rate), feedback)",
        "stays_finite",
    ),
    "example out of bounds": ("Gains(0.5, 0.05)", "Gains(-0.5, 0.05)", "declares_itself"),
}


@pytest.mark.parametrize("fault", sorted(BROKEN))
def test_broken_law_is_caught(fault, tmp_path):
    old, new, check = BROKEN[fault]
    law = written(tmp_path / "broken.py", GOOD, (old, new))
    assert any(_fails(law, one) for one in CHECKS if check in one.__name__)


def written(path, text, *pairs):
    """The law of a file with this text, changed."""
    path.write_text(replaced(text, *pairs) if pairs else text)
    return from_file(path)


@pytest.mark.parametrize("slow", [3e-4, 3e-8])
@pytest.mark.parametrize("unit", ["N m/s", "T"])
def test_a_gain_that_acts_through_memory_alone_has_its_unit_checked(unit, slow, tmp_path):
    """An integral that the first call does not see yet, and one that is seen after many calls only."""
    changes = (
        ('Gain("N m/s", above', f'Gain("{unit}", above'),
        ("clip_axes(grown, gains.integral_limit / gains.k_integral)", "grown"),
        ("scale(gains.k_integral, integral)", "scale(gains.k_integral, memory.integral)"),
        ("Gains(0.3, 0.03, 3e-4, 2e-3)", f"Gains(0.3, 0.03, {slow}, 2e-3)"),
    )
    law = written(tmp_path / "adaptive.py", Path(catalogue()["pid"].module.__file__).read_text(), *changes)
    assert _fails(law, keeps_units) == (unit == "T")


def test_a_gain_that_acts_near_the_target_alone_has_its_unit_checked(tmp_path):
    text = Path(catalogue()["sliding"].module.__file__).read_text()
    wrong = ('boundary_layer: Annotated[float, Gain("rad/s"', 'boundary_layer: Annotated[float, Gain("m"')
    assert _fails(written(tmp_path / "layered.py", text, wrong), keeps_units)


def _fails(law, check):
    try:
        check(law)
    except Exception:
        return True
    return False


UNREADABLE = {
    "a library's root": ("size = math.sqrt(measurement.rate[0])", "none of the scalar operations", "sqrt"),
    "an if": ("size = 1.0 if measurement.rate[0] > 0.0 else 2.0", "a comparison of numbers", "where"),
    "NumPy": ("size = np.linalg.norm(measurement.rate)", "a function of NumPy", "starhold.algebra.vector"),
    "a power": ("size = measurement.rate[0] ** 2", "a power", "products"),
    "an unknown operator": ("size = measurement.rate[0] % 2.0", "an operator that is none", "+ - * /"),
}


@pytest.mark.parametrize("kind", UNREADABLE)
def test_what_cannot_be_recorded_is_told_in_one_line(kind, tmp_path):
    """It names the law, the line of its file, and what to write instead."""
    text, found, instead = UNREADABLE[kind]
    damping = ("    damping = scale(", f"    {text}\n    damping = scale(size * ")
    path = tmp_path / "own_law.py"
    law = written(path, GOOD, damping, ("from typing", "import math\n\nimport numpy as np\nfrom typing"))
    line = next(number for number, row in enumerate(path.read_text().splitlines(), 1) if text in row)
    reasons = {verdict.reason for verdict in examine(law) if verdict.outcome == "failed" and "own-law" in verdict.reason}
    assert len(reasons) == 1
    (reason,) = reasons
    assert reason.startswith(f"law own-law: own_law.py, line {line}: found ")
    assert found in reason
    assert instead in reason.partition("allowed: ")[2]
    with refused("own_law.py, line"):
        fly(sample_loop(law, law.examples()[0]), 1)


def test_a_law_of_another_package_that_does_not_load_is_left_out_with_a_warning(monkeypatch):
    points = [("broken", "no_such_package.law", "parts"), ("incomplete", "json", "parts"), ("old", "my_law", "laws")]
    offered = [EntryPoint(name, module, f"starhold.{group}") for name, module, group in points]
    monkeypatch.setattr("starhold.parts.catalogue.entries", lambda group: [one for one in offered if one.group == group])
    with pytest.warns(UserWarning, match="is left out") as told:
        found = _installed.__wrapped__()
    assert set(found) == set(_installed())
    texts = [str(warning.message) for warning in told]
    assert texts[0].startswith("the part no_such_package.law is left out: ModuleNotFoundError")
    assert "its ROLE must be one of" in texts[1]
    assert "starhold.laws, now starhold.parts" in texts[2]
