"""The magnetometer filter against least squares over all fields, and against the truth from tumbling on."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

import starhold as sh
from starhold.parts import magnetic_field
from starhold.parts.craft import make_craft
from starhold.parts.estimators import magnetometer_filter
from tests.making import spun
from tests.tiers import leading

PERIOD, FIELD, START, RATE = 0.5, 5e-9, 1e-3, 1.5e-4
INERTIA = np.array([0.035, 0.03, 0.012])
PARAMS = magnetometer_filter.Params(FIELD, bias=RATE, rate=RATE, rate_walk=0.0, start_deviation=START)
EPOCH = magnetic_field.prepared((2026.0, 1.0, 1.0, 0.0, 0.0, 0.0))
NAME = "magnetometer_filter"


def position(step):
    turn = 1.1e-3 * PERIOD * step
    return 6.878e6 * np.array([math.cos(turn), -0.13 * math.sin(turn), 0.99 * math.sin(turn)])


def turned_by_gyro(x, steps, shown):
    """The attitudes of a body that turns as a gyro shows, less its bias."""
    return [Rotation.from_rotvec(x[:3]) * Rotation.from_rotvec(k * PERIOD * (shown - x[3:])) for k in range(steps)]


def turned_freely(x, steps, rate):
    """The attitudes of a free body, by SciPy."""
    begin = Rotation.from_rotvec(x[:3]).as_quat(scalar_first=True)
    attitudes, _ = spun(lambda t, q: np.zeros(3), PERIOD * np.arange(steps), begin, rate + x[3:], np.diag(INERTIA))
    return [Rotation.from_quat(q, scalar_first=True) for q in attitudes]


@pytest.mark.parametrize("move", leading([turned_by_gyro, turned_freely]))
def test_estimate_is_the_most_likely_one(move):
    """Of a gyro without noise and of a body without torque, whose motions have no unknowns but those of the start."""
    steps, random, shown = 240, np.random.default_rng(3), np.array([0.01, -0.02, 0.015])
    known = [np.array(magnetic_field.field(tuple(position(k)), k * PERIOD, EPOCH)) for k in range(steps)]
    spread = np.repeat([START, RATE], 3)
    truth = move(spread * random.normal(size=6), steps, shown)
    fields = [q.inv().apply(b) + random.normal(scale=FIELD, size=3) for q, b in zip(truth, known, strict=True)]

    def residuals(x):
        moved = move(x, steps, shown)
        off = [q.inv().apply(b) - seen for q, b, seen in zip(moved, known, fields, strict=True)]
        return np.concatenate([*np.divide(off, FIELD), x / spread])

    found = least_squares(residuals, np.zeros(6), x_scale=spread)
    last, covariance = move(found.x, steps, shown)[-1], np.linalg.inv(found.jac.T @ found.jac)
    # How the last attitude depends on the start.
    slopes = [(last.inv() * move(found.x + d, steps, shown)[-1]).as_rotvec() / 1e-6 for d in 1e-6 * np.eye(6)]
    wanted = np.sqrt(np.diag(np.transpose(slopes) @ covariance @ slopes))

    craft, gyro = make_craft(INERTIA), move is turned_by_gyro
    numbers = magnetometer_filter.prepare(PARAMS, PERIOD)
    memory = magnetometer_filter.remember(numbers, None)
    memory = memory if gyro else memory._replace(slow=tuple(shown))
    for k, seen in enumerate(fields):
        readings = SimpleNamespace(magnetic_field=tuple(seen), position=tuple(position(k)))
        readings = SimpleNamespace(**vars(readings), rate=tuple(shown)) if gyro else readings
        estimate, memory = magnetometer_filter.estimate(readings, memory, numbers, craft, PERIOD)
    apart = (last.inv() * Rotation.from_quat(estimate.attitude, scalar_first=True)).as_rotvec()
    assert np.abs(apart / wanted).max() < 0.03
    assert estimate.attitude_deviation == pytest.approx(wanted, rel=0.02)
    if gyro:
        assert np.abs((estimate.gyro_bias - found.x[3:]) / np.sqrt(np.diag(covariance))[3:]).max() < 0.03


def tumbling(gyro, seed, duration, **magnetometer):
    """A flight of a CubeSat released at 10 deg/s about any axis in any attitude."""
    random = np.random.default_rng(seed)
    attitude, axis = random.normal(size=4), random.normal(size=3)
    bias = random.normal(scale=math.radians(0.5), size=3).tolist()
    told = {"noise": "0.3 deg/sqrt(h)", "bias_walk": "5 deg/h"}
    parts = [
        {"type": "gnss", "position": 10.0},
        {"type": "magnetometer", "noise": "200 nT", **magnetometer},
        {"type": "magnetometer-filter", "field": "200 nT", "bias": "0.5 deg/s", "rate_walk": 2e-5, **told},
        *([{"type": "gyro", "bias": bias, **told}] if gyro else []),
    ]
    given = {
        "name": "tumbling",
        "spacecraft": {"inertia": INERTIA.tolist()},
        "orbit": {"position": [6.878e6, 0.0, 0.0], "velocity": [0.0, -980.0, 7548.0]},
        "initial": {
            "attitude": (attitude / np.linalg.norm(attitude)).tolist(),
            "rate": (math.radians(10.0) * axis / np.linalg.norm(axis)).tolist(),
        },
        # 2e-5 rad/s a second of rate, about the mean moment.
        "environment": {"torque_noise": 0.0 if gyro else 2e-5 * 0.0257 / math.sqrt(PERIOD)},
        "simulation": {"duration": duration, "control_period": PERIOD, "substeps": 2, "record_every": 20, "seed": seed},
        "part": parts,
        "law": [{"type": "pd", "k_rate": 1e-12, "k_attitude": 1e-12}],
    }
    return sh.simulate(sh.scenario(given))


def errors(run):
    """The errors of the attitude (rad) at all samples, and whether it is said to be valid."""
    true, told = (Rotation.from_quat(run[name].values, scalar_first=True) for name in ("attitude", f"{NAME}_attitude"))
    return (true.inv() * told).as_rotvec(), run[f"{NAME}_is_valid"].values > 0.5


def test_it_finds_attitude_and_rate_of_a_body_that_tumbles():
    """With a gyro and an outage: errors over deviations before it, at its end and long after it are in a 99.9 % band."""
    squares, outage = [], (1800.0, 2100.0)
    for seed in range(1, 17):
        run = tumbling(True, seed, "45 min", outage=list(outage))
        off, valid = errors(run)
        time, size = run["time"].values, np.degrees(np.linalg.norm(off, axis=1))
        assert not valid[time < 100.0].any()
        assert valid[time > 1500.0].all()
        assert size[valid].max() < 5.0
        rate = run["rate"].values - run[f"{NAME}_rate"].values
        assert np.degrees(np.linalg.norm(rate, axis=1))[time > 1500.0].max() < 0.1
        deviations = run[f"{NAME}_attitude_deviation"].values
        places = [np.searchsorted(time, t) for t in (outage[0] - 10.0, outage[1] - 10.0, 2700.0)]
        squares.append((off[places] / deviations[places]) ** 2)
    low, high = stats.chi2(48).ppf([0.0005, 0.9995])
    totals = np.sum(squares, axis=(0, 2))
    assert ((low < totals) & (totals < high)).all(), totals / 48.0


@pytest.mark.slow
def test_without_a_gyro_it_takes_longer():
    found = []
    for seed in range(1, 41):
        off, valid = errors(tumbling(False, seed, "100 min"))
        size = np.degrees(np.linalg.norm(off, axis=1))
        found.append((valid[-1], size[-1] < 3.0, (valid & (size > 10.0)).mean()))
    ends, near, wrong = np.transpose(found)
    assert ends.mean() >= 0.9
    assert near[ends > 0.5].all()
    assert wrong.mean() < 0.005
