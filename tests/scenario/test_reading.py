"""Scenario files: what is read, and that every fault becomes one clear line."""

import json
import tomllib
from dataclasses import replace

import jsonschema
import numpy as np
import pytest

from starhold.algebra.cosines import from_angles
from starhold.errors import InputError
from starhold.laws.modes import mode_laws
from starhold.scenario.bodies import bodies
from starhold.scenario.bodies.rigid_body.craft import wheels_of
from starhold.scenario.building import build
from starhold.scenario.json_schema import json_schema
from starhold.scenario.reading import builtin_names, builtin_text, load, parse
from starhold.scenario.writing import template_text
from starhold.simulation.lane import fly
from tests.making import built
from tests.refusals import refused, replaced, rows

BASE = builtin_text("three-laws")


def build_all(text):
    parsed = parse(text, "my.toml")
    return [build(parsed, entry) for entry in parsed.laws]


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


FAULTS = rows("""
torque_limit = | torqe_limit = | spacecraft.torqe_limit | unknown key | torque_limit?
[orbit] | [orbits] | orbits | unknown key | orbit?
k_rate = 0.09 |  | law[1].k_rate | required
[spacecraft] | [other] | no body | [body], [libration], [spacecraft]
duration = 2000.0 | duration = true | simulation.duration | True | a number in s
[orbit] | orbit = 3↵[x] | orbit
duration = 2000.0 | duration = "long" | simulation.duration | "long" | 1 s
"0.01 N m" | "0.01 kg" | spacecraft.torque_limit | "0.01 kg" | N m
"0.01 N m" | -0.01 | spacecraft.torque_limit | -0.01 | above 0
[2.0, 3.0, 4.0] | [2.0, -3.0, 4.0] | spacecraft.inertia | positive definite
[2.0, 3.0, 4.0] | [2.0, 3.0, 6.0] | spacecraft.inertia | largest exceeds the sum
[2.0, 3.0, 4.0] | [[2,1,0],[0,3,0],[0,0,4]] | spacecraft.inertia | symmetric
[2.0, 3.0, 4.0] | [2.0, 3.0] | spacecraft.inertia | [2.0, 3.0] | three principal moments
attitude = [0, 1, 1, 1] | attitude = [0, 0, 0, 0] | initial.attitude | not zero
attitude = [0, 1, 1, 1] | attitude = [0, 1, 1] | initial.attitude | 4 numbers
attitude = [0, 1, 1, 1] | attitude = [10, 0, 0, 0] | initial.attitude | length 1
attitude = [0, 1, 1, 1] | angles = [120, 20, 0] | initial.angles | [120, 20, 0] | "120 deg" | is in rad
gravity_gradient = true | gravity_gradient = true↵[sensor]↵attitude_noise = 10 | sensor.attitude_noise | "10 deg"
gravity_gradient = true | gravity_gradient = "yes" | environment.gravity_gradient | "yes" | true or false
[2.0, 3.0, 4.0] | [1e155, 1e155, 1e155] | spacecraft.inertia | 1e+30
control_period = 0.1 | control_period = 0.1↵record_every = 9223372036854775808 | simulation.record_every | 2^53
control_period = 0.1 | control_period = 0.1↵substeps = 10000000 | substeps | at most 1e+06
rate = [0.04 | rate = [nan | initial.rate | finite
control_period = 0.1 | control_period = 0 | simulation.control_period | above 0
control_period = 0.1 | control_period = 2100 | simulation.control_period | 2000 s
control_period = 0.1 | control_period = 0.7 | simulation.duration | whole number
control_period = 0.1 | control_period = 0.1↵substeps = 1.5 | substeps | whole number
control_period = 0.1 | control_period = 0.1↵record_every = 20001 | simulation.record_every | 20001 | at most the 20000
name = "three-laws" | name = "../../x" | name | ../../x | letters
type = "lyapunov" | type = "lyapunov"↵name = "summary.json" | law[1].name | summary.json | file of results
type = "lyapunov" | type = "lyapunow" | law[1].type | lyapunov?
type = "lyapunov" | type = [] | law[1].type | one of
r = 50.0 | r = 1e30 | law mpc | weights
mode = "inertial" | mode = "inertia" | target.mode | inertial
k_rate = 0.09 | k_rate = 0.09↵quaternion_sign = "short" | law[1].quaternion_sign | shortest
k_rate = 0.09 | k_rate = 0.09↵form = "I" | law[1].form
position = [7.0e6, 0, 0] | position = [0, 0, 0] | orbit.position | away from the centre
k_rate = 0.09 | k_rate = 0.09↵bandwidth = 0.1 | law[1].bandwidth: found an input of a form, and no form | form = "bandwidth"
mode = "inertial"↵attitude = [1, 0, 0, 0] | mode = "history" | target.file
mode = "inertial"↵attitude = [1, 0, 0, 0] | mode = "history"↵file = "no.csv" | target.file | no.csv
attitude = [0, 1, 1, 1] | attitude = [0, 1, 1, 1]↵angles = [0, 0, 0] | initial.angles | either
[orbit] | [orbit | not TOML
"0.01 N m" | "0.01 N m"↵actuator_lag = 1e-20 | part lag | a time constant of 1e-20 s | a slower one | too many
"0.01 N m" | "0.01 N m"↵actuator_lag = "10 ms" | substeps: found 1 | at least 20 substeps, for lag has a time
k_rate = 0.09 | form = "settling"↵bandwidth = 0.1 | law[1].bandwidth: found an input of another form than "settling"
""")
STATE = "position = [7.0e6, 0, 0]         # m, inertial\nvelocity = [0, 7550, 0]"
BENDING = '[[part]]\ntype = "flexible-modes"\nmodes = [[400, 0.01, 0.1, 0.1, 0.1, 0]]\n[target]'
FORM = 'form = "bandwidth"\nbandwidth = 0.1\nk_rate = 0.09'
GAINS = "k_rate = 0.09                    # N m s\nk_attitude = 0.009               # N m"
FAULTS += [
    [STATE, 'altitude = "600 km"', "orbit.inclination: found nothing; allowed: an angle"],
    ["[orbit]\n" + STATE, "#", "gravity"],
    ["[target]", BENDING, "simulation.substeps", "at least 80 substeps, for flexible-modes has a time constant of 0.0025 s"],
    ["k_rate = 0.09", FORM, 'found a gain beside form = "bandwidth"', "bandwidth, damping, or the gains without the form"],
    [GAINS, 'form = "bandwidth"\nbandwith = 0.1', "law[1].bandwith: found an unknown key; did you mean bandwidth?"],
    ["2000.0", 310 * "1", "simulation.duration", "60 digits"],
    ["2000.0", 4301 * "1", "60 digits"],
    ["2000.0", f'"{310 * "1"} s"', "simulation.duration", "'1 s'"],
    ["2000.0", 5000 * "[", "too deep"],
    ["2000.0", 50 * "[" + 50 * "]", "simulation.duration", "too deep"],
    ["2000.0", 50 * "{a=" + "1" + 50 * "}", "simulation.duration.a", "too deep"],
    ["[orbit]", f"[{'.'.join(20000 * ['a'])}]\n[orbit]", "dotted key", "at most 16"],
    ["[orbit]", " . ".join(20000 * ['"a"']) + " = 1\n[orbit]", "dotted key", "at most 16"],
    ["[orbit]", f"[{'.'.join(30 * ['a'])}]\n[orbit]", "a.a.a", "too deep"],
    ["torque_limit =", f"{5000 * 'a'} =", "spacecraft.aaa", "unknown key"],
    ["torque_limit =", '"a\\nb" =', "spacecraft.a\\nb", "unknown key"],
    ['name = "three-laws"', f'name = "{101 * "x"}"', "name", "at most 100"],
    [BASE[BASE.index("[[law]]") :], "", "law: found no law"],
    [BASE[BASE.index("[[law]]") :], 2 * '[[law]]\ntype = "pd"\nname = "a"\nk_rate = 1\nk_attitude = 1\n', "law[2].name"],
]


@pytest.mark.parametrize("row", FAULTS, ids=lambda row: row[2])
def test_a_fault_is_one_line_with_file_key_and_what_is_allowed(row):
    old, new, *words = row
    with refused(*words, start="my.toml: ") as caught:
        build_all(replaced(BASE, old, new))
    assert len(str(caught.value)) < 500


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


@pytest.mark.parametrize("name", ["../evil", "a/b", ".hidden", ""])
def test_a_name_leads_nowhere(name):
    with refused("law[1].name"):
        parse(BASE.replace('type = "lyapunov"', f'type = "lyapunov"\nname = "{name}"'), "my.toml")


def test_same_law_twice_gets_numbers():
    text = BASE + '\n[[law]]\ntype = "lyapunov"\nk_rate = 1\nk_attitude = 1\n'
    assert [entry.name for entry in parse(text, "x").laws] == ["lyapunov", "sliding", "mpc", "lyapunov-2"]


def test_missing_file_names_the_nearest_builtin(tmp_path):
    with pytest.raises(InputError, match="did you mean three-laws"):
        load("three-law")
    with pytest.raises(InputError, match="cannot be read"):
        load(tmp_path)
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    for path in (tmp_path / "binary.toml", 5000 * "x", "a\0b"):
        with pytest.raises(InputError, match="cannot be read") as caught:
            load(path)
        assert len(str(caught.value)) < 300
    with pytest.raises(InputError, match="more than 4194304 characters"):
        parse(2**23 * " ", "my.toml")


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
    samples, _ = fly(built(load("geostationary")), 1)
    assert np.abs(samples[19:23, 0]) == pytest.approx(np.abs(from_angles(*np.radians([8, -5, 12]))), abs=1e-12)
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
    for bad, told in HISTORIES:
        (tmp_path / "h.csv").write_text(bad)
        with refused("target.file", told):
            build(load(tmp_path / "s.toml"), scenario.laws[0])


HISTORIES = rows("""
0,1,0,0,0↵ | 1 rows
0,1,0,0,0↵0,1,0,0,0↵ | a time of 0 s after one of 0 s
0,0,0,0,0↵700,1,0,0,0↵ | line 1: a quaternion of length 0
0,1,0,0,0↵5,1,0,0,0↵ | covers 0 to 5 s
a,b↵c,d↵ | line 1: columns a, b
time,q1,q2,q3,w↵0,1,0,0,0↵ | line 1: columns time, q1, q2, q3, w
time,q0,q0,q2,q3↵0,1,0,0,0↵ | line 1: columns
0,1,0,0,0↵↵5,1,0,0↵ | line 3: 4 columns
0,1,0,0,0↵5,nan,0,0,0↵ | line 2: 'nan'
nan,1,0,0,0↵5,1,0,0,0↵ | line 1: 'nan'
0,1,0,0,0↵5,0.9,0,0,0↵ | line 2: a quaternion of length 0.9
0,1,0,0,0↵5,x,0,0,0↵ | line 2: 'x'
 | 0 rows
""")


MISSPELT = rows("""
k_rate | k_ratee
[orbit] | [orbits]
radius = | raduis =
margin | margn
"L2" | "L4"
"sun-earth" | "sun"
""")


def test_json_schema_accepts_what_is_read_and_refuses_a_misspelling():
    schema = json.loads(json.dumps(json_schema()))
    assert '"default": "riccati"' in json.dumps(schema)
    check = jsonschema.Draft202012Validator(schema)
    check.check_schema(schema)
    for text in [*map(template_text, bodies()), *(builtin_text(name) for name in builtin_names())]:
        assert not list(check.iter_errors(tomllib.loads(text)))
    station = [(builtin_text("l2-circle"), old, new) for old, new in MISSPELT[2:]]
    for text, old, new in [(BASE, *MISSPELT[0]), (BASE, *MISSPELT[1]), *station]:
        assert list(check.iter_errors(tomllib.loads(replaced(text, old, new))))


@pytest.mark.parametrize("body", bodies())
def test_template_runs_as_it_is_and_names_every_key(body):
    text = template_text(body)
    scenario = parse(text, "new.toml")
    assert len([build(scenario, entry) for entry in scenario.laws]) >= 2
    for name, field in bodies()[body].tables.model_fields.items():
        options = [field.annotation, *getattr(field.annotation, "__args__", ())]
        for model in (o for o in options if hasattr(o, "model_fields")):
            assert f"[{name}]" in text or f"[[{name}]]" in text
            assert [key for key in model.model_fields if f"{key} = " not in text] in (
                [],
                ["deficit"],
                ["in_mode", "axis", "direction"],
            )
