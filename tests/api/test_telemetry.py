"""Telemetry is read from any of its kinds of file, with units, axes, time bases and gaps."""

import erfa
import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

import starhold as sh
from starhold.studies.telemetry import read
from starhold.studies.telemetry_files import TimeTable, mapping_names, seconds_of
from tests.api.flown_telemetry import flown, table
from tests.refusals import refused
from tests.texts import toml

MAPPING = toml("""
[telemetry] separator = ";"; missing = ["-9999"]; time = {{ column = "clock", base = "{base}", unit = "{unit}" }}
[telemetry.columns.gyro_rate] columns = ["wx", "wy", "wz"]; unit = "deg/s"; axes = [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]
[telemetry.columns.star_tracker_attitude] columns = ["qx", "qy", "qz", "qs"]; scalar = "last"; conjugate = true
axes = [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]
""")
TO_BODY = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def mapped(folder, frame, base="run", unit="s"):
    """The telemetry of a table, through the mapping."""
    (folder / "map.toml").write_text(MAPPING.format(base=base, unit=unit))
    frame.to_csv(folder / "tm.csv", sep=";", index=False)
    return read(*flown()[:2], folder / "tm.csv", folder / "map.toml")


def sample(rows=5):
    """A table in the units and axes of the mapping, and the rates and attitudes that it means."""
    draw = np.random.default_rng(1)
    rates, turns = draw.normal(size=(rows, 3)), Rotation.random(rows, rng=draw)
    columns = dict(zip(("wx", "wy", "wz"), np.degrees(rates @ TO_BODY).T, strict=True))
    # SciPy's rotation takes components in the body's axes to the reference's: that of the file's axes follows TO_BODY.
    told = (turns * Rotation.from_matrix(TO_BODY)).inv().as_quat().T
    columns |= dict(zip(("qx", "qy", "qz", "qs"), told, strict=True))
    return pd.DataFrame({"clock": 0.5 * np.arange(rows)} | columns), rates, turns.as_quat(scalar_first=True)


@pytest.mark.parametrize("kind", ["csv", "parquet", "nc"])
def test_what_starhold_records_is_read_to_the_bit(kind, tmp_path):
    """Without a mapping, from each kind of file."""
    scenario, loop, run = flown()
    path = tmp_path / f"run.{kind}"
    if kind == "parquet":
        pytest.importorskip("pyarrow")
    if kind == "nc":
        run.to_netcdf(path, engine="h5netcdf")
    else:
        table().to_csv(path, index=False) if kind == "csv" else table().to_parquet(path)
    told = read(scenario, loop, path)
    assert np.array_equal(told.times, run.time)
    for name in ("gyro_rate", "star_tracker_attitude", "mekf_gyro_bias", "wheel_momentum", "command"):
        assert np.array_equal(told.columns[name], run[name]), name
    assert "none missing" in told.sentence


def test_a_message_is_turned_to_the_axes_of_date(tmp_path):
    """The attitudes of an AEM are relative to EME2000, those of this orbit to the equinox of date; its times are UTC."""
    scenario, loop, run = flown()
    sh.export_aem(run, tmp_path / "run.aem", object_name="A", object_id="2026-001A", epoch="2026-03-20T12:00:10")
    told = read(scenario, loop, tmp_path / "run.aem")
    assert told.absolute
    np.testing.assert_allclose(told.times, run.time + 10.0, atol=1e-6)
    np.testing.assert_allclose(told.columns["attitude"], run.attitude, atol=1e-9)


def test_units_order_and_axes_are_those_of_the_mapping(tmp_path):
    """Degrees, a scalar at the end, the turn from the body, and other axes than the body's; against SciPy's rotations."""
    frame, rates, attitudes = sample()
    told = mapped(tmp_path, frame)
    np.testing.assert_allclose(told.columns["gyro_rate"], rates, rtol=1e-12)
    products = np.sum(told.columns["star_tracker_attitude"] * attitudes, axis=1)
    np.testing.assert_allclose(np.abs(products), 1.0, atol=1e-12)


@pytest.mark.parametrize("date", ["1981-08-01", "2016-12-31T23:59:59", "2017-01-01", "2026-03-20T12:00:00"])
def test_time_bases_agree_with_erfa(date):
    """GPS time, made by ERFA, Julian dates, made by pandas, and Unix time of an instant are one."""
    stamp = pd.Timestamp(date)
    clock = (stamp.year, stamp.month, stamp.day, stamp.hour, stamp.minute, stamp.second)
    tai = erfa.utctai(*erfa.dtf2d("UTC", *clock))
    since = {"gps": ((tai[0] - 2444244.5) + tai[1]) * 86400.0 - 19.0, "jd": stamp.to_julian_date()}
    since["mjd"] = since["jd"] - 2400000.5
    since |= {"unix": stamp.timestamp(), "utc": stamp.isoformat()}
    for base, value in since.items():
        told = seconds_of(pd.DataFrame({"time": [value]}), TimeTable(base=base), "tm.csv", "")
        assert told[0] == pytest.approx(stamp.timestamp(), abs=1e-4), base


def test_absolute_times_count_from_the_scenarios_epoch(tmp_path):
    """Milliseconds of Unix time."""
    frame, _, _ = sample()
    frame["clock"] = (1000.0 * (pd.Timestamp("2026-03-20T12:00:05").timestamp() + frame["clock"])).astype(int)
    assert mapped(tmp_path, frame, "unix", "ms").times.tolist() == [5.0, 5.5, 6.0, 6.5, 7.0]


def test_gaps_are_counted_and_times_put_in_order(tmp_path):
    """Missing rows, empty cells, a word for nothing, doubled, disordered and empty times."""
    frame, rates, _ = sample(12)
    frame = frame.astype(object)
    frame.loc[3, "wx"], frame.loc[4, "wy"] = None, -9999
    frame = frame.drop(index=[7, 8])
    frame = pd.concat([frame, frame.iloc[[2]], frame.iloc[[0]].assign(clock=None)])
    told = mapped(tmp_path, frame)
    assert told.times.tolist() == [0.5 * k for k in range(12) if k not in (7, 8)]
    words = ("12 rows, one every 0.5 s", "2 missing", "1 without a time", "1 at the time of another", "1 out of order")
    assert [word for word in (*words, "gyro_rate in 2") if word not in told.sentence] == []
    np.testing.assert_allclose(told.columns["gyro_rate"][2], rates[2], rtol=1e-12)


def test_what_does_not_fit_is_refused(tmp_path):
    """Each in one line, with what was found and what is allowed."""
    frame, _, _ = sample()
    with refused("tm.csv", "no column wx", "wxx"):
        mapped(tmp_path, frame.rename(columns={"wx": "wxx"}))
    with refused("tm.csv", "row 2, wy", "three", "a number"):
        mapped(tmp_path, frame.astype(object).replace({"wy": {frame.loc[1, "wy"]: "three"}}))
    with refused("row 1, clock", "ISO 8601"):
        mapped(tmp_path, frame.astype({"clock": str}).replace({"clock": {"0.0": "noon"}}), "utc")
    mapped(tmp_path, frame)
    for old, new, words in (
        ('"deg/s"', '"nT"', ("columns.gyro_rate.unit", "nT", "rad/s")),
        ("gyro_rate", "giro_rate", ("giro_rate", "gyro_rate")),
        ('"wy", ', "", ("2 columns", "3 for gyro_rate")),
        ("[[0, 1, 0]", "[[0, 2, 0]", ("gyro_rate.axes", "orthogonal")),
        ('unit = "deg/s"', 'scalar = "last"', ("gyro_rate", "not a quaternion")),
        ("separator", "divider", ("divider", "unknown key")),
    ):
        (tmp_path / "bad.toml").write_text(MAPPING.format(base="run", unit="s").replace(old, new, 1))
        with refused(*words):
            read(*flown()[:2], tmp_path / "tm.csv", tmp_path / "bad.toml")
    for name, words in (("no.csv", ("no file",)), ("tm.xls", (".xls", ".parquet")), ("tm.csv", ("a mapping",))):
        (tmp_path / "tm.xls").touch()
        with refused(*words):
            read(*flown()[:2], tmp_path / name)
    (tmp_path / "tm.csv").write_text("time,gyro_rate_x\n0,1,2\n")
    with refused("tm.csv", "kind csv"):
        read(*flown()[:2], tmp_path / "tm.csv")


@pytest.mark.parametrize("name", mapping_names())
def test_public_data_sets_are_read_in_the_layout_of_their_mapping(name, tmp_path):
    """Synthetic files of that layout, for the data themselves are not here; two files have times of their own."""
    draw, stamps = np.random.default_rng(2), pd.date_range("2026-03-20T12:00:00", periods=6, freq="10s")
    rates, attitudes, torques = draw.normal(size=(6, 3)), Rotation.random(6, rng=draw).as_quat(), draw.normal(size=(6, 3))
    told = pd.DataFrame({"timestamp": stamps.strftime("%Y-%m-%dT%H:%M:%S")})
    for k, axis in enumerate("XYZ"):
        told[f"ESTA_RATE_{axis}"], told[f"ESTA_B_SAT_{axis}"] = np.degrees(rates[:, k]), 1e4 * (k + 1)
        told[f"ESTA_Q_{axis}"], told["ESTA_Q_S"] = attitudes[:, k], attitudes[:, 3]
    told.to_csv(tmp_path / "TmAocsStateEstimationA_131.csv", index=False)
    control = pd.DataFrame({f"CONTROL_TORQUE_{axis}": torques[:, k] for k, axis in enumerate("XYZ")})
    control["timestamp"] = (stamps + pd.Timedelta("4s")).strftime("%Y-%m-%dT%H:%M:%S")
    control.to_csv(tmp_path / "TmAocsStateControl_143.csv", index=False)
    got = read(*flown()[:2], tmp_path / "TmAocsStateEstimationA_131.csv", name)
    own = np.isfinite(got.columns["gyro_rate"]).all(axis=1)
    assert got.times[own].tolist() == [0.0, 10.0, 20.0, 30.0, 40.0, 50.0]
    np.testing.assert_allclose(got.columns["gyro_rate"][own], rates, rtol=1e-12)
    np.testing.assert_allclose(got.columns["attitude"][own], np.roll(attitudes, 1, axis=1))
    np.testing.assert_allclose(got.columns["magnetometer_magnetic_field"][own], [[1e-5, 2e-5, 3e-5]] * 6)
    if name == "tubin":
        assert got.times[~own].tolist() == [4.0, 14.0, 24.0, 34.0, 44.0, 54.0]
        np.testing.assert_allclose(got.columns["command"][~own], torques)
