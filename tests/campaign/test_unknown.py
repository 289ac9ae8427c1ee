"""Campaigns with inertia and alignments that no law knows, and with known ones, against a simulation by NumPy alone."""

import numpy as np
import pytest

import starhold as sh
from tests.campaign.flown import normal

INERTIA, START, RATE = np.array([3.0, 4.0, 5.0]), np.array([0.9, 0.1, -0.3, 0.2]), np.array([0.3, -0.2, 0.4])
LIMIT, K_RATE, K_ATTITUDE, PERIOD, STEPS, SUBSTEPS = 0.5, 2.6, 1.3, 0.2, 200, 4
SHARE, TURN, SPIN = 0.05, 0.004, 0.02
"""Deviations: of a moment of inertia as a share of it, of alignments about each axis (rad), of the rate (rad/s)."""
EFFORT, ERROR = 5.2, 0.008
CRAFT = {
    "name": "unknown",
    "spacecraft": {"inertia": INERTIA.tolist(), "torque_limit": LIMIT},
    "initial": {"attitude": START.tolist(), "rate": RATE.tolist()},
    "simulation": {"duration": PERIOD * STEPS, "control_period": PERIOD, "substeps": SUBSTEPS, "seed": 7},
    "part": [{"type": "gyro"}, {"type": "star-tracker", "cross": 0.0, "roll": 0.0}],
    "law": [{"type": "lyapunov", "k_rate": K_RATE, "k_attitude": K_ATTITUDE}],
}
HEAD, GYRO = "part.star-tracker.mounting_error", "part.gyro.mounting_error"
ASKED = [{"metric": "effort", "at_most": EFFORT}, {"metric": "final_attitude_error", "at_most": ERROR}]


def product(p, q):
    """Of quaternions, scalar first, a row each."""
    s = p[:, :1] * q[:, :1] - np.sum(p[:, 1:] * q[:, 1:], axis=1, keepdims=True)
    return np.hstack([s, p[:, :1] * q[:, 1:] + q[:, :1] * p[:, 1:] + np.cross(p[:, 1:], q[:, 1:])])


def turned(vectors):
    """The quaternions of rotation vectors."""
    angle = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.hstack([np.cos(0.5 * angle), 0.5 * np.sinc(0.5 * angle / np.pi) * vectors])


def by_numpy(inertia, supposed, rate, head, gyro):
    """Effort and largest error in the last quarter of flights, a row each: Euler's equations by RK4 under a held torque, of
    a law that supposes an inertia, and reads a tracker and a gyro which are turned against the body."""
    lanes = len(rate)
    q, w = np.tile(START / np.linalg.norm(START), (lanes, 1)), rate.copy()
    of_head, of_gyro = turned(head), turned(gyro)
    effort, worst = np.zeros(lanes), np.zeros(lanes)

    def slope(state, torque):
        q, w = state[:, :4], state[:, 4:]
        spun = 0.5 * product(q, np.hstack([np.zeros((lanes, 1)), w]))
        return np.hstack([spun, (torque - np.cross(w, inertia * w)) / inertia])

    for step in range(STEPS):
        back = of_gyro * [1.0, -1.0, -1.0, -1.0]
        seen = product(product(back, np.hstack([np.zeros((lanes, 1)), w])), of_gyro)[:, 1:]
        shown = product(q, of_head)[:, 1:]
        torque = np.clip(np.cross(seen, supposed * seen) - K_RATE * seen - K_ATTITUDE * shown, -LIMIT, LIMIT)
        effort += np.linalg.norm(torque, axis=1) * PERIOD
        state, h = np.hstack([q, w]), PERIOD / SUBSTEPS
        for _ in range(SUBSTEPS):
            a = slope(state, torque)
            b = slope(state + 0.5 * h * a, torque)
            c = slope(state + 0.5 * h * b, torque)
            state = state + h / 6.0 * (a + 2.0 * b + 2.0 * c + slope(state + h * c, torque))
        q, w = state[:, :4] / np.linalg.norm(state[:, :4], axis=1, keepdims=True), state[:, 4:]
        if step > 0.75 * STEPS - 2:
            worst = np.maximum(worst, 2.0 * np.arctan2(np.linalg.norm(q[:, 1:], axis=1), np.abs(q[:, 0])))
    return effort, worst


def flown(known, runs):
    """A campaign, and what NumPy makes of the same draws. A known alignment is corrected in software, so it is as if none
    were there."""
    over = {"spacecraft.inertia": normal(SHARE, relative=True, known_to_law=known), "initial.rate": normal(SPIN)}
    over |= {} if known else {HEAD: normal(TURN), GYRO: normal(TURN)}
    frame = sh.campaign(sh.scenario(CRAFT), None, runs=runs, over=over, requirement=ASKED, threads=1, search=False).frame()

    def drawn(key):
        return frame[[f"{key}[{k}]" for k in (1, 2, 3)]].to_numpy() if f"{key}[1]" in frame else np.zeros((runs, 3))

    inertia = drawn("spacecraft.inertia")
    effort, worst = by_numpy(inertia, inertia if known else INERTIA, drawn("initial.rate"), drawn(HEAD), drawn(GYRO))
    assert frame["effort"].to_numpy() == pytest.approx(effort, rel=1e-6)
    assert frame["final_attitude_error"].to_numpy() == pytest.approx(worst, abs=1e-6)
    return (frame["effort"] <= EFFORT) & (frame["final_attitude_error"] <= ERROR)


@pytest.mark.parametrize("known", [False, True])
def test_flights_are_those_of_numpy_run_by_run(known):
    assert 0.05 < flown(known, 60).mean() < 0.99


@pytest.mark.slow
def test_ten_thousand_flights_are_judged_as_an_independent_simulation_judges_its_own():
    """Of draws of its own: both shares of successes, and how far they lie apart, within three deviations."""
    runs, random, shares = 10_000, np.random.default_rng(5), []
    for known in (False, True):
        inertia = INERTIA * (1.0 + SHARE * random.normal(size=(runs, 3)))
        head, gyro = (0.0 if known else TURN) * random.normal(size=(2, runs, 3))
        rate = RATE + SPIN * random.normal(size=(runs, 3))
        effort, worst = by_numpy(inertia, inertia if known else INERTIA, rate, head, gyro)
        shares.append((flown(known, runs).mean(), np.mean((effort <= EFFORT) & (worst <= ERROR))))
    pairs = np.array(shares)
    variances = (pairs * (1.0 - pairs) / runs).sum(axis=1)
    apart = pairs[:, 0] - pairs[:, 1]
    assert (np.abs(apart) < 3.0 * np.sqrt(variances)).all()
    assert abs(apart[1] - apart[0]) < 3.0 * np.sqrt(variances.sum())
    # The two cases themselves differ by far more than that.
    assert pairs[1, 0] - pairs[0, 0] > 10.0 * np.sqrt(variances.sum())
