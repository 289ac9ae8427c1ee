"""Conditions on time and place, and losses, in files: what is read, and that every fault becomes one clear line."""

import tomllib

import jsonschema
import pytest

from starhold.errors import InputError
from starhold.scenario.json_schema import json_schema
from starhold.scenario.reading import parse
from starhold.scenario.values import locate
from tests.making import built
from tests.missions import GUARDED, HEADS, MONITORS, WATCHFUL, cubesat, mode
from tests.refusals import refused, replaced, rows

FAULTS = rows("""
06:30:20.2Z | 06:20:20Z | mode[1].until.not_before: found 2026-03-05T06:20:20, 580 s before
06:30:20.2Z | 07:30:00Z | not_before: found 2026-03-05T07:30:00, 3600 s after
"2026-03-05T06:30:20.2Z" | "400 s" | not_before: found 400 s; allowed: a time within
"2026-03-05T06:30:20.2Z" | "noon" | mode[1].until.not_before: found "noon"
until = { not_before = "200 s" | until = { not_before = "200 s", not_after = 150 | found a time 50 s before not_before
elevation_below = "5 deg" | elevation_below = "5 deg", elevation_above = "6 deg" | elevation_above: found 0.10471975511965978
latitude = "10 deg", | | mode[2].until.latitude: found nothing; allowed: this key, which elevation
axis = [1, 0, 0], | | mode[2].until.axis: found nothing; allowed: this key, which sun_angle_above needs
axis = [1, 0, 0] | axis = [0, 0, 0] | mode[2].until.axis: found [0.0, 0.0, 0.0]
not_before = "200 s" | not_before = "200 s", height = 5 | height: found 5.0; allowed: this key only with
epoch = "2026-03-05T06:30:00Z" | | mode[1].until.not_before: found 2026-03-05T06:30:20.200000
on_loss = "safe" | on_loss = "save" | law[1].on_loss: found "save"; did you mean safe?
on_loss = "safe" | | law[1].on_loss: found nothing; allowed: the name of the mode that monitor leads to
on_loss = "safe" | on_loss = "safe"↵wheels_lost = 0 | law[1].wheels_lost
limit = "5 s" | limit = "5 deg" | law[1].monitor[1].limit: found "5 deg"
"1 deg/s^2" | "1 deg/s" | law[1].monitor[2].limit: found "1 deg/s"; allowed: a quantity in rad/s^2
times = 20 | times = 0 | law[1].monitor[4].times
reading = "rate" | reading = "rates" | law[1].monitor[2].reading: found "rates"; did you mean rate?
reading = "rate" | reading = "rate"↵estimate = "rate" | law[1].monitor[2]: found both; allowed: one of them
reading = "rate" | reading = "rate"↵sensor = "gyros" | law[1].monitor[2].sensor: found "gyros"; did you mean gyro?
"attitude_deviation"↵ | "attitude_sigma"↵ | law[1].monitor[4].estimate: found "attitude_sigma"; did you mean attit
kind = "stuck" | kind = "range" | law[1].monitor[1].kind: found "range"; allowed: rate, stuck
kind = "stuck" | kind = "silent" | law[1].monitor[1].kind
""")


@pytest.mark.parametrize("row", FAULTS, ids=lambda row: row[2])
def test_a_fault_is_told_in_one_line(row):
    old, new, told = row
    with refused(told):
        parse(replaced(WATCHFUL, old, new), "mission.toml")


def test_modes_that_only_lead_to_each_other_are_refused():
    island = mode("a", 'until = { after = 5, to = "b" }') + mode("b", 'back = { after = 5, to = "a" }')
    text = cubesat(GUARDED.replace('on_loss = "safe"\n', "")) + mode("first", 'until = { after = 5, to = "next" }')
    text += mode("next", 'until = { after = 5, to = "first" }') + island
    with refused('mode[3]: found "a"; allowed: a mode that a condition of another one leads to'):
        parse(text, "mission.toml")


def test_the_mode_of_a_loss_needs_nothing_that_leads_to_it_or_away():
    text = cubesat(GUARDED) + mode("work") + mode("safe")
    law = built(parse(text, "mission.toml")).law
    assert (law.module.on_loss, [one.switches for one in law.module.modes]) == (1, [(), ()])
    # The last mode but that of a loss may fly to the end; one before it may not.
    with refused("law[1].mode[1].until: found nothing; allowed: a condition"):
        parse(cubesat(GUARDED) + mode("idle") + mode("work", "back = { after = 5 }") + mode("safe"), "mission.toml")


@pytest.mark.parametrize(
    ("parts", "condition", "told"),
    [
        ("", 'tracker_age_below = "2 s"', "a sensor that measures attitude_is_new, such as star-tracker"),
        (
            "",
            'attitude_deviation_below = "1 deg"',
            "an estimator that gives attitude_deviation, such as magnetometer-filter or mekf",
        ),
        (None, "sunlight_above = 0.5", "orbit.epoch: found nothing; allowed: a date, which conditions of law[1] need"),
    ],
)
def test_a_condition_that_lacks_a_part_is_told_which(parts, condition, told):
    text = cubesat(parts or "", GUARDED) + mode("work", f"until = {{ {condition} }}") + mode("safe")
    if parts is None:
        text = text[: text.index("[orbit]")] + text[text.index("[initial]") :]
    with refused(told):
        built(parse(text, "mission.toml"))


def test_numbers_of_conditions_and_monitors_change_by_their_keys():
    scenario = parse(WATCHFUL, "mission.toml")
    key = "law.mission.mode[1].until.not_before"
    assert locate(scenario, key).value == 20.2
    assert locate(scenario.with_({key: "10 s"}), key).value == 10.0
    assert locate(scenario, "law.mission.monitor[3].limit").value == pytest.approx(0.0872664626)
    assert locate(scenario, "law.mission.monitor[2].times").value == 2.0
    assert locate(scenario, "law.mission.wheels_lost").value == 1.0
    for key in ("law.mission.monitor[9].limit", "law.mission.monitor[1]", "law.mission.monitor[1].height"):
        with pytest.raises(InputError):
            locate(scenario, key)


def test_the_schema_takes_conditions_and_monitors():
    schema = jsonschema.Draft202012Validator(json_schema())
    assert schema.is_valid(tomllib.loads(WATCHFUL))
    for old, new in (
        ('kind = "stuck"', 'kind = "silent"'),
        ("axis = [1, 0, 0]", "axis = [1, 0]"),
        ("times = 20", "times = 0"),
    ):
        assert not schema.is_valid(tomllib.loads(replaced(WATCHFUL, old, new)))


def test_two_trackers_may_feed_one_filter_and_a_monitor_of_either():
    second = HEADS[HEADS.index("[[part]]", 5) : HEADS.index('[[part]]\ntype = "mekf"')]
    heads = HEADS.replace(second, second + second.replace("outage", 'name = "second"\noutage'))
    heads += 'more_trackers = [["10 arcsec", "60 arcsec", 0, -1, 0]]\n'
    text = replaced(WATCHFUL, HEADS, heads).replace(
        '"attitude"\nlimit = "5 s"', '"attitude"\nsensor = "second"\nlimit = "5 s"'
    )
    law = built(parse(text, "mission.toml")).law
    assert [one.sensor for one in law.module.monitors] == [1, 0, 0, None]
    assert MONITORS.count("reading") == 3
