"""Scenario files: what is read, and that every fault becomes one clear line."""

import json
import math
import re
from dataclasses import replace

import jsonschema
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic_core import PydanticCustomError

from starhold.errors import InputError
from starhold.laws.catalogue import catalogue
from starhold.laws.interface import Gain
from starhold.laws.modes import mode_laws
from starhold.scenario.bodies import bodies
from starhold.scenario.bodies.rigid_body.craft import wheels_of
from starhold.scenario.bodies.rigid_body.tables import RigidBodyTable
from starhold.scenario.building import build
from starhold.scenario.json_schema import json_schema
from starhold.scenario.quantity import reader
from starhold.scenario.reading import builtin_names, builtin_text, load, parse
from starhold.scenario.template import template_text
from starhold.scenario.writing import law_table
from tests.making import built
from tests.refusals import refused

BASE = builtin_text("three-laws")


def build_all(text):
    parsed = parse(text, "my.toml")
    return [build(parsed, entry) for entry in parsed.laws]


def fault(old, new, text=BASE):
    assert old in text
    with refused() as caught:
        build_all(text.replace(old, new))
    return str(caught.value)


@pytest.mark.parametrize("name", builtin_names())
def test_builtin_scenarios_build(name):
    scenario = load(name)
    assert scenario.table.description
    loops = [build(scenario, entry) for entry in scenario.laws]
    # There is something to compare, or modes that follow one another.
    assert len(loops) >= 2 or len(mode_laws(loops[0].law, loops[0].gains)) >= 2


def test_the_published_experiment_is_as_published():
    scenario = load("three-laws")
    loop = build(scenario, scenario.laws[0])
    assert loop.craft.inertia == (2.0, 3.0, 4.0)
    assert loop.craft.torque_limit == 0.01
    assert loop.craft.gravity == 3.986e14
    assert loop.start.attitude == pytest.approx((0.0, *(3**-0.5,) * 3), rel=1e-15)
    assert loop.start.rate == (0.04, 0.03, 0.02)
    assert (loop.start.position, loop.start.velocity) == ((7e6, 0.0, 0.0), (0.0, 7550.0, 0.0))
    assert (loop.period, loop.limit, loop.has("gravity-gradient")) == (0.1, "axis", True)
    assert scenario.pick("lyapunov").gains == (0.09, 0.009)
    assert scenario.pick("sliding").gains.surface_gain == (0.08, 0.08, 0.08)


FAULTS = {
    "unknown key": ("torque_limit =", "torqe_limit =", ["spacecraft.torqe_limit", "unknown key", "torque_limit?"]),
    "unknown table": ("[orbit]", "[orbits]", ["orbits", "unknown key", "orbit?"]),
    "unknown gain": ("k_rate = 0.09", "k_ratee = 0.09", ["law[1].k_ratee", "unknown key", "k_rate?"]),
    "missing gain": ("k_rate = 0.09", "", ["law[1].k_rate", "required"]),
    "missing table": ("[spacecraft]", "[other]", ["no body", "[body], [libration], [spacecraft]"]),
    "wrong type": ("duration = 2000.0", "duration = true", ["simulation.duration", "True", "a number in s"]),
    "wrong type of a table": ("[orbit]", "orbit = 3\n[x]", ["orbit"]),
    "text for a number": ("duration = 2000.0", 'duration = "long"', ["simulation.duration", '"long"', "1 s"]),
    "wrong unit": ('"0.01 N m"', '"0.01 kg"', ["spacecraft.torque_limit", '"0.01 kg"', "N m"]),
    "negative limit": ('"0.01 N m"', "-0.01", ["spacecraft.torque_limit", "-0.01", "above 0"]),
    "negative inertia": ("[2.0, 3.0, 4.0]", "[2.0, -3.0, 4.0]", ["spacecraft.inertia", "positive definite"]),
    "impossible inertia": ("[2.0, 3.0, 4.0]", "[2.0, 3.0, 6.0]", ["spacecraft.inertia", "largest exceeds the sum"]),
    "unsymmetric inertia": ("[2.0, 3.0, 4.0]", "[[2,1,0],[0,3,0],[0,0,4]]", ["spacecraft.inertia", "symmetric"]),
    "inertia of two": ("[2.0, 3.0, 4.0]", "[2.0, 3.0]", ["spacecraft.inertia", "[2.0, 3.0]", "three principal moments"]),
    "ragged inertia": ("[2.0, 3.0, 4.0]", "[[2.0], 3.0, 4.0]", ["spacecraft.inertia"]),
    "zero quaternion": ("attitude = [0, 1, 1, 1]", "attitude = [0, 0, 0, 0]", ["initial.attitude", "not zero"]),
    "three for a quaternion": ("attitude = [0, 1, 1, 1]", "attitude = [0, 1, 1]", ["initial.attitude", "4 numbers"]),
    "a quaternion of length 10": ("attitude = [0, 1, 1, 1]", "attitude = [10, 0, 0, 0]", ["initial.attitude", "length 1"]),
    "degrees without a unit": (
        "attitude = [0, 1, 1, 1]",
        "angles = [120, 20, 0]",
        ["initial.angles", "[120, 20, 0]", '"120 deg"', "is in rad"],
    ),
    "noise in degrees without a unit": (
        "gravity_gradient = true",
        "gravity_gradient = true\n[sensor]\nattitude_noise = 10",
        ["sensor.attitude_noise", '"10 deg"'],
    ),
    "yes": (
        "gravity_gradient = true",
        'gravity_gradient = "yes"',
        ["environment.gravity_gradient", '"yes"', "true or false"],
    ),
    "one for true": ("gravity_gradient = true", "gravity_gradient = 1", ["environment.gravity_gradient", "true or false"]),
    "an inertia of 1e155": ("[2.0, 3.0, 4.0]", "[1e155, 1e155, 1e155]", ["spacecraft.inertia", "1e+30"]),
    "noise of 1e300": (
        "gravity_gradient = true",
        "gravity_gradient = true\ntorque_noise = 1e300",
        ["environment.torque_noise", "1e+30"],
    ),
    "samples 2^63 steps apart": (
        "control_period = 0.1",
        "control_period = 0.1\nrecord_every = 9223372036854775808",
        ["simulation.record_every", "2^53"],
    ),
    "endless substeps": ("control_period = 0.1", "control_period = 0.1\nsubsteps = 10000000", ["substeps", "at most 1e+06"]),
    "a lag that no substeps resolve": (
        'torque_limit = "0.01 N m"',
        'torque_limit = "0.01 N m"\nactuator_lag = 1e-20',
        ["part lag", "a time constant of 1e-20", "a slower one", "too many"],
    ),
    "a number of 310 digits": ("duration = 2000.0", "duration = " + 310 * "1", ["simulation.duration", "60 digits"]),
    "a number of 4301 digits": ("duration = 2000.0", "duration = " + 4301 * "1", ["60 digits"]),
    "a text of 310 digits": ("duration = 2000.0", f'duration = "{310 * "1"} s"', ["simulation.duration", "'1 s'"]),
    "a tower of powers": ("duration = 2000.0", 'duration = "9**9**9 s"', ["simulation.duration", "'1 s'"]),
    "brackets": ("duration = 2000.0", "duration = " + 5000 * "[", ["too deep"]),
    "lists in lists": ("duration = 2000.0", "duration = " + 50 * "[" + 50 * "]", ["simulation.duration", "too deep"]),
    "tables in tables": (
        "duration = 2000.0",
        "duration = " + 50 * "{a=" + "1" + 50 * "}",
        ["simulation.duration.a", "too deep"],
    ),
    "a key of 20000 parts": ("[orbit]", f"[{'.'.join(20000 * ['a'])}]\n[orbit]", ["dotted key", "at most 16"]),
    "quoted parts": ("[orbit]", " . ".join(20000 * ['"a"']) + " = 1\n[orbit]", ["dotted key", "at most 16"]),
    "a key of 30 parts": ("[orbit]", f"[{'.'.join(30 * ['a'])}]\n[orbit]", ["a.a.a", "too deep"]),
    "a long key": ("torque_limit =", f"{5000 * 'a'} =", ["spacecraft.aaa", "unknown key"]),
    "a key of two lines": ("torque_limit =", '"a\\nb" =', ["spacecraft.a\\nb", "unknown key"]),
    "nan": ("rate = [0.04", "rate = [nan", ["initial.rate", "finite"]),
    "inf": ("duration = 2000.0", "duration = inf", ["simulation.duration", "finite"]),
    "control period zero": ("control_period = 0.1", "control_period = 0", ["simulation.control_period", "above 0"]),
    "control period too long": ("control_period = 0.1", "control_period = 2100", ["simulation.control_period", "2000 s"]),
    "no whole steps": ("control_period = 0.1", "control_period = 0.7", ["simulation.duration", "whole number"]),
    "half a substep": ("control_period = 0.1", "control_period = 0.1\nsubsteps = 1.5", ["substeps", "whole number"]),
    "samples longer apart than the run": (
        "control_period = 0.1",
        "control_period = 0.1\nrecord_every = 20001",
        ["simulation.record_every", "20001", "at most the 20000"],
    ),
    "a lag too fast for the integration": (
        'torque_limit = "0.01 N m"',
        'torque_limit = "0.01 N m"\nactuator_lag = "10 ms"',
        ["simulation.substeps", "found 1", "at least 20 substeps, for lag has a time constant of 0.01"],
    ),
    "a name that leads out of the results": ('name = "three-laws"', 'name = "../../x"', ["name", "../../x", "letters"]),
    "a name of a place": ('name = "three-laws"', 'name = "/abs/x"', ["name", "/abs/x", "letters"]),
    "a name that is markup": ('name = "three-laws"', 'name = "[/red]"', ["name", "[/red]", "letters"]),
    "a long name": ('name = "three-laws"', f'name = "{101 * "x"}"', ["name", "at most 100"]),
    "a law that is called like a file": (
        'type = "lyapunov"',
        'type = "lyapunov"\nname = "summary.json"',
        ["law[1].name", "summary.json", "file of results"],
    ),
    "unknown law": ('type = "lyapunov"', 'type = "lyapunow"', ["law[1].type", "lyapunov?"]),
    "type that is a list": ('type = "lyapunov"', "type = []", ["law[1].type", "one of"]),
    "form that is a list": ("k_rate = 0.09", "k_rate = 0.09\nform = []", ["law[1].form"]),
    "weights without a solution": ("r = 50.0", "r = 1e30", ["law mpc", "weights"]),
    "law without type": ('type = "lyapunov"', "", ["law[1].type"]),
    "gain out of bounds": ("k_rate = 0.09", "k_rate = -0.09", ["law[1].k_rate", "-0.09", "above 0"]),
    "unknown mode": ('mode = "inertial"', 'mode = "inertia"', ["target.mode", "inertial"]),
    "unknown sign policy": (
        "k_rate = 0.09",
        'k_rate = 0.09\nquaternion_sign = "short"',
        ["law[1].quaternion_sign", "shortest"],
    ),
    "form of a law without": ("k_rate = 0.09", 'k_rate = 0.09\nform = "I"', ["law[1].form"]),
    "gravity without orbit": (
        "[orbit]\nposition = [7.0e6, 0, 0]         # m, inertial\nvelocity = [0, 7550, 0]",
        "#",
        ["gravity"],
    ),
    "centre of the Earth": ("position = [7.0e6, 0, 0]", "position = [0, 0, 0]", ["orbit.position", "away from the centre"]),
    "panels too fast for the integration": (
        "[target]",
        '[[part]]\ntype = "flexible-modes"\nmodes = [[400, 0.01, 0.1, 0.1, 0.1, 0]]\n[target]',
        ["simulation.substeps", "at least 80 substeps, for flexible-modes has a time constant of 0.0025"],
    ),
    "no inclination": (
        "position = [7.0e6, 0, 0]         # m, inertial\nvelocity = [0, 7550, 0]",
        'altitude = "600 km"',
        ["orbit.inclination: found nothing; allowed: an angle"],
    ),
    "a gain beside a form": (
        "k_rate = 0.09",
        'form = "bandwidth"\nbandwidth = 0.1\nk_rate = 0.09',
        ['law[1].k_rate: found a gain beside form = "bandwidth"', "bandwidth, damping, or the gains without the form"],
    ),
    "an input of a form without it": (
        "k_rate = 0.09",
        "k_rate = 0.09\nbandwidth = 0.1",
        ["law[1].bandwidth: found an input of a form, and no form", 'form = "bandwidth"'],
    ),
    "an input of another form": (
        "k_rate = 0.09",
        'form = "settling"\nbandwidth = 0.1',
        ['law[1].bandwidth: found an input of another form than "settling"', 'form = "bandwidth"'],
    ),
    "a misspelt input of a form": (
        "k_rate = 0.09                    # N m s\nk_attitude = 0.009               # N m",
        'form = "bandwidth"\nbandwith = 0.1',
        ["law[1].bandwith: found an unknown key; did you mean bandwidth?"],
    ),
    "history without file": ('mode = "inertial"\nattitude = [1, 0, 0, 0]', 'mode = "history"', ["target.file"]),
    "missing history": (
        'mode = "inertial"\nattitude = [1, 0, 0, 0]',
        'mode = "history"\nfile = "no.csv"',
        ["target.file", "no.csv"],
    ),
    "attitude twice": (
        "attitude = [0, 1, 1, 1]",
        "attitude = [0, 1, 1, 1]\nangles = [0, 0, 0]",
        ["initial.angles", "either"],
    ),
    "not TOML": ("[orbit]", "[orbit", ["not TOML"]),
}


@pytest.mark.parametrize("name", sorted(FAULTS))
def test_a_fault_is_one_line_with_file_key_and_what_is_allowed(name):
    old, new, words = FAULTS[name]
    message = fault(old, new)
    assert message.startswith("my.toml: ")
    assert len(message) < 500
    for word in words:
        assert word in message


def test_file_without_laws():
    text = BASE[: BASE.index("[[law]]")]
    with pytest.raises(InputError, match=r"law: found no law"):
        parse(text, "my.toml")


def test_wheels_and_craft_are_made_once_and_anew_for_a_changed_scenario():
    scenario = load("wheels-orbital")
    assert wheels_of(scenario) is wheels_of(scenario)
    assert scenario.craft is scenario.craft
    table = scenario.table
    heavier = table.spacecraft.model_copy(update={"inertia": np.diag([7.0, 8.0, 6.0])})
    fewer = table.wheels.model_copy(update={"layout": "orthogonal"})
    changed = replace(scenario, table=table.model_copy(update={"spacecraft": heavier, "wheels": fewer}))
    assert len(wheels_of(changed).axes) == 3
    assert changed.craft.inertia == pytest.approx((6.999, 7.999, 5.999), rel=1e-12)
    assert scenario.craft.with_rotors == (6.0, 8.0, 5.0)


def test_a_fit_beyond_all_numbers_is_refused():
    law = '[[law]]\ntype = "modal"\nform = "fit"\nangle = 3.0\nbelow = [-1, -1, -1]\nabove = [-1, {}, -1]\n'
    head = BASE[: BASE.index("[[law]]")]
    assert parse(head + law.format(-1), "my.toml").laws
    with pytest.raises(InputError, match=r"law\[1\]: c exp\(d angle\) \+ e is too large"):
        parse(head + law.format(900), "my.toml")


def test_names_must_differ():
    text = BASE.replace('type = "lyapunov"', 'type = "lyapunov"\nname = "a"').replace(
        'type = "sliding"', 'type = "sliding"\nname = "a"'
    )
    with pytest.raises(InputError, match=r"law\[2\]\.name"):
        parse(text, "my.toml")
    for name in ("../evil", "a/b", ".hidden", ""):
        with pytest.raises(InputError, match=r"law\[1\]\.name"):
            parse(BASE.replace('type = "lyapunov"', f'type = "lyapunov"\nname = "{name}"'), "my.toml")


def test_same_law_twice_gets_numbers():
    text = BASE + '\n[[law]]\ntype = "lyapunov"\nk_rate = 1\nk_attitude = 1\n'
    assert [entry.name for entry in parse(text, "x").laws] == ["lyapunov", "sliding", "mpc", "lyapunov-2"]


def test_missing_file_names_the_nearest_builtin(tmp_path):
    with pytest.raises(InputError, match="did you mean three-laws"):
        load("three-law")
    with pytest.raises(InputError, match="readable"):
        load(tmp_path)
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    for path in (tmp_path / "binary.toml", 5000 * "x", "a\0b"):
        with pytest.raises(InputError, match="readable") as caught:
            load(path)
        assert len(str(caught.value)) < 300
    with pytest.raises(InputError, match="more than 4194304 characters"):
        parse(2**23 * " ", "my.toml")


def test_units_convert():
    text = BASE.replace("[2.0, 3.0, 4.0]", '["20000 kg cm^2", 3.0, "4 kg m²"]').replace(
        "rate = [0.04, 0.03, 0.02]", 'rate = ["90 deg/s", "1 rpm", 0.02]'
    )
    scenario = parse(text, "x")
    assert np.allclose(np.diag(scenario.table.spacecraft.inertia), [2, 3, 4], rtol=1e-14)
    assert scenario.table.initial.rate == pytest.approx((math.pi / 2, 2 * math.pi / 60, 0.02))


def test_matrix_gain_takes_number_diagonal_or_matrix():
    matrices = [
        parse(BASE.replace("surface_gain = 0.08", f"surface_gain = {text}"), "x").pick("sliding").gains.surface_gain
        for text in ("0.08", "[0.08, 0.08, 0.08]", "[[0.08, 0, 0], [0, 0.08, 0], [0, 0, 0.08]]")
    ]
    assert matrices == [(0.08, 0.08, 0.08)] * 3


def test_design_form_gives_gains():
    text = BASE[: BASE.index("[[law]]")] + '[[law]]\ntype = "matrix-pd"\nform = "inertial"\na = 10\nb = 20\nd = 0.1\n'
    gains = parse(text, "x").laws[0].gains
    inertia = np.diag([2.0, 3.0, 4.0])
    assert np.allclose(1.0 / np.array(gains.k_attitude), np.diag(10 * inertia + 20 * np.eye(3)))
    assert np.allclose(gains.k_rate, np.diag(0.1 * inertia))
    with pytest.raises(InputError, match="must not both be zero"):
        parse(text.replace("a = 10\nb = 20", "a = 0\nb = 0"), "x")


def test_relative_start_is_relative_to_the_target():
    loop = built(load("geostationary"))
    from starhold.simulation.lane import fly

    samples, _ = fly(loop, 1)
    from starhold.algebra.cosines import from_angles

    expected = from_angles(*np.radians([8, -5, 12]))
    assert np.abs(samples[19:23, 0]) == pytest.approx(np.abs(expected), abs=1e-12)
    assert samples[23:26, 0] == pytest.approx(np.radians([0.01, -0.02, 0.01]), abs=1e-15)


def test_history_file(tmp_path):
    times = np.linspace(0, 600, 61)
    rows = np.c_[times, np.cos(times / 1000), np.zeros_like(times), np.sin(times / 1000), np.zeros_like(times)]
    np.savetxt(tmp_path / "h.csv", rows, delimiter=",", header="time,q0,q1,q2,q3", comments="")
    text = BASE.replace('mode = "inertial"\nattitude = [1, 0, 0, 0]', 'mode = "history"\nfile = "h.csv"')
    text = text.replace("duration = 2000.0", "duration = 600.0")
    (tmp_path / "s.toml").write_text(text)
    scenario = load(tmp_path / "s.toml")
    table = build(scenario, scenario.laws[0]).target.params.table
    assert table.shape == (6001, 10)
    assert table[3000, 5] == pytest.approx(2e-3, rel=1e-3)
    # Named columns stand where their names say.
    swapped = np.column_stack([rows[:, 0], rows[:, 2:], rows[:, 1]])
    np.savetxt(tmp_path / "h.csv", swapped, delimiter=", ", header="Time, q1, q2, q3, q0", comments="")
    assert np.array_equal(build(load(tmp_path / "s.toml"), scenario.laws[0]).target.params.table, table)
    for bad, told in {
        "0,1,0,0,0\n": "1 rows",
        "0,1,0,0,0\n0,1,0,0,0\n": "a time of 0 s after one of 0 s",
        "0,0,0,0,0\n700,1,0,0,0\n": "line 1: a quaternion of length 0",
        "0,1,0,0,0\n5,1,0,0,0\n": "covers 0 to 5 s",
        "a,b\nc,d\n": "line 1: columns a, b",
        "time,q1,q2,q3,w\n0,1,0,0,0\n": "line 1: columns time, q1, q2, q3, w",
        "time,q0,q0,q2,q3\n0,1,0,0,0\n": "line 1: columns",
        "0,1,0,0,0\n\n5,1,0,0\n": "line 3: 4 columns",
        "0,1,0,0,0\n5,nan,0,0,0\n": "line 2: 'nan'",
        "nan,1,0,0,0\n5,1,0,0,0\n": "line 1: 'nan'",
        "0,1,0,0,0\n5,0.9,0,0,0\n": "line 2: a quaternion of length 0.9",
        "0,1,0,0,0\n5,x,0,0,0\n": "line 2: 'x'",
        "": "0 rows",
    }.items():
        (tmp_path / "h.csv").write_text(bad)
        with pytest.raises(InputError, match=r"target\.file.*" + re.escape(told)):
            build(load(tmp_path / "s.toml"), scenario.laws[0])


def test_json_schema_accepts_what_is_read_and_refuses_a_misspelling():
    import tomllib

    schema = json.loads(json.dumps(json_schema()))
    assert '"default": "riccati"' in json.dumps(schema)
    check = jsonschema.Draft202012Validator(schema)
    check.check_schema(schema)
    for text in [*map(template_text, bodies()), *(builtin_text(name) for name in builtin_names())]:
        assert not list(check.iter_errors(tomllib.loads(text)))
    assert list(check.iter_errors(tomllib.loads(BASE.replace("k_rate", "k_ratee"))))
    assert list(check.iter_errors(tomllib.loads(BASE.replace("[orbit]", "[orbits]"))))


def test_template_runs_as_it_is_and_names_every_key():
    text = template_text("rigid-body")
    scenario = parse(text, "new.toml")
    assert len([build(scenario, entry) for entry in scenario.laws]) == 4
    for name, field in RigidBodyTable.model_fields.items():
        options = [field.annotation, *getattr(field.annotation, "__args__", ())]
        for model in (o for o in options if hasattr(o, "model_fields")):
            assert f"[{name}]" in text or f"[[{name}]]" in text
            for key in model.model_fields:
                assert f"{key} = " in text


@given(st.floats(-1e12, 1e12, allow_nan=False).filter(lambda value: value == 0 or abs(value) > 1e-30))
def test_numbers_read_as_they_are_written(value):
    read = reader(Gain("N m"))
    assert read(value) == value
    assert read(f"{value!r} N m") == pytest.approx(value, rel=1e-15)


@given(st.text(max_size=12))
def test_any_text_gives_a_number_or_one_line(text):
    try:
        value, message = reader(Gain("N m"))(text), ""
    except PydanticCustomError as error:
        value, message = 0.0, error.message()
    assert math.isfinite(value)
    assert "\n" not in message


@given(st.sampled_from(sorted(catalogue())))
def test_gains_survive_toml_exactly(name):
    law = catalogue()[name]
    head = BASE[: BASE.index("[[law]]")]
    for gains in law.examples():
        assert parse(head + law_table(law, gains), "x").laws[0].gains == gains


ODD = [
    "true ",
    ' "x" ',
    ' "" ',
    " [] ",
    " [1] ",
    " [[1]] ",
    " [{}] ",
    " {a = 1} ",
    " nan ",
    " -inf ",
    " -1 ",
    " 0 ",
    " 1e308 ",
    " 1e-308 ",
    " 2020-01-01\n",
    " 99999999999999999999999 ",
    ' "1e999 m" ',
    ' "m" ',
    " [nan, nan, nan] ",
    " [[], [], []] ",
    " ['a', 'b', 'c', 'd']",
]


@pytest.mark.parametrize("odd", ODD)
def test_no_value_of_any_key_ends_in_anything_but_one_line(odd):
    """Every value of the template and of the published experiment in turn is replaced by something odd."""
    for text in (template_text("rigid-body"), BASE):
        lines = text.splitlines()
        for number, line in enumerate(lines):
            key, equals, _ = line.partition(" = ")
            if not equals or line.startswith("#"):
                continue
            mutant = "\n".join([*lines[:number], f"{key} = {odd}", *lines[number + 1 :]])
            message = outcome(mutant)
            assert "\n" not in message, (line, message)


def outcome(text):
    """The error of a text, or nothing where it can be read; other exceptions pass through."""
    try:
        build_all(text)
    except InputError as error:
        return str(error)
    return ""
