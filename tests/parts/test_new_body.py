"""A body is one file and its law another, in a folder of their own: flown, compared, drawn and refused like any other."""

import json
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import starhold as sh
from starhold.algebra.structure import flatten
from starhold.conformance.parts import examine_part, find_part
from starhold.conformance.suite import examine, find_law
from starhold.loop.kernels import fly_plainly
from starhold.scenario.json_schema import json_schema
from starhold.simulation.lane import fly
from tests.making import built
from tests.refusals import refused
from tests.running import starhold
from tests.texts import toml

BODY = '''"""A mass on a spring's rail, slowed by the air."""

from typing import Annotated, NamedTuple

from starhold.algebra.quantity import Quantity
from starhold.algebra.scalar import both, is_finite, less
from starhold.algebra.vector import Vector, add, dot, norm, scale
from starhold.parts.contract import Card, Parameter

CARD = Card("Sledge", "m v' = force - drag |v| v", ("Newton",), ("one mass",))
ROLE = "body"
COMMAND = "force"


class Params(NamedTuple):
    mass: Annotated[float, Parameter("kg", above=0.0, text="mass")]
    drag: Annotated[float, Parameter("kg/m", at_least=0.0, text="drag over speed squared")] = 0.3


class Craft(NamedTuple):
    inverse: float
    drag: float


def examples():
    return [Params(2.0, 0.3)]


def make(params):
    return Craft(1.0 / params.mass, params.drag)


class State(NamedTuple):
    position: Annotated[Vector, Parameter("m", shape=(3,), spread=False, text="from the mark")]
    velocity: Annotated[Vector, Parameter("m/s", shape=(3,), spread=False, text="over ground")] = (0.0, 0.0, 0.0)
    force: Vector = (0.0, 0.0, 0.0)


class Measurement(NamedTuple):
    position: Annotated[Vector, Quantity("m", "from the mark")]
    velocity: Annotated[Vector, Quantity("m/s", "over ground")]


class Sample(NamedTuple):
    position: Annotated[Vector, Quantity("m", "from the mark", "axis")]
    velocity: Annotated[Vector, Quantity("m/s", "over ground", "axis")]
    force: Annotated[Vector, Quantity("N", "that acts", "axis")]
    command: Annotated[Vector, Quantity("N", "that is commanded, within the limit", "axis")]


def rates(state, loads, force_rate, craft):
    drag = scale(-craft.drag * norm(state.velocity), state.velocity)
    return (state.velocity, scale(craft.inverse, add(state.force, drag)), force_rate)


def renormalised(state):
    return state


def is_sound(state, setup):
    near = less(dot(state.position, state.position), setup.divergence_bound * setup.divergence_bound)
    return both(is_finite(dot(state.velocity, state.velocity)), near)


def observe(state, scene):
    return Measurement(state.position, state.velocity)


def sample(state, goal, applied, command):
    return Sample(state.position, state.velocity, applied, command)
'''

LAW = '''"""Pulls a sledge to its mark."""

from typing import Annotated, NamedTuple

from starhold.algebra.vector import add, scale
from starhold.laws.interface import Card, Gain

BODY = "sledge"
CARD = Card(
    title="Rein",
    summary="-k x - c v",
    sources=(),
    claims="none",
    assumptions=(),
    quaternion_sign="even",
    rest_tolerance=0.0,
)


class Gains(NamedTuple):
    k: Annotated[float, Gain("N/m", above=0.0)]
    c: Annotated[float, Gain("N s/m", above=0.0)]


def examples():
    return [Gains(1.0, 0.5), Gains(0.5, 2.0)]


def force(measurement, gains, craft, memory):
    return add(scale(-gains.k, measurement.position), scale(-gains.c, measurement.velocity)), memory
'''

TEXT = toml("""name = "pull"
[body] file = "sledge.py"; mass = "1500 g"
[control] limit = "0.4 N"
[initial] position = [1.0, -0.4, 0.2]; velocity = [0.1, 0.3, "-20 cm/s"]
[simulation] duration = 10.0; control_period = 0.05; substeps = 16
[[law]] file = "rein.py"; k = 1.0; c = 0.5
[[law]] file = "rein.py"; name = "slack"; k = 0.5; c = 2.0
""")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "sledge.py").write_text(BODY)
    (tmp_path / "rein.py").write_text(LAW)
    (tmp_path / "pull.toml").write_text(TEXT)
    return tmp_path


def test_it_flies_as_an_independent_integration_does(folder: Path) -> None:
    run = sh.simulate(folder / "pull.toml", "rein")
    mass, drag = 1.5, 0.3
    x = np.array([1.0, -0.4, 0.2, 0.1, 0.3, -0.2])
    limited = False
    for k, seen in enumerate(zip(run["position"].to_numpy(), run["velocity"].to_numpy(), strict=True)):
        assert np.abs(np.concatenate(seen) - x).max() < 1e-9
        wanted = -1.0 * x[:3] - 0.5 * x[3:]
        force = np.clip(wanted, -0.4, 0.4)
        limited |= bool((force != wanted).any())
        assert np.abs(run["command"].to_numpy()[k] - force).max() < 1e-9

        def slope(_, y, force=force):
            return np.concatenate([y[3:], (force - drag * np.linalg.norm(y[3:]) * y[3:]) / mass])

        x = solve_ivp(slope, (0.0, 0.05), x, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    assert limited
    assert run.attrs["body"] == "sledge"
    assert run["position"].attrs["units"] == "m"


def test_laws_are_compared_measured_and_changed(folder: Path) -> None:
    first, second = sh.compare(folder / "pull.toml")
    assert (first.name, second.name) == ("rein", "slack")
    assert first.metrics["peak_command"] == 0.4
    assert first.metrics["final_position"] != second.metrics["final_position"]
    assert first.certificates[0].outcome == "undecided"
    assert sh.metrics(first.run) == first.metrics
    scenario = sh.load(folder / "pull.toml")
    assert scenario.craft == (1.0 / 1.5, 0.3)
    assert scenario.with_({"body.mass": 4.0, "law.slack.k": 0.7}).craft.inverse == 0.25


@pytest.mark.slow
def test_the_command_line_writes_runs_pictures_and_the_report_and_proves_nothing(folder: Path) -> None:
    starhold("compare", "pull.toml", "-o", "out", cwd=folder, code=0)
    names = {path.relative_to(folder / "out").as_posix() for path in (folder / "out").rglob("*") if path.is_file()}
    assert {"report.html", "rein/run.nc", "slack/run.nc", "position.png", "force.png", "command.png"} <= names
    assert "no theorem is about the body sledge" in (folder / "out" / "report.html").read_text()
    assert json.loads((folder / "out" / "summary.json").read_text())["laws"]["rein"]["peak_command"] == 0.4
    said = starhold("certify", "pull.toml", "-o", "proof", cwd=folder, code=4)
    assert "no theorem is about the body sledge" in said.stdout
    path = folder / "proof" / "certificate.json"
    content = json.loads(path.read_text())
    found = [(one["name"], one["outcome"], one["claims"]) for one in content["certificates"]]
    assert found == [("rein", "undecided", []), ("slack", "undecided", [])]
    assert "not claimed" in starhold("check", path, cwd=folder, code=0).stdout
    # Whoever writes that it is proved is contradicted.
    content["certificates"][0]["outcome"] = "proved"
    path.write_text(json.dumps(content))
    assert starhold("check", path, cwd=folder).returncode == 1


def test_a_lost_motion_is_told(folder: Path) -> None:
    near = TEXT.replace("substeps = 16", "lost_beyond = 1.2").replace("velocity = [0.1,", "velocity = [2.0,")
    run = sh.simulate(sh.scenario(tomllib.loads(near), folder), "rein")
    assert 0.0 < run.attrs["diverged_at"] < 1.0


FAULTS = {
    "no such body": ("pull.toml", 'file = "sledge.py"', 'type = "sled"', 'found "sled"; allowed: a file, because no other'),
    "a body with a table": ("pull.toml", 'file = "sledge.py"', 'type = "rigid-body"', "allowed: the [spacecraft] table"),
    "no file": ("pull.toml", '"sledge.py"', '"sled.py"', 'body.file: found "sled.py": No such file or directory'),
    "another role": ("pull.toml", '"sledge.py"', '"rein.py"', 'body.file: "rein.py": '),
    "neither": ("pull.toml", 'file = "sledge.py"\n', "", "body.type: found nothing"),
    "both": ("pull.toml", 'file = "sledge.py"', 'file = "sledge.py"\ntype = "sledge"', "either a type or a file"),
    "unknown key": ("pull.toml", "mass =", "mas =", "body.mas: found an unknown key; did you mean mass?"),
    "missing key": ("pull.toml", 'mass = "1500 g"\n', "", "body.mass: found nothing"),
    "unit": ("pull.toml", "1500 g", "1500 m", "body.mass: found"),
    "bound": ("pull.toml", '"1500 g"', "-1.0", "body.mass: found -1.0; allowed: above 0"),
    "unknown state": ("pull.toml", "velocity =", "speed =", "initial.speed: found an unknown key"),
    "the command at the start": ("pull.toml", "velocity =", "force =", "initial.force: found an unknown key"),
    "missing state": ("pull.toml", "position = [1.0, -0.4, 0.2]\n", "", "initial.position: found nothing"),
    "unit of the limit": ("pull.toml", '"0.4 N"', '"0.4 m"', "control.limit: found"),
    "periods": ("pull.toml", "duration = 10.0", "duration = 10.01", "simulation.duration"),
    "another body's law": ("pull.toml", 'file = "rein.py"\nk', 'type = "pd"\nk', 'law[1].type: found "pd"; allowed: a file'),
    "two bodies": ("pull.toml", "[control]", "[spacecraft]\n[control]", "a second body beside [body]"),
    "import": ("sledge.py", "import Card, Parameter", "import Card, Parametre", 'body.file: "sledge.py": sledge.py, line 8'),
    "syntax": ("sledge.py", "def make(", "def make", 'body.file: "sledge.py": SyntaxError'),
    "lacks": ("sledge.py", "def observe", "def observed", "this body needs observe"),
    "no unit": ("sledge.py", 'Annotated[float, Parameter("kg", above=0.0, text="mass")]', "float", "declares no unit"),
    "no quantity": ("sledge.py", 'Annotated[Vector, Quantity("N", "that acts", "axis")]', "Vector", "with Quantity"),
    "no command": ("sledge.py", 'COMMAND = "force"', 'COMMAND = "torque"', "State"),
    "matrix": ("sledge.py", 'shape=(3,), spread=False, text="from the mark"', "shape=(3, 3)", "a number or a vector"),
    "make": ("sledge.py", "1.0 / params.mass", "1.0 / params.weight", "body: sledge.py, line"),
    "rates": ("sledge.py", "craft.inverse, add", "craft.inverted, add", "part sledge: sledge.py, line"),
    "shape": ("sledge.py", "scale(craft.inverse, add(state.force, drag))", "craft.inverse", "part sledge"),
    "law's command": ("rein.py", "), memory", ")[:2], memory", "law rein: rein.py: force must return three numbers"),
    "law": ("rein.py", "gains.c", "gains.d", "law rein: rein.py, line"),
    "law's body": ("rein.py", 'BODY = "sledge"', 'BODY = "rigid-body"', "torque"),
    "a law of no body": ("rein.py", 'BODY = "sledge"', 'BODY = "sled"', "there is no body sled"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_one_line(folder: Path, fault: str) -> None:
    file, old, new, told = FAULTS[fault]
    text = (folder / file).read_text()
    assert old in text
    (folder / file).write_text(text.replace(old, new, 1))
    assert told in _said(folder)


def test_a_law_for_another_body_is_refused(folder: Path) -> None:
    (folder / "wagon.py").write_text(BODY)
    (folder / "pull.toml").write_text(TEXT.replace("sledge.py", "wagon.py"))
    assert "a law for the body sledge, not for wagon" in _said(folder)


def test_each_loop_keeps_the_body_that_it_was_read_with(folder: Path) -> None:
    loop = built(sh.load(folder / "pull.toml"))
    before = flatten(fly(loop, 40)[1].state)
    (folder / "sledge.py").write_text(BODY.replace("-craft.drag * norm", "-2.0 * craft.drag * norm"))
    assert flatten(fly(built(folder / "pull.toml"), 40)[1].state) != before
    assert flatten(fly(loop, 40)[1].state) == flatten(fly_plainly(loop, 40).state) == before


@pytest.mark.parametrize(
    ("old", "new", "check"),
    [
        ("", "", None),
        (
            "-gains.k, measurement",
            "-gains.k / dot(measurement.position, measurement.position), measurement",
            "The command is finite",
        ),
        ("[Gains(1.0, 0.5), ", "[Gains(-1.0, 0.5), ", "Gains written"),
        ("    return add(scale(-gains.k", "    COUNT[0] += 1.0\n    return add(scale(COUNT[0]", "The command depends"),
    ],
)
def test_its_laws_go_through_the_checks_for_any_body(folder: Path, old: str, new: str, check: str | None) -> None:
    # The body is found beside the law.
    (folder / "sledge.py").rename(folder / "cart.py")
    assert old in LAW
    text = LAW.replace('BODY = "sledge"', 'BODY = "cart"\nCOUNT = [0.0]').replace(
        "import add, scale", "import add, dot, scale"
    )
    (folder / "rein.py").write_text(text.replace(old, new) if old else text)
    law = find_law(str(folder / "rein.py"))
    assert law.body == "cart"
    failed = [verdict.name for verdict in examine(law) if verdict.outcome != "passed"]
    assert any(name.startswith(check) for name in failed) if check else failed == []
    told = starhold("check-law", "rein.py", cwd=folder, code=1 if check else 0)
    assert told.stdout.count("passed") == 6 - len(failed)


def test_a_body_s_file_is_checked(folder: Path) -> None:
    outcomes = {verdict.outcome for verdict in examine_part(find_part(str(folder / "sledge.py")))}
    assert outcomes == {"passed", "does not apply"}
    (folder / "sledge.py").write_text(BODY.replace('shape=(3,), spread=False, text="from the mark"', "shape=(3, 3)"))
    failed = [verdict for verdict in examine_part(find_part(str(folder / "sledge.py"))) if verdict.outcome == "failed"]
    assert "a number or a vector" in failed[0].reason


def test_body_and_law_of_another_package_are_known_by_type(folder: Path, offer: Any) -> None:
    (folder / "wagon.py").write_text(BODY)
    (folder / "tow.py").write_text(LAW.replace('BODY = "sledge"', 'BODY = "wagon"'))
    offer(folder, "wagon", "tow")
    text = TEXT.replace('file = "sledge.py"', 'type = "wagon"').replace('file = "rein.py"', 'type = "tow"')
    (folder / "my.toml").write_text(text)
    own, other = sh.simulate(folder / "my.toml", "tow"), sh.simulate(folder / "pull.toml", "rein")
    assert own.attrs["body"] == "wagon"
    assert (own["position"].to_numpy() == other["position"].to_numpy()).all()
    (folder / "my.toml").write_text(text.replace("[[law]]", "[[part]]\ntype = 'lag'\nlag = 0.1\n[[law]]", 1))
    lagged = sh.simulate(folder / "my.toml", "tow")
    assert np.abs(lagged["force"].to_numpy()[1] - own["force"].to_numpy()[1]).max() > 0.01
    (folder / "pull.toml").write_text(text.replace("wagon", "wagen"))
    assert "did you mean wagon?" in _said(folder)
    assert {"BodyFromFile", "WagonBody", "WagonInitial"} <= set(json_schema()["$defs"])
    assert find_law("tow").body == "wagon"
    assert {verdict.outcome for verdict in examine(find_law("tow"))} == {"passed"}


def _said(folder: Path) -> str:
    with refused() as caught:
        sh.simulate(folder / "pull.toml", "rein")
    assert starhold("run", "pull.toml", "--law", "rein", "-o", "x", cwd=folder).returncode == 2
    return str(caught.value)
