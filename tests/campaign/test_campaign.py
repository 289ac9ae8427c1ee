"""Whole campaigns: the runs that they store are those of each run's own scenario, whoever flies them."""

import math

import numpy as np
import pandas as pd
import pytest
from scipy import stats

import starhold as sh
from starhold.campaign import lanes as lane_making
from starhold.campaign.campaign import CHUNK
from starhold.campaign.store import Store
from starhold.errors import InputError
from starhold.studies.body import study_of
from starhold.studies.compare import build, record
from tests.campaign.flown import ASKED, OVER, fly, own_flight, same, small, uniform
from tests.tiers import leading


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    return fly(tmp_path_factory.mktemp("small") / "c", metrics=["overshoot", "iterations"])


@pytest.mark.slow
def test_rows_are_the_flights_of_each_runs_own_scenario(result):
    frame = result.frame()
    assert list(frame.law.unique()) == ["lyapunov", "pd"]
    assert len(frame) == 180
    for law, run in (("pd", 0), ("pd", 41), ("lyapunov", 89)):
        own, row, recording = own_flight(result, run, law)
        assert own.table.simulation.run == run
        error = recording["attitude_error"]
        last = int(len(error) * 0.75)
        turn = np.linalg.norm(error[-1, :1] * error[-1, 1:] - error[last, :1] * error[last, 1:])
        assert row["drift"] == pytest.approx(2.0 * turn / (recording["time"][-1] - recording["time"][last]))


def test_what_was_flown_is_read_back(result):
    frame = result.frame()
    pd_runs = frame[frame.law == "pd"]
    assert (pd_runs["flown.gains.k_rate"] == pd_runs["law.pd.k_rate"]).all()
    assert pd_runs["law.pd.k_rate"].between(1.5, 2.5).all()
    assert (frame["flown.craft.inertia[2]"] == frame["spacecraft.inertia[2]"]).all()
    assert (frame["flown.gaussian.rate"] == frame["sensor.rate_noise"]).all()
    attitudes = frame[[f"flown.state.attitude[{k}]" for k in range(1, 5)]].to_numpy()
    assert np.abs(np.linalg.norm(attitudes, axis=1) - 1.0).max() < 1e-15
    both = [group.drop(columns="law").reset_index(drop=True) for _, group in frame.groupby("law")]
    drawn = [name for name in OVER if name in frame.columns and name != "law.pd.k_rate"]
    assert drawn
    assert (both[0][drawn] == both[1][drawn]).all().all()


def test_verdicts_and_quantiles_are_those_of_other_libraries(result):
    files = sorted((result.folder / "runs" / "pd").glob("*.parquet"))
    frame = pd.concat([pd.read_parquet(path) for path in files], ignore_index=True)
    law = next(law for law in result.laws if law.law == "pd")
    for verdict, asked in zip(law.verdicts, ASKED, strict=True):
        failures = int((frame[f"margin.{verdict.name}"] < 0.0).sum())
        assert (verdict.failures, verdict.runs) == (failures, 90)
        bounds = stats.binomtest(failures, 90).proportion_ci(1.0 - 2.0 * (1.0 - verdict.confidence), "exact")
        assert (verdict.lower, verdict.upper) == pytest.approx((bounds.low, bounds.high), rel=1e-9)
        assert verdict.share == pytest.approx(0.9973 if asked["metric"] == "lost" else 0.9)
    late = frame["settling_time"].isna() | (frame["settling_time"] > 30.0)
    assert law.verdicts[0].failures == int(late.sum())
    assert (frame["failed"] == frame.filter(like="margin.").lt(0.0).any(axis=1)).all()
    for spread in law.spreads:
        values = frame[spread.metric].dropna()
        assert spread.missing == 90 - len(values)
        if len(values):
            told = (values.min(), *values.quantile([0.05, 0.25, 0.5, 0.75, 0.95]), values.max())
            assert spread.quantiles == pytest.approx(told, rel=1e-12)
            assert spread.counts.sum() <= len(values)


@pytest.mark.slow
def test_envelopes_are_those_of_recordings(result):
    law = next(law for law in result.laws if law.law == "pd")
    angles = []
    for run in range(90):
        error = result.again(run, "pd").flight.recording["attitude_error"]
        angles.append(2.0 * np.arctan2(np.linalg.norm(error[:, 1:], axis=1), np.abs(error[:, 0])))
    envelope = next(envelope for envelope in law.envelopes if envelope.name == "attitude_error")
    ends = np.round(envelope.times / 0.2).astype(int)
    starts = [0, *ends[:-1]]
    tops = np.array(
        [[a[first : last if last < 200 else 201].max() for first, last in zip(starts, ends, strict=True)] for a in angles]
    )
    assert envelope.least == pytest.approx(tops.min(axis=0), rel=1e-9)
    assert envelope.most == pytest.approx(tops.max(axis=0), rel=1e-9)
    # By the bins, which are of the square of half the angle's sine.
    ranked = np.sort(np.sin(0.5 * tops) ** 2, axis=0)
    for values, share in ((envelope.low, 0.05), (envelope.median, 0.5), (envelope.high, 0.95)):
        place, noted = share * 89, np.sin(0.5 * values) ** 2
        assert (noted >= ranked[math.floor(place)] / 1.07).all()
        assert (noted <= ranked[math.ceil(place)] * 1.07).all()


# Each worker loads and compiles everything for itself.
@pytest.mark.parametrize(
    "options", leading([{"threads": 2}, {"law": "pd"}, {"law": "pd", "threads": None, "workers": 1}], 2)
)
def test_who_flies_and_how_runs_are_cut_change_nothing(result, tmp_path, options, monkeypatch):
    if "law" in options and "workers" not in options:
        # Made run by run in place of at once, and in other blocks.
        monkeypatch.setattr(lane_making.Lanes, "_agrees", lambda *_: False)
        monkeypatch.setattr("starhold.campaign.campaign.SMALL", 37)
    again = fly(tmp_path / "c", metrics=["overshoot", "iterations"], **options)
    if "law" not in options:
        assert again.digest == result.digest
    frames = [
        frame[frame.law == "pd"].drop(columns="law").reset_index(drop=True) for frame in (result.frame(), again.frame())
    ]
    pd.testing.assert_frame_equal(*frames, check_exact=True)
    assert CHUNK > 90


@pytest.mark.slow
def test_faults_words_and_kernels_of_their_own(tmp_path):
    scenario = small(
        wheels={"layout": "pyramid", "inertia": 1e-3, "torque_limit": 0.2, "momentum_limit": 4.0},
        fault=[{"time": 4.0, "wheel": 1, "lost": True, "action": "reallocate"}],
        simulation__duration=12.0,
    )
    over = {
        "fault[1].time": uniform(2, 9),
        "spacecraft.limit": {"distribution": "choice", "values": ["axis", "norm"], "weights": [3, 1]},
        "initial.rate": {"distribution": "normal", "sigma": 0.01},
        "law.pd.quaternion_sign": {"distribution": "choice", "values": ["shortest", "as_published"]},
    }
    found = fly(tmp_path / "c", scenario=scenario, over=over, requirement=[{"metric": "lost"}], runs=24, law="pd")
    frame = found.frame()
    assert set(frame["spacecraft.limit"]) == {"axis", "norm"}
    assert frame["flown.event[1].time"].to_numpy() == pytest.approx(frame["fault[1].time"].to_numpy(), abs=0.2)
    assert frame["peak_wheel_momentum"].between(0.0, 4.0).all()
    for run in (0, 17):
        own, row, recording = own_flight(found, run, "pd")
        assert own.table.spacecraft.limit == row["spacecraft.limit"]
        assert row["peak_wheel_momentum"] == np.abs(recording["wheel_momentum"]).max()


def test_other_bodies_fly_campaigns_too(tmp_path):
    station = sh.load("l2-equilibrium")
    law = station.laws[0].name
    over = {"initial.position": {"distribution": "normal", "sigma": "5 %", "relative": True}}
    requirement = [{"metric": "final_distance", "at_most": "5000 km", "share": 0.5}]
    found = sh.campaign(station, tmp_path / "c", runs=20, over=over, requirement=requirement, law=law, search=False)
    for run in (3, 19):
        own_flight(found, run, law)


def test_ends_once_all_is_decided(tmp_path):
    asked = [{"id": "easy", "metric": "final_rate_error", "at_most": "60 deg/s", "share": 0.99}]
    options = {"requirement": asked, "runs": 20_000, "law": "pd", "until_decided": True}
    scenario = small(simulation__duration=2.0)
    found = fly(tmp_path / "a", scenario=scenario, **options)
    assert found.runs == 2048
    assert found.met
    assert fly(tmp_path / "b", scenario=scenario, **options | {"threads": 2}).digest == found.digest
    again = fly(tmp_path / "a", scenario=scenario, resume=True, **options)
    assert (again.digest, again.flown) == (found.digest, 0)


def test_goes_on_after_a_crash_with_more_runs_and_not_after_a_change(result, tmp_path, monkeypatch):
    folder = tmp_path / "c"
    with monkeypatch.context() as patched:
        patched.setattr("starhold.campaign.campaign.CHUNK", 32)
        fly(folder, metrics=["overshoot", "iterations"], runs=70)
    held = sorted((folder / "runs" / "pd").glob("*.parquet"))
    assert len(held) == 3
    held[1].write_bytes(held[1].read_bytes()[:-9] + b"corrupted")
    (folder / "campaign.json").unlink()
    with pytest.warns(UserWarning, match="its bytes were changed; runs 32 to 63 are flown again"):
        again = fly(folder, metrics=["overshoot", "iterations"], resume=True)
    assert again.digest == result.digest
    assert again.flown == 32 + 20 + 20
    changed = OVER | {"law.pd.k_rate": uniform(1.4, 2.5)}
    with pytest.raises(InputError, match=r'over."law.pd.k_rate".low: 1.4, was 1.5'):
        fly(folder, metrics=["overshoot", "iterations"], over=changed, resume=True)
    assert Store.open(folder).missing("pd") == []


@pytest.mark.slow
def test_the_worst_is_flown_again_by_its_file(tmp_path, brief):
    clean = {"sensor": None, "spacecraft.actuator_lag": None}
    scenario = sh.load("cubesat-slew").with_({"simulation.record_every": 1, "simulation.duration": 60, **clean})
    over = {"initial.rate": {"distribution": "shell", "high": "2 deg/s"}}
    asked = [
        {"metric": "final_attitude_error", "at_most": "1 deg", "share": 0.5},
        {"metric": "peak_torque", "at_most": 0.01, "share": 0.5},
        {"metric": "settling_time", "at_most": "500 s", "share": 0.5},
    ]
    found = sh.campaign(scenario, tmp_path / "c", runs=64, over=over, requirement=asked, law="pd")
    frame = found.frame()
    brackets = {bracket.metric: bracket for bracket in found.laws[0].brackets}
    for metric, bracket in brackets.items():
        assert not bracket.flown < frame[metric].max()
        own = sh.load(found.folder / bracket.file)
        metrics = study_of(own.body).metrics_of(record(own, build(own, own.pick("pd"))))
        assert (
            metrics[metric] is None
            if math.isnan(bracket.flown)
            else metrics[metric] == pytest.approx(bracket.flown, rel=1e-12)
        )
    assert brackets["peak_torque"].flown <= brackets["peak_torque"].proved == 0.002
    assert {metric for metric, bracket in brackets.items() if bracket.proved is not None} == {"peak_torque"}


def test_angles_and_norms_are_inputs_too(tmp_path):
    over = {key: OVER[key] for key in ("initial.attitude", "initial.rate")}
    asked = [{"metric": "settling_time", "at_most": "14 s", "share": 0.9}]
    # As published, a law goes the long way round where q0 is negative: then that decides.
    scenario = small().with_({"law.pd.quaternion_sign": "shortest"})
    drivers = fly(tmp_path / "c", scenario=scenario, runs=400, over=over, requirement=asked, law="pd").laws[0].drivers
    assert drivers.inputs[0].input == "angle of initial.attitude"
    assert "norm of initial.rate" in {driver.input for driver in drivers.inputs}


def test_lost_runs_have_a_time_and_no_metrics(tmp_path):
    over = {"initial.rate": {"distribution": "shell", "low": 1.0, "high": "12 rad/s"}}
    found = fly(tmp_path / "c", over=over, law="pd", requirement=[{"metric": "lost", "share": 0.5}])
    frame = found.frame()
    lost = frame["diverged_at"].notna()
    assert 0 < lost.sum() < 90
    assert found.laws[0].lost == lost.sum() == found.laws[0].verdicts[0].failures
    assert frame.loc[lost, "effort"].isna().all()
    assert frame.loc[~lost, "effort"].notna().all()
    assert (frame["failed"] == lost).all()
    run = int(np.flatnonzero(lost)[0])
    assert same(found.again(run).flight.lost, frame["diverged_at"][run])
