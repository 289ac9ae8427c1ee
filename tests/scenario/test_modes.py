"""Laws of modes in files: what is read, and that every fault becomes one clear line."""

import tomllib

import jsonschema
import pytest

from starhold.errors import InputError
from starhold.laws.modes import mode_laws
from starhold.loop.modes import loop_of_mode
from starhold.scenario.building import build
from starhold.scenario.designing import design
from starhold.scenario.json_schema import json_schema
from starhold.scenario.reading import parse
from starhold.scenario.values import locate
from tests.making import built
from tests.missions import BASE, DETUMBLE, POINT
from tests.parts.files import TARGET
from tests.refusals import refused, replaced, rows
from tests.texts import toml

STATION = '{ type = "ground-station", latitude = "60 deg", longitude = "20 deg" }'
SLEW = '\nslew = { rate = "1 deg/s", acceleration = "0.02 deg/s^2" }'
TEXT = BASE + DETUMBLE + POINT + 'back = { rate_above = "5 deg/s" }\n'


def read(text):
    scenario = parse(text, "mission.toml")
    return scenario, build(scenario, scenario.laws[0])


FAULTS = rows("""
type = "pd" | type = "pdd" | law[1].mode[1].type: found "pdd"; did you mean pd?
k_rate = 0.02 | k_rat = 0.02 | law[1].mode[1].k_rat: found an unknown key; did you mean k_rate?
rate_below = | speed_below = | law[1].mode[1].until.speed_below: found an unknown key
rate_below = "0.5 deg/s", dwell | dwell | law[1].mode[1].until
name = "point" | name = "detumble" | law[1].mode[2].name: found "detumble"; allowed: a name that no other mode
name = "point" | | law[1].mode[2].name: found nothing; allowed: this key is required
back = { | back = { to = "pint", | law[1].mode[2].back.to: found "pint"; allowed: one of detumble
back = { | until = { after = "9 s" }↵back = { | law[1].mode[2].until.to: found nothing
until = { | back = { after = 5 }↵until = { | law[1].mode[1].back.to: found nothing
"0.5 deg/s" | "0.5 deg" | law[1].mode[1].until.rate_below
type = "modes" | type = "modes"↵k_rate = 1 | law[1].k_rate: found an unknown key
k_integral = 1e-5 | k_integral = 1.0 | law[1].mode[2]: k_integral must be below
""")
FAULTS += [
    [DETUMBLE[DETUMBLE.index("until") :], "", "law[1].mode[1].until: found nothing; allowed: a condition"],
    [TEXT[TEXT.index(POINT) :], "", "law[1].mode: found one mode; allowed: at least two [[law.mode]] tables"],
    [TEXT[TEXT.index(DETUMBLE) :], "", "law[1].mode: found nothing; allowed: at least two [[law.mode]] tables"],
]


@pytest.mark.parametrize("row", FAULTS, ids=lambda row: row[2])
def test_a_fault_is_told_in_one_line(row):
    old, new, told = row
    with refused(told):
        read(replaced(TEXT, old, new))


def test_a_mode_that_nothing_leads_to_is_refused():
    third = POINT.replace('"point"', '"rest"')
    text = BASE + DETUMBLE.replace("dwell", 'to = "rest", dwell') + POINT + "until = { after = 5 }" + third
    with refused('mode[2]: found "point"; allowed: a mode that a condition of another one leads to'):
        read(text)


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ('{ mode = "orbital" }', 'mode[2].target.mode: found "orbital"; allowed: another mode without an [orbit] table'),
        ('{ type = "inertial" }', "mode[2].target.type"),
        ('{ type = "constant-torque", torque = [0, 0, 0] }', "of the role environment; allowed: a target"),
        ('{ mood = "inertial" }', "mode[2].target.mood: found an unknown key"),
        ('"nadir"', 'mode[2].target: found "nadir"; allowed: a table'),
        (STATION, "no two-body, which targets-of-modes needs"),
        (STATION + SLEW, "no two-body, which targets-of-modes needs"),
    ],
)
def test_a_target_that_a_mode_cannot_have_is_told_in_one_line(given, told):
    with refused(told):
        read(TEXT + f"target = {given}\n")


def test_a_mode_takes_a_target_from_a_file(tmp_path):
    (tmp_path / "turned.py").write_text(TARGET)
    text = TEXT + 'target = { file = "turned.py" }\n'
    loop = built(parse(text, "mission.toml", tmp_path))
    assert loop_of_mode(loop, 0).target.part.name == "inertial"
    assert loop_of_mode(loop, 1).target.part.name == "turned"
    (tmp_path / "turned.py").write_text(TARGET.replace("return Goal", "return 1 / 0, Goal"))
    broken = parse(text, "mission.toml", tmp_path)
    with pytest.raises(InputError, match=r"turned\.py"):
        build(broken, broken.laws[0])


def test_a_mode_changes_by_its_key_and_designs_its_gains():
    scenario, _ = read(TEXT)
    changes = {"law.mission.mode[1].k_rate": 0.03, "law.mission.mode[1].until.rate_below": "1 deg/s"}
    entry = scenario.with_(changes).laws[0]
    numbers = {item.name: value for item, value in zip(entry.law.fields(), entry.gains, strict=True)}
    assert numbers["mode[1].k_rate"] == 0.03
    assert numbers["mode[1].until.rate_below"] == pytest.approx(0.017453292519943295)
    assert numbers["mode[1].until.dwell"] == 2.0
    assert numbers["mode[2].integral_limit"] == 1e-4
    assert locate(scenario, "law.mission.mode[1].until.dwell").value == 2.0
    assert locate(scenario, "law.mission.mode[2].k_rate").value == 0.006
    for key in ("law.mission.mode[1].until", "law.mission.mode[3].k_rate", "law.mission.mode[1].gain"):
        with pytest.raises(InputError):
            locate(scenario, key)
    designed, _ = read(TEXT.replace("k_rate = 0.02\nk_attitude = 1e-6", 'form = "bandwidth"\nbandwidth = "0.1 rad/s"'))
    name, law, gains = mode_laws(designed.laws[0].law, designed.laws[0].gains)[0]
    assert (name, law.name) == ("detumble", "pd")
    assert gains.k_attitude > 1e-4


def test_the_schema_takes_modes():
    schema = jsonschema.Draft202012Validator(json_schema())
    assert schema.is_valid(tomllib.loads(TEXT))
    for old, new in (("rate_below", "speed_below"), ('name = "point"\n', ""), ("k_rate = 0.02", "k_rat = 0.02")):
        assert not schema.is_valid(tomllib.loads(replaced(TEXT, old, new)))


RODS = toml("""
[orbit] altitude = "500 km"; inclination = "97 deg"
[[part]] type = "magnetometer"
[[part]] type = "magnetorquers"; dipole_limit = 0.2
[[part]] type = "thrusters"; torque = 0.01; lever = 0.1
[[law]]""")


@pytest.mark.parametrize(
    ("first", "second", "told"),
    [
        ('["magnetorquers"]', '["thrusters", "magnetorquers"]', "point: effectors: found magnetorquers and thrusters, whi"),
        ('["magnetorquers"]', None, "point: effectors: found magnetorquers and thrusters, which both take the command"),
        ('["magnetorquer"]', '["thrusters"]', 'detumble: effectors: found "magnetorquer"; did you mean magnetorquers?'),
        ("[]", '["thrusters"]', "detumble: effectors: found none that takes the command; allowed: one of magnetorquers, t"),
        ('"thrusters"', None, "law[1].mode[1].effectors: found"),
    ],
)
def test_each_mode_has_one_effector_for_its_command(first, second, told):
    lines = [f"effectors = {given}\n" if given else "" for given in (first, second)]
    text = BASE.replace("[[law]]", RODS) + DETUMBLE + lines[0] + POINT + lines[1]
    with refused(told):
        read(text)


def test_without_modes_two_effectors_for_a_command_are_refused_with_what_helps():
    text = BASE.replace("[[law]]", RODS).partition('type = "modes"')[0] + 'type = "pd"\nk_rate = 0.01\nk_attitude = 0.001\n'
    with pytest.raises(InputError, match=r'a second effector for the command.* type "modes" whose modes name theirs'):
        read(text)


def test_a_mode_that_lacks_a_reading_is_told_which_sensor_has_it():
    modes = DETUMBLE.replace('type = "pd"\nk_rate = 0.02\nk_attitude = 1e-6', 'type = "b-dot"\nk = 1e-3') + POINT
    with refused("no magnetic_field, ", " a sensor that measures magnetic_field, such as magnetometer"):
        read(BASE + modes)


def test_forms_of_modes_are_not_designed_alone():
    with pytest.raises(InputError, match="only modes, whose designs are not shown"):
        design(read(TEXT)[0])
