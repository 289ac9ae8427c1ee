"""Pointing error budgets: flights against linear theory and recordings, and the command."""

import csv
import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.linalg import solve_discrete_lyapunov
from scipy.spatial.transform import Rotation
from scipy.stats import norm

import starhold as sh
from starhold.errors import InputError
from starhold.scenario.bodies.rigid_body.craft import wheels_of
from starhold.studies.budget import COMBINED, LOOP, TOGETHER, sources
from tests.refusals import complains, refused
from tests.running import starhold
from tests.texts import toml

PERIOD, INERTIA, K_RATE, K_ATTITUDE = 0.5, (2.0, 3.0, 4.0), 0.4, 0.2
NOISE = {"torque noise": 2e-5, "attitude noise": 2e-4, "rate noise": 1e-4}
LINEAR = {
    "name": "linear",
    "spacecraft": {"inertia": list(INERTIA)},
    "environment": {"torque_noise": NOISE["torque noise"]},
    "sensor": {"attitude_noise": NOISE["attitude noise"], "rate_noise": NOISE["rate noise"]},
    "simulation": {"duration": 600.0, "control_period": PERIOD},
    "budget": {"start": 100.0, "window": 10.0, "separation": 60.0, "runs": 64},
    "law": [{"type": "pd", "k_rate": K_RATE, "k_attitude": K_ATTITUDE, "quaternion_sign": "shortest"}],
}
FULL = {
    "name": "imager",
    "spacecraft": {"inertia": [0.05, 0.065, 0.025], "torque_limit": "2 mN m"},
    "orbit": {"altitude": "500 km", "inclination": "97 deg"},
    "environment": {"gravity_gradient": True},
    "wheels": {
        "layout": "pyramid",
        "inertia": 1e-5,
        "torque_limit": "2 mN m",
        "momentum_limit": "15 mN m s",
        "viscous": 1e-8,
        "momentum": "1 mN m s",
    },
    "simulation": {"duration": 60.0, "control_period": 0.25, "record_every": 2, "seed": 7, "run": 3},
    "budget": {"start": 30.0, "window": 4.0, "separation": 10.0, "runs": 3, "confidence": 1.0, "boresight": [0, 0.6, 0.8]},
    "part": [
        {"type": "gyro", "noise": 2e-5, "bias": [1e-5, -2e-5, 1e-5]},
        {"type": "star-tracker", "cross": "10 arcsec", "roll": "60 arcsec", "interval": 0.5, "delay": 0.25},
        {"type": "complementary-filter", "attitude_gain": 0.1, "bias_gain": 0.004},
        {"type": "constant-torque", "name": "leak", "torque": ["1e-6 N m", 0, 0]},
    ],
    "law": [{"type": "lyapunov", "k_rate": 0.02, "k_attitude": 0.002, "quaternion_sign": "shortest"}],
}


@pytest.fixture(scope="module")
def linear():
    return sh.budget(sh.scenario(LINEAR))


@pytest.fixture(scope="module")
def full():
    return sh.budget(sh.scenario(FULL))


def deviations(inertia, source, length, apart):
    """Stationary standard deviations of the angle about an axis, of its mean over `length` instants and of the difference of
    such means, of the loop of one axis under the noise of a source: from the discrete Lyapunov equation."""
    held = np.array([[0.5 * PERIOD**2], [PERIOD]]) / inertia
    gain = np.array([[0.5 * K_ATTITUDE, K_RATE]])
    closed = np.array([[1.0, PERIOD], [0.0, 1.0]]) - held @ gain
    enters = {"torque noise": 1.0, "attitude noise": gain[0, 0], "rate noise": gain[0, 1]}[source] * NOISE[source]
    covariance = solve_discrete_lyapunov(closed, enters**2 * held @ held.T)
    lags = [(np.linalg.matrix_power(closed, lag) @ covariance)[0, 0] for lag in range(length + apart)]

    def of(weights):
        places = np.arange(len(weights))
        return np.sqrt(weights @ np.array(lags)[np.abs(places[:, None] - places)] @ weights)

    mean = np.ones(length) / length
    drift = np.pad(mean, (apart, 0)) - np.pad(mean, (0, apart))
    return {"APE": of(np.ones(1)), "MPE": of(mean), "PDE": of(drift)}


@pytest.mark.parametrize("source", NOISE)
def test_error_of_a_linear_loop_is_that_of_its_covariance(linear, source):
    for axis, inertia in zip("xyz", INERTIA, strict=True):
        for index, deviation in deviations(inertia, source, 20, 120).items():
            assert linear.row(source).figures[index][axis].deviation == pytest.approx(deviation, rel=0.06), (axis, index)


def test_independent_sources_of_a_linear_loop_add_up_as_squares(linear):
    assert [row.name for row in linear.rows] == [LOOP, *NOISE, COMBINED, TOGETHER]
    for index in ("APE", "MPE", "RPE", "PDE"):
        assert linear.level(LOOP, index) == 0.0
        for axis in "xyz":
            together = linear.row(TOGETHER).figures[index][axis]
            assert together.deviation == pytest.approx(linear.row(COMBINED).figures[index][axis].deviation, rel=0.05)
            # What is relative to a mean varies along its window.
            if index != "RPE":
                assert together.level == pytest.approx(norm.isf(0.5 * 0.0027) * together.deviation, rel=0.12)
        assert linear.level(TOGETHER, index) == pytest.approx(linear.level(COMBINED, index), rel=0.08)


@pytest.mark.slow
def test_errors_together_are_those_of_recorded_runs(full):
    """Every run of the budget is the run of that number, whose error and estimate SciPy turns into rotation vectors."""
    scenario, errors, knowledge = sh.scenario(FULL), [], []
    for run in range(3, 6):
        record = sh.simulate(scenario.with_({"simulation.run": run}))
        kept = record.sel(time=record.time[(record.time > 29.9) & (record.time < 59.9)])
        true, told = (
            Rotation.from_quat(kept[name].to_numpy(), scalar_first=True)
            for name in ("attitude", "complementary_filter_attitude")
        )
        errors.append(true.as_rotvec())
        knowledge.append((true.inv() * told).as_rotvec())
    across = np.array(FULL["budget"]["boresight"])
    for name, vectors in (("APE", errors), ("AKE", knowledge)):
        expected = np.linalg.norm(np.cross(vectors, across), axis=-1).max()
        assert full.level(TOGETHER, name) == pytest.approx(expected, rel=1e-9)
        assert full.row(TOGETHER).figures[name]["y"].mean == pytest.approx(np.mean(np.array(vectors)[..., 1]), rel=1e-8)
    means = [pd.DataFrame(run).rolling(8).mean().to_numpy()[7:] for run in errors]
    drifts = np.array([run[20:] - run[:-20] for run in means])
    assert full.row(TOGETHER).figures["MPE"]["angle"].level == pytest.approx(np.linalg.norm(means, axis=-1).max(), rel=1e-9)
    assert full.row(TOGETHER).figures["PDE"]["z"].level == pytest.approx(np.abs(drifts[..., 2]).max(), rel=1e-9)


def test_every_number_that_disturbs_is_a_source_and_what_shapes_the_loop_is_none(full):
    names = [source.name for source in sources(sh.scenario(FULL))]
    sensed = ["gyro noise", "gyro bias", "star-tracker cross", "star-tracker roll"]
    assert names == ["gravity gradient", "wheel friction", *sensed, "leak"]
    skewed = sh.scenario(FULL).with_({"part.gyro.axis_errors": [[0, 1e-3, 0], [0, 0, 0], [0, 0, 0]]})
    (axes,) = [source for source in sources(skewed) if source.name == "gyro axis errors"]
    assert not np.any(skewed.with_(dict(axes.without)).parts[0].params.axis_errors)
    assert [row.name for row in full.rows if row.kind == "source"] == names
    # Neither what is constant nor noise moves the error of an estimate that knows the motion.
    assert full.level("leak", "APE") > 100.0 * full.level("leak", "AKE") > 0.0
    assert full.level("star-tracker cross", "AKE") > 0.1 * full.level(TOGETHER, "AKE")


def test_contributions_are_what_sources_add_to_the_loop_itself():
    """A start off target moves the loop itself, and of a linear loop nothing else."""
    short = LINEAR | {"simulation": {"duration": 100.0, "control_period": PERIOD}, "budget": {"start": 5.0, "runs": 8}}
    turned = short | {"initial": {"angles": ["0.2 deg", 0, 0]}}
    on, off = (sh.budget(sh.scenario(tables)) for tables in (short, turned))
    # A budget that ends earlier is that of a shorter flight.
    assert sh.budget(sh.scenario(LINEAR | {"budget": short["budget"] | {"end": 100.0 - PERIOD}})).records() == on.records()
    assert off.level(LOOP, "APE") > 5.0 * off.level("attitude noise", "APE")
    for source in NOISE:
        for index in on.indices:
            assert off.level(source, index) == pytest.approx(on.level(source, index), rel=1e-2), (source, index)


def test_a_filter_assumes_the_same_noise_whatever_flies():
    """Where it takes the deviations from the tracker's table the budget is that of a filter whose own table states them."""
    states = {"cross": "10 arcsec", "roll": "60 arcsec"}
    filters = [{"type": "mekf", "noise": 2e-5, "bias_walk": 1e-6, "bias": 1e-4} | more for more in ({}, states)]
    budgets = [sh.budget(sh.scenario(FULL | {"part": [*FULL["part"][:2], one]})) for one in filters]
    assert {"star-tracker cross", "star-tracker roll"} <= {row.name for row in budgets[0].rows}
    assert budgets[0].summary() == budgets[1].summary()


def test_constant_torques_add_up_and_not_as_squares():
    """Two equal ones: twice the error of one, whose angle is the torque over the stiffness."""
    leaks = [{"type": "constant-torque", "name": name, "torque": [1e-5, 0, 0]} for name in ("left", "right")]
    found = sh.budget(sh.scenario(LINEAR | {"environment": {}, "sensor": {}, "part": leaks}))
    one = found.row("left").figures["MPE"]["x"]
    assert one.level == pytest.approx(1e-5 / (0.5 * K_ATTITUDE), rel=1e-3)
    assert found.level(TOGETHER, "MPE") == pytest.approx(2.0 * one.level, rel=1e-6)
    assert found.level(COMBINED, "MPE") == pytest.approx(np.sqrt(2.0) * one.level, rel=1e-6)


def test_faults_never_come():
    sound = FULL | {"part": FULL["part"][3:]}
    fault = {"time": "5 s", "wheel": 1, "lost": True, "action": "none"}
    assert sh.budget(sh.scenario(sound | {"fault": [fault]})).records() == sh.budget(sh.scenario(sound)).records()


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"budget.window": 600.0}, "budget.window: found 600 s"),
        ({"budget.window": 0.5}, "budget.window: found 0.5 s"),
        ({"budget.window": -1.0}, "budget.window"),
        ({"budget.window": "10 m"}, "budget.window"),
        ({"budget.end": 700.0}, "budget.end: found 700 s"),
        ({"budget.end": 101.0}, "budget.start: found 100 s"),
        ({"budget.separation": 495.0}, "budget.separation: found 495 s"),
        ({"budget.separation": 0.0}, "budget.separation"),
        ({"budget.start": 599.0}, "budget.start: found 599 s"),
        ({"budget.start": "1 h"}, "budget.start: found 3600 s"),
        ({"budget.runs": 0}, "budget.runs"),
        ({"budget.runs": 90_000}, "budget.runs: found 90000 of 1000 samples"),
        ({"budget.confidence": 1.5}, "budget.confidence"),
        ({"budget.boresight": [0, 0, 0]}, "budget.boresight"),
        ({"budget.interpretation": "often"}, "budget.interpretation"),
        ({"budget.requirement": {"ape": 1}}, "an old key; allowed: [[requirement]] tables"),
        ({"requirement": [{"method": "budget", "metric": "ake", "at_most": 1}]}, "did you mean ape?"),
        ({"requirement": [{"method": "budget", "metric": "ape", "at_least": 1}]}, "requirement[1].at_least"),
        ({"environment": None, "sensor": None}, "no disturbance of the loop"),
        ({"initial.rate": ["3000 rad/s", 0, 0]}, "the motion diverges at"),
    ],
)
def test_what_cannot_be_is_one_line(changes, line):
    with refused(line):
        sh.budget(sh.scenario(LINEAR).with_(changes))


def test_large_errors_are_warned_of():
    far = LINEAR | {"initial": {"angles": ["30 deg", 0, 0]}, "budget": {"start": 0.0, "runs": 1}}
    with pytest.warns(UserWarning, match="errors up to 30 deg from 0 s on"):
        sh.budget(sh.scenario(far))


def test_friction_is_taken_from_wheels_wherever_it_stands():
    axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
    tables = [
        {"wheels": FULL["wheels"]},
        {"wheels": None, "wheel": [{"axis": axis, "unit": "RW0", "viscous": 1e-6} for axis in axes]},
    ]
    for changes in tables:
        scenario = sh.scenario(FULL).with_(changes)
        (friction,) = (source for source in sources(scenario) if source.name == "wheel friction")
        before, after = (wheels_of(one) for one in (scenario, scenario.with_(friction.without)))
        assert np.any(before.viscous)
        assert not np.any(after.viscous)
        assert not np.any(after.coulomb)
        assert after.momentum_limit == before.momentum_limit


def test_other_bodies_and_unknown_laws_are_refused():
    with pytest.raises(InputError, match="rigid-body"):
        sh.budget("l2-circle")
    with pytest.raises(InputError, match="pd"):
        sh.budget(sh.scenario(LINEAR), "pid")


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "full.toml").write_text(sh.scenario(FULL).text, encoding="utf-8")
    return tmp_path


def cells(text, number=float):
    """The rows of a printed table, cell by cell, and of cells that are numbers what `number` makes of them."""
    rows = ([cell.strip() for cell in line.split("│")] for line in text.splitlines() if "│" in line)
    return [[number(cell) if re.fullmatch(r"[\d.]+(e-?\d+)?", cell) else cell for cell in row] for row in rows]


@pytest.mark.slow
def test_command_writes_what_its_page_quotes(folder):
    page = (Path(__file__).parents[2] / "docs" / "pointing-budget.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"`imager.toml`:\n\n```toml\n(.*?)```", page, flags=re.DOTALL)
    (quoted,) = re.findall(r"```text\n(.*?)```", page, flags=re.DOTALL)
    (folder / "imager.toml").write_text(example, encoding="utf-8")
    done = starhold("budget", "imager.toml", "-o", "out", cwd=folder, code=0)
    # Libraries of linear algebra differ in the last digit.
    assert cells(done.stdout) == cells(quoted, lambda text: pytest.approx(float(text), rel=1e-3))
    assert sorted(path.name for path in (folder / "out").iterdir()) == ["budget.csv", "budget.png", "summary.json"]
    told = json.loads((folder / "out" / "summary.json").read_text(encoding="utf-8"))["laws"]["wheel"]
    assert (told["window"], told["runs"], told["met"]) == (10.0, 32, True)
    rows = csv.DictReader((folder / "out" / "budget.csv").read_text(encoding="utf-8").splitlines())
    levels = {(row["source"], row["index"]): float(row["level (rad)"]) for row in rows if row["axis"] == told["axis"]}
    assert levels == {(name, index): level for name, own in told["levels"].items() for index, level in own.items()}
    complains(starhold("budget", "imager.toml", "-o", "out", cwd=folder), "results already there")


STRICT = toml("""
[[requirement]] method = "budget"; metric = "ape"; at_most = "1 mas"
[[requirement]] method = "budget"; metric = "rpe"; at_most = "1 deg"
""")


def test_options_take_the_place_of_the_files_keys_and_a_missed_requirement_is_told(folder):
    text = (folder / "full.toml").read_text(encoding="utf-8")
    (folder / "strict.toml").write_text(text + STRICT, encoding="utf-8")
    options = ("--start", "20", "--window", "0.1 min", "--separation", "8 s", "--runs", "2")
    done = starhold("budget", "strict.toml", *options, "-o", "out", cwd=folder, code=3)
    assert "missed" in done.stdout
    assert "met" in done.stdout
    told = json.loads((folder / "out" / "summary.json").read_text(encoding="utf-8"))["laws"]["lyapunov"]
    assert [told[key] for key in ("start", "window", "separation", "runs", "met")] == [20.0, 6.0, 8.0, 2, False]
    complains(starhold("budget", "strict.toml", "--window", "-5", "-o", "other", cwd=folder), "budget.window")
    assert not (folder / "other").exists()
