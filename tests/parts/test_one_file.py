"""One file adds a part of any role: it flies, is recorded, listed and checked, and nothing else is touched."""

import hashlib
import tomllib
from pathlib import Path

import numpy as np
import pytest
from jsonschema import Draft202012Validator

import starhold as sh
from starhold.analysis.cost import recorded_states
from starhold.conformance.parts import examine_part, find_part
from starhold.conformance.suite import examine, find_law
from starhold.laws import catalogue as laws
from starhold.parts.effectors import control_moment_gyros
from starhold.scenario.json_schema import json_schema
from starhold.scenario.parts import installed
from starhold.scenario.reading import parse
from starhold.simulation.lane import fly, label
from tests.making import built
from tests.parts.files import BODY, JETS, LAW, PARTS, PD, part
from tests.refusals import refused, replaced
from tests.tiers import WHOLE, leading

RECORDED = {"effector": {"deflection"}, "sensor": {"mine_rate"}, "estimator": {"gyro_rate", "mine_rate"}}
"""Beside what a loop without the part records."""


def text_of(role, given):
    """A scenario with the part of this role, which `given` names."""
    if role == "law":
        return BODY + f"[[law]]\n{given}k = 0.9\np = 0.09\n"
    before = part('type = "gyro"\n') if role == "estimator" else ""
    return BODY + before + part(given + PARTS[role][1]) + PD


def package():
    """The text of the whole package as one number."""
    found = hashlib.sha256()
    for path in sorted(Path(sh.__file__).parent.rglob("*.py")):
        found.update(str(path).encode() + path.read_bytes())
    return found.hexdigest()


@pytest.fixture
def own(tmp_path):
    """Write the one file of a role."""

    def write(role):
        (tmp_path / "mine.py").write_text(LAW if role == "law" else PARTS[role][0])
        return tmp_path / "mine.py"

    return write


@pytest.mark.parametrize("role", leading([*PARTS, "law"], 3))
def test_one_file_is_read_flown_recorded_and_checked(role, own, tmp_path):
    before = package()
    path, text = own(role), text_of(role, 'file = "mine.py"\n')
    schema = Draft202012Validator(json_schema())
    assert schema.is_valid(tomllib.loads(text))
    assert not schema.is_valid(tomllib.loads(text.replace('file = "mine.py"\n', "")))
    place = {"law": "law[1]", "estimator": "part[2]"}.get(role, "part[1]")
    with refused(f"{place}.no_such_key: found an unknown key; allowed: one of"):
        parse(text_of(role, 'file = "mine.py"\nno_such_key = 1\n'), "own", tmp_path)
    flown = sh.simulate(parse(text, "own", tmp_path))
    plain = sh.simulate(parse(BODY + PD, "own"))
    assert set(flown.data_vars) - set(plain.data_vars) == RECORDED.get(role, set())
    assert all(np.isfinite(flown[name]).all() for name in flown.data_vars)
    # It acts: without it the flight is another one.
    if role != "law":
        assert float(np.abs(flown.rate - plain.rate).max()) > 1e-6
        assert "mine" in flown.attrs["parts"].split(", ")
    verdicts = list(examine(find_law(str(path))) if role == "law" else examine_part(find_part(str(path))))
    assert [v for v in verdicts if v.outcome == "failed"] == []
    assert len([v for v in verdicts if v.outcome == "passed"]) >= 5
    assert package() == before


def test_the_files_in_another_package_are_listed_and_fly_by_their_names(own, tmp_path, offer, recwarn):
    before = set(installed()), set(laws.catalogue())
    files = {role: own(role).rename(tmp_path / f"offered_{role}.py") for role in (*PARTS, "law")}
    offer(tmp_path, *(path.stem for path in files.values()))
    assert set(installed()) - before[0] == {f"offered-{role}" for role in PARTS}
    assert set(laws.catalogue()) - before[1] == {"offered-law"}
    assert not recwarn.list
    schema = Draft202012Validator(json_schema())
    for role, path in files.items():
        text = text_of(role, f'type = "offered-{role}"\n')
        assert schema.is_valid(tomllib.loads(text))
        assert not schema.is_valid(tomllib.loads(text_of(role, f'type = "offered-{role}"\nno_such_key = 1\n')))
        assert (find_law if role == "law" else find_part)(f"offered-{role}").role == role
        if role not in ("sensor", "law") and not WHOLE:
            continue
        (tmp_path / "mine.py").write_text(path.read_text())
        of_file = sh.simulate(parse(text_of(role, 'file = "mine.py"\n'), "own", tmp_path))
        np.testing.assert_array_equal(sh.simulate(parse(text, "own")).rate, of_file.rate)


ROW = [0.2, 0.5, 0.1, 0.0, 0.1, 1.0, 0.2, 0.6, 0.1, 0.05, 0.010, 0.005, 0.015, 0.20, 0.01, 0.15]
INSTALLED = {
    "thrusters": ('torque = "50 mN m"\nminimum = "20 ms"\non = "5 mN m"\noff = "2 mN m"\n', "propellant", ("time",), "kg"),
    "hinged-panels": (f'mass = "30 kg"\npanels = [{ROW}]\n', "panel_angle", ("time", "panel"), "rad"),
    "control-moment-gyros": (
        f"units = {[*map(list, control_moment_gyros.examples()[0].units)]}\n", "rotor_momentum", ("time", "gyro"), "N m s"
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", leading(INSTALLED))
def test_an_effector_flies_from_a_scenario(name):
    keys, recorded, dimensions, unit = INSTALLED[name]
    text = BODY.replace("[simulation]", "[simulation]\nsubsteps = 4") + part(f'type = "{name}"\nname = "wing"\n{keys}') + PD
    run = sh.simulate(parse(text, "own"))
    assert run[recorded].dims == dimensions
    assert run[recorded].attrs["units"] == unit
    assert float(np.abs(run[recorded]).max()) > 1e-6


def test_a_state_of_an_effector_needs_no_names(tmp_path):
    """What a call costs is asked of the recorded states."""
    plain = (("return State(ZERO)", "return ZERO"), ("return State(command)", "return command"))
    (tmp_path / "mine.py").write_text(replaced(JETS, *plain))
    loop = built(parse(BODY + part('file = "mine.py"\nmost = 0.05\n') + PD, "own", tmp_path))
    assert recorded_states(loop, label(loop, *fly(loop, 5), 1)).shape == (6, 16 + 3)
