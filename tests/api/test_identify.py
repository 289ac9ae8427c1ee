"""Fits to telemetry: truth in the region that is told, exact slopes, what cannot be told by name, refusals, other code."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

import starhold as sh
from starhold.errors import InputError
from starhold.scenario.building import build
from starhold.scenario.reading import load, parse
from starhold.simulation.lane import fly, label
from starhold.studies.fitting import START, Free, Predictor
from starhold.studies.identify import Fit
from starhold.studies.residuals import noise_of
from starhold.studies.telemetry import read
from tests.running import starhold
from tests.texts import toml
from tests.tiers import WHOLE, fewer

GYRO, FIELD, DIPOLE = (
    '[[part]]\ntype = "gyro"\nnoise = 1e-4\nbias = [3e-4, -2e-4, 3e-4]\n',
    '[[part]]\ntype = "magnetometer"\nnoise = "100 nT"\n',
    '[[part]]\ntype = "residual-dipole"\ndipole = [0.05, -0.03, 0.04]\n',
)
TUMBLE = toml("""
name = "tumble"
[spacecraft] inertia = [0.05, 0.065, 0.025]
[orbit] altitude = "500 km"; inclination = "97.4 deg"; epoch = "2026-03-20T12:00:00Z"
[initial] rate = ["6 deg/s", "-5 deg/s", "6.2 deg/s"]
[environment] gravity_gradient = true
[simulation] duration = 120.0; control_period = 1.0; substeps = 2
[[law]] type = "pd"; k_rate = 1e-12; k_attitude = 1e-12
""")
INERTIA, BIAS = "spacecraft.inertia", "part.gyro.bias"


def scenario(*parts, text=TUMBLE, **changes):
    made = parse(text + "".join(parts), "tumble.toml")
    return made.with_(changes) if changes else made


def flown(made, run=0):
    """A Dataset of the first law's flight, with random numbers of its own."""
    loop = build(made, made.pick(None))
    return label(loop, *fly(loop, made.table.simulation.steps, 1, run), 1).dataset()


def predictor(made, *keys, outside=True):
    return Predictor(made, made.pick(None), Free.of(made, keys), outside)


@pytest.fixture(scope="module")
def cubesat():
    return scenario(GYRO, FIELD, DIPOLE)


@pytest.mark.slow
def test_the_truth_lies_in_the_region_and_the_covariance_is_that_of_the_scatter(cubesat):
    """Of flights with noise as stated, from wrong numbers: inertia of a tumbling CubeSat by gyro and magnetometer alone."""
    count = fewer(300, 30)
    told = cubesat.with_({INERTIA: [0.0505, 0.0645, 0.0252], BIAS: [0.0, 0.0, 0.0]})
    known = predictor(told, INERTIA, BIAS)
    truth = np.array([0.05, 0.065, 0.025, 3e-4, -2e-4, 3e-4])
    loop = build(cubesat, cubesat.pick(None))
    errors, fits = [], []
    for run in range(count):
        telemetry = read(cubesat, loop, flown(cubesat, run + 1))
        fit = Fit(told, known, telemetry).solved()
        assert fit.settled, run
        fits.append(fit)
        errors.append(fit.values - truth)
    errors = np.array(errors)
    distances = [e @ np.linalg.solve(f.posterior.covariance, e) for e, f in zip(errors, fits, strict=True)]
    inside = np.mean(np.array(distances) <= stats.chi2.ppf(0.95, len(truth)))
    deviations = np.mean([f.posterior.deviations for f in fits], axis=0)
    scatter = np.sqrt((errors**2).mean(axis=0))
    if WHOLE:
        assert 0.93 <= inside <= 0.97
        assert np.all(np.abs(scatter / deviations - 1.0) < 0.1)
    else:
        assert inside >= 0.7
        assert np.all((scatter / deviations > 0.5) & (scatter / deviations < 1.6))
    # The sum of squares is chi-squared with the degrees that are told.
    total, degrees = sum(f.chi2 for f in fits), sum(f.degrees for f in fits)
    assert 1e-4 < stats.chi2.cdf(total, degrees) < 1.0 - 1e-4
    assert np.mean([f.white for f in fits]) > 0.9


def test_predictions_have_the_bits_of_a_flight_without_noise(cubesat):
    quiet = cubesat.with_({"part.gyro.noise": 0.0, "part.magnetometer.noise": 0.0})
    run, known = flown(quiet), predictor(cubesat, INERTIA, BIAS)
    x = known.begun(known.loop.start.attitude, known.loop.start.rate)
    shown = known(x, 120, run["command"].to_numpy()).values
    for reading in known.readings:
        np.testing.assert_array_equal(shown[:, reading.rows], run[reading.name].to_numpy())


@pytest.mark.parametrize("outside", [True, False])
def test_slopes_against_differences_over_our_own_flights(outside):
    """Under given commands, and through filter and law: inertia with its products, bias, scale, dipole, start."""
    text = TUMBLE.replace("1e-12", "1e-3").replace(
        "[0.05, 0.065, 0.025]", "[[0.05, 1e-3, 0], [1e-3, 0.065, 0], [0, 0, 0.025]]"
    )
    tracker = '[[part]]\ntype = "star-tracker"\ncross = 1e-4\nroll = 1e-4\n'
    mekf = '[[part]]\ntype = "mekf"\nnoise = 1e-4\nbias_walk = 1e-5\nbias = 1e-3\ncross = 1e-4\nroll = 1e-4\n'
    made = scenario(GYRO, FIELD, DIPOLE, tracker, mekf, text=text)
    keys = (INERTIA, BIAS, "part.gyro.scale_error", "part.residual-dipole.dipole", "part.magnetometer.scale_error")
    known = predictor(made, *keys, outside=outside)
    x = known.begun((0.5, -0.5, 0.5, 0.5), known.loop.start.rate)
    commands = 1e-5 * np.random.default_rng(1).standard_normal((31, 3))
    slopes = known(x, 30, commands).slopes
    for k, name in enumerate((*START, *known.free.names)):
        step = 1e-4 * max(abs(x[k]), 1e-2 if k < len(START) else 1e-3)
        at = [known(x + s * step * (np.arange(len(x)) == k), 30, commands).values for s in (1, -1, 2, -2)]
        differences = (8.0 * (at[0] - at[1]) - (at[2] - at[3])) / (12.0 * step)
        size = np.abs(differences).max()
        assert size > 0.0, name
        np.testing.assert_allclose(slopes[..., k], differences, atol=2e-6 * size, err_msg=name)


def told_of(made, *keys, **options):
    return sh.identify(made, telemetry=flown(made, 1), free=keys, **options)


def test_the_scale_of_an_inertia_needs_a_torque_that_is_known():
    """The gravity gradient is none: it grows with the inertia."""
    fit = told_of(scenario(GYRO, FIELD), INERTIA, commands="none")
    (sentence,) = fit.posterior.sentences
    assert "the scale of spacecraft.inertia" in sentence
    assert not fit.posterior.is_determined.any()
    assert fit.values / fit.values[0] == pytest.approx(np.array([1.0, 1.3, 0.5]), rel=2e-3)
    # What is not told stays where the file has it, and is not flown as if it were.
    assert fit.values == pytest.approx([0.05, 0.065, 0.025], rel=2e-3)
    assert not fit.learnt().table.campaign or not fit.learnt().table.campaign.over
    # With all torques that make it known free as well, only their common scale is not.
    fit = told_of(scenario(GYRO, FIELD, DIPOLE), INERTIA, "part.residual-dipole.dipole", BIAS, commands="none")
    (sentence,) = fit.posterior.sentences
    assert "the common scale of spacecraft.inertia, part.residual-dipole.dipole" in sentence
    assert fit.posterior.is_determined.tolist() == [False] * 6 + [True] * 3
    assert list(fit.learnt().table.campaign.over) == [", ".join(f"{BIAS}[{k}]" for k in (1, 2, 3))]


@pytest.mark.slow
def test_scale_factors_that_no_reading_shows_are_named():
    """At a constant rate a gyro's scale factor is one with the rate, but for what turning its noise leaves possible; the
    noise itself shows in no prediction."""
    spinning = TUMBLE.replace('["6 deg/s", "-5 deg/s", "6.2 deg/s"]', "[0.0, 0.0, 0.01]").replace("= true", "= false")
    fit = told_of(scenario(GYRO, text=spinning), "part.gyro.scale_error", "part.gyro.noise", commands="none")
    assert sorted(fit.posterior.sentences) == [
        "These data barely constrain part.gyro.scale_error: its standard deviation exceeds its size.",
        "These data do not determine part.gyro.noise: no reading depends on it.",
    ]
    assert fit.posterior.barely(fit.free).tolist() == [True, False]
    assert not fit.learnt().table.campaign or not fit.learnt().table.campaign.over
    # The bias of its axis and the scale factor together: named with what they trade.
    fit = told_of(scenario(GYRO, FIELD, text=spinning), f"{BIAS}[3]", "part.gyro.scale_error", commands="none")
    (sentence,) = fit.posterior.sentences
    assert f"barely constrain {BIAS}[3], part.gyro.scale_error apart" in sentence


def test_readings_correlated_in_time_are_told(cubesat):
    """The telemetry has a dipole that the scenario lacks."""
    fit = sh.identify(scenario(GYRO, FIELD), telemetry=flown(cubesat), free=[BIAS], commands="none")
    assert not fit.white
    assert fit.consistent < 1e-6


def test_samples_between_instants_of_the_loop():
    """Telemetry every 0.7 s of a flight in steps of 0.1 s, fitted in steps of 1 s: a cubic through four instants is exact to
    less than the noise, a line is not."""
    fine = scenario(GYRO, FIELD, DIPOLE, **{"simulation.control_period": 0.1})
    run = flown(fine).isel(time=slice(0, 1190, 7))
    fit = sh.identify(
        scenario(GYRO.replace("1e-4", "3.1623e-4"), FIELD, DIPOLE), telemetry=run, free=[BIAS], commands="none"
    )
    assert fit.consistent > 0.01
    assert fit.white


def test_the_noise_that_sensors_state():
    """White noise as the file has it; of a direction both angles; what accumulates is told."""
    sun = '[[part]]\ntype = "sun-sensor"\nnoise = 1e-3\n'
    tracker = '[[part]]\ntype = "star-tracker"\ncross = 1e-4\nroll = 5e-4\nboresight = [0, 1, 0]\n'
    loop = build(made := scenario(GYRO.replace("noise", "bias_walk = 1e-5\nnoise"), FIELD, sun, tracker), made.pick(None))
    known = {r.name: noise_of(loop, r) for r in Predictor(made, made.pick(None), Free.of(made, [BIAS]), True).readings}
    covariances = {name: np.linalg.inv(n.whiten.T @ n.whiten) for name, n in known.items()}
    np.testing.assert_allclose(covariances["gyro_rate"], 1e-8 * np.eye(3), rtol=1e-12)
    np.testing.assert_allclose(covariances["magnetometer_magnetic_field"], 1e-14 * np.eye(3), rtol=1e-12)
    np.testing.assert_allclose(covariances["sun_sensor_sun"], 1e-6 * np.eye(3), rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(covariances["star_tracker_attitude"], np.diag([1e-8, 25e-8, 1e-8]), rtol=1e-9, atol=1e-17)
    assert [n.degrees for n in known.values()] == [3, 3, 2, 3]
    assert [n.accumulates for n in known.values()] == [True, False, False, False]


def test_from_the_command_line_to_a_campaign(tmp_path, cubesat):
    """Gaps, times between instants, and the file that comes out, which a campaign flies."""
    (tmp_path / "tumble.toml").write_text(cubesat.text)
    frame = flown(cubesat, 3).drop_vars(["attitude", "quaternion", "attitude_error"]).to_dataframe().reset_index()
    columns = {f"gyro_rate_{a}": flown(cubesat, 3)["gyro_rate"].sel(axis=a).to_numpy() for a in "xyz"}
    columns |= {
        f"magnetometer_magnetic_field_{a}": flown(cubesat, 3)["magnetometer_magnetic_field"].sel(axis=a) for a in "xyz"
    }
    import pandas as pd

    table = pd.DataFrame({"time": np.unique(frame["time"]), **columns})
    table.loc[20:40, "gyro_rate_y"] = np.nan
    table.drop(index=range(60, 70)).to_csv(tmp_path / "orbit.csv", index=False)
    words = ("identify", "tumble.toml", "orbit.csv", "--free", f"{INERTIA}, {BIAS}", "--commands", "none", "-o", "fit")
    done = starhold(*words, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "spacecraft.inertia = [0.0" in done.stdout
    assert {p.name for p in (tmp_path / "fit").iterdir()} == {
        "identify.csv",
        "identify.png",
        "identify.toml",
        "summary.json",
    }
    learnt = load(tmp_path / "fit" / "identify.toml")
    (dispersed,) = learnt.table.campaign.over.values()
    assert dispersed.distribution == "correlated-normal"
    campaign = sh.campaign(learnt.with_({"campaign.runs": 4, "simulation.duration": 5.0}), folder=tmp_path / "flown")
    drawn = campaign.frame()[[f"{INERTIA}[1]", f"{BIAS}[3]"]]
    assert (drawn.nunique() == 4).all()


KEYS = {
    "spacecraft.weight": "an unknown key",
    "spacecraft.mass": "no finite value",
    "part.gyro.epoch": "an unknown key",
    "spacecraft.limit": "not a real number",
    "initial.rate": "always fitted",
    "simulation.duration": "a key that all runs share",
    "orbit.altitude": "no equation gives the effect of",
    f"{BIAS}, {BIAS}[1]": "a number given twice",
    "part.gyro.limit": "no finite value",
    "": "found nothing",
}


@pytest.mark.parametrize("keys", KEYS)
def test_keys_that_cannot_be_fitted_are_refused_in_a_line(keys, cubesat):
    with pytest.raises(InputError, match=KEYS[keys]) as refused:
        sh.identify(cubesat, telemetry=flown(cubesat), free=keys)
    assert "--free" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_telemetry_that_does_not_fit_is_refused_in_a_line(cubesat, tmp_path):
    run = flown(cubesat)
    cases = [
        (run.drop_vars("magnetometer_magnetic_field"), cubesat, {}, "without magnetometer_magnetic_field"),
        (run.isel(time=slice(0, 1)), cubesat, {}, "12 free numbers with the start; allowed: at most the 6 data"),
        (run, cubesat.with_({"part.gyro.noise": 0.0}), {}, "gyro_rate: found no noise"),
        (run.drop_vars("command"), cubesat, {"commands": "recorded"}, "--commands: found recorded"),
        (run.assign_coords(time=run["time"] - 5.0), cubesat, {}, "begins at -5 s"),
    ]
    for telemetry, made, options, words in cases:
        with pytest.raises(InputError, match=words):
            sh.identify(made, telemetry=telemetry, free=[INERTIA, BIAS], **options)
    (tmp_path / "tumble.toml").write_text(cubesat.text)
    done = starhold("identify", "tumble.toml", "none.csv", "--free", BIAS, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1


@pytest.mark.slow
def test_numbers_of_a_basilisk_flight():
    """Other code flies the truth: a tumbling hub under a known torque, its recorded states with noise of our own."""
    from tests.oracles.basilisk import need, simulation

    need()
    from Basilisk.simulation import extForceTorque, spacecraft

    inertia = [[0.05, 1e-3, -5e-4], [1e-3, 0.065, 8e-4], [-5e-4, 8e-4, 0.03]]
    hub, pushed = spacecraft.Spacecraft(), extForceTorque.ExtForceTorque()
    hub.hub.mHub, hub.hub.IHubPntBc_B = 10.0, inertia
    hub.hub.r_CN_NInit, hub.hub.v_CN_NInit = [[7e6], [0.0], [0.0]], [[0.0], [7.5e3], [0.0]]
    hub.hub.sigma_BNInit, hub.hub.omega_BN_BInit = [[0.1], [0.2], [-0.3]], [[0.05], [-0.04], [0.06]]
    torque = [2e-5, -1e-5, 3e-5]
    pushed.extTorquePntB_B = [[x] for x in torque]
    hub.addDynamicEffector(pushed)
    record = hub.scStateOutMsg.recorder()
    _, run = simulation(0.5, hub, pushed, record)
    run(200.0)
    sigma, rates = record.sigma_BN, record.omega_BN_B
    square = (sigma**2).sum(axis=1, keepdims=True)
    attitudes = np.hstack([1.0 - square, 2.0 * sigma]) / (1.0 + square)
    noise = np.random.default_rng(7)
    bias = np.array([1e-3, -2e-3, 5e-4])
    turned = np.hstack([np.ones((len(sigma), 1)), 0.5e-4 * noise.standard_normal(sigma.shape)])
    q, d = attitudes.T, turned.T
    product = [q[0] * d[0] - (q[1:] * d[1:]).sum(axis=0), *(q[0] * d[1:] + d[0] * q[1:] + np.cross(q[1:].T, d[1:].T).T)]
    import xarray as xr

    telemetry = xr.Dataset(
        {
            "gyro_rate": (("time", "axis"), rates + bias + 1e-4 * noise.standard_normal(rates.shape)),
            "star_tracker_attitude": (("time", "quaternion"), np.array(product).T),
            "command": (("time", "axis"), np.tile(torque, (len(rates), 1))),
        },
        {"time": record.times() * 1e-9, "axis": list("xyz"), "quaternion": ["q0", "q1", "q2", "q3"]},
    )
    text = TUMBLE.replace("[0.05, 0.065, 0.025]", "[[0.06, 0, 0], [0, 0.06, 0], [0, 0, 0.03]]").replace("= true", "= false")
    text = text.replace("120.0", "200.0").replace("control_period = 1.0", "control_period = 0.5")
    tracker = '[[part]]\ntype = "star-tracker"\ncross = 1e-4\nroll = 1e-4\n'
    gyro = '[[part]]\ntype = "gyro"\nnoise = 7.0710678e-5\n'
    made = scenario(gyro, tracker, text=text)
    fit = sh.identify(made, telemetry=telemetry, free=[INERTIA, BIAS])
    truth = np.array([0.05, 1e-3, -5e-4, 0.065, 8e-4, 0.03, *bias])
    error = fit.values - truth
    assert fit.settled
    assert fit.white
    assert fit.consistent > 0.01
    assert error @ np.linalg.solve(fit.posterior.covariance, error) < stats.chi2.ppf(0.999, len(truth))
    assert np.all(fit.posterior.deviations < [1e-3 * 0.05] * 6 + [1e-4] * 3)
    # Nothing else than these commands pushes it.
    assert sh.identify(made, telemetry=telemetry, free=[BIAS], commands="none").consistent < 1e-9
    # The posterior of a matrix is one of its own.
    assert list(fit.learnt().table.campaign.over) == [INERTIA, ", ".join(f"{BIAS}[{k}]" for k in (1, 2, 3))]
    assert replace(fit, telemetry="").summary()["settled"]
