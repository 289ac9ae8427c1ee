"""No claim covers a flight that is told more wrongly than it assumes, as before an estimate has settled."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from starhold.analysis.departure import covered, departures
from starhold.analysis.misreadings import misreadings
from starhold.scenario.building import build
from starhold.scenario.reading import parse
from starhold.simulation.lane import fly
from starhold.studies.body import study_of
from tests.certification.own_spacecraft import LATE, OWN, TEXTS, loop_with

STEP = 0.25
STEADY = {"share": None, "attitude_error": 1e-4, "rate_error": 1e-5}


class Flown(dict):
    """What is recorded of a flight whose filter tells rates (n, 3) off by others, and the attitude by angles (n,)."""

    unit = 1.0

    def __init__(self, rate, off, turned):
        seen = np.zeros((len(rate), 4))
        seen[:, 0], seen[:, 2] = np.cos(turned / 2.0), np.sin(turned / 2.0)
        true = {"time": np.arange(len(rate)) * STEP, "attitude": np.eye(4)[[0] * len(rate)], "rate": rate}
        super().__init__(true, complementary_filter_attitude=seen, complementary_filter_rate=rate + off)


def wrong(flight, **numbers):
    """The samples at which attitude and rate are told more wrongly than a claim with these numbers says."""
    claim = SimpleNamespace(numbers=STEADY | numbers, assumptions=("settled-estimate",))
    return np.array(misreadings(claim, loop_with(TEXTS["filtered"])[1], flight))


def test_an_estimate_without_noise_is_compared_with_its_bounds():
    off, turned = np.zeros((6, 3)), np.array([0.0, 0.0, 0.0, 0.0, 2e-4, 0.0])
    off[2, 1] = 2e-5
    assert np.argwhere(wrong(Flown(np.zeros((6, 3)), off, turned))).tolist() == [[0, 4], [1, 2]]


def test_errors_that_grow_with_the_motion_are_bounded_by_that_of_the_last_windows():
    random, growth, ago, kept = np.random.default_rng(4), np.array([[0.3, 0.5], [0.01, 0.1]]), 1.6, 0.4
    rate = 1e-2 * np.cumsum(random.normal(size=(60, 3)), axis=0) * (random.uniform(size=(60, 1)) < 0.2)
    change = [0.0, *np.linalg.norm(np.diff(rate, axis=0), axis=1) / STEP, 0.0]
    faster = np.maximum(change[1:], change[:-1])
    moved = np.array([np.linalg.norm(rate, axis=1) + STEP / 2.0 * faster, faster])
    most, length = np.zeros((2, 60)), math.ceil(ago / STEP)
    for k in range(60):
        before = np.zeros(2)
        for window in range(30):
            last = max(0, k - window * length)
            grown = np.maximum(before, growth @ moved[:, max(0, last - length) : last + 1].max(axis=1))
            most[:, k], before = most[:, k] + kept**window * (grown - before), grown
    for share, held in ((0.999, True), (1.001, False)):
        turned, off = share * (most + np.array([[1e-4], [1e-5]]))
        found = wrong(Flown(rate, np.outer(off, [0.0, 0.6, 0.8]), turned), told_growth=[*growth.flat, ago, kept])
        assert (found == (not held)).all()


SLOW = """
[[part]]
type = "star-tracker"
cross = 0.0
roll = 0.0
interval = 0.5
[[part]]
type = "gyro"
bias = ["0.1 deg/s", "0 deg/s", "0 deg/s"]
[[part]]
type = "mekf"
noise = 1e-5
bias_walk = 1e-6
bias = 1e-6
cross = "60 arcsec"
roll = "60 arcsec"
"""


def flight_with(parts):
    """The certificate of the law with these sensors, its loop, and a flight of it."""
    scenario = parse(OWN.replace("duration = 200.0", "duration = 3000.0") + parts, "own.toml", None)
    loop = build(scenario, scenario.laws[0])
    (issued,) = study_of(scenario.body).certify(scenario, scenario.laws[0], loop, pointing=True)
    samples, carry = fly(loop, scenario.table.simulation.steps)
    return issued.certificate, loop, study_of(scenario.body).name_samples(scenario, loop, samples, carry)


@pytest.mark.slow
def test_a_flight_whose_filter_has_not_taken_out_the_bias_is_not_covered():
    """Without noise the claim has no share, and the flight goes on far beyond its bound."""
    certificate, loop, run = flight_with(SLOW)
    claim = certificate.claim("pointing")
    assert (claim.numbers["share"], claim.left_out) == (None, [])
    late = run["time"] > claim.numbers["settling"]
    assert run["error_angle"][late].max() > 5.0 * claim.numbers["angle"]
    assert departures(certificate, loop, run)["pointing"][0].time == 0.0
    begin, _ = covered(certificate, loop, run) or (math.inf, None)
    since = run["time"] - begin
    for time, most in claim.numbers["funnel"]:
        assert (run["error_angle"][since >= time] <= most).all()


@pytest.mark.slow
def test_late_readings_are_no_departure():
    certificate, loop, run = flight_with(LATE)
    assert not departures(certificate, loop, run)["pointing"]
    assert covered(certificate, loop, run) == (0.0, 3000.0)
