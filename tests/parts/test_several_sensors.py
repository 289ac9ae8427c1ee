"""Loops with several star trackers: what filters make of them, what is recorded, and what flies in all forms."""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import starhold as sh
from starhold.conformance.verdicts import agree
from starhold.scenario import reading
from starhold.scenario.building import build
from tests.parts.trackers import ARCSEC, FILTER, FIRST, GYRO, MEKF, SECOND, TWO, errors, row, scenario, tracker


def test_a_filter_takes_the_trackers_own_numbers_where_it_states_none():
    """A campaign may draw them only as known to it; what the filter states itself it keeps."""
    assumed, stated = scenario(GYRO, FIRST, SECOND, MEKF), scenario(GYRO, FIRST, SECOND, TWO)
    assert sh.simulate(assumed).identical(sh.simulate(stated).assign_attrs(scenario=assumed.text))
    tuned = scenario(GYRO, FIRST, MEKF | {"cross": 1e-3})
    assert build(tuned, tuned.laws[0]).find("mekf").params[3:5] == (1e-3, FIRST["roll"])
    with pytest.raises(sh.InputError, match="part mekf: the deviations cross and roll of each star tracker must be above 0"):
        sh.simulate(scenario(GYRO, tracker(0.0, 0.0), MEKF))
    for given, key in ((assumed, "star-tracker.cross"), (assumed, "star-tracker-2.roll")):
        over = {f"part.{key}": {"distribution": "normal", "sigma": "1 arcsec"}}
        with pytest.raises(sh.InputError, match="known_to_law: found false; allowed: true"):
            sh.campaign(given, runs=2, over=over, search=False)
        assert len(sh.campaign(stated, runs=2, over=over, search=False).frame()) == 2


def test_two_equal_trackers_are_one_of_half_the_variance():
    own, half = tracker(10.0 * ARCSEC, 10.0 * ARCSEC), 10.0 * ARCSEC / math.sqrt(2.0)
    even = MEKF | {"cross": own["cross"], "roll": own["roll"]}
    pair = sh.simulate(scenario(GYRO, own, own, even | {"more_trackers": [row(own)]}))
    one = sh.simulate(scenario(GYRO, tracker(half, half), MEKF | {"cross": half, "roll": half}))
    names = ("mekf_attitude_deviation", "mekf_gyro_bias_deviation")
    for name in names:
        # The axes turn with another estimate of the rate.
        assert pair[name].values[1:] == pytest.approx(one[name].values[1:], rel=1e-4)
    alone = sh.simulate(scenario(GYRO, own, even))
    assert (alone[names[0]].values[5:] > 1.1 * pair[names[0]].values[5:]).all()


def test_what_a_second_tracker_sees_is_used_while_the_first_sees_nothing():
    blind = FIRST | {"outage": [0.0, 100.0]}
    run = sh.simulate(scenario(GYRO, blind, SECOND, TWO))
    assert not run["star_tracker_attitude_is_new"].values.any()
    assert np.abs(errors(run)[-1]).max() < 100.0 * ARCSEC
    order = FILTER | {"cross": SECOND["cross"], "roll": SECOND["roll"], "boresight": SECOND["boresight"]}
    swapped = sh.simulate(scenario(GYRO, SECOND, blind, order | {"more_trackers": [row(FIRST)]}))
    deviations = (one["mekf_attitude_deviation"].values[1:] for one in (run, swapped))
    assert np.abs(np.divide(*deviations) - 1.0).max() < 1e-3


def test_columns_are_called_after_the_parts():
    run = sh.simulate(scenario(GYRO, FIRST, SECOND | {"name": "side"}, TWO))
    first, second = (
        Rotation.from_quat(run[f"{name}_attitude"].values, scalar_first=True) for name in ("star_tracker", "side")
    )
    assert run["side_attitude_is_new"].values[1:].mean() == pytest.approx(1 / 3, abs=0.02)
    # Each has random numbers of its own.
    assert (first[1].inv() * second[1]).magnitude() > ARCSEC


@pytest.mark.parametrize("estimator", [TWO, {"type": "complementary-filter", "attitude_gain": 0.2, "bias_gain": 0.01}])
def test_all_forms_of_a_flight_agree(estimator):
    given = scenario(GYRO, FIRST, SECOND, estimator)
    loop = build(given, given.laws[0])
    agree(loop, [loop.start] * 3, (0,))


def test_complementary_filter_takes_the_mean():
    filtered = {"type": "complementary-filter", "attitude_gain": 1.0, "bias_gain": 0.0}
    run = sh.simulate(scenario(GYRO, FIRST, tracker(50.0 * ARCSEC, 50.0 * ARCSEC), filtered))
    first, second, told = (
        Rotation.from_quat(run[f"{name}_attitude"].values[1:], scalar_first=True)
        for name in ("star_tracker", "star_tracker_2", "complementary_filter")
    )
    mean = first * Rotation.from_rotvec(0.5 * (first.inv() * second).as_rotvec())
    assert (mean.inv() * told).magnitude().max() < 1e-9


def test_second_magnetometer_is_recorded_where_nothing_reads_one_and_refused_elsewhere(tmp_path):
    second = '\n[[part]]\ntype = "magnetometer"\nname = "boom"\nnoise = 1e-9\n'
    builtin = Path(reading.__file__).parent / "builtin" / "cubesat-nadir.toml"
    (tmp_path / "read.toml").write_text(builtin.read_text() + second)
    with pytest.raises(sh.InputError, match="part boom: found a second sensor of magnetic_field, beside magnetometer"):
        sh.simulate(tmp_path / "read.toml", "wheel")
    orbit = {"position": [6.9e6, 0.0, 0.0], "velocity": [0.0, 5.0e3, 5.7e3]}
    magnetometers = [{"type": "magnetometer", "noise": 1e-8}, {"type": "magnetometer", "noise": 1e-9, "name": "boom"}]
    run = sh.simulate(scenario(*magnetometers, orbit=orbit))
    apart = (run["magnetometer_magnetic_field"] - run["boom_magnetic_field"]).values[1:]
    assert 0.8e-8 < apart.std() < 1.2e-8
