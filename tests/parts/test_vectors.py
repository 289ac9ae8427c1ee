"""Directions in the Kalman filter: against a sequential one of NumPy, in flights, and with a tracker that sees nothing."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

import starhold as sh
from starhold.conformance.bench import CRAFT
from starhold.conformance.verdicts import agree
from starhold.parts import magnetic_field, sun
from starhold.parts.epoch import START
from starhold.parts.estimators import mekf
from starhold.scenario.building import build
from tests.parts.trackers import ARCSEC, FIRST, GYRO, MEKF, errors, scenario

PERIOD = 0.5
DEVIATIONS = {"sun": 2e-3, "field": 6e-3, "nadir": 4e-3}
PARAMS = mekf.Params(5e-5, 3e-3, 1e-3, 20.0 * ARCSEC, 120.0 * ARCSEC, (0.0, 0.6, 0.8), **DEVIATIONS)
LIGHT, FIELD = sun.prepared(START), magnetic_field.prepared(START)
READING, WALK = PARAMS.noise / math.sqrt(PERIOD), PARAMS.bias_walk * math.sqrt(PERIOD / 3600.0)
"""Deviations of a reading of the gyro and of the change of its bias in a control period (rad/s)."""


def unit(vector):
    return np.array(vector) / np.linalg.norm(vector)


def skew(v):
    return np.cross(v, np.eye(3)).T


def turn_of(quaternion):
    return Rotation.from_quat(quaternion, scalar_first=True)


def flight(steps, seed):
    """True attitudes, biases and noises of the gyro, and the readings at all control steps: of trackers, a gyro, two Sun
    sensors, a magnetometer and a horizon sensor, each of which sees something now and then."""
    random = np.random.default_rng(seed)
    bias, rate, turn = random.normal(scale=PARAMS.bias, size=3), np.array([0.02, -0.05, 0.03]), Rotation.random(rng=random)
    cross, roll, axis = PARAMS.cross, PARAMS.roll, np.array(PARAMS.boresight)
    truth, shown = [], []
    for k in range(steps):
        angle = 1.1e-3 * PERIOD * k
        position = 6.9e6 * np.array([math.cos(angle), 0.6 * math.sin(angle), 0.8 * math.sin(angle)])
        field = np.array(magnetic_field.field(tuple(position), PERIOD * k, FIELD))
        known = {"sun": np.array(sun.sun(PERIOD * k, LIGHT).direction), "field": field, "nadir": -position}
        seen = {name: turn.inv().apply(unit(known[name])) + s * random.normal(size=3) for name, s in DEVIATIONS.items()}
        other = turn.inv().apply(known["sun"]) + DEVIATIONS["sun"] * random.normal(size=3)
        angles, noise = random.normal(size=3), random.normal(scale=READING, size=3)
        tracked = turn * Rotation.from_rotvec(cross * (angles - axis * (axis @ angles)) + roll * axis * (axis @ angles))
        sensors = (
            {"rate": rate + bias + noise},
            {"position": position},
            {"attitude": tracked.as_quat(scalar_first=True), "attitude_is_new": k in (3, 4) or k % 7 == 6},
            {"sun": unit(seen["sun"]), "sun_is_seen": k % 2 == 0},
            {"sun": unit(other) * (k % 3 == 0), "sun_is_seen": k % 3 == 0},
            {"magnetic_field": np.linalg.norm(field) * seen["field"], "magnetic_field_is_new": k % 4 != 1},
            {"nadir": unit(seen["nadir"]), "nadir_is_seen": k % 5 == 2},
        )
        every = tuple(
            SimpleNamespace(**{n: tuple(x) if np.ndim(x) else float(x) for n, x in one.items()}) for one in sensors
        )
        first = {name: value for one in reversed(every) for name, value in vars(one).items()}
        truth.append((turn, bias, noise, known))
        shown.append(SimpleNamespace(**first, every=every))
        push = random.normal(scale=2e-3, size=3)
        turn, rate = turn * Rotation.from_rotvec(PERIOD * (rate + 0.5 * push)), rate + push
        bias = bias + random.normal(scale=WALK, size=3)
    return truth, shown


def filtered(shown, params=PARAMS):
    numbers = mekf.prepare(params, PERIOD)
    memory, given = mekf.remember(numbers, None), []
    for readings in shown:
        estimate, memory = mekf.estimate(readings, memory, numbers, CRAFT, PERIOD)
        given.append((estimate, memory))
    return given


def test_estimates_are_those_of_measurements_taken_one_after_the_other():
    """Nine errors, of attitude, bias and the gyro's last noise, corrected row by row in Joseph's form."""
    truth, shown = flight(60, seed=3)
    given = filtered(shown)
    half, nothing = 0.5 * PERIOD, np.zeros((3, 3))
    head = np.linalg.inv(PARAMS.cross * np.eye(3) + (PARAMS.roll - PARAMS.cross) * np.outer(*[PARAMS.boresight] * 2))
    turn, bias, last = Rotation.identity(), np.zeros(3), None
    spread = np.diag(np.repeat([PARAMS.start_deviation, PARAMS.bias, READING], 3)) ** 2
    fixed = False
    for readings, (*_, known), (estimate, memory) in zip(shown, truth, given, strict=True):
        rate = np.array(readings.rate)
        if last is not None:
            moved = Rotation.from_rotvec(PERIOD * (0.5 * (last + rate) - bias))
            axes = moved.inv().as_matrix()
            turn = turn * moved
            step = np.block([[axes, -half * (axes + np.eye(3)), -half * axes], [nothing, np.eye(3), nothing], [nothing] * 3])
            drive = np.block([[-half * np.eye(3), -half * np.eye(3)], [np.eye(3), nothing], [nothing, np.eye(3)]])
            spread = step @ spread @ step.T + drive @ np.diag(np.repeat([WALK, READING], 3) ** 2) @ drive.T
        last = rate
        rows = []
        tracker = readings.every[2]
        if tracker.attitude_is_new:
            apart = 2.0 * (turn.inv() * turn_of(tracker.attitude)).as_quat(canonical=True)[:3]
            rows += [(row, row @ apart, 1.0) for row in head]
        if fixed:
            kinds = {"sun": ("sun", "sun_is_seen"), "field": ("magnetic_field", "magnetic_field_is_new")}
            for kind, (name, flag) in (kinds | {"nadir": ("nadir", "nadir_is_seen")}).items():
                for one in readings.every:
                    if hasattr(one, name) and getattr(one, flag):
                        foretold = turn.inv().apply(unit(known[kind]))
                        off = unit(getattr(one, name)) - foretold
                        rows += [(skew(foretold)[i], off[i], DEVIATIONS[kind]) for i in range(3)]
        if tracker.attitude_is_new and not fixed:
            turn = turn_of(tracker.attitude)
            spread[:3], spread[:, :3] = 0.0, 0.0
            spread[:3, :3] = np.linalg.inv(head.T @ head)
            spread[:3, 6:], spread[6:, :3], rows = 0.0, 0.0, []
        change = np.zeros(9)
        for row, off, deviation in rows:
            h = np.concatenate([row, np.zeros(6)])
            gain = spread @ h / (h @ spread @ h + deviation**2)
            change = change + gain * (off - h @ change)
            joseph = np.eye(9) - np.outer(gain, h)
            spread = joseph @ spread @ joseph.T + deviation**2 * np.outer(gain, gain)
        fixed = fixed or bool(tracker.attitude_is_new)
        small, bias, noise = change[:3], bias + change[3:6], change[6:]

        def on(angles, begin=turn):
            return begin * Rotation.from_quat(unit([1.0, *(0.5 * angles)]), scalar_first=True)

        deviations = np.sqrt(np.diag(spread))
        assert (on(small).inv() * turn_of(estimate.attitude)).magnitude() < 1e-10
        assert np.abs(np.array(estimate.gyro_bias) - bias).max() < 1e-10 * PARAMS.bias
        assert np.abs(np.array(estimate.rate) - (rate - bias - noise)).max() < 1e-10
        # Before the first fix the noise of the first reading counts in the start.
        assert estimate.attitude_deviation == pytest.approx(deviations[:3].tolist(), rel=1e-10 if fixed else 1e-8)
        assert estimate.gyro_bias_deviation == pytest.approx(deviations[3:6].tolist(), rel=1e-10)
        # The attitude that is kept lacks half a period of the noise.
        turn = on(small - half * noise)
        assert (turn.inv() * turn_of(memory.attitude)).magnitude() < 1e-10
    assert fixed


def test_errors_are_as_large_as_the_filter_says():
    """Squares of all six errors over their covariance, at steps after which all, some or no sensors saw something, of 40
    flights: each in its 95 % band."""
    places, squares = (8, 15, 22, 30, 39), []
    for seed in range(40):
        truth, shown = flight(40, seed)
        given, row = filtered(shown), []
        for (turn, bias, noise, _), (_, memory) in ((truth[k], given[k]) for k in places):
            kept = turn * Rotation.from_rotvec(-0.5 * PERIOD * noise)
            error = np.concatenate([(turn_of(memory.attitude).inv() * kept).as_rotvec(), bias - memory.bias])
            blocks = [[memory.turn, memory.mixed], [np.transpose(memory.mixed), memory.walk]]
            covariance = np.block([[np.array(block) for block in line] for line in blocks])
            row.append(error @ np.linalg.solve(covariance, error))
        squares.append(row)
    low, high = stats.chi2(240).ppf([0.025, 0.975])
    totals = np.sum(squares, axis=0)
    assert ((low < totals) & (totals < high)).all(), totals / 240.0


def test_directions_correct_no_attitude_that_was_made_of_them():
    """The step at which another estimator starts the filter leaves its attitude and the stated deviation as they are."""
    truth, shown = flight(3, seed=5)
    begun = tuple((truth[0][0] * Rotation.from_rotvec([0.01, 0.0, -0.01])).as_quat(scalar_first=True))
    for readings in shown:
        readings.fix = SimpleNamespace(attitude=begun, is_valid=1.0)
    alone = PARAMS._replace(cross=math.inf, roll=math.inf, start_deviation=0.02)
    (first, _), _, (third, _) = filtered(shown, alone)
    assert first.attitude == pytest.approx(begun, abs=1e-15)
    assert first.attitude_deviation == pytest.approx((0.02,) * 3)
    assert first.is_valid == third.is_valid == 1.0
    assert (truth[2][0].inv() * turn_of(third.attitude)).magnitude() < 0.01
    assert max(third.attitude_deviation) < 0.01


OBSERVER = {"altitude": "520 km", "inclination": "97.5 deg", "raan": "25 deg", "epoch": "2027-03-20T09:00:00Z"}
SENSORS = (
    GYRO | {"bias": [3e-4, -2e-4, 1e-4]},
    {"type": "gnss"},
    {"type": "magnetometer", "noise": "100 nT"},
    {"type": "sun-sensor", "noise": "0.1 deg"},
)
BOTH = {"sun": "0.1 deg", "field": "0.25 deg"}


def test_sun_and_field_hold_the_error_down_while_trackers_see_nothing():
    """Filters of the gyro alone, with each direction alone, and with both, in one flight: 24 minutes after the last fix."""
    taken = {"alone": {}, "sun": {"sun": BOTH["sun"]}, "field": {"field": BOTH["field"]}, "both": BOTH}
    filters = [MEKF | {"name": name, "watches": name != "both"} | more for name, more in taken.items()]
    blind = FIRST | {"outage": [60.0, 2000.0]}
    run = sh.simulate(scenario(*SENSORS, blind, *filters, orbit=OBSERVER, duration="1500 s"))
    late, worst = run["time"].values > 300.0, {}
    for name in taken:
        off = (turn_of(run["attitude"].values).inv() * turn_of(run[f"{name}_attitude"].values)).as_rotvec()[late]
        assert 0.5 < np.sqrt(np.mean((off / run[f"{name}_attitude_deviation"].values[late]) ** 2)) < 2.0, name
        worst[name] = math.degrees(np.linalg.norm(off, axis=1).max())
    assert worst["both"] < 0.15
    assert worst["alone"] > 30.0 * worst["both"]
    assert min(worst["sun"], worst["field"]) > 10.0 * worst["both"]


def test_directions_that_are_not_seen_correct_nothing():
    """A Sun sensor in the shadow of its outage, and a magnetometer in its own."""
    gone = {"outage": [0.0, 100.0]}
    sensors = [one | gone if one["type"] in ("magnetometer", "sun-sensor") else one for one in SENSORS]
    filters = MEKF | {"name": "alone"}, MEKF | BOTH | {"name": "seeing", "watches": True}
    run = sh.simulate(scenario(*sensors, FIRST, *filters, orbit=OBSERVER, record_every=1))
    for name in ("attitude", "gyro_bias", "attitude_deviation"):
        assert run[f"seeing_{name}"].values == pytest.approx(run[f"alone_{name}"].values, rel=1e-9, abs=1e-12)


def test_without_a_star_tracker_another_estimator_gives_the_first_attitude():
    watching = {"type": "quest", "watches": True, **BOTH}
    filtered = MEKF | BOTH | {"started_by": "quest", "start_deviation": "0.5 deg"}
    given = scenario(*SENSORS, watching, filtered, orbit=OBSERVER, duration="200 s", record_every=1)
    run = sh.simulate(given)
    true, best = turn_of(run["attitude"].values), turn_of(run["quest_attitude"].values)
    late = run["time"].values > 60.0
    off, raw = np.linalg.norm(errors(run)[late], axis=1), (true.inv() * best).magnitude()[late]
    assert run["mekf_is_valid"].values.all()
    assert np.sqrt(np.mean(off**2)) < 0.25 * np.sqrt(np.mean(raw**2))
    loop = build(given, given.laws[0])
    agree(loop, [loop.start] * 3, (0,))


@pytest.mark.parametrize(
    ("parts", "orbit", "message"),
    [
        ((FIRST, MEKF | {"sun": 0.01}), OBSERVER, "no sun, which mekf needs; allowed: a sensor that measures sun, such as"),
        ((FIRST, SENSORS[2], MEKF | {"field": 0.01}), OBSERVER, "no position, which mekf needs"),
        ((FIRST, MEKF | {"nadir": 0.01}), OBSERVER, "no nadir, which mekf needs"),
        ((SENSORS[3], MEKF | {"sun": 0.01}), OBSERVER, "no fix, which mekf needs; allowed: started_by, the estimator whose"),
        ((MEKF,), OBSERVER, "no attitude, which mekf needs"),
        ((FIRST, SENSORS[3], MEKF | {"sun": 0.0}), OBSERVER, "sun: found 0.0; allowed: above 0"),
        ((FIRST, SENSORS[3], MEKF | {"sun": 0.01, "epoch": [2027] * 6}), OBSERVER, "epoch"),
        ((FIRST, *SENSORS[1:3], MEKF | {"field": 0.01}), OBSERVER | {"epoch": "2031-01-01T00:00:00Z"}, "2025 to 2030"),
    ],
)
def test_bad_input_is_refused_in_one_line(parts, orbit, message):
    with pytest.raises(sh.InputError) as caught:
        sh.simulate(scenario(SENSORS[0], *parts, orbit=orbit))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
