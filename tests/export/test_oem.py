"""Orbit ephemeris messages: written for a library of others, read from it, flown from; and what is refused."""

import erfa
import numpy as np
import pytest
from ccsds_ndm.mapping import NDMFileFormats
from ccsds_ndm.ndm_io import NdmIo

import starhold as sh
from starhold.parts.epoch import days_of
from starhold.scenario.element_sets import READERS
from tests.making import orbited
from tests.refusals import refused, replaced
from tests.running import starhold
from tests.texts import toml

TEXT = toml("""
name = "own"
[spacecraft] inertia = [2.0, 3.0, 4.0]
[orbit] altitude = "500 km"; inclination = "97 deg"; epoch = "2027-03-20T12:00:00Z"
[simulation] duration = 1200.0; control_period = 5; record_every = 12
[[law]] type = "pd"; k_rate = 0.1; k_attitude = 0.01
""")
ORBIT = """altitude = "500 km"
inclination = "97 deg"
epoch = "2027-03-20T12:00:00Z"
"""
parse = READERS["oem"]


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    path = tmp_path_factory.mktemp("flown") / "own.toml"
    path.write_text(TEXT)
    return sh.simulate(sh.load(path))


def flies(folder, message, orbit='oem = "own.oem"\n'):
    (folder / "own.oem").write_text(message)
    (folder / "own.toml").write_text(TEXT.replace(ORBIT, orbit))
    return sh.load(folder / "own.toml")


def test_a_library_of_others_reads_what_is_written_in_axes_of_erfa(run, tmp_path):
    sh.export_oem(run, tmp_path / "own.oem", object_id="2026-001A")
    (segment,) = NdmIo().from_path(tmp_path / "own.oem").body.segment
    about, vectors = segment.metadata, segment.data.state_vector
    assert (about.center_name, about.ref_frame, about.time_system) == ("EARTH", "EME2000", "UTC")
    assert [one.epoch for one in vectors][:2] == ["2027-03-20T12:00:00", "2027-03-20T12:01:00"]
    found = np.array([[float(getattr(one, name).value) for name in ("x", "y", "z")] for one in vectors])
    turn = erfa.pmat06(2451545.0, days_of((2027.0, 3.0, 20.0, 12.0, 0.0, 0.0))) @ np.linalg.inv(erfa.bp06(2451545.0, 0.0)[0])
    assert np.abs(1e3 * found @ turn.T - run["position"].to_numpy()).max() < 1e-2
    # And back, through that library's own writing.
    again = NdmIo().to_string(NdmIo().from_path(tmp_path / "own.oem"), NDMFileFormats.KVN)
    (tmp_path / "other.oem").write_text(again)
    told = sh.read_oem(tmp_path / "other.oem")
    assert np.abs(told.states[:, :3] - 1e3 * found).max() < 1e-6
    np.testing.assert_array_equal(told.times, run["time"].to_numpy())


def test_a_round_trip_keeps_all_digits(run, tmp_path):
    run.to_netcdf(tmp_path / "run.nc", engine="h5netcdf")
    starhold("export", "oem", tmp_path, "-o", "own.oem", "--frame", "MOD_EARTH", cwd=tmp_path, code=0)
    starhold("export", "oem", tmp_path, "-o", "own.oem", cwd=tmp_path, code=2)
    told = sh.read_oem(tmp_path / "own.oem")
    both = np.concatenate([run["position"].to_numpy(), run["velocity"].to_numpy()], axis=1)
    np.testing.assert_allclose(told.states, both, rtol=3e-16)
    assert (told.epoch, told.frame, told.center) == ("2027-03-20T12:00:00", "MOD_EARTH", "EARTH")


def test_a_flight_begins_between_the_states_and_says_how_far_it_comes(run, tmp_path):
    sh.export_oem(run, tmp_path / "own.oem")
    message = (tmp_path / "own.oem").read_text()
    orbit = 'oem = "own.oem"\nepoch = "2027-03-20T12:03:25Z"\n'
    with pytest.warns(
        UserWarning, match=r"two-body motion from this state departs by .* km from the ephemeris in 995 s, where"
    ):
        scenario = flies(tmp_path, message, orbit)

    begun = [run[name].to_numpy()[0] for name in ("position", "velocity")]
    there = orbited(*begun, [0.0, 205.0])[-1]
    # The axes of date turn by a centimetre in 205 s.
    assert np.abs(np.concatenate(scenario.table.orbit.start) - there)[:3].max() < 2e-2
    with pytest.warns(UserWarning, match="orbit.oem") as said:
        again = flies(tmp_path, message, orbit + '[[part]]\ntype = "oblateness"\n')
    assert len([one for one in said if "oblateness from this state departs by" in str(one.message)]) == 1
    both = sh.simulate(again)
    assert "from the ephemeris" in str(said[0].message)
    far = float(str(said[0].message).split(" departs by ")[1].split()[0])
    times = both["time"].to_numpy()
    inside = times <= 995.0
    old = orbited(*begun, times[inside] + 205.0)[:, :3]
    flown = np.linalg.norm(both["position"].to_numpy()[inside] - old, axis=1).max() / 1e3
    assert far == pytest.approx(flown, rel=0.15)


ABOUT = "OBJECT_NAME = SPACECRAFT\nOBJECT_ID = 0000-000A\nCENTER_NAME = EARTH\nREF_FRAME = EME2000\nTIME_SYSTEM = UTC\n"
SPAN = "START_TIME = 2027-03-20T12:05:00\nSTOP_TIME = 2027-03-20T12:20:00\n"
SECOND = f"META_START\n{ABOUT}{SPAN}META_STOP\n2027-03-20T12:05:00 "


def test_segments_are_read_one_after_the_other_and_no_state_lies_between_them(run, tmp_path):
    """As a library of others reads them. The second segment has another orbit, 1 km beside the first from 12:05 on: states
    are of the one or the other, and at their common instant of the second."""
    sh.export_oem(run, tmp_path / "one.oem")
    lines = (tmp_path / "one.oem").read_text().splitlines()
    place = next(k for k, line in enumerate(lines) if line.startswith("2027-03-20T12:05:00 "))
    moved = []
    for line in lines[place:]:
        stamp, x, *rest = line.split()
        moved.append(" ".join([stamp, repr(float(x) + 1.0), *rest]))
    text = "\n".join([*lines[: place + 1], SECOND.rsplit("\n", 1)[0], *moved, ""])
    (tmp_path / "two.oem").write_text(text)
    segments = NdmIo().from_path(tmp_path / "two.oem").body.segment
    theirs = [[float(one.x.value) for one in segment.data.state_vector] for segment in segments]
    told, single = sh.read_oem(tmp_path / "two.oem"), sh.read_oem(tmp_path / "one.oem")
    assert told.begins == (0, len(theirs[0])) == (0, 6)
    np.testing.assert_allclose(told.states[:, 0], 1e3 * np.concatenate(theirs), rtol=1e-15)
    assert told.times[5] == told.times[6] == 300.0
    assert single.begins == (0,)
    both = [parse(tmp_path / name) for name in ("two.oem", "one.oem")]
    for time, beside in ((290.0, 0.0), (299.9, 0.0), (300.0, 1e3), (310.0, 1e3), (700.0, 1e3)):
        (x, y, z), (v, *_) = (np.subtract(*pair) for pair in zip(*(one.state(one.epoch, time) for one in both), strict=True))
        # In axes of date the step is turned by the precession.
        assert np.linalg.norm([x, y, z]) == pytest.approx(beside, abs=0.05)
        assert abs(v) < 1e-3


@pytest.mark.parametrize(
    ("change", "orbit", "said"),
    [
        ({}, 'epoch = "2027-03-20T11:00:00Z"', r"orbit\.epoch: .* is before the first state of own\.oem; allowed: a date"),
        ({}, 'epoch = "2027-03-21"', r"orbit\.epoch: found .* is after the last state of own\.oem; .* for 1200 s"),
        ({}, 'altitude = "500 km"', r"orbit\.altitude: found a key beside oem; allowed: oem alone, or with epoch"),
        ({"= EME2000": "= ITRF2000"}, "", r"REF_FRAME = ITRF2000, of which EME2000, ICRF, GCRF, MOD_EARTH, TEME are read"),
        ({"= UTC": "= TAI"}, "", "TIME_SYSTEM = TAI, of which UTC are read"),
        ({"= EARTH": "= MARS"}, "", "CENTER_NAME = MARS, of which EARTH are read"),
        ({"CENTER_NAME": "CENTRE"}, "", "no CENTER_NAME"),
        ({"VERS = 2.0": "VERS = 9"}, "", "line 1: CCSDS_OEM_VERS = 9"),
        ({"2027-03-20T12:05:00 ": "2027-03-20T12:05:00 1 "}, "", "line 20: 7 numbers behind the epoch, 6 or 9 are wanted"),
        ({"2027-03-20T12:05:00 ": "2027-03-20T12:01:00 "}, "", "the epoch 2027-03-20T12:01:00 after 2027-03-20T12:04:00"),
        ({"2027-03-20T12:05:00 ": "META_START\n"}, "", "line 21: .* in place of key = value"),
        ({"2027-03-20T12:05:00 ": SECOND}, "", "from 2027-03-20T12:05:00 on, after one that ends at 2027-03-20T12:04"),
        ({"2027-03-20T12:05:00 ": SECOND.replace("EARTH", "MOON")}, "", "CENTER_NAME = MOON, after one of EARTH"),
        ({"2027-03-20T12:05:00 ": SECOND.replace("CENTER_NAME", "CENTER")}, "", "no CENTER_NAME"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_refused_in_one_line(run, change, orbit, said, tmp_path):
    sh.export_oem(run, tmp_path / "own.oem")
    message = (tmp_path / "own.oem").read_text()
    message = replaced(message, *change.items()) if change else message
    with refused(match=said):
        flies(tmp_path, message, f'oem = "own.oem"\n{orbit}\n')


def test_a_run_without_an_orbit_has_no_ephemeris(tmp_path):
    run = sh.simulate(
        sh.load("three-laws").with_({"simulation.duration": 2.0, "orbit": None, "environment.gravity_gradient": False})
    )
    with pytest.raises(sh.InputError, match="a run without an orbit; allowed: one of a scenario with"):
        sh.export_oem(run, tmp_path / "own.oem")
