"""The table of a turn's limits, and what a law takes from the start of the run."""

import math

import numpy as np
import pytest

from starhold.errors import InputError
from starhold.scenario.designing import design
from starhold.scenario.reading import builtin_text, load, parse
from starhold.studies.modal_roots import pick_modal, study
from tests.refusals import refused, replaced, rows

BASE = builtin_text("landing-limits")
COARSE = BASE.replace('step = "5 deg"', 'step = "85 deg"').replace("step = 0.001", "step = 0.05")


def parsed(*pairs, text=COARSE):
    return parse(replaced(text, *pairs) if pairs else text, "my.toml")


def test_lists_and_spreads_give_the_decimals_that_are_meant():
    table = load("landing-limits").table.transient
    assert len(table.roots) == 3000
    assert table.roots[:2] == (-3.0, -2.999)
    assert (table.roots[1437], table.roots[-1]) == (-1.563, -0.001)
    assert np.degrees(table.angles) == pytest.approx(np.arange(10, 181, 5), rel=1e-12)
    assert table.start_rate == pytest.approx((math.radians(20.0) / 3**0.5,) * 3)
    listed = parsed(("{ from = -3.0, to = -0.001, step = 0.05 }", "[-2, -1.5, -0.5]")).table.transient
    assert listed.roots == (-2, -1.5, -0.5)
    given = parsed(('"20 deg/s"', '[0.1, "2 deg/s", 0]')).table.transient
    assert given.start_rate == pytest.approx((0.1, math.radians(2.0), 0.0))


def test_what_the_table_leaves_out():
    text = COARSE[: COARSE.index("[transient]")] + "[transient]\nrate_limit = 0.5\n" + COARSE[COARSE.index("[[law]]") :]
    table = parse(text, "x").table.transient
    assert (table.rate_limit, table.acceleration_limit, table.rate_tolerance) == (0.5, math.inf, 0.0)
    assert (len(table.angles), len(table.roots)) == (35, 3000)
    assert table.start_rate == (0.0, 0.0, 0.0)


FAULTS = rows("""
to = -0.001 | to = 0 | transient.roots | below zero
{ from = -3.0, to = -0.001, step = 0.05 } | [-1, -2] | transient.roots | increase
{ from = -3.0, to = -0.001, step = 0.05 } | [] | transient.roots | a list of values
from = -3.0 | from = -1e-4 | transient.roots | from at most to
step = 0.05 | step = 1e-7 | transient.roots | 100000
step = 0.05 | step = 0 | transient.roots | above 0
step = 0.05 | stop = 0.05 | transient.roots | step = ..
from = "10 deg" | from = 0 | transient.angles | above 0
to = "180 deg" | to = "190 deg" | transient.angles | at most 180 deg
axis = [1, 1, 1] | axis = [1, 1] | transient.axis | 3 numbers
axis = [1, 1, 1] | axis = [0, 0, 0] | transient.axis | not zero
"20 deg/s" | [0.1, 0, 0, 0] | transient.rate | 3 numbers
"20 deg/s" | "20 deg" | transient.rate | rad/s
rate = "20 deg/s" | rate = "40 deg/s" | transient.rate | rate_limit, 30 deg/s
"50 deg/s^2" | "-50 deg/s^2" | transient.acceleration_limit | above 0
"3 deg/s" | "-3 deg/s" | transient.rate_tolerance | at least 0
angle_end = "0.1 deg" | angle_end = 0 | transient.angle_end | above 0
rate_end = | rate_ends = | transient.rate_ends | rate_end?
below = [-0.991348, -2.12427, -0.862229] | below = [1, 2] | law[2].below | 3 numbers
below = [-0.991348, -2.12427, -0.862229] | below = [0, 0, 1]↵angle = 1.0 | law[2] | not stable
""")


@pytest.mark.parametrize("row", FAULTS, ids=lambda row: row[2])
def test_a_fault_is_one_line_with_file_key_and_what_is_allowed(row):
    with refused(*row[2:], start="my.toml: "):
        parsed(row[:2])


UNREACHABLE = rows("""
"50 deg/s^2" | "5 deg/s^2" | acceleration_limit: found 5 deg/s^2 | from 10 deg no root | 1/s
rate_limit = "30 deg/s" | rate_limit = "20.01 deg/s" | rate_limit | at least 25.6 | from 180 deg no root
duration = 40.0 | duration = 4.0 | acceleration_limit | within 4 s
duration = 40.0 | duration = 1.0 | simulation.duration: found 1 s | from 10 deg no root settles
""")


@pytest.mark.parametrize("row", UNREACHABLE, ids=lambda row: row[2])
def test_a_limit_that_cannot_be_met_is_named(row):
    scenario = parsed(row[:2])
    with refused(*row[2:]):
        study(scenario, pick_modal(scenario, None))


def test_the_search_wants_a_modal_law_limits_and_a_target_at_rest():
    with pytest.raises(InputError, match=r"a \[transient\] table with limits"):
        pick_modal(load("three-laws"), None)
    other = '[[law]]\ntype = "pd"\nk_rate = 1000\nk_attitude = 1000\n'
    with_other = parsed(("[[law]]", other + "\n[[law]]"), text=COARSE.split('[[law]]\ntype = "modal"\nname = "own-fit"')[0])
    assert pick_modal(with_other, None).name == "published"
    with pytest.raises(InputError, match='law: found pd; allowed: a law with type = "modal"'):
        pick_modal(with_other, "pd")
    with pytest.raises(InputError, match="none that is modal"):
        pick_modal(parse(COARSE.split("[[law]]")[0] + other, "x"), None)
    orbital = 'mode = "orbital"\n[orbit]\nposition = [7e6, 0, 0]\nvelocity = [0, 7550, 0]'
    moving = parsed(('mode = "inertial"\nattitude = [1, 0, 0, 0]', orbital))
    with pytest.raises(InputError, match=r"target\.mode: found orbital"):
        pick_modal(moving, None)


def test_a_fit_without_angle_takes_that_of_the_start():
    scenario = parsed()
    assert scenario.pick("published").spec.angle == pytest.approx(math.pi / 2)
    # The error counts, not the attitude; and the shorter of the two turns.
    turned = parsed(("attitude = [1, 0, 0, 0]", "attitude = [0, 1, 0, 0]"))
    expected = 2.0 * math.acos(math.cos(math.pi / 4.0) / 3**0.5)
    assert turned.pick("published").spec.angle == pytest.approx(expected)
    relative = parsed(
        ("[initial]", '[initial]\nrelative_to = "target"'), ("attitude = [1, 0, 0, 0]", "attitude = [0, 1, 0, 0]")
    )
    assert relative.pick("published").spec.angle == pytest.approx(math.pi / 2)
    told = parsed(('name = "published"', 'name = "published"\nangle = "45 deg"'))
    assert told.pick("published").gains.phi_0[0] == pytest.approx(-1.0491, abs=1e-4)
    found = design(scenario, "published")[0]
    assert found.inputs["angle"] == pytest.approx(math.pi / 2)
    assert found.gains["phi_1"][0] == pytest.approx(-0.851, abs=1e-4)
