"""Scenarios made in Python and changed by key are what a file would be."""

import math
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import starhold as sh
from starhold.scenario.reading import builtin_names, builtin_text
from starhold.scenario.writing import toml_text
from tests.refusals import refused
from tests.tiers import leading

BODY = {
    "name": "made",
    "spacecraft": {"inertia": [2.0, 3.0, 4.0], "torque_limit": "10 mN m"},
    "initial": {"angles": ["90 deg", 0, 0]},
    "simulation": {"duration": 20.0, "control_period": 0.1},
    "law": [
        {"type": "pd", "k_rate": 0.09, "k_attitude": 0.009},
        {"type": "lqr", "name": "form 2.1", "form": "II", "q": [1, 1, 1, 0.2, 0.2, 0.2], "r": 50},
    ],
}
TEXT = st.text(st.characters(exclude_categories=["Cs"]), max_size=8)
NUMBERS = st.booleans() | st.integers(-(2**70), 2**70) | st.floats(allow_nan=False)
LEAVES = st.recursive(
    NUMBERS | TEXT, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(TEXT, inner, max_size=3), max_leaves=6
)


@given(st.dictionaries(TEXT, LEAVES | st.lists(st.dictionaries(TEXT, LEAVES, max_size=2), max_size=2), max_size=4))
def test_what_is_written_reads_back(tables):
    read = tomllib.loads(toml_text(tables))
    assert read == tables
    assert repr(read) == repr({key: read[key] for key in read})


@pytest.mark.parametrize("name", builtin_names())
def test_the_tables_of_a_file_make_its_scenario(name):
    made, loaded = sh.scenario(tomllib.loads(builtin_text(name))), sh.load(name)
    assert repr(made.table) == repr(loaded.table)
    assert made.laws == loaded.laws
    assert tomllib.loads(made.text) == tomllib.loads(loaded.text)


def test_arrays_tuples_paths_and_none_are_taken(tmp_path):
    (tmp_path / "h.csv").write_text("0,1,0,0,0\n10,1,0,0,0\n20,1,0,0,0\n30,1,0,0,0\n")
    given = BODY | {
        "spacecraft": {"inertia": np.diag([2.0, 3.0, 4.0]), "torque_limit": np.float64(0.01), "limit": None},
        "initial": {"attitude": (1.0, 0.1, 0.0, 0.0)},
        "target": {"mode": "history", "file": Path("h.csv")},
        "orbit": None,
    }
    made = sh.scenario(given, folder=tmp_path)
    assert made.craft.inertia == (2.0, 3.0, 4.0)
    assert made.table.orbit is None
    assert sh.simulate(made).sizes["time"] == 201


def test_a_component_of_a_vector_that_the_file_leaves_out():
    still = sh.load("three-laws").with_({"initial": None})
    assert still.with_({"initial.rate[2]": "1 deg/s"}).table.initial.rate == (0.0, math.radians(1.0), 0.0)
    with pytest.raises(
        sh.InputError, match=r"initial.angles\[2\]: found nothing; allowed: a scenario that has initial.angles"
    ):
        still.with_({"initial.angles[2]": "1 deg"})


def test_an_input_error_has_no_frames_but_the_callers():
    """The call, and the frame that tells it in short; its own frames would say nothing about the input."""
    scenario = sh.load("three-laws")
    calls = (
        lambda: sh.load("no-such"),
        lambda: sh.scenario({}),
        lambda: scenario.with_({"x": 1}),
        lambda: sh.campaign(scenario, runs=0),
        lambda: sh.simulate(scenario, "lyapunow"),
    )
    for call in calls:
        with pytest.raises(sh.InputError) as caught:
            call()
        assert len(caught.traceback) <= 4
        assert caught.value.__suppress_context__


def test_a_rotation_of_scipy_is_an_attitude():
    """As it is, in tables and in changes, and the same attitude: it turns body components into inertial ones."""
    turn = Rotation.from_euler("ZYX", [40.0, -20.0, 70.0], degrees=True)
    made = sh.scenario(BODY | {"initial": {"attitude": turn}, "target": {"attitude": turn.inv()}})
    again = made.with_({"initial.attitude": turn * turn, "target.attitude": turn})
    for scenario, start, goal in ((made, turn, turn.inv()), (again, turn * turn, turn)):
        run = sh.simulate(scenario.with_({"simulation.duration": 1.0}), "pd")
        own = Rotation.from_quat(run["attitude"].to_numpy()[0], scalar_first=True)
        np.testing.assert_allclose(own.as_matrix(), start.as_matrix(), atol=1e-12)
        error = Rotation.from_quat(run["attitude_error"].to_numpy()[0], scalar_first=True)
        np.testing.assert_allclose(error.as_matrix(), (goal.inv() * start).as_matrix(), atol=1e-12)
    angles = made.with_({"initial": {"angles": ["40 deg", "-20 deg", "70 deg"]}})
    by_angles = sh.simulate(angles.with_({"simulation.duration": 1.0}), "pd")["attitude"].to_numpy()[0]
    np.testing.assert_allclose(Rotation.from_quat(by_angles, scalar_first=True).as_matrix(), turn.as_matrix(), atol=1e-12)
    filters = [{"type": "star-tracker", "cross": 1e-4, "roll": 1e-4}, {"type": "gyro"}]
    filters.append({"type": "complementary-filter", "attitude_gain": 0.1, "bias_gain": 0.0, "start": turn})
    assert sh.scenario(BODY | {"part": filters}).parts[-1].params.start == pytest.approx(turn.as_quat(scalar_first=True))


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"spacecraft.inertai": [1, 1, 1]}, "spacecraft.inertai: found an unknown key; did you mean inertia?"),
        ({"spacecraft.inertia": [1, 1, 9]}, "no body has these principal moments"),
        ({"law.pd.k_rate": -1.0}, "law[1].k_rate: found -1.0; allowed: above 0"),
        ({"law.form 2.1.k_rate": 1.0}, "law[2].k_rate: found a gain beside form"),
        ({"law.ppd.k_rate": 1.0}, 'law.ppd.k_rate: found "ppd"; did you mean pd?'),
        ({"law[3].k_rate": 1.0}, "law[3]: found no such table; allowed: 1 to 2"),
        ({"wheel[1].axis": [1, 0, 0]}, "wheel[1]: found nothing; allowed: a scenario that has wheel"),
        ({"name.first": 1}, "name.first: found a value that is not a table"),
        ({"spacecraft..inertia": 1}, "not a key"),
        ({3: 1}, "a key that is not a string"),
        ({"spacecraft.inertia": {1, 2}}, "numbers, strings, booleans, dates, rotations, and lists and tables of them"),
        ({"initial": {3: 1}}, "the key 3"),
        ({"law": None}, "law: found no law"),
        ({"simulation": None}, "simulation: found nothing; allowed: this key is required"),
        ({"description": "half \ud800"}, "whole characters"),
    ],
)
def test_what_cannot_be_is_told_as_of_a_file(changes, said):
    with refused(said):
        sh.scenario(BODY).with_(changes)


def test_keys_of_tables_lists_and_laws_by_name_or_place():
    made = sh.scenario(BODY)
    other = made.with_(
        {"law.pd.k_rate": "0.2 N m s", "law[2].r": 40, "law.form 2.1.q": [2] * 6, "simulation.duration": "1 min"}
    )
    assert other.laws[0].gains.k_rate == 0.2
    assert other.laws[1].spec.r == (40.0,) * 3
    assert other.laws[1].spec.q == (2.0,) * 6
    assert other.table.simulation.steps == 600
    assert made.table.simulation.steps == 200
    assert made.with_({}).laws == made.laws
    assert [entry.name for entry in made.with_({"law.pd": None}).laws] == ["form 2.1"]
    fault = [{"time": 3.0, "wheel": 1, "lost": True}]
    wheels = sh.load("wheels-orbital").with_({"fault": fault, "wheels.momentum": 0.01})
    assert wheels.with_({"fault[1].time": "5 s"}).table.fault[0].time == 5.0


def test_gains_known_to_be_unstable_stay_allowed():
    tables = BODY | {"law": [{"type": "modal", "form": "equal", "a": 0.1}]}
    with pytest.raises(sh.InputError, match="not stable"):
        sh.scenario(tables)
    made = sh.scenario(tables, allow_unstable=True)
    assert made.with_({"law.modal.a": 0.2}).laws[0].spec.a == 0.2


def test_what_notebooks_show_is_short():
    made = sh.scenario(BODY)
    assert repr(made) == "<Scenario made: pd, form 2.1; 200 control steps>"
    (flight, _) = sh.compare(made)
    for shown in (made, *made.laws, flight, flight.recording, flight.certificates[0], *flight.certificates[0].claims):
        assert len(repr(shown)) < 250
    assert repr(flight).startswith("<Flight pd: settling")
    assert repr(sh.design(made)[0]).startswith("<Design form 2.1: lqr II; k_rate")


@pytest.mark.parametrize(
    "before", leading(["import starhold.scenario.reading", "", "import starhold as sh; sh.load('three-laws')"])
)
def test_the_package_of_scenarios_is_called_whatever_is_imported_first(before):
    code = f"{before}\nimport starhold as sh\nfrom starhold.scenario.reading import parse\nprint(sh.scenario({BODY!r}).name)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout == "made\n", done.stderr
