"""What results say of themselves in Python: short, with units, by names that a user knows."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import starhold as sh
from starhold.scenario.reading import builtin_names, load
from tests.tiers import leading

STEPS, FEW = 40, ("l2-circle", "landing", "wheels-orbital", "cubesat-nadir")


@pytest.fixture(scope="module")
def short():
    return load("cubesat-slew").with_({"simulation.duration": 4.0})


def test_a_run_holds_the_angle_to_the_target(short):
    run = sh.simulate(short)
    turned = Rotation.from_quat(run["attitude_error"].to_numpy(), scalar_first=True)
    np.testing.assert_allclose(run["error_angle"], turned.magnitude(), rtol=1e-12)
    assert run["error_angle"].attrs == {"units": "rad", "long_name": "angle to the target"}


@pytest.mark.parametrize("name", leading(dict.fromkeys([*FEW, *builtin_names()]), len(FEW)))
def test_every_number_of_a_flight_has_its_unit(name):
    whole = load(name)
    timing = whole.table.simulation
    brief = whole.with_({"simulation.duration": STEPS * timing.control_period, "simulation.record_every": 1, "fault": None})
    entry = brief.laws[0]
    found = sh.metrics(sh.simulate(brief, entry.name))
    numbers = {key for key, value in found.items() if not isinstance(value, bool | list) or key == "peak_accelerations"}
    assert numbers == set(found.units)
    assert found.units["settling_time"] == "s"
    assert found.units["effort"] == ("m/s" if brief.body == "libration-point" else "N m s")


def test_flights_and_margins_have_units(short):
    flights = sh.compare(short)
    assert sh.metrics(flights[0]).units["cost_median"] == "s"
    assert sh.to_pandas(flights).attrs["units"]["peak_rate" if "peak_rate" in flights[0].metrics else "peak_torque"]
    margins = sh.margins(short)
    assert set(margins[0].units) == set(margins[0]._fields) - {"axis"}
    assert sh.to_pandas(margins).attrs["units"] == margins[0].units


@pytest.mark.slow
def test_a_campaign_tells_in_words_that_a_user_knows():
    """No list of numbers where a law's results are shown, and columns called after parts."""
    brief = load("cubesat-nadir").with_({"simulation.duration": 10.0, "simulation.record_every": 1, "fault": None})
    over = {
        "part.gyro.bias": {"distribution": "normal", "mean": 0, "sigma": 1e-4},
        "part.star-tracker.cross": {"distribution": "uniform", "low": 1e-5, "high": 1e-4},
        "wheels.momentum": {"distribution": "normal", "sigma": 1e-4},
    }
    result = sh.campaign(brief, runs=4, law="lyapunov", over=over, search=False)
    assert len(repr(result.laws[0])) < 200
    assert all(len(repr(spread)) < 500 for spread in result.laws[0].spreads)
    frame = result.frame()
    flown = {name.partition("[")[0] for name in frame.columns if name.startswith("flown.")}
    assert flown == {"flown.gyro.memory", "flown.star-tracker.cross", "flown.wheels.state.momentum"}
    np.testing.assert_array_equal(frame["flown.gyro.memory[2]"], frame["part.gyro.bias[2]"])


def test_metrics_are_of_the_numbers_of_samples_whatever_else_a_dataset_holds():
    run = sh.simulate(sh.load("three-laws").with_({"simulation.duration": 30.0}), "lyapunov")
    wanted = sh.metrics(run)
    for other in (
        run.map(np.asfortranarray).assign_attrs(run.attrs),
        run.assign(note=("time", ["a word"] * run.sizes["time"], {"units": "1", "long_name": "note"})),
        run.assign(mass=((), 3.0, {"units": "kg", "long_name": "mass"})),
        run.drop_vars("rate"),
    ):
        assert sh.metrics(other) == wanted
    single = sh.metrics(run.astype("f4", keep_attrs=True))
    assert single["peak_torque"] == pytest.approx(wanted["peak_torque"], rel=1e-6)
