"""One epoch for a whole flight: how it is written, which parts get it, and that their own tables do not have it."""

import re
from dataclasses import replace
from datetime import UTC, date, datetime, timedelta, timezone

import numpy as np
import pytest

import starhold as sh
from starhold.errors import InputError
from starhold.parts.catalogue import PACKAGES, parts
from starhold.parts.epoch import EPOCH, START, date_of
from starhold.report.settings import settings
from starhold.scenario.json_schema import json_schema, part_schemas
from starhold.scenario.reading import make_scenario, parse
from starhold.scenario.values import locate
from starhold.simulation.lane import fly
from starhold.studies.compare import build
from starhold.studio.editing import check, choices, words
from tests.refusals import refused, rows
from tests.texts import toml

NOON = (2026.0, 3.0, 20.0, 12.0, 0.0, 0.0)
CRAFT = toml("""
name = "own"
[spacecraft] inertia = [0.05, 0.065, 0.025]; torque_limit = "2 mN m"
[wheels] layout = "pyramid"; inertia = 2e-5; torque_limit = "2 mN m"; momentum_limit = "15 mN m s"
[simulation] duration = 20; control_period = 0.5
""")
ORBIT = '[orbit]\naltitude = "500 km"\ninclination = "97.4 deg"\n'
PARTS = "".join(
    f'[[part]]\ntype = "{name}"\n{numbers}\n'
    for name, numbers in {
        "residual-dipole": 'dipole = ["10 mA m^2", 0, "5 mA m^2"]',
        "solar-pressure": "plates = [[0.06, 1, 0, 0, 0.05, 0, 0.02, 0.2, 0.3]]",
        **dict.fromkeys(("magnetometer", "sun-sensor", "gyro", "gnss", "triad"), ""),
        "magnetic-unloading": "dipole_limit = 0.3\ngain = 1e-3",
        "star-tracker": "cross = 1e-5\nroll = 1e-4",
        "ground-station": 'latitude = "60 deg"\nlongitude = "20 deg"',
    }.items()
)
PD = '[[law]]\ntype = "pd"\nk_rate = 0.004\nk_attitude = 0.0008\n'
MODES = toml("""
[[law]] type = "modes"
[[law.mode]] name = "power"; type = "pd"; k_rate = 0.004; k_attitude = 0.0008; target = { type = "sun" }
until = { after = 5 }
[[law.mode]] name = "turn"; type = "pd"; k_rate = 0.004; k_attitude = 0.0008
target = { type = "slew", attitude = [0.6, 0, 0.8, 0], rate = 0.01, acceleration = 1e-4 }; until = { after = 5 }
[[law.mode]] name = "panels"; type = "pd"; k_rate = 0.004; k_attitude = 0.0008; target = { type = "yaw-steering" }
""")


def scenario(epoch="", parts=PARTS, law=PD, folder=None):
    return parse(CRAFT + ORBIT + (f"epoch = {epoch}\n" if epoch else "") + parts + law, "my.toml", *filter(None, [folder]))


def epochs(scenario):
    """The epochs of all parts that declare one, by name, targets of modes included."""
    targets = [(f"{entry.name} {n}", fitted) for entry in scenario.laws for n, fitted in enumerate(entry.targets)]
    return {
        name: value
        for name, fitted in [*((fitted.called, fitted) for fitted in scenario.parts), *targets]
        for item, value in zip(fitted.part.fields(), fitted.params, strict=True)
        if item.gain == EPOCH
    }


WRITTEN = rows("""
[2026, 3, 20, 12, 0, 0] | [2026.0, 3.0, 20.0, 12.0, 0.0, 0.0] | "2026-03-20T12:00:00Z" | "2026-03-20T12:00:00"
"2026-03-20 12:00" | "2026-03-20T14:30:00+02:30" | "20260320T120000Z"
2026-03-20T12:00:00Z | 2026-03-20T12:00:00 | 2026-03-20 07:00:00-05:00
""")


@pytest.mark.parametrize("epoch", [epoch for row in WRITTEN for epoch in row])
def test_every_part_gets_the_epoch_of_the_orbit_however_it_is_written(epoch):
    found = epochs(scenario(epoch, law=MODES))
    assert len(found) == 11
    assert set(found.values()) == {NOON}


def test_all_parts_of_starhold_that_declare_an_epoch_are_looked_at():
    named = {name for role in PACKAGES if role != "body" for name, part in parts(role).items() if not part.table}
    declaring = {name for role in PACKAGES for name, part in parts(role).items() if name in named and _declares(part)}
    assert declaring == {
        "residual-dipole", "solar-pressure", "magnetometer", "sun-sensor", "triad", "magnetic-unloading", "magnetorquers",
        "ground-station", "sun", "yaw-steering", "star-tracker", "coarse-sun-sensors", "quest", "slew",
        "magnetometer-filter", "mekf",
        "ground-strip",
    }  # fmt: skip
    assert declaring - {
        "magnetorquers",
        "sun",
        "yaw-steering",
        "coarse-sun-sensors",
        "quest",
        "slew",
        "magnetometer-filter",
        "mekf",
        "ground-strip",
    } == set(epochs(scenario()))


def _declares(part):
    return any(item.gain.shared == EPOCH.shared for item in part.fields())


def test_a_date_alone_is_its_midnight_and_fractions_of_a_second_are_kept():
    assert set(epochs(scenario("2026-03-20")).values()) == {(2026.0, 3.0, 20.0, 0.0, 0.0, 0.0)}
    assert scenario('"2026-03-20T12:00:30.25Z"').table.orbit.epoch[5] == 30.25
    assert scenario("[2026, 3, 20, 12, 0, 30.123456789]").table.orbit.epoch[5] == 30.123456789


def test_dates_of_the_standard_library_are_read_as_they_convert():
    zone = timezone(timedelta(hours=-7))
    told = datetime(2026, 12, 31, 20, 15, 1, 500_000, zone)
    utc = told.astimezone(UTC)
    assert date_of(told) == (utc.year, utc.month, utc.day, utc.hour, utc.minute, 1.5)
    assert date_of(told.isoformat()) == date_of(told)
    assert date_of(date(2026, 2, 3)) == date_of(datetime(2026, 2, 3)) == date_of([2026, 2, 3, 0, 0, 0])


def test_the_flight_is_that_of_parts_made_by_hand_with_the_epoch():
    read = scenario("2026-03-20T12:00:00Z")
    loop, other = build(read, read.laws[0]), build(scenario(), scenario().laws[0])
    assert set(epochs(scenario()).values()) == {START}
    by_hand = tuple(
        replace(fitted, params=fitted.params._replace(epoch=NOON))
        if "epoch" in getattr(fitted.params, "_fields", ())
        else fitted
        for fitted in other.parts
    )
    samples = [fly(one, 40)[0] for one in (loop, replace(other, parts=by_hand), other)]
    assert np.array_equal(samples[0], samples[1], equal_nan=True)
    assert not np.array_equal(samples[0], samples[2], equal_nan=True)


NO_DATES = rows("""
"noon" | "noon"
12:00:00 | "12:00:00"
[2026, 2, 30, 0, 0, 0] | [2026, 2, 30, 0, 0, 0]
"0001-01-01T00:00:00+01:00" | "0001-01-01T00:00:00+01:00"
{ year = 2026 } | {'year': 2026}
""")


@pytest.mark.parametrize(("epoch", "found"), NO_DATES)
def test_what_is_no_date_is_refused_in_one_line(epoch, found):
    with refused(start=f"my.toml: orbit.epoch: found {found}; allowed: "):
        scenario(epoch)


def test_an_epoch_beyond_a_model_names_the_part_and_the_epoch():
    with pytest.raises(InputError, match=r"residual-dipole: .* from 2025 to 2030, not at the epoch \[2031, 1, 2, 0, 0, 0\]"):
        sh.simulate(scenario("2031-01-02"))


@pytest.mark.parametrize(
    ("key", "text"),
    [
        ("part[3].epoch", PARTS.replace('"magnetometer"\n', '"magnetometer"\nepoch = [2026, 3, 20, 12, 0, 0]\n') + PD),
        ("law[1].mode[1].target.epoch", PARTS + MODES.replace('"sun" }', '"sun", epoch = 2026-03-20 }')),
    ],
)
def test_an_epoch_of_one_part_is_refused_with_the_place_of_the_one_for_all(key, text):
    told = "found a key that the whole flight shares; allowed: epoch in [orbit], which gives it to all parts"
    with refused(start=f"my.toml: {key}: {told}"):
        parse(CRAFT + ORBIT + text, "my.toml")


OWN = """
from typing import Annotated, NamedTuple
from starhold.parts.contract import Card
from starhold.parts.epoch import EPOCH, Date, days_of

CARD = Card("Torque of the day", "M = 1e-9 day", ("none",), ())
ROLE = "environment"
Params = NamedTuple("Params", [("begun", Annotated[Date, EPOCH])])
Numbers = NamedTuple("Numbers", [("day", float)])

def prepare(params, period):
    return Numbers(days_of(params.begun))

def torque(state, params, craft, memory):
    return (1e-9 * params.day, 0.0, 0.0)

def examples():
    return [Params((2026.0, 1.0, 1.0, 0.0, 0.0, 0.0)), Params((2027.0, 6.0, 1.0, 0.0, 0.0, 0.0))]
"""
LAW = """
from typing import Annotated, NamedTuple
from starhold.algebra.vector import scale
from starhold.laws.interface import Card, Gain
from starhold.parts.epoch import EPOCH, Date

CARD = Card("Damping of the hour", "u = -k h w", ("none",), ("rigid body",), "none", "even")
Gains = NamedTuple("Gains", [("k", Annotated[float, Gain("N m s", above=0.0)]), ("begun", Annotated[Date, EPOCH])])

def torque(measurement, gains, craft, memory):
    return scale(-gains.k * gains.begun[3], measurement.rate), memory

def examples():
    return [Gains(0.1, (2026.0, 1.0, 1.0, 3.0, 0.0, 0.0))]
"""


def test_parts_and_laws_in_files_get_it_by_their_declaration(tmp_path):
    (tmp_path / "day_torque.py").write_text(OWN)
    (tmp_path / "hour_law.py").write_text(LAW)
    both = '[[part]]\nfile = "day_torque.py"\n', '[[law]]\nfile = "hour_law.py"\nk = 0.001\n'
    read = scenario("2026-03-20T12:00:00Z", *both, folder=tmp_path)
    assert read.parts[0].params == (NOON,)
    assert read.laws[0].gains == (0.001, NOON)
    assert scenario("", *both, folder=tmp_path).parts[0].params == (START,)
    first = sh.simulate(read)
    assert first.torque.values[0, 0] == 0.0
    assert not np.array_equal(first.rate, sh.simulate(read.with_({"orbit.epoch": "2026-04-20"})).rate)
    for number, key in enumerate(("part[1].begun", "law[1].begun")):
        texts = list(both)
        texts[number] += "begun = [2026, 1, 1, 0, 0, 0]\n"
        with pytest.raises(InputError, match=r"epoch in \[orbit\]") as caught:
            scenario("", *texts, folder=tmp_path)
        assert caught.value.key == key


def test_where_a_scenario_has_no_orbit_the_part_has_the_key_itself(tmp_path):
    (tmp_path / "day_torque.py").write_text(OWN.replace('ROLE = "environment"', 'ROLE = "environment"\nBODY = ""'))
    tables = {
        "libration": {"point": "L2"},
        "initial": {"position": [0.0, 0.0, 1e-3]},
        "simulation": {"duration": 1.0, "control_period": 0.1},
        "part": [{"file": "day_torque.py", "begun": [2026, 3, 20, 12, 0, 0]}],
        "law": [{"type": "l2-optimal", "form": "best", "radius": 1.0}],
    }
    assert make_scenario({"name": "own"} | tables, tmp_path).parts[0].params == (NOON,)


def test_with_changes_it_for_all_and_writes_what_reads_back():
    read = scenario("2026-03-20T12:00:00Z", law=MODES)
    day = [2027, 1, 2, 3, 4, 5]
    for value in (day, "2027-01-02T03:04:05Z", datetime(*day), np.array(day)):
        other = read.with_({"orbit.epoch": value})
        assert set(epochs(other).values()) == {(2027.0, 1.0, 2.0, 3.0, 4.0, 5.0)}
        assert epochs(parse(other.text, "again")) == epochs(other)
    # What a file writes as a date of TOML is kept where another key changes.
    assert epochs(read.with_({"orbit.raan": 0.1})) == epochs(read)
    assert set(epochs(read.with_({"orbit.epoch": None})).values()) == {START}
    with pytest.raises(InputError, match=r"part\[3\].epoch: found a key that the whole flight shares"):
        read.with_({"part.magnetometer.epoch": "2027-01-01"})
    tables = {"name": "own", "spacecraft": {"inertia": [2, 3, 4]}, "simulation": {"duration": 10}}
    orbit = {"altitude": 5e5, "inclination": 1.0, "epoch": datetime(2026, 3, 20, 12, tzinfo=UTC)}
    law = {"type": "pd", "k_rate": 0.2, "k_attitude": 0.03}
    made = make_scenario(tables | {"orbit": orbit, "part": [{"type": "sun"}], "law": [law]})
    assert set(epochs(made).values()) == set(epochs(parse(made.text, "again")).values()) == {NOON}


@pytest.mark.slow
def test_a_campaign_chooses_among_dates_and_draws_no_others():
    read = scenario("2026-03-20")
    assert locate(read, "orbit.epoch").value == (2026.0, 3.0, 20.0, 0.0, 0.0, 0.0)
    over = {"orbit.epoch": {"distribution": "choice", "values": ["2026-03-20T12:00:00Z", [2026, 6, 21, 0, 0, 0]]}}
    normal, noon = {"distribution": "normal", "sigma": 1}, {"distribution": "choice", "values": ["noon", "2026-01-01"]}
    for key, bad, told in (
        ("orbit.epoch", normal, 'distribution: found "normal"; allowed: choice, because the key holds a date'),
        ("orbit.epoch", noon, 'values[1]: found "noon"; allowed: a date as'),
        ("part.sun-sensor.epoch", over["orbit.epoch"], "epoch in [orbit], which gives it to all parts"),
    ):
        with refused(key, told):
            sh.campaign(read, runs=4, over={key: bad})
    # The first five of these runs have the same date: the sixth flies under its own all the same.
    found = sh.campaign(read, runs=6, over=over, search=False)
    months = found.frame()["orbit.epoch[2]"]
    assert set(months[:5]) == {6.0}
    assert months[5] == 3.0
    assert [found.again(run).differs for run in (0, 5)] == [()] * 2


def test_schemas_and_the_studio_know_the_one_place():
    told = words()
    assert "epoch" in told["tables"]["orbit"]
    assert all("epoch" not in keys for keys in told["part"].values())
    assert "epoch" not in str([one["properties"].keys() for one in part_schemas("rigid-body", ("orbit.epoch",))])
    orbits = [item for name, item in json_schema()["$defs"].items() if name == "Orbit"]
    assert [kind["type"] for kind in orbits[0]["properties"]["epoch"]["anyOf"]] == ["string", "array"]
    tables = {part["name"]: part["table"] for part in choices()["parts"]}
    assert "epoch" not in "".join(tables.values())
    text = CRAFT + ORBIT + tables["magnetometer"] + PD
    assert "error" not in check(text, "my.toml", ".")
    assert check(text.replace('"magnetometer"', '"magnetometer"\nepoch = 5'), "my.toml", ".")["key"] == "part[1].epoch"


def _epochs_told(scenario):
    """The rows of the page's settings that hold an epoch, each with its table."""
    page = settings(scenario)
    return re.findall(r"<h3>([^<]*)</h3>(?:(?!</section>).)*<td>epoch</td><td>([^<]*)</td>", page, re.DOTALL)


def test_the_page_tells_the_epoch_once_and_where_it_is_the_default():
    assert _epochs_told(scenario("2026-03-20T12:00:00Z")) == [("orbit", "2026-03-20T12:00:00+00:00")]
    assert _epochs_told(scenario()) == [("orbit", "[2026, 1, 1, 0, 0, 0], by default")]
    assert _epochs_told(scenario(parts="", law=MODES)) == [("orbit", "[2026, 1, 1, 0, 0, 0], by default")]
    assert _epochs_told(scenario(parts="")) == []
    # In free space there is no table to tell it.
    free = parse(f'{CRAFT}[[part]]\ntype = "sun"\n{PD}', "my.toml")
    assert _epochs_told(free) == [("target sun", "[2026, 1, 1, 0, 0, 0]")]
