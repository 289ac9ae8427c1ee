"""Replays give what was flown, to the bit, go on over gaps, and find where telemetry parts from the scenario."""

from types import SimpleNamespace

import numpy as np
import pytest

import starhold as sh
from starhold.parts.estimators import mekf
from starhold.studies.replay import tolerance_of
from tests.api.flown_telemetry import FILE, flown, table
from tests.refusals import complains, refused
from tests.running import starhold

SWAPPED_AT = 30.0


def replayed(frame, folder, scenario=None, **options):
    """The replay of a table."""
    frame.to_csv(folder / "tm.csv", index=False)
    return sh.replay(scenario or flown()[0], telemetry=folder / "tm.csv", **options)


def swapped():
    """The run's table with two axes of the gyro exchanged from a time on."""
    frame = table()
    late = frame["time"] >= SWAPPED_AT
    frame.loc[late, ["gyro_rate_x", "gyro_rate_y"]] = frame.loc[late, ["gyro_rate_y", "gyro_rate_x"]].to_numpy()
    return frame


def test_a_recording_gives_its_own_estimates_and_commands_to_the_bit():
    """Whatever noise the scenario itself would draw: the readings are those of the recording."""
    scenario, _, run = flown()
    result = sh.replay(scenario.with_({"simulation.seed": 7}), telemetry=run)
    names = {one.name for one in result.comparisons}
    assert {"command", "wheel_command", "mekf_attitude", "mekf_rate", "mekf_gyro_bias"} <= names
    assert all(one.same_bits for one in result.comparisons)
    assert result.parted is None
    assert "agree" in result.sentence
    assert "bit for bit" in result.sentence


def test_readings_alone_give_the_estimates_to_the_bit(tmp_path):
    """A filter needs no more than what its sensors tell; commands need the orbit and the wheels, which the model gives."""
    names = [head for head in table() if head.startswith(("time", "gyro", "star", "magnet", "mekf")) or head == "command_x"]
    result = replayed(table()[names], tmp_path)
    estimates = [one for one in result.comparisons if one.name.startswith("mekf")]
    assert len(estimates) == 4
    assert all(one.same_bits for one in estimates)
    assert any("Not recorded" in note and "wheel_momentum" in note for note in result.notes)
    # Nothing of the model is left in what is recorded: another craft has the same estimates.
    other = replayed(table()[names], tmp_path, flown()[0].with_({"spacecraft.inertia": [0.1, 0.2, 0.3]}))
    assert [one.same_bits for one in other.comparisons] == [True] * 4


def test_estimates_are_those_of_the_filter_in_plain_python():
    """The filter's equation, called for each recorded reading in turn."""
    scenario, loop, run = flown()
    fitted = next(iter(loop.used("estimator")))
    numbers, every = fitted.prepared(loop.period), loop.carry()
    memory, got = every.memories.estimator, sh.replay(scenario, telemetry=run).run
    for k in range(20):
        star = SimpleNamespace(
            attitude=tuple(run["star_tracker_attitude"].values[k].tolist()),
            attitude_is_new=float(run["star_tracker_attitude_is_new"].values[k]),
        )
        rate = tuple(run["gyro_rate"].values[k].tolist())
        readings = SimpleNamespace(rate=rate, **vars(star), every=(SimpleNamespace(rate=rate), star))
        estimate, memory = mekf.estimate(readings, memory, numbers, loop.known, loop.period)
        assert estimate.attitude == tuple(got["mekf_attitude"][k].tolist())
        assert estimate.gyro_bias == tuple(got["mekf_gyro_bias"][k].tolist())


def test_a_gap_is_passed_and_the_filter_finds_back(tmp_path):
    """Ten seconds without any row, and a gyro that is silent for five more, through which its rate goes straight on."""
    frame = table()
    frame.loc[60:70, [f"gyro_rate_{axis}" for axis in "xyz"]] = np.nan
    result = replayed(frame.drop(index=range(20, 40)), tmp_path)
    assert "20 missing" in result.notes[0]
    assert any("gyro_rate is read at 90" in note and "121 control steps" in note for note in result.notes)
    attitude = next(one for one in result.comparisons if one.name == "mekf_attitude")
    assert np.isfinite(result.run["mekf_attitude"]).all()
    assert len(attitude.times) == 101
    assert attitude.difference[-1] < 0.35 * attitude.difference.max() < 1e-3


def test_a_swapped_axis_is_found_when_it_begins(tmp_path):
    """Before it nothing differs by a bit."""
    result = replayed(swapped(), tmp_path)
    assert result.sentence.startswith("They first deviate at 30 s: mekf_attitude differs by ")
    assert {one.parted_at for one in result.comparisons} == {SWAPPED_AT, None}
    rate = next(one for one in result.comparisons if one.name == "mekf_rate")
    assert rate.parted_at == SWAPPED_AT
    early = rate.times < SWAPPED_AT
    assert np.array_equal(rate.computed[early], rate.recorded[early])


def test_telemetry_begins_where_it_begins(tmp_path):
    """A minute's second half alone: the orbit is where it is then, so that the target is."""
    frame = table()
    names = [head for head in frame if not head.startswith(("position", "velocity"))]
    result = replayed(frame.loc[60:, names], tmp_path)
    assert result.run["time"][0] == 30.0
    np.testing.assert_array_equal(result.run["position"][0], flown()[2]["position"].values[60])


def test_an_attitude_that_the_satellite_estimated_is_compared_with_the_estimate(tmp_path):
    """Where telemetry calls it by no estimator's name; against the recorded truth it is within three sigma at the end."""
    frame = table()
    result = replayed(frame[[head for head in frame if not head.startswith("mekf")]], tmp_path)
    pairs = {one.name: one for one in result.comparisons}
    assert pairs["mekf_attitude"].against == "attitude"
    assert not pairs["mekf_attitude"].beyond[-20:].any()


def test_what_cannot_be_replayed_is_refused(tmp_path):
    """In one line: readings that are missing, another time, no telemetry, a tolerance that is none."""
    frame = table()
    with refused("tm.csv", "no magnetometer_magnetic_field", "leave out"):
        replayed(frame[[head for head in frame if not head.startswith("magnetometer")]], tmp_path)
    with refused("tm.csv", "times from 1000", "0 to 60 s"):
        replayed(frame.assign(time=frame["time"] + 1000.0), tmp_path)
    with refused("telemetry", "nothing"):
        sh.replay(flown()[0])
    with refused("tolerance", "-1"):
        replayed(frame, tmp_path, tolerance="-1")
    with refused("no gaussian_attitude and gaussian_rate"):
        sh.replay("three-laws-noise", telemetry=sh.simulate(sh.load("three-laws-noise").with_({"simulation.duration": 1.0})))
    assert tolerance_of("0.05") == 0.05


@pytest.mark.parametrize("command", ["replay", "identify"])
def test_a_wrong_file_is_named_before_a_folder_of_results(command, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "summary.json").write_text("{}")
    # The file is there in two of the cases, and holds no telemetry in one.
    for given in (["no.csv"], ["tm.csv", "--mapping", "no.toml"], ["tm.csv"]):
        (tmp_path / "tm.csv").write_text("time\n0\n")
        complains(starhold(command, "cubesat-nadir", *given, "-o", "out", cwd=tmp_path), given[-1])


@pytest.mark.slow
def test_every_builtin_scenario_with_recorded_sensors_replays_its_run_to_the_bit():
    """Modes, faults and wheels among them."""
    for name in ("cubesat-mission", "cubesat-nadir", "cubesat-detumble"):
        scenario = sh.load(name).with_({"simulation.record_every": 1})
        assert "bit for bit" in sh.replay(scenario, telemetry=sh.simulate(scenario)).sentence, name


def test_the_command_prints_the_parting_and_writes_numbers_and_a_figure(tmp_path):
    """Code 0 where all agrees, 3 where it parts; the numbers are a table that starhold reads again."""
    (tmp_path / "short.toml").write_text(FILE)
    swapped().to_csv(tmp_path / "swapped.csv", index=False)
    done = starhold("replay", "short.toml", "swapped.csv", "-o", "out", cwd=tmp_path, code=3)
    assert "They first deviate at 30 s: mekf_attitude" in " ".join(done.stdout.split())
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"replay.csv", "replay.png"}
    heads = (tmp_path / "out" / "replay.csv").read_text().partition("\n")[0]
    assert heads.startswith("time (s),attitude_q0 (1)")
    assert "recorded mekf_rate_x (rad/s)" in heads
    table().to_csv(tmp_path / "whole.csv", index=False)
    words = ("replay", "short.toml", "whole.csv", "-o", "same", "--pictures", "none")
    assert "bit for bit" in starhold(*words, cwd=tmp_path, code=0).stdout
    assert "Missing argument" in starhold("replay", "short.toml", cwd=tmp_path, code=2).stderr
