"""Sweeps measure what comparisons measure, bit for bit, whatever differs between the runs."""

import math

import numpy as np
import pytest
import xarray as xr

import starhold as sh
from starhold.algebra.structure import flatten
from starhold.simulation.batched import Flying, fly_batched
from starhold.simulation.lane import fly
from starhold.studies.compare import build, fly_law
from tests.refusals import refused
from tests.running import starhold
from tests.tiers import leading

SHORT = {"simulation.duration": 20.0, "simulation.record_every": 3}
THREE = sh.load("three-laws").with_(SHORT)
WHEELS = sh.load("wheels-orbital")
POINT = sh.load("l2-circle").with_({"simulation.duration": 0.5, "law.relay": None, "law.relay with layer": None})
FAULT = {"time": 10.3, "wheel": 2, "lost": True, "inertia": [6.0, 8.0, 5.0], "delay": 5.0}
FULL = [[2.0, 0.1, 0.0], [0.1, 3.0, 0.0], [0.0, 0.0, 4.0]]

SWEPT = {
    "gains": (THREE, {"law.lyapunov.k_rate": np.linspace(0.05, 0.2, 6), "law.lyapunov.k_attitude": [0.005, 0.009]}, None),
    "inertia, diagonal or not": (
        THREE,
        {"spacecraft.inertia": [[2, 3, 4], [2, 3, 3], [3, 3, 3], [2, 2, 3], FULL]},
        "sliding",
    ),
    "limits and kinds": (
        THREE.with_({"law.mpc": None}),
        {"spacecraft.limit": ["axis", "norm", "none"], "spacecraft.torque_limit": [0.01, 0.02]},
        None,
    ),
    "whole numbers": (THREE, {"law.mpc.horizon": [5, 10]}, None),
    "periods": (THREE, {"simulation.control_period": [0.05, 0.1, 0.2, 0.1, 0.1, 0.1, 0.1]}, "sliding"),
    "noise and seeds": (
        THREE,
        {"environment.torque_noise": [0.0, 1e-4, 2e-4, 3e-4, 4e-4], "simulation.seed": [1, 2]},
        "sliding",
    ),
    "starts": (
        THREE,
        {"initial.rate": [[0.04, 0.03, 0.02], [0.0, 0.0, 0.0], [5.0, 0, 0], ["70 rad/s", 0, 0], [0.1, 0, 0]]},
        "lyapunov",
    ),
    "faults": (
        WHEELS.with_({"simulation.duration": 60.0, "simulation.record_every": 7, "fault": [FAULT]}),
        {"fault[1].inertia": [[6.0, 8.0, 5.0], [6.5, 8.0, 5.0], [7.0, 8.0, 5.0], [7.0, 8.5, 5.5], [7.5, 8.0, 5.0]]},
        None,
    ),
    "station keeping": (POINT, {"law.smooth.k": [0.5, 1.0, 2.0, 3.0, 4.0]}, None),
    "station keeping, the model": (
        POINT,
        {"libration.model": ["linear", "nonlinear"], "initial.position": [[0, 1, 0]] * 4},
        None,
    ),
}


def same(found, wanted):
    if isinstance(wanted, list):
        return found == wanted
    return (isinstance(found, float) and math.isnan(found)) if wanted is None else found == wanted


@pytest.mark.parametrize("kind", SWEPT)
def test_every_row_is_what_a_comparison_of_the_changed_scenario_measures(kind):
    scenario, changes, law = SWEPT[kind]
    table = sh.sweep(scenario, changes, law, threads=2)
    count = math.prod(len(values) for values in changes.values())
    flown = 1 if law is not None or any(key.startswith("law.") for key in changes) else len(scenario.laws)
    assert len(table) == count * flown
    for row in table.to_dict("records"):
        other = scenario.with_({key: row[key] for key in changes})
        wanted = sh.metrics(sh.simulate(other, row["law"]))
        for name, value in wanted.items():
            assert same(row[name], value), (row, name, value)


LANDING = sh.load("landing")
ALONE = {"simulation.duration": 5.0} | {f"law.{entry.name}": None for entry in LANDING.laws[1:]}


@pytest.mark.slow
@pytest.mark.parametrize("scenario", leading([POINT, LANDING.with_(ALONE), THREE]))
def test_metrics_of_a_run_are_those_of_its_flight_and_of_its_file(scenario, tmp_path):
    (tmp_path / "s.toml").write_text(scenario.text)
    starhold("run", "s.toml", "--no-certify", "-o", "out", cwd=tmp_path, code=0)
    entry = scenario.laws[0]
    flight = fly_law(scenario, entry, build(scenario, entry))
    run = sh.simulate(scenario)
    with xr.open_dataset(tmp_path / "out" / "run.nc") as read:
        assert set(read.attrs) == set(run.attrs)
        for name, value in run.attrs.items():
            assert np.array_equal(read.attrs[name], value), name
        for found in (sh.metrics(run), sh.metrics(read)):
            assert set(flight.metrics) - set(found) <= {"cost_median", "cost_worst"}
            for name, value in found.items():
                assert flight.metrics[name] == value, name
    assert sh.metrics(flight) == flight.metrics
    assert "diverged_at" not in run.attrs


def test_batched_flights_have_the_samples_of_single_ones_lost_ones_included():
    # Too fast to follow from the start, or soon, for a gain that the held torque cannot bear.
    rates = {0.0: 0.09, 0.04: 60.0, 70.0: 0.09, 0.02: 100.0, 0.01: 200.0}
    changed = [
        THREE.with_({"initial.rate": [f"{rate} rad/s", 0.1, 0.0], "law.lyapunov.k_rate": k, "spacecraft.torque_limit": None})
        for rate, k in rates.items()
    ]
    loops = [build(one, one.laws[0]) for one in changed]
    lost = set()
    for every in (1, 7):
        together = fly_batched([Flying(loop, 50, every) for loop in loops], lambda _, samples, carry: (samples, carry))
        for loop, (samples, carry) in zip(loops, together, strict=True):
            wanted, end = fly(loop, 50, every)
            assert np.array_equal(samples, wanted, equal_nan=True)
            assert carry.lost_at == end.lost_at
            if carry.lost_at < 0.0:
                assert flatten(carry) == flatten(end)
            lost.add(carry.lost_at)
    assert {-1.0, 0.0} < lost


def test_pairs_are_flown_as_they_are_given_and_names_pick_the_laws():
    table = sh.sweep(
        THREE, [{"law.sliding.surface_gain": 0.08, "law.sliding.switching_gain": 0.005}, {"law.sliding.surface_gain": 0.1}]
    )
    assert table["law"].tolist() == ["sliding"] * 2
    assert np.isnan(table["law.sliding.switching_gain"][1])
    both = sh.sweep(THREE, {"law.sliding.surface_gain": [0.08, 0.1], "law.lyapunov.k_rate": [0.1]})
    assert sorted(both["law"]) == ["lyapunov", "lyapunov", "sliding", "sliding"]
    assert len(sh.sweep(THREE, {"simulation.seed": [1]})) == 3


@pytest.mark.parametrize(
    ("changes", "law", "said"),
    [
        ({"law.lyapunov.k_rate": [0.1, -0.1]}, None, "law[1].k_rate: found -0.1"),
        ({"law.lyapunov.k_rate": 0.1}, None, "allowed: a list of values to fly"),
        ({"spacecraft.torque_limit": "0.1 N m"}, None, "allowed: a list of values to fly"),
        ({}, None, "nothing to change"),
        ({"law.lyapunov.k_rate": []}, None, "nothing to change"),
        ([{}], None, "nothing to change"),
        ({"simulation.seed": [1]}, "slidin", "did you mean sliding?"),
    ],
)
def test_what_cannot_be_flown_is_one_line(changes, law, said):
    with refused(said):
        sh.sweep(THREE, changes, law)


def test_progress_is_told_to_the_end():
    told = []
    sh.sweep(THREE, {"law.lyapunov.k_rate": [0.1, 0.11, 0.12, 0.13, 0.14]}, progress=lambda *at: told.append(at))
    assert told[-1] == (5, 5)


def test_results_as_tables(tmp_path):
    run = sh.simulate(THREE)
    table = sh.to_pandas(run)
    assert len(table) == run.sizes["time"]
    assert np.array_equal(table["rate_error_y"], run.rate_error[:, 1])
    assert np.array_equal(table["attitude_q0"], run.attitude[:, 0])
    wheels = sh.to_pandas(sh.simulate(WHEELS.with_({"simulation.duration": 1.0})))
    assert "wheel_momentum_1" in wheels
    flights = sh.compare(THREE)
    told = sh.to_pandas(flights)
    assert told["name"].tolist() == ["lyapunov", "sliding", "mpc"]
    assert told["peak_torque"].tolist() == [flight.metrics["peak_torque"] for flight in flights]
    claims = sh.to_pandas([certificate for flight in flights for certificate in flight.certificates])
    assert set(claims[claims["name"] == "lyapunov"]["outcome"]) == {"proved"}
    with pytest.raises(TypeError, match="cannot make a table of int"):
        sh.to_pandas([3])
    with pytest.raises(ValueError, match="not a run"):
        sh.metrics(xr.Dataset())
