"""One file adds a part of any role: it flies, is recorded, listed and checked, and nothing else is touched."""

import hashlib
import tomllib
from pathlib import Path

import numpy as np
import pytest
from jsonschema import Draft202012Validator
from scipy.integrate import solve_ivp

import starhold as sh
from starhold.conformance.parts import examine_part, find_part
from starhold.conformance.suite import examine, find_law
from starhold.laws import catalogue as laws
from starhold.scenario.json_schema import json_schema
from starhold.scenario.parts import installed
from starhold.scenario.reading import parse
from tests.parts.files import BODY, LAW, PARTS, PD, part
from tests.refusals import refused
from tests.running import starhold

RECORDED = {"effector": {"deflection", "speed"}, "sensor": {"mine_rate"}, "estimator": {"gyro_rate", "mine_rate"}}
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


@pytest.mark.parametrize("role", [*PARTS, "law"])
def test_one_file_is_flown_recorded_and_checked(role, own, tmp_path):
    before = package()
    path, text = own(role), text_of(role, 'file = "mine.py"\n')
    assert [p.name for p in tmp_path.iterdir()] == ["mine.py"]
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


@pytest.fixture(scope="module")
def schema():
    """The JSON Schema without parts of other packages."""
    return Draft202012Validator(json_schema())


@pytest.mark.parametrize("role", [*PARTS, "law"])
def test_its_table_takes_its_own_keys_alone(role, own, tmp_path, schema):
    own(role)
    text = text_of(role, 'file = "mine.py"\n')
    assert schema.is_valid(tomllib.loads(text))
    assert not schema.is_valid(tomllib.loads(text.replace('file = "mine.py"\n', "")))
    place = "law[1]" if role == "law" else "part[2]" if role == "estimator" else "part[1]"
    with refused(f"{place}.no_such_key: found an unknown key; allowed: one of"):
        parse(text_of(role, 'file = "mine.py"\nno_such_key = 1\n'), "own", tmp_path)


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
        (tmp_path / "mine.py").write_text(path.read_text())
        of_file = sh.simulate(parse(text_of(role, 'file = "mine.py"\n'), "own", tmp_path))
        np.testing.assert_array_equal(sh.simulate(parse(text, "own")).rate, of_file.rate)
        assert (find_law if role == "law" else find_part)(f"offered-{role}").role == role


def test_all_of_them_fly_together_from_the_command_line(own, tmp_path):
    for role in PARTS:
        own(role).rename(tmp_path / f"my_{role}.py")
    own("law").rename(tmp_path / "my_law.py")
    tables = [part(f'file = "my_{role}.py"\n' + keys) for role, (_, keys) in PARTS.items()]
    (tmp_path / "own.toml").write_text(BODY + "".join(tables) + '[[law]]\nfile = "my_law.py"\nk = 0.9\np = 0.09\n')
    starhold("run", "own.toml", "-o", "out", cwd=tmp_path, code=0)
    import xarray as xr

    with xr.open_dataset(tmp_path / "out" / "run.nc") as run:
        assert {"deflection", "speed", "my_sensor_rate", "my_estimator_rate"} <= set(run.data_vars)
        assert run.deflection.attrs["units"] == "sqrt(kg) m"
        assert run.my_sensor_rate.dims == ("time", "axis")
        assert run.attrs["parts"].split(", ") == [f"my-{role}" for role in ("target", *(r for r in PARTS if r != "target"))]


INERTIA = np.array([[8.0, 0.2, 0.1], [0.2, 9.0, 0.3], [0.1, 0.3, 7.0]])
COUPLING, FREQUENCY = np.array([0.5, 0.2, 0.9]), 2.0
"""As in the scenario of the files."""


def flexible(own, damping):
    """A flight of a hub with the appendage, without any torque."""
    path = own("effector")
    (path.parent / "idle.py").write_text(LAW)
    keys = f'file = "mine.py"\ndamping = {damping}\n' + PARTS["effector"][1]
    text = BODY.replace("control_period = 0.1", "control_period = 0.1\nsubsteps = 20").replace("10.0", "20.0")
    return sh.simulate(parse(text + part(keys) + '[[law]]\nfile = "idle.py"\n', "own", path.parent))


def inertial(q, v):
    """Vectors (n, 3) in body axes turned to inertial ones by quaternions (n, 4)."""
    return v + 2.0 * q[:, :1] * np.cross(q[:, 1:], v) + 2.0 * np.cross(q[:, 1:], np.cross(q[:, 1:], v))


def test_an_appendage_keeps_momentum_and_energy_where_nothing_acts(own):
    run = flexible(own, 0.0)
    w, x, v = run.rate.values, run.deflection.values, run.speed.values
    total = inertial(run.attitude.values, w @ INERTIA + v[:, None] * COUPLING)
    assert np.abs(total - total[0]).max() < 1e-9 * np.linalg.norm(total[0])
    energy = 0.5 * np.sum(w * (w @ INERTIA), 1) + v * (w @ COUPLING) + 0.5 * v**2 + 0.5 * (FREQUENCY * x) ** 2
    assert np.abs(energy - energy[0]).max() < 1e-9 * energy[0]
    # It swings and moves the hub: the hub's own momentum is not kept.
    hub = inertial(run.attitude.values, w @ INERTIA)
    assert np.ptp(x) > 0.02
    assert np.abs(hub - hub[0]).max() > 1e-2 * np.linalg.norm(hub[0])


@pytest.mark.parametrize("damping", [0.0, 0.05])
def test_an_appendage_moves_as_the_coupled_equations_say(own, damping):
    run = flexible(own, damping)
    mass = np.block([[INERTIA, COUPLING[:, None]], [COUPLING[None], np.ones((1, 1))]])

    def slope(_, y):
        w, (x, v) = y[:3], y[3:]
        turning = -np.cross(w, INERTIA @ w + COUPLING * v)
        *spin, speeding = np.linalg.solve(mass, [*turning, -2.0 * damping * FREQUENCY * v - FREQUENCY**2 * x])
        return [*spin, v, speeding]

    times = run.time.values
    start = [*run.rate.values[0], run.deflection.values[0], run.speed.values[0]]
    exact = solve_ivp(slope, (0.0, times[-1]), start, "DOP853", times, rtol=1e-12, atol=1e-14).y
    assert np.abs(run.rate.values - exact[:3].T).max() < 1e-9
    assert np.abs(run.deflection.values - exact[3]).max() < 1e-9
    assert np.abs(run.speed.values - exact[4]).max() < 1e-9
