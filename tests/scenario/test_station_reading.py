"""Scenarios of station keeping: what is read, and that every fault becomes one clear line."""

import math
import tomllib

import jsonschema
import numpy as np
import pytest

from starhold.analysis.libration_point import CircleGoal, EquilibriumGoal, goal_of
from starhold.errors import InputError
from starhold.laws.catalogue import catalogue
from starhold.parts.bodies.libration_point import EARTH_DIAMETER, PRIMARIES
from starhold.scenario.bodies.libration_point.tables import LibrationPointTable, PointLawTable
from starhold.scenario.building import build
from starhold.scenario.json_schema import json_schema
from starhold.scenario.reading import builtin_text, load, parse
from starhold.scenario.template import template_text
from tests.refusals import refused

BASE = builtin_text("l2-circle")
OWN = 'larger = 1.327e20\nsmaller = 4.035e14\nseparation = "1.496e11 m"'


def build_all(text):
    scenario = parse(text, "my.toml")
    return [build(scenario, entry) for entry in scenario.laws]


FAULTS = {
    "unknown table": ("[control]", "[controls]", ["controls", "unknown key", "control?"]),
    "unknown key": ("margin =", "margn =", ["control.margn", "unknown key", "margin?"]),
    "unknown pair": ('"sun-earth"', '"sun-earht"', ["libration.primaries", "sun-earht", "sun-earth?"]),
    "a list of pairs": ('"sun-earth"', "[]", ["libration.primaries", "[]", "sun-earth"]),
    "separation next to nothing": (
        'primaries = "sun-earth"',
        OWN.replace('"1.496e11 m"', "1e-300"),
        ["libration.separation", "1e-30"],
    ),
    "separation in km": (
        'primaries = "sun-earth"',
        OWN.replace('"1.496e11 m"', "1.496e8"),
        ["libration.separation", "in m"],
    ),
    "masses in kg": (
        'primaries = "sun-earth"',
        'larger = 5.97e24\nsmaller = 7.35e22\nseparation = "384400 km"',
        ["libration.separation", "GM in m^3/s^2"],
    ),
    "GM in km^3/s^2": (
        'primaries = "sun-earth"',
        OWN.replace("1.327e20", "1.327e11"),
        ["libration.larger", "Sun", '"1.327e+11 km^3/s^2"'],
    ),
    "phase in degrees without a unit": (
        "[0.02, -0.25, 0.0]",
        "[0.02, -0.25, 0.0]\nphase = 90",
        ["initial.phase", '"90 deg"'],
    ),
    "radius in seconds": ("radius = 1.0", 'radius = "1 s"', ["law[1].radius", '"1 s"', "a quantity in m"]),
    "unknown point": ('point = "L2"', 'point = "L4"', ["libration.point", "L4", "L1"]),
    "unknown model": ('model = "linear"', 'model = "lin"', ["libration.model", "nonlinear"]),
    "pair twice": ('primaries = "sun-earth"', f'primaries = "sun-earth"\n{OWN}', ["libration.primaries", "either"]),
    "half a pair": ('primaries = "sun-earth"', "larger = 1e20", ["libration.smaller", "together"]),
    "pair the wrong way": ('primaries = "sun-earth"', OWN.replace("e14", "e24"), ["libration.smaller", "at most"]),
    "libration no table": (
        '[libration]\nprimaries = "sun-earth"\npoint = "L2"\nmodel = "linear"',
        "libration = 3",
        ["libration"],
    ),
    "length unit": ('point = "L2"', 'point = "L2"\nlength_unit = "3 s"', ["libration.length_unit", '"3 s"', "m"]),
    "two limits": ("margin = 0.10", 'margin = 0.10\nlimit = "1e-6 m/s^2"', ["control.margin", "one of limit"]),
    "wrong unit": ("margin = 0.10", 'limit = "1e-6 N"', ["control.limit", "m/s^2"]),
    "limit zero": ("margin = 0.10", "limit = 0", ["control.limit", "above 0"]),
    "deficit of all": ("margin = 0.10", "deficit = 1.0", ["control.deficit", "at most 0.99"]),
    "limit of nothing": ("margin = 0.10", 'margin = 0.10\nlimit_kind = "none"', ["control.limit_kind", "norm or axis"]),
    "greedy without a limit": ("margin = 0.10", "", ["law l2-optimal", "no limit", "margin"]),
    "position of two": ("[0.02, -0.25, 0.0]", "[0.02, -0.25]", ["initial.position", "3 numbers"]),
    "position in seconds": ("[0.02, -0.25, 0.0]", '["1 s", 0, 0]', ["initial.position", "m"]),
    "too far": ("[0.02, -0.25, 0.0]", '["1e6 km", 0, 0]', ["initial.position", "lost_beyond"]),
    "relative to": ('"target"', '"circle"', ["initial.relative_to", "point"]),
    "no duration": ('duration = "2 yr"', "", ["simulation.duration", "required"]),
    "period too long": ("control_period = 0.001", 'control_period = "3 yr"', ["simulation.control_period", "duration"]),
    "too many steps": ("control_period = 0.001", "control_period = 1e-15", ["simulation.duration", "control periods"]),
    "tolerance": ("tolerance = 0.02", "tolerance = 0.0", ["settling.tolerance", "above 0"]),
    "attitude law": ('type = "l2-optimal"', 'type = "pd"', ["law[4].type", "l2-circle"]),
    "unknown form": ('form = "best"', 'form = "bets"', ["law[1].form", "best?"]),
    "unknown gain": ("radius = 1.0", "radius = 1.0\nradus = 2", ["law[1].radus", "radius?"]),
    "gain out of bounds": ("radius = 1.0", "radius = -1.0", ["law[1].radius", "above 0"]),
    "same name": ('name = "relay"', 'name = "smooth"', ["law[2].name", "no other law"]),
    "deficit of rest": (
        'type = "l2-optimal"\nboundary_layer = 0.005\nform = "best"\nradius = 1.0',
        'type = "l2-equilibrium"\nform = "degree"\ndeficit = 0.1',
        ["law[4].deficit", "without a circle"],
    ),
    "margin of rest": (
        'type = "l2-optimal"\nboundary_layer = 0.005\nform = "best"\nradius = 1.0',
        'type = "l2-equilibrium"\nform = "degree"',
        ["control.margin", "without a circle"],
    ),
    "no best rate": ('point = "L2"', 'point = "L3"', ["law[1]", "not above 2"]),
    "not TOML": ("[control]", "[control", ["not TOML"]),
}


@pytest.mark.parametrize("name", sorted(FAULTS))
def test_a_fault_is_one_line_with_file_key_and_what_is_allowed(name):
    old, new, words = FAULTS[name]
    assert old in BASE
    with refused(*words, start="my.toml: "):
        build_all(BASE.replace(old, new))


def test_a_file_without_laws():
    with pytest.raises(InputError, match=r"law: found no law"):
        parse(BASE.split("[[law]]")[0], "my.toml")


def test_strings_with_units_are_scaled():
    text = BASE.replace("[0.02, -0.25, 0.0]", '["12742 km", -0.25, "0 m"]\nvelocity = ["1 m/s", 0.0, 0.0]')
    text = text.replace("margin = 0.10", 'limit = "2e-6 m/s^2"\nlag = "12 h"').replace('"2 yr"', '"100 d"')
    scenario = parse(text, "my.toml")
    units, table = scenario.table.libration.units, scenario.table
    assert units.length == EARTH_DIAMETER
    assert table.initial.position == pytest.approx((1.0, -0.25, 0.0))
    assert table.initial.velocity[0] * units.velocity == pytest.approx(1.0)
    assert table.control.limit is not None
    assert table.control.limit * units.acceleration == pytest.approx(2e-6)
    assert [entry.options.lag * units.time for entry in scenario.laws] == pytest.approx([43200.0] * 4)
    assert table.simulation.steps == round(100 * 86400 / units.time / 0.001)


def test_lengths_of_laws_take_units_too():
    """Laws' radii, places, rates and layers: numbers are scaled, strings carry units, as in the other tables."""
    head = BASE.split("[[law]]")[0]
    law = '[[law]]\ntype = "l2-circle"\nradius = "6371 km"\nrate = "0.01 rad/d"\nboundary_layer = "1 cm/s"\nalpha = 1'
    law += "\nk = 1\nk_x = 18"
    scenario = parse(f"{head}{law}\nk_velocity = 6", "my.toml")
    gains, units = scenario.laws[0].gains, scenario.table.libration.units
    assert gains.radius == pytest.approx(0.5, rel=1e-15)
    assert gains.rate == pytest.approx(0.01 / 86400.0 * units.time)
    assert gains.boundary_layer == pytest.approx(0.01 / units.velocity)
    rest = f'{head}[[law]]\ntype = "l2-equilibrium"\nform = "degree"\nlimit = 1.0\ny = "-12742 km"\nz = 0.5'
    assert parse(rest, "my.toml").laws[0].gains[:2] == pytest.approx((-1.0, 0.5))


def test_a_limit_in_the_law_comes_before_the_common_one():
    scenario = load("l2-deficit")
    shares = [entry.options.limit / scenario.laws[0].options.limit for entry in scenario.laws]
    assert shares[:3] == pytest.approx([1.0, 0.95, 0.9])
    assert scenario.laws[3].options.limit == 2.786
    free = parse(builtin_text("l2-deficit").replace("deficit = 0.0\n", ""), "my.toml")
    assert math.isinf(free.laws[0].options.limit)
    assert build(free, free.laws[0]).limit == "none"


def test_starts_on_the_circle_of_each_law_and_at_its_place_of_rest():
    for name in ("l2-circle", "l2-equilibrium"):
        scenario = load(name)
        for entry in scenario.laws:
            loop, goal = build(scenario, entry), goal_of(entry.gains)
            offset = np.array(scenario.table.initial.position)
            assert goal.distance(np.array([loop.start.position]) - offset)[0] == pytest.approx(0.0, abs=1e-15)
            if isinstance(goal, CircleGoal):
                assert loop.start.velocity == (0.0, 0.0, goal.rate)
            else:
                assert isinstance(goal, EquilibriumGoal)
                assert loop.start.velocity == (0.0, 0.0, 0.0)


def test_two_bodies_of_ones_own():
    sun_earth = PRIMARIES["sun-earth"]
    own = f"larger = {sun_earth.larger!r}\nsmaller = {sun_earth.smaller!r}\nseparation = {sun_earth.separation!r}"
    ours, theirs = (parse(BASE.replace('primaries = "sun-earth"', text), "my") for text in (own, ""))
    assert ours.craft == theirs.craft
    assert ours.table.libration.units == theirs.table.libration.units


def test_the_template_names_every_key_and_the_schema_takes_it():
    scenario = parse(template_text("libration-point"), "new.toml")
    assert [build(scenario, entry) for entry in scenario.laws]
    for name, field in LibrationPointTable.model_fields.items():
        options = [field.annotation, *getattr(field.annotation, "__args__", ())]
        for model in (o for o in options if hasattr(o, "model_fields")):
            assert f"[{name}]" in template_text("libration-point")
            for key in model.model_fields:
                assert f"{key} = " in template_text("libration-point") or key == "deficit"
    for key in PointLawTable.model_fields:
        assert key in template_text("libration-point")
    check = jsonschema.Draft202012Validator(json_schema())
    assert not list(check.iter_errors(tomllib.loads(BASE)))
    for old, new in (("radius =", "raduis ="), ("margin", "margn"), ('"L2"', '"L4"'), ('"sun-earth"', '"sun"')):
        assert list(check.iter_errors(tomllib.loads(BASE.replace(old, new))))


def test_unstable_gains_are_refused_unless_they_are_allowed(tmp_path):
    head = BASE.split("[[law]]")[0]
    circle = 'type = "l2-circle"\nradius = 1\nrate = 1.4\nalpha = 1\nk = 1\nk_x = {}\nk_velocity = 6'
    rest = 'type = "l2-equilibrium"\nlimit = 1.0\ny = 0\nz = 0\nk_x = {}\nk_velocity = [6.0, {}, 4.0]'
    for law in (circle.format(8.8), rest.format(8.8, 3.4), rest.format(17.8, 0.0)):
        (tmp_path / "my.toml").write_text(f"{head}[[law]]\n{law}")
        with pytest.raises(InputError, match=r"law\[1\]: .*--allow-unstable"):
            load(tmp_path / "my.toml")
        assert load(tmp_path / "my.toml", allow_unstable=True).laws
    for law in (circle.format(8.9), rest.format(8.9, 3.4)):
        assert parse(f"{head}[[law]]\n{law}", "my.toml").laws


def test_every_station_law_has_a_goal():
    for law in catalogue("libration-point").values():
        for gains in law.examples():
            assert isinstance(goal_of(gains), CircleGoal | EquilibriumGoal)
