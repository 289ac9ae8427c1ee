"""Scenarios of station keeping: what is read, and that every fault becomes one clear line."""

import math

import numpy as np
import pytest

from starhold.analysis.libration_point import CircleGoal, EquilibriumGoal, goal_of
from starhold.errors import InputError
from starhold.parts.bodies.libration_point import EARTH_DIAMETER, PRIMARIES
from starhold.scenario.building import build
from starhold.scenario.reading import builtin_text, load, parse
from tests.refusals import refused, replaced, rows

BASE = builtin_text("l2-circle")
OWN = 'larger = 1.327e20\nsmaller = 4.035e14\nseparation = "1.496e11 m"'


def build_all(text):
    scenario = parse(text, "my.toml")
    return [build(scenario, entry) for entry in scenario.laws]


FAULTS = rows("""
"sun-earth" | "sun-earht" | libration.primaries | sun-earht | sun-earth?
primaries = "sun-earth" | larger = 1.327e20↵smaller = 4.035e14↵separation = 1e-300 | libration.separation | 1e-30
primaries = "sun-earth" | larger = 1.327e20↵smaller = 4.035e14↵separation = 1.496e8 | libration.separation | in m
primaries = "sun-earth" | larger = 5.97e24↵smaller = 7.35e22↵separation = "384400 km" | libration.separation | GM in m^3/s^2
[0.02, -0.25, 0.0] | [0.02, -0.25, 0.0]↵phase = 90 | initial.phase | "90 deg"
radius = 1.0 | radius = "1 s" | law[1].radius | "1 s" | a quantity in m
point = "L2" | point = "L4" | libration.point | L4 | L1
model = "linear" | model = "lin" | libration.model | nonlinear
primaries = "sun-earth" | larger = 1e20 | libration.smaller | together
primaries = "sun-earth" | larger = 1.327e20↵smaller = 4.035e24↵separation = "1.496e11 m" | libration.smaller | at most
point = "L2" | point = "L2"↵length_unit = "3 s" | libration.length_unit | "3 s" | m
margin = 0.10 | margin = 0.10↵limit = "1e-6 m/s^2" | control.margin | one of limit
margin = 0.10 | limit = "1e-6 N" | control.limit | m/s^2
margin = 0.10 | deficit = 1.0 | control.deficit | at most 0.99
margin = 0.10 | margin = 0.10↵limit_kind = "none" | control.limit_kind | norm or axis
margin = 0.10 |  | law l2-optimal | no limit | margin
[0.02, -0.25, 0.0] | ["1e6 km", 0, 0] | initial.position | lost_beyond
"target" | "circle" | initial.relative_to | point
control_period = 0.001 | control_period = 1e-15 | simulation.duration | control periods
type = "l2-optimal" | type = "pd" | law[4].type | l2-circle
name = "relay" | name = "smooth" | law[2].name | no other law
point = "L2" | point = "L3" | law[1] | not above 2
""")
OPTIMAL, EQUILIBRIUM = 'type = "l2-optimal"\nboundary_layer = 0.005\nform = "best"\nradius = 1.0', 'type = "l2-equilibrium"'
FAULTS += [
    ['primaries = "sun-earth"', OWN.replace("e20", "e11"), "libration.larger", "Sun", '"1.327e+11 km^3/s^2"'],
    ['primaries = "sun-earth"', f'primaries = "sun-earth"\n{OWN}', "libration.primaries", "either"],
    [OPTIMAL, EQUILIBRIUM + '\nform = "degree"\ndeficit = 0.1', "law[4].deficit", "without a circle"],
    [OPTIMAL, EQUILIBRIUM + '\nform = "degree"', "control.margin", "without a circle"],
    [BASE[BASE.index("[[law]]") :], "", "law: found no law"],
]


@pytest.mark.parametrize("row", FAULTS, ids=lambda row: row[2])
def test_a_fault_is_one_line_with_file_key_and_what_is_allowed(row):
    old, new, *words = row
    with refused(*words, start="my.toml: "):
        build_all(replaced(BASE, old, new))


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
