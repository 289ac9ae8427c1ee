"""What keys hold, and what numbers with units mean there."""

import re
import tomllib

import jsonschema
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from starhold.campaign.dispersions import read_dispersions
from starhold.scenario.json_schema import json_schema
from starhold.scenario.reading import load, parse
from starhold.scenario.values import _filled, accepted, locate, width_at
from starhold.scenario.writing import template_text
from tests.refusals import refused
from tests.tiers import leading

NOISE = load("three-laws-noise")
WHEELS = load("wheels-orbital")
SLEW = load("cubesat-slew")
CIRCLE = load("l2-circle")
FULL = [[2.0, 0.1, 0.0], [0.1, 3.0, 0.0], [0.0, 0.0, 4.0]]


def value_at(scenario, key):
    return locate(scenario, key).value


def number_at(scenario, key, raw, name=""):
    place = locate(scenario, key)
    return accepted(scenario, place, _filled(place, raw, place.shape, name), name)


def test_values_are_those_of_the_validated_tables():
    held = {
        "spacecraft.inertia": (2.0, 3.0, 4.0),
        "spacecraft.inertia[2]": 3.0,
        "spacecraft.torque_limit": 0.01,
        "spacecraft.limit": "axis",
        "environment.gravity_gradient": True,
        "initial.rate": (0.04, 0.03, 0.02),
        "law.lyapunov.k_rate": 0.09,
        "law[1].k_rate": 0.09,
        "law.mpc.horizon": 10,
        "law.lyapunov.quaternion_sign": "as_published",
        "orbit.altitude": None,
        "spacecraft.actuator_lag": 0.0,
    }
    assert {key: value_at(NOISE, key) for key in held} == held
    assert value_at(WHEELS, "law.wheel.torque") == WHEELS.laws[0].spec.torque == 0.02
    assert value_at(CIRCLE, "control.margin") == 0.1


def test_values_of_numbered_tables_and_parts():
    fault = {"time": "1 min", "inertia": [5, 5, 5], "delay": "2 s"}
    gyro = {"type": "gyro", "bias": ["1 deg/s", 0, 0], "scale_error": "1 %"}
    made = NOISE.with_({"fault": [fault], "part": [gyro]})
    assert value_at(made, "fault[1].time") == 60.0
    assert value_at(made, "part.gyro.bias") == (np.deg2rad(1.0), 0.0, 0.0)
    assert value_at(made, "part[1].scale_error") == 0.01


def test_a_matrix_is_its_diagonal_where_the_file_has_no_more():
    assert value_at(NOISE.with_({"spacecraft.inertia": FULL}), "spacecraft.inertia") == tuple(map(tuple, FULL))
    diagonal = [[2.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 4.0]]
    assert np.shape(value_at(NOISE.with_({"spacecraft.inertia": diagonal}), "spacecraft.inertia")) == (3, 3)
    weights = {"type": "lqr", "form": "numeric", "q": [1, 1, 1, 2, 2, 2], "r": 50}
    law = NOISE.with_({"law": [weights]})
    assert value_at(law, "law.lqr.q") == (1.0, 1.0, 1.0, 2.0, 2.0, 2.0)
    assert value_at(law, "law.lqr.r") == (50.0, 50.0, 50.0)


def test_numbers_mean_what_the_file_would():
    assert number_at(NOISE, "initial.rate", ["1 deg/s", 0, "2 deg/s"]) == (np.deg2rad(1.0), 0.0, np.deg2rad(2.0))
    assert number_at(NOISE, "initial.rate", 0.1) == (0.1, 0.1, 0.1)
    assert number_at(NOISE, "initial.rate[3]", "1 deg/s") == np.deg2rad(1.0)
    assert number_at(NOISE, "spacecraft.torque_limit", "2 mN m") == 0.002
    # Scaled by the unit of length, as the file's own tables are.
    assert number_at(CIRCLE, "initial.position", "12742 km") == pytest.approx((1.0, 1.0, 1.0), rel=1e-12)
    assert number_at(SLEW, "initial.attitude", [0, 1, 0, 0]) == (0.0, 1.0, 0.0, 0.0)


def test_widths_need_not_be_values():
    place = locate(NOISE, "spacecraft.torque_limit")
    assert width_at(place, "-1 mN m", "sigma") == -0.001
    assert width_at(place, "5 %", "sigma", "1") == 0.05
    assert width_at(locate(CIRCLE, "initial.position"), "12742 km", "sigma") == pytest.approx(np.ones(3), rel=1e-12)


@pytest.mark.parametrize("key", ["spacecraft.torque_limit", "law.lyapunov.k_rate", "fault[1].time", "part.gyro.noise"])
@given(value=st.floats(1e-3, 0.1))
def test_a_changed_value_is_read_back_exactly(key, value):
    scenario = NOISE.with_({"fault": [{"time": 1, "inertia": [5, 5, 5]}], "part": [{"type": "gyro"}]})
    assert value_at(scenario.with_({key: value}), key) == value


REFUSED = {
    "spacecraf.inertia": "spacecraft?",
    "spacecraft.inertai": "inertia?",
    "spacecraft": "whole table",
    "law.lyapunov": "whole table",
    "law": "whole table",
    "fault": "whole table",
    "fault.time": "fault[1].KEY",
    "fault[1].time": "[[fault]]",
    "law.pid.k_rate": "mpc",
    "law.lyapunov.type": "determines the kind of a table",
    "simulation.duration": "all runs share",
    "transient.rate": "no [transient] table",
    "initial.rate[4]": "1 to 3",
    "sensor.rate_noise[1]": "not a vector",
    "spacecraft.inertia.x": "index",
    "a..b": "not a key",
    "": "not a key",
}


@pytest.mark.parametrize("key", REFUSED)
def test_a_key_that_leads_nowhere_is_told_in_one_line(key):
    with refused(f'campaign.over."{key}"', REFUSED[key]):
        value_at(NOISE, key)


@pytest.mark.parametrize(
    ("key", "raw", "said"),
    [
        ("initial.rate", [1, 2], "3 numbers"),
        ("initial.rate", "1 m", "a quantity in rad/s"),
        ("spacecraft.torque_limit", -1, "above 0"),
        ("spacecraft.torque_limit", [1, 2], "one value"),
        ("spacecraft.limit", "norn", "'norm'"),
        ("law.mpc.horizon", 2.5, "whole number"),
        ("spacecraft.inertia", [1, 1, 9], "largest exceeds the sum"),
        ("orbit.position", [1, 0, 0], "above the Earth's radius"),
    ],
)
def test_a_number_that_the_key_refuses_is_told_in_one_line(key, raw, said):
    with refused(f'campaign.over."{key}".low: found ', said):
        number_at(NOISE, key, raw, "low")


@pytest.mark.parametrize("body", leading(["rigid-body", "libration-point"]))
def test_the_commented_campaign_of_a_template_is_one(body):
    text = template_text(body)
    table = re.search(r"^# \[campaign\].*?\n\n", text, flags=re.DOTALL | re.MULTILINE)
    assert table is not None
    there = re.sub("^# ", "", table[0], flags=re.MULTILINE)
    scenario = parse(text.replace(table[0], there), "new.toml")
    (found,) = read_dispersions(scenario, scenario.table.campaign.over)
    assert found.dims == 3
    check = jsonschema.Draft202012Validator(json_schema())
    assert not list(check.iter_errors(tomllib.loads(scenario.text)))
    assert list(check.iter_errors(tomllib.loads(scenario.text.replace("sampling =", "sampler ="))))
