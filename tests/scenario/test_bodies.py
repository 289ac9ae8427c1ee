"""One kind of scenario with different bodies: how a file's body is known, what is refused, and names that have changed."""

import pytest
from pydantic import BaseModel

from starhold.errors import InputError
from starhold.scenario.bodies import bodies
from starhold.scenario.json_schema import json_schema
from starhold.scenario.quantity import meaning
from starhold.scenario.reading import builtin_text, load, make_scenario, open_scenario, parse
from starhold.scenario.schema import LawTable, ScenarioTable, Timing
from tests.refusals import refused

BODY = "inertia = [2.0, 3.0, 4.0]\ntorque_limit = 0.01\n"
SLEW = f"name = 's'\n[spacecraft]\n{BODY}[simulation]\nduration = 10.0\n"
WHEELS = f"{SLEW}[wheels]\nlayout = 'pyramid'\ninertia = 1e-3\ntorque_limit = 0.02\nmomentum_limit = 0.4\n"
POINT = "name = 'p'\n[libration]\n[control]\nlimit = 4.0\n[simulation]\nduration = 1.0\n"


def message(text):
    with refused() as caught:
        parse(text, "my.toml")
    return str(caught.value)


def test_the_bodies_are_found_by_their_folders():
    assert set(bodies()) == {"rigid-body", "libration-point"}
    for name, body in bodies().items():
        assert type(body).__module__ == f"starhold.scenario.bodies.{name.replace('-', '_')}"
        assert issubclass(body.tables, ScenarioTable)
        assert issubclass(body.law_table, LawTable)
        assert issubclass(body.tables.model_fields["simulation"].annotation, Timing)
        assert body.tables.model_fields[body.marker].is_required()
        scenario = parse(body.template, "new.toml")
        assert scenario.body == name
        assert scenario.about(name) is scenario


@pytest.mark.parametrize("name", ["rigid-body", "libration-point"])
def test_a_key_means_what_the_schema_says(name):
    tables = {type(table) for _, table in parse(bodies()[name].template, "new.toml").table if isinstance(table, BaseModel)}
    assert len(tables) > 4
    for table in tables:
        stated = table.model_json_schema()["properties"]
        assert {key: meaning(field) for key, field in table.model_fields.items()} == {
            key: stated[key].get("description", "") for key in table.model_fields
        }


def test_no_two_tables_share_a_name_in_the_schema():
    """Their schemas stand beside one another under their classes' names; those of the shared tables are the same."""
    known = [body.tables.model_json_schema()["$defs"] for body in bodies().values()]
    assert set.intersection(*map(set, known)) == {"CampaignTable", "RequirementTable"}
    assert all(one[name] == known[0][name] for one in known for name in ("CampaignTable", "RequirementTable"))
    assert set.union(*map(set, known)) <= set(json_schema()["$defs"])


def test_a_file_has_one_body():
    law = "[[law]]\ntype = 'pd'\nk_rate = 0.1\nk_attitude = 0.1\n"
    nobody = SLEW.replace(f"[spacecraft]\n{BODY}", "") + law
    assert message(nobody) == "my.toml: found no body; allowed: one of the tables [body], [libration], [spacecraft]"
    assert message("") == "my.toml: found no body; allowed: one of the tables [body], [libration], [spacecraft]"
    near = SLEW.replace("[spacecraft]", "[spacecrfat]") + law
    assert message(near) == "my.toml: spacecrfat: found an unknown key; did you mean spacecraft?"
    both = SLEW + "[libration]\n" + law
    assert message(both) == "my.toml: spacecraft: found a second body beside [libration]; allowed: one of the two"
    with pytest.raises(InputError, match="scenario: found no body"):
        make_scenario({"name": "made", "simulation": {"duration": 1.0}})


def test_a_body_is_refused_where_another_is_needed():
    scenario = open_scenario("l2-circle")
    assert open_scenario(scenario) is scenario
    with refused(start="l2-circle: libration: found a scenario of a libration-point; allowed: here one of a rigid-body"):
        scenario.about("rigid-body")


def test_laws_of_one_body_are_unknown_to_another():
    assert 'law[1].type: found "l2-circle"; allowed: one of ' in message(SLEW + "[[law]]\ntype = 'l2-circle'\n")
    assert 'law[1].type: found "pd"; allowed: one of l2-circle' in message(POINT + "[[law]]\ntype = 'pd'\n")


def test_what_a_law_s_table_says_beside_gains_is_its_options():
    gains = "[[law]]\ntype = 'pd'\nk_rate = 0.1\nk_attitude = 0.1\n"
    own = 'quaternion_sign = "hysteresis"\nhysteresis_width = 0.2\nfault_action = "none"\n'
    assert parse(SLEW + gains, "x").laws[0].options == ("as_published", 0.5, None)
    assert parse(SLEW + gains + own, "x").laws[0].options == ("hysteresis", 0.2, "none")
    point = "[[law]]\ntype = 'l2-equilibrium'\nform = 'degree'\n"
    assert parse(POINT + point, "x").laws[0].options == (4.0, 0.0)
    assert parse(POINT + point + "limit = 3.0\nlag = 0.01\n", "x").laws[0].options == (3.0, 0.01)


SLIDING = "[[law]]\ntype = 'sliding'\nsurface_gain = 0.08\nswitching_gain = 0.005\nboundary_layer = 0.01\n"
SETTLING = "[[law]]\ntype = 'pd'\nform = 'settling'\ntime = 60.0\nwheel_momentum = [0, 0, 0]\n"
CIRCLE = "[[law]]\ntype = 'l2-circle'\nform = 'best'\nradius = 1.0\nboundary_layer = 0.05\n"
OPTIMAL = "[[law]]\ntype = 'l2-optimal'\nradius = 1.0\nrate = 1.4\nalpha = 1.0\nbeta = 1.0\npull = 1.0\n"
OPTIMAL += "surface_gain = 1.0\nboundary_layer = 0.05\n"
RENAMED = [
    (SLEW + SLIDING + "quaternion_sign = 'shortest'\n", "law[1].double_cover", "quaternion_sign"),
    (SLEW + SLIDING, "law[1].slope", "surface_gain"),
    (SLEW + SLIDING, "law[1].reach", "switching_gain"),
    (SLEW + SLIDING, "law[1].layer", "boundary_layer"),
    (POINT + CIRCLE, "law[1].layer", "boundary_layer"),
    (POINT + OPTIMAL, "law[1].layer", "boundary_layer"),
    (POINT + OPTIMAL, "law[1].slope", "surface_gain"),
    (SLEW + "[certify]\nslew_angle = 0.5\n" + SLIDING, "certify.turn", "slew_angle"),
    (WHEELS + SETTLING, "law[1].stored", "wheel_momentum"),
]


@pytest.mark.parametrize(("text", "key", "new"), RENAMED)
def test_an_old_key_is_refused_with_the_new_one_named(text, key, new):
    old = key.rpartition(".")[2]
    scenario = parse(text, "my.toml")
    said = f"{key}: found an old name; allowed: {new}, its new name"
    assert message(text.replace(f"{new} =", f"{old} =")) == f"my.toml: {said}"
    # Where it is changed by key, as by a sweep, too.
    with refused(start=f"my.toml with {key} = 0.1: {said}"):
        scenario.with_({key: 0.1})
    with refused(f"found an old name; allowed: {new}, its new name"):
        scenario.with_({key.replace("law[1]", f"law.{scenario.laws[0].name}"): 0.1})


def test_an_old_key_is_unknown_where_the_new_one_is_too():
    assert "law[1].slope: found an unknown key" in message(SLEW + "[[law]]\ntype = 'pd'\nslope = 1.0\n")
    assert "simulation.turn: found an unknown key" in message(SLEW.replace("duration", "turn = 1.0\nduration") + SLIDING)


def test_the_old_name_of_a_law_and_of_a_scenario():
    text = builtin_text("l2-equilibrium").replace('type = "l2-equilibrium"', 'type = "l2-rest"', 1)
    assert message(text) == 'my.toml: law[1].type: found "l2-rest"; allowed: l2-equilibrium, its new name'
    with pytest.raises(InputError, match=r"l2-rest: found no such file; .* l2-equilibrium, its new name"):
        load("l2-rest")
    with pytest.raises(InputError, match='found "l2-rest"; allowed: l2-equilibrium, its new name'):
        parse(POINT + "[[law]]\ntype = 'l2-equilibrium'\nform = 'degree'\n", "x").with_({"law.l2-rest.y": 0.5})
