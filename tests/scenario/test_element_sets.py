"""Orbits from two lines and messages: SGP4's published vectors, in axes that ERFA agrees with; bad files in one line."""

import json
import pickle
import re
from importlib import resources

import erfa
import numpy as np
import pytest

import starhold as sh
from starhold.parts.epoch import days_of
from starhold.scenario.element_sets import ElementSet, with_orbit
from starhold.scenario.writing import toml_text
from tests.refusals import refused
from tests.running import starhold

pytest.importorskip("sgp4")
PACKAGE = resources.files("sgp4")
LINES = [line[:69] for line in (PACKAGE / "SGP4-VER.TLE").read_text().splitlines() if line[:2] in ("1 ", "2 ")]
ISS = (
    "1 25544U 98067A   08264.51782528 -.00002182  00000-0 -11606-4 0  2927",
    "2 25544  51.6416 247.4627 0006703 130.5360 325.0288 15.72125391563537",
)
KEPT = ("00005", "06251", "28057", "08195", "28626")
"""Low, decaying, polar, Molniya and geostationary."""
TABLES = {
    "name": "own",
    "spacecraft": {"inertia": [2.0, 3.0, 4.0]},
    "simulation": {"duration": 5400.0, "control_period": 1.0},
    "settling": {"attitude_tolerance": "1 deg", "rate_tolerance": "0.1 deg/s"},
    "law": [{"type": "pd", "k_rate": 0.1, "k_attitude": 0.01}],
}


def published():
    """Of each satellite its lines, and rows of minutes, position (km) and velocity (km/s) as Vallado et al. printed them."""
    found, name = {}, ""
    for row in (PACKAGE / "tcppver.out").read_text().splitlines():
        if row.strip().endswith("xx"):
            name = f"{int(row.split()[0]):05d}"
            found[name] = []
        elif name:
            found[name].append([float(x) for x in row.split()[:7]])
    pairs = {first[2:7].replace(" ", "0"): (first, second) for first, second in zip(LINES[::2], LINES[1::2], strict=True)}
    return {name: (pairs[name], np.array(found[name])) for name in KEPT}


@pytest.mark.parametrize("name", KEPT)
def test_states_are_those_published_turned_by_erfa(name):
    lines, rows = published()[name]
    elements = ElementSet("own.tle", lines)
    begin = elements.epoch
    # From true to mean axes, and from the mean equinox to the true one.
    at = (2451545.0, days_of(begin))
    turn = erfa.nutm80(*at).T @ erfa.rz(-erfa.eqeq94(*at), np.eye(3))
    for minutes, *numbers in rows[:12]:
        position, velocity = elements.state(begin, 60.0 * minutes)
        expected = turn @ np.array(numbers[:3]), turn @ np.array(numbers[3:])
        # Epochs are told to a microsecond; 0.2" are a millionth of the distance.
        assert np.abs(np.array(position) / 1e3 - expected[0]).max() < 1e-6 * np.linalg.norm(expected[0]) + 1e-5
        assert np.abs(np.array(velocity) / 1e3 - expected[1]).max() < 1e-6 * np.linalg.norm(expected[1]) + 1e-7


def written(folder, text, name="own.tle"):
    (folder / name).write_text(text)
    return {"omm" if "omm" in name else "tle": name}


def test_a_flight_begins_where_sgp4_says_and_the_difference_is_said(tmp_path):
    orbit = written(tmp_path, "\n".join(("ISS (ZARYA)", *ISS)))
    with pytest.warns(UserWarning, match=r"orbit.tle: .* departs by 49\.2 km from SGP4's orbit in 5400 s; a part such"):
        scenario = sh.scenario(TABLES | {"orbit": orbit}, folder=tmp_path)
    table, elements = scenario.table.orbit, ElementSet("own.tle", ISS)
    assert table.start == elements.state(elements.epoch)
    assert table.epoch == elements.epoch
    assert 'tle = "own.tle"' in scenario.text
    with pytest.warns(UserWarning, match="orbit.tle"):
        later = scenario.with_({"orbit.epoch": "2008-09-21T00:00:00Z"})
    assert later.table.orbit.start == elements.state((2008.0, 9.0, 21.0, 0.0, 0.0, 0.0))
    assert pickle.loads(pickle.dumps(table)).tle.satellite().satnum == 25544
    with pytest.warns(UserWarning, match="orbit.tle") as said:
        sh.scenario(TABLES | {"orbit": orbit | {"epoch": "2009-01-01T00:00:00Z"}}, folder=tmp_path)
    assert any(
        re.search(r"the elements are of \[2008, 9, 20, .*, 102 days from the epoch", str(one.message)) for one in said
    )


def test_a_command_says_the_distance_once_and_of_the_motion_that_flies(tmp_path):
    """It knows a nominal model, and reads the scenario again for its page."""
    tables = TABLES | {"orbit": written(tmp_path, "\n".join(ISS)), "part": [{"type": "oblateness"}]}
    tables |= {"nominal": {"spacecraft": {"inertia": [2.0, 3.0, 4.1]}}}
    (tmp_path / "own.toml").write_text(toml_text(tables))
    done = starhold("run", "own.toml", "--pictures", "page", cwd=tmp_path, code=0)
    (line,) = [line for line in done.stderr.splitlines() if "SGP4" in line]
    assert re.search(
        r"two-body motion with oblateness from this state departs by 0?\.?\d* km from SGP4's orbit in 5400 s$", line
    )


def test_messages_of_every_form_give_the_same_state(tmp_path):
    for kind in ("csv", "xml"):
        written(tmp_path, (PACKAGE / f"sample_omm.{kind}").read_text(), f"own.omm.{kind}")
    states = [with_orbit({"orbit": {"omm": f"own.omm.{kind}"}}, tmp_path, "here")["orbit"] for kind in ("csv", "xml")]
    fields = dict(states[0]["omm"].fields)
    lines = "\n".join(f"{name} = {value}" + " [deg]" * (name == "INCLINATION") for name, value in fields.items())
    for text, name in ((json.dumps([fields]), "own.omm.json"), (lines, "own.omm")):
        states.append(with_orbit({"orbit": written(tmp_path, text, name)}, tmp_path, "here")["orbit"])
    assert len({tuple(state["position"]) for state in states}) == 1


BAD = {
    "checksum": ((ISS[0][:-1] + "9", ISS[1]), r"line 1 ends with the checksum 9, but its digits add up to 7"),
    "short": ((ISS[0], ISS[1][:-3]), r"line 2 has 66 characters, not 69"),
    "one line": ((ISS[0],), r"1 lines that begin with 1 or 2, of 1"),
    "two satellites": ((*ISS, *ISS), r"4 lines that begin"),
    "mixed": ((ISS[0], LINES[1]), r"lines of two satellites, 25544 and 00005"),
    "words": (("no elements",), r"0 lines that begin with 1 or 2"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_lines_are_refused_in_one_line(name, tmp_path):
    lines, reason = BAD[name]
    with refused(match=rf"orbit\.tle: found .*own\.tle: {reason}.*; allowed: a text file of one"):
        sh.scenario(TABLES | {"orbit": written(tmp_path, "\n".join(lines))}, folder=tmp_path)


@pytest.mark.parametrize(
    ("orbit", "reason"),
    [
        ({"tle": "none.tle"}, r"orbit\.tle: found .*none\.tle: No such file"),
        ({"tle": 5}, r"orbit\.tle: found 5; allowed: the name of"),
        (
            {"tle": "own.tle", "altitude": "500 km"},
            r"orbit\.altitude: found a key beside tle; allowed: tle alone, or with epoch",
        ),
        ({"tle": "own.tle", "epoch": "tomorrow"}, r"orbit\.epoch: found .*a date"),
        ({"omm": "own.tle"}, r"orbit\.omm: found .*own\.tle: no CLASSIFICATION_TYPE"),
        ({"omm": "own.json"}, r"orbit\.omm: found .*own\.json: "),
    ],
)
def test_bad_tables_are_refused_in_one_line(orbit, reason, tmp_path):
    written(tmp_path, "\n".join(ISS))
    (tmp_path / "own.json").write_text("[{]")
    with refused(match=reason):
        sh.scenario(TABLES | {"orbit": orbit}, folder=tmp_path)


def test_a_decayed_satellite_has_no_orbit(tmp_path):
    orbit = written(tmp_path, "\n".join(published()["06251"][0]))
    with pytest.raises(sh.InputError, match=r"orbit\.epoch: found .*SGP4 has no orbit: "):
        sh.scenario(TABLES | {"orbit": orbit | {"epoch": "2020-06-01T00:00:00Z"}}, folder=tmp_path)
