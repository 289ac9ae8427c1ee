"""Dead times and jitter of sensors, against a flight that SciPy integrates: the state at the instant of exposure."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import starhold as sh
from starhold.errors import InputError
from starhold.parts.catalogue import parts
from starhold.parts.contract import DEVIATIONS, UNBOUNDED
from starhold.parts.random import Dice, Silent
from starhold.parts.sensors import gnss, gyro
from tests.parts.trackers import ARCSEC, FILTER, FIRST, GYRO, errors, scenario

PERIOD, INERTIA = 0.1, np.array([2.0, 3.0, 4.0])
EARTH = 3.986004418e14
RATE = [0.1, -0.2, 0.15]
ORBIT = {"position": [6.9e6, 0.0, 0.0], "velocity": [0.0, 5.0e3, 5.7e3], "gravitational_parameter": EARTH}
CASES = {0.0: 1e-9, 0.3: 1e-9, 0.26: 4e-5, 0.05: 4e-5}
"""Dead times (s), whole periods and others, and by how much readings may differ: a straight line between control instants
has an error of the square of the period."""


def flown(**timing):
    """A flight almost without torque, and its sensors, all late alike."""
    sensors = [
        {"type": "gyro"} | timing,
        {"type": "star-tracker", "cross": 0.0, "roll": 0.0} | timing,
        {"type": "gnss"} | timing,
        {"type": "sun-sensor", "half_angle": math.pi} | timing,
        {"type": "horizon-sensor"} | timing,
        {"type": "magnetometer"} | timing,
        {"type": "coarse-sun-sensors", "threshold": 0.0} | timing,
    ]
    given = scenario(
        *sensors,
        {"type": "complementary-filter", "attitude_gain": 0.1, "bias_gain": 0.0},
        orbit=ORBIT,
        duration="20 s",
        control_period=PERIOD,
        record_every=1,
        substeps=2,
    )
    law = {"law[1]": {"type": "pd", "k_rate": 1e-12, "k_attitude": 1e-12}, "initial.rate": RATE}
    return sh.simulate(given.with_(law))


@pytest.fixture(scope="module")
def truth():
    run = flown()
    start = [*run["attitude"].values[0], *RATE, *ORBIT["position"], *ORBIT["velocity"]]

    def slope(_, y):
        (q0, *q), w, r, v = y[:4], y[4:7], y[7:10], y[10:]
        turn = [-0.5 * np.dot(q, w), *(0.5 * (q0 * w + np.cross(q, w)))]
        return [*turn, *(np.cross(INERTIA * w, w) / INERTIA), *v, *(-EARTH / np.linalg.norm(r) ** 3 * r)]

    solved = solve_ivp(slope, (0.0, 20.0), start, "DOP853", rtol=1e-12, atol=1e-12, dense_output=True)
    return run, lambda times: solved.sol(np.maximum(times, 0.0)).T


@pytest.mark.parametrize("delay", CASES)
def test_a_reading_is_of_the_state_before_the_dead_time(truth, delay):
    exact, at = truth
    run = flown(delay=delay) if delay else exact
    then = at(run["time"].values - delay)
    settled = run["time"].values >= delay
    turned = Rotation.from_quat(then[:, :4], scalar_first=True)
    within = CASES[delay]
    assert np.abs(run["gyro_rate"].values - then[:, 4:7])[settled].max() < within
    shown = Rotation.from_quat(run["star_tracker_attitude"].values, scalar_first=True)
    assert (turned.inv() * shown).magnitude()[settled].max() < within
    assert np.abs(run["gnss_position"].values - then[:, 7:10])[settled].max() < 8e5 * within + 1e-5
    assert np.abs(run["gnss_velocity"].values - then[:, 10:])[settled].max() < 1e3 * within + 1e-8
    down = turned.inv().apply(-then[:, 7:10] / np.linalg.norm(then[:, 7:10], axis=1)[:, None])
    assert np.abs(run["horizon_sensor_nadir"].values - down)[settled].max() < within
    # What is shown without a dead time is turned back into inertial axes, where Sun and field hardly move.
    now = Rotation.from_quat(exact["attitude"].values, scalar_first=True)
    for name, slack in (("sun_sensor_sun", 1e-7), ("magnetometer_magnetic_field", 4e-3)):
        still = now.apply(exact[name].values)
        off = np.linalg.norm(run[name].values - turned.inv().apply(still), axis=1) / np.linalg.norm(still, axis=1)
        assert off[settled].max() < within + slack * delay
    # The diodes' direction is that of the Sun.
    assert np.abs(run["coarse_sun_sensors_sun"].values - run["sun_sensor_sun"].values)[settled].max() < 2e-5


def test_until_a_dead_time_is_over_the_start_is_shown():
    run = flown(delay=0.5)
    for name in ("gyro_rate", "star_tracker_attitude", "gnss_position"):
        shown, state = run[name].values, run[name.split("_")[-1]].values
        assert np.abs(shown[:6] - state[0]).max() < 1e-15 * np.abs(state[0]).max()
        assert np.abs(shown[5:] - state[:-5]).max() < 1e-15 * np.abs(state[0]).max()


def test_the_filter_lags_by_a_dead_time_that_it_does_not_know():
    """Of a body that turns steadily the attitude is off by rate times dead time: nobody takes it out, and the filter says so
    as little as it can."""
    late = FIRST | {"delay": "50 ms"}
    run = sh.simulate(scenario(GYRO, late, FILTER, duration="100 s", control_period=0.1))
    rate, off = run["rate"].values[-1], errors(run)[-1]
    assert np.abs(off + 0.05 * rate).max() < 6.0 * 80.0 * ARCSEC
    run = sh.simulate(
        scenario(GYRO | {"delay": "50 ms"}, FIRST, FILTER, duration="10 s", control_period=0.1, record_every=1)
    )
    assert np.abs(run["gyro_rate"].values[1:] - run["rate"].values[1:]).max() > 1e-4


@pytest.mark.parametrize(
    ("sensor", "field", "before", "after"),
    [(gyro, "rate", (0.1, 0.2, -0.3), (0.2, 0.0, -0.3)), (gnss, "position", (7e6, 0.0, 0.0), (7e6 - 10.0, 700.0, 50.0))],
)
@pytest.mark.parametrize("delay", [0.0, 0.25])
def test_jitter_moves_the_instant_along_the_change(sensor, field, before, after, delay):
    """Half a second apart: a reading is on the line through both, 0.01 s off by one deviation."""
    states = [
        SimpleNamespace(_replace=None, rate=(0.0,) * 3, position=(7e6, 0.0, 0.0), velocity=(0.0,) * 3) for _ in range(2)
    ]
    for state, value in zip(states, (before, after), strict=True):
        vars(state)[field] = value
        state._replace = lambda own=state, **new: SimpleNamespace(**(vars(own) | new))
    numbers = sensor.prepare(sensor.Params(delay=delay, jitter=0.01), 0.5)
    memory = sensor.remember(numbers, states[0])
    _, memory = sensor.measure(states[0], memory, numbers, Silent(), 0)
    slope, off = np.subtract(after, before) / 0.5, []
    for step in range(500):
        shown = np.array(getattr(sensor.measure(states[1], memory, numbers, Dice((1, 2), step, 0), 1)[0], field))
        along = np.dot(shown - after, slope) / np.dot(slope, slope)
        assert shown - after == pytest.approx(along * slope, abs=1e-9 * np.linalg.norm(after))
        off.append(along)
    assert np.mean(off) == pytest.approx(-delay, abs=3.0 * 0.01 / math.sqrt(500.0))
    assert np.std(off) == pytest.approx(0.01, rel=0.1)


LATE = [p for p in parts("sensor").values() if {"delay", "jitter"} & {*p.module.Params._fields}]


@pytest.mark.parametrize("part", LATE, ids=lambda part: part.name)
@pytest.mark.parametrize("key", ["delay", "jitter"])
def test_a_claim_bounds_no_sensor_that_is_late_anyhow(part, key):
    """What declares the error of readings calls it unbounded, whatever else the sensor has, but that by a delay of attitude
    or rate or by its jitter, which grows with the motion; a claim leaves out one that declares none, with its noise."""
    tell = part.hook("error")
    for params in part.module.examples():
        late = params._replace(**{"jitter": 0.0, key: 0.1}) if hasattr(params, "jitter") else params._replace(**{key: 0.1})
        errors = UNBOUNDED if tell is None else tell(late)
        expected = 0.1 if key == "delay" else late.delay + 0.1 * DEVIATIONS
        grows = max(errors.turning, errors.late) >= errors.ago == expected and errors.gaussian == (key == "jitter")
        assert errors == UNBOUNDED or (grows and part.name in ("gyro", "star-tracker"))
    assert tell is not None or part.hook("noise") is None
    assert {"gyro", "magnetometer", "star-tracker"} <= {p.name for p in LATE}


def test_too_long_a_dead_time_is_refused():
    with pytest.raises(InputError, match="part gyro: the delay must be at most 64 control periods, 32 s"):
        sh.simulate(scenario(GYRO | {"delay": "33 s"}, FIRST, FILTER))
