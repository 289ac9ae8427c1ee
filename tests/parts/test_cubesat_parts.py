"""Two CubeSats from scenario files that hold all parts of the field, the air, the light and their sensors."""

import math

import numpy as np

import starhold as sh
from tests.missions import cubesat
from tests.texts import toml

PARTS = toml("""
[[law]] type = "pd"; k_rate = 0.004; k_attitude = 0.0008
[[part]] type = "residual-dipole"; dipole = ["10 mA m^2", 0, "5 mA m^2"]
[[part]] type = "oblateness"
[[part]] type = "drag"; plates = "plates.csv"; density = "1e-12 kg/m^3"
[[part]] type = "solar-pressure"
plates = [[0.06, 1, 0, 0, 0.05, 0, 0.02, 0.2, 0.3], [0.03, 0, 1, 0, 0, 0.1, 0.02, 0.2, 0.3]]
[[part]] type = "gyro"; noise = 5e-5
[[part]] type = "magnetometer"; noise = "50 nT"
[[part]] type = "sun-sensor"; noise = "0.1 deg"
[[part]] type = "gnss"; position = "10 m"; velocity = "0.1 m/s"
""")
START = {"duration": 600, "angles": '["40 deg", 0, "10 deg"]', "rate": (0.0175, -0.0087, 0.0052)}
FINE = toml("""
[[part]] type = "star-tracker"; cross = "10 arcsec"; roll = "60 arcsec"; interval = 1.0; outage = ["2 min", "3 min"]
[[part]] type = "mekf"; noise = 5e-5; bias_walk = 1e-5; bias = "0.05 deg/s"; cross = "10 arcsec"; roll = "60 arcsec"
""")
COARSE = """
[[part]]
type = "triad"
"""
PLATES = "area,nx,ny,nz,x,y,z\n0.06,1,0,0,0.05,0,0.02\n0.06,-1,0,0,-0.05,0,0.02\n0.03,0,-1,0,0,-0.1,0.02\n"
ALIKE = {
    "gyro_rate", "magnetometer_magnetic_field", "magnetometer_magnetic_field_is_new", "sun_sensor_sun",
    "sun_sensor_sun_is_seen", "gnss_position", "gnss_velocity",
}  # fmt: skip


def flown(tmp_path, estimator):
    (tmp_path / "plates.csv").write_text(PLATES)
    (tmp_path / "cubesat.toml").write_text(cubesat(PARTS, estimator, **START))
    return sh.simulate(tmp_path / "cubesat.toml")


def errors(run, name):
    """The angles (rad) between true and estimated attitudes."""
    true, found = (np.asarray(run[key]) for key in ("attitude", f"{name}_attitude"))
    return 2.0 * np.arccos(np.minimum(1.0, np.abs(np.sum(true * found, axis=1))))


def test_star_tracker_and_kalman_filter(tmp_path):
    run = flown(tmp_path, FINE)
    recorded = {"mekf_attitude_deviation", "mekf_gyro_bias", "mekf_gyro_bias_deviation", "star_tracker_attitude_is_new"}
    assert recorded | ALIKE <= set(run.data_vars)
    error, deviation = errors(run, "mekf"), np.asarray(run["mekf_attitude_deviation"])
    time = np.asarray(run["time"])
    assert (error[50:] < 5.0 * np.linalg.norm(deviation[50:], axis=1)).all()
    assert error[time > 200.0].max() < math.radians(0.05)
    # It stays on target while the tracker is out.
    out = np.asarray(run["star_tracker_attitude_is_new"])[(time > 122.0) & (time < 178.0)]
    assert out.max() == 0.0
    on_target = 2.0 * np.arccos(np.minimum(1.0, np.abs(np.asarray(run["attitude_error"])[time > 150.0, 0])))
    assert on_target.max() < math.radians(0.5)


def test_sun_and_magnetometer(tmp_path):
    run = flown(tmp_path, COARSE)
    assert {"triad_attitude", "triad_rate", "triad_attitude_age"} | ALIKE <= set(run.data_vars)
    age = np.asarray(run["triad_attitude_age"])[1:]
    lit = np.asarray(run["sun_sensor_sun_is_seen"])[1:] > 0.5
    assert lit.mean() > 0.5
    # 0.1 deg of the Sun's sensor, and 50 nT of at least 20 uT at some angle to the Sun.
    assert np.median(errors(run, "triad")[1:][age == 0.0]) < math.radians(0.5)
