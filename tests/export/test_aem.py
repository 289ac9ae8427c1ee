"""Attitude ephemeris messages: written for a library of others, read from it, flown to."""

import erfa
import numpy as np
import pytest
import xarray as xr
from ccsds_ndm.mapping import NDMFileFormats
from ccsds_ndm.ndm_io import NdmIo
from scipy.spatial.transform import Rotation

import starhold as sh
from starhold.export.aem import parse_aem
from starhold.parts.epoch import days_of, precession
from tests.running import starhold

TIMES = np.array([0.0, 0.1, 2.5, 86400.25])
ATTITUDES = Rotation.random(4, random_state=1).as_quat(scalar_first=True)
ABOUT = {"epoch": "2026-12-31T23:59:59.5", "object_name": "CUBE SAT", "object_id": "2026-001A"}
TEXT = """CCSDS_AEM_VERS = 1.0
CREATION_DATE = 2026-01-01T00:00:00
ORIGINATOR = TEST
META_START
COMMENT a quarter turn about the third axis
OBJECT_NAME = CUBE SAT
OBJECT_ID = 2026-001A
REF_FRAME_A = EME2000
REF_FRAME_B = SC_BODY_1
ATTITUDE_DIR = A2B
TIME_SYSTEM = UTC
START_TIME = 2026-059T23:59:59
STOP_TIME = 2026-03-01T00:00:01
ATTITUDE_TYPE = QUATERNION
QUATERNION_TYPE = LAST
META_STOP
DATA_START
2026-059T23:59:59 0 0 0 1
2026-03-01T00:00:01.25 0 0 0.7071067811865476 0.7071067811865476
DATA_STOP
"""
START = "2026-059T23:59:59"


def written(tmp_path, version):
    run = xr.Dataset({"attitude": (("time", "quaternion"), ATTITUDES)}, {"time": TIMES})
    return sh.export_aem(run, tmp_path / "run.aem", version=version, **ABOUT)


@pytest.mark.parametrize("version", ["1.0", "2.0"])
def test_what_is_written_is_read_again(version, tmp_path):
    told = parse_aem(written(tmp_path, version))
    np.testing.assert_array_equal(told.attitudes, ATTITUDES)
    np.testing.assert_array_equal(told.times, TIMES)
    assert told[2:] == ("2026-12-31T23:59:59.5", "CUBE SAT", "EME2000", "UTC")


def test_a_library_of_others_reads_what_is_written(tmp_path):
    (segment,) = NdmIo().from_path(written(tmp_path, "1.0")).body.segment
    about, states = segment.metadata, [state.quaternion_state for state in segment.data.attitude_state]
    assert (about.ref_frame_a, about.ref_frame_b, about.attitude_dir.value) == ("EME2000", "SC_BODY_1", "A2B")
    assert [state.epoch for state in states][1:3] == ["2026-12-31T23:59:59.6", "2027-01-01T00:00:02"]
    found = [[float(getattr(state.quaternion, name)) for name in ("qc", "q1", "q2", "q3")] for state in states]
    np.testing.assert_allclose(found, ATTITUDES, rtol=0, atol=1e-15)


def test_precession_is_that_of_erfa():
    for days in np.linspace(-18000.0, 36000.0, 20):
        seen = Rotation.from_quat(precession(days), scalar_first=True).inv().as_matrix()
        np.testing.assert_allclose(seen, erfa.bp06(2451545.0, days)[1], rtol=0, atol=1e-11)


def test_axes_of_date_are_turned_into_those_that_are_named(tmp_path):
    """A body that holds its first axis on the Sun sees it where ERFA has it in the frame of the message."""
    scenario = sh.load("three-laws").with_({"simulation.duration": 2.0, "orbit.epoch": "2027-03-20T12:00:00Z"})
    run = sh.simulate(scenario, "lyapunov")
    sun, _ = erfa.epv00(2451545.0, days_of((2027.0, 3.0, 20.0, 12.0, 0.0, 0.0)))
    toward = -sun["p"] / np.linalg.norm(sun["p"])
    to_date = erfa.bp06(2451545.0, days_of((2027.0, 3.0, 20.0, 12.0, 0.0, 0.0)))[1]
    own = Rotation.from_quat(run["attitude"].to_numpy()[0], scalar_first=True).inv().apply(to_date @ toward)
    for frame, seen in (("EME2000", toward), ("MOD_EARTH", to_date @ toward)):
        sh.export_aem(run, tmp_path / "run.aem", frame=frame)
        told = parse_aem(tmp_path / "run.aem")
        assert told.frame == frame
        found = Rotation.from_quat(told.attitudes[0], scalar_first=True).inv().apply(seen)
        np.testing.assert_allclose(found, own, rtol=0, atol=1e-11)
        # And back, as a target.
        changed = {"target": {"mode": "history", "file": str(tmp_path / "run.aem")}, "simulation.duration": 1.0}
        again = sh.simulate(scenario.with_(changed), "lyapunov")
        offset = Rotation.from_quat(again["attitude_error"].to_numpy()[0], scalar_first=True)
        goal = Rotation.from_quat(again["attitude"].to_numpy()[0], scalar_first=True) * offset.inv()
        assert (goal.inv() * Rotation.from_quat(run["attitude"].to_numpy()[0], scalar_first=True)).magnitude() < 1e-9


def test_axes_that_nothing_ties_to_a_date_are_left_alone(tmp_path):
    nowhere = {"orbit": None, "environment.gravity_gradient": False}
    mars = {"orbit.gravitational_parameter": "42828.37 km^3/s^2", "orbit.epoch": "2027-03-20"}
    for about in ({}, nowhere, mars):
        run = sh.simulate(sh.load("three-laws").with_({"simulation.duration": 2.0} | about), "lyapunov")
        sh.export_aem(run, tmp_path / "run.aem")
        np.testing.assert_array_equal(parse_aem(tmp_path / "run.aem").attitudes, run["attitude"].to_numpy())


def test_what_a_library_of_others_writes_is_read(tmp_path):
    message = NdmIo().from_path(written(tmp_path, "1.0"))
    path = tmp_path / "other.aem"
    path.write_text(NdmIo().to_string(message, NDMFileFormats.KVN))
    told = parse_aem(path)
    np.testing.assert_allclose(told.attitudes, ATTITUDES, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(told.times, TIMES)


def quarter(text, tmp_path):
    path = tmp_path / "turn.aem"
    path.write_text(text)
    return parse_aem(path)


@pytest.mark.parametrize(
    ("edits", "turned"),
    [
        ({}, 1),
        ({"= A2B": "= B2A"}, -1),
        ({"A = EME2000": "A = SC_BODY_1", "B = SC_BODY_1": "B = EME2000"}, -1),
        ({"A = EME2000": "A = SC_BODY_1", "B = SC_BODY_1": "B = EME2000", "= A2B": "= B2A"}, 1),
    ],
)
def test_the_quaternion_turns_the_frame_to_the_body(edits, turned, tmp_path):
    text = TEXT
    for old, new in edits.items():
        text = text.replace(old, new)
    told = quarter(text, tmp_path)
    # The first axis of the frame, seen from a body that has turned by a quarter about the third axis, lies at -y.
    seen = Rotation.from_quat(told.attitudes[1], scalar_first=True).inv().apply([1.0, 0.0, 0.0])
    np.testing.assert_allclose(seen, [0.0, -float(turned), 0.0], atol=1e-15)
    assert told.times.tolist() == [0.0, 2.25]
    assert told.frame == "EME2000"


def test_a_scalar_that_comes_first_is_read_as_such(tmp_path):
    first = TEXT.replace("= LAST", "= FIRST").replace("0 0 0 1", "1 0 0 0")
    first = first.replace("0 0 0.7071067811865476 0.7071067811865476", "0.7071067811865476 0 0 0.7071067811865476")
    np.testing.assert_array_equal(quarter(first, tmp_path).attitudes, quarter(TEXT, tmp_path).attitudes)


BROKEN = {
    "CCSDS_AEM_VERS = 3.0": ("VERS = 1.0", "VERS = 3.0"),
    "in place of CCSDS_AEM_VERS": ("CCSDS_AEM_VERS", "CCSDS_OEM_VERS"),
    "no META_START": ("META_START", "META"),
    "no DATA_STOP": ("DATA_STOP", ""),
    "no ATTITUDE_TYPE": ("ATTITUDE_TYPE = QUATERNION\n", ""),
    "ATTITUDE_TYPE = SPIN": ("TYPE = QUATERNION\n", "TYPE = SPIN\n"),
    "frames EME2000 and ICRF": ("SC_BODY_1", "ICRF"),
    "line 18: 5 numbers": ("0 0 0 1", "0 0 0 1 0"),
    "line 18: a quaternion of length 2": ("0 0 0 1", "0 0 0 2"),
    "line 18: a quaternion of length nan": ("0 0 0 1", "0 0 0 nan"),
    "line 18: could not convert": ("0 0 0 1", "0 0 0 x"),
    "in place of an epoch": (f"{START} 0", "yesterday 0"),
    "which is no time of a day": (f"{START} 0", "2026-400T00:00:00 0"),
    "the epoch 2026-03-01T00:00:01.25 after": (f"{START} 0", "2027-01-01T00:00:00 0"),
    "a second segment": ("DATA_STOP", "DATA_STOP\nMETA_START"),
    "1 attitudes": (f"{START} 0 0 0 1\n", ""),
}


@pytest.mark.parametrize("told", BROKEN)
def test_what_is_wrong_with_a_message_is_told(told, tmp_path):
    path = tmp_path / "bad.aem"
    assert BROKEN[told][0] in TEXT
    path.write_text(TEXT.replace(*BROKEN[told]))
    with pytest.raises(sh.InputError, match=told):
        sh.read_aem(path)
    with pytest.raises(sh.InputError, match="No such file"):
        sh.read_aem(tmp_path / "none.aem")


def test_the_command_writes_a_message(tmp_path):
    sh.simulate(sh.load("three-laws").with_({"simulation.duration": 2.0})).to_netcdf(tmp_path / "run.nc", engine="h5netcdf")
    starhold("export", "aem", ".", "-o", "run.aem", "--object", "CUBE", cwd=tmp_path, code=0)
    assert sh.read_aem(tmp_path / "run.aem").object_name == "CUBE"
    bad = starhold("export", "aem", "run.nc", "-o", "run.aem", cwd=tmp_path)
    assert (bad.returncode, bad.stderr.count("\n")) == (2, 1)
    assert "a file already there" in bad.stderr
    for words, told in {
        ("nowhere.nc", "x.aem"): "a run.nc, or the folder of one",
        ("run.nc", "no/x.aem"): "cannot be written",
        ("run.nc", "x.aem", ("epoch", "noon")): "'noon' in place of an epoch",
        ("run.nc", "x.aem", ("version", "7")): "neither 1.0 nor 2.0",
        ("run.nc", "x.aem", ("object_name", "a\nb")): "no line of printable ASCII",
    }.items():
        run, file, *options = words
        with pytest.raises(sh.InputError, match=told):
            sh.export_aem(tmp_path / run, tmp_path / file, **dict(options))


def test_a_message_begins_at_the_epoch_of_the_orbit(tmp_path):
    scenario = sh.load("three-laws").with_({"simulation.duration": 2.0})
    dated = scenario.with_({"orbit.epoch": "2026-12-31T23:59:59.5Z"})
    sh.simulate(dated, "lyapunov").to_netcdf(tmp_path / "run.nc", engine="h5netcdf")
    for run, words, epoch in (
        (sh.simulate(dated, "lyapunov"), {}, "2026-12-31T23:59:59.5"),
        (tmp_path / "run.nc", {}, "2026-12-31T23:59:59.5"),
        (tmp_path / "run.nc", {"epoch": "2027-03-04T00:00:00"}, "2027-03-04T00:00:00"),
        (sh.simulate(scenario, "lyapunov"), {}, "2000-01-01T12:00:00"),
    ):
        sh.export_aem(run, tmp_path / "run.aem", **words)
        assert sh.read_aem(tmp_path / "run.aem").epoch == epoch
