"""Estimates say whether they rest on a measurement, and their deviations are right between measurements too."""

import tomllib
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

import starhold as sh
from starhold.report.attitude_plots import unsure
from starhold.scenario.building import build
from starhold.simulation.lane import Recording
from tests.parts.trackers import ARCSEC, COMPLEMENTARY, FILTER, FIRST, GYRO, ORBIT, errors, scenario
from tests.tiers import leading

LATE = FIRST | {"outage": [0.0, 10.0]}
DIRECTIONS = ({"type": "gnss"}, {"type": "magnetometer"}, {"type": "sun-sensor", "outage": [0.0, 10.0]})


@pytest.mark.parametrize(
    ("parts", "name"),
    leading(
        [
            ((GYRO, LATE, FILTER), "mekf"),
            ((GYRO, LATE, COMPLEMENTARY), "complementary_filter"),
            ((GYRO, *DIRECTIONS, {"type": "triad"}), "triad"),
            ((GYRO, *DIRECTIONS, {"type": "quest"}), "quest"),
        ],
        2,
    ),
)
def test_an_estimate_is_valid_from_the_first_fix_on(parts, name):
    given = scenario(*parts, orbit=ORBIT, record_every=1)
    run = sh.simulate(given)
    valid, time = run[f"{name}_is_valid"].values, run["time"].values
    assert valid.tolist() == (time >= 10.0).astype(float).tolist()
    # Before its first reading it is where it begins, and not where the body is.
    loop = build(given, given.laws[0])
    first = loop.carry().memories.estimate
    assert first.attitude == (1.0, 0.0, 0.0, 0.0) != loop.start.attitude
    assert first.is_valid == 0.0


def test_an_estimate_that_is_too_uncertain_is_not_valid():
    lost = FIRST | {"outage": [5.0, 30.0]}
    run = sh.simulate(scenario(GYRO, lost, FILTER | {"valid_within": "100 arcsec"}, record_every=1))
    deviation = run["mekf_attitude_deviation"].values.max(axis=1)
    assert run["mekf_is_valid"].values.tolist() == (deviation <= 100.0 * ARCSEC).astype(float).tolist()
    assert 0.2 < run["mekf_is_valid"].values.mean() < 0.9


def test_time_without_a_valid_estimate_is_required_flown_many_times_and_drawn():
    """Of a tracker that comes up at 10 s of 40: 20 of 81 instants. Where no estimator says it, there is no such metric."""
    required = [
        {"id": "share", "metric": "invalid_share", "method": "flight", "at_most": 20 / 81},
        {"id": "longest", "metric": "longest_invalid", "method": "campaign", "at_most": "9.9 s"},
    ]
    drawn = {
        "requirement": required,
        "campaign": {"runs": 4, "over": {"initial.rate": {"distribution": "normal", "sigma": 1e-3}}},
    }
    text = tomllib.loads(scenario(GYRO, LATE, FILTER, record_every=1).text)
    share, longest = sh.verify(sh.scenario(text | drawn))
    assert (share.verdict, share.number, longest.verdict) == ("met", 20 / 81, "missed")
    run = sh.simulate(sh.scenario(text))
    assert unsure([SimpleNamespace(recording=Recording.of(run))]) == ((0.0, 10.0),)
    with pytest.raises(sh.InputError, match=r"invalid_share.* limit_share"):
        sh.verify(sh.scenario(tomllib.loads(scenario().text) | {"requirement": required[:1]}))


def test_errors_are_as_large_as_the_filter_says_between_updates_and_through_an_outage():
    """Before the outage, in it, at its end and after it, and between two fixes then, of 80 flights: squares over the
    deviation's are in the 99.9 % band."""
    random, squares = np.random.default_rng(12), []
    head = FIRST | {"outage": [10.0, 30.0], "interval": 2.0}
    for seed in range(80):
        gyro = GYRO | {"bias": random.normal(scale=3e-4, size=3).tolist()}
        run = sh.simulate(scenario(gyro, head, FILTER, seed=seed + 1, record_every=1))
        places = np.searchsorted(run["time"].values, (9.5, 20.0, 29.5, 30.5, 34.5, 38.0, 38.5, 39.0, 39.5))
        deviations = run["mekf_attitude_deviation"].values[places]
        squares.append((errors(run)[places] / deviations) ** 2)
        assert (deviations[2, :2] > 5.0 * deviations[0, :2]).all()
    low, high = stats.chi2(240).ppf([0.0005, 0.9995])
    totals = np.sum(squares, axis=(0, 2))
    assert ((low < totals) & (totals < high)).all(), totals / 240.0
