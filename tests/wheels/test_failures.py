"""What is left after wheels are lost."""

import csv
import subprocess
import sys

import matplotlib.image
import numpy as np
import pytest
from scipy.optimize import linprog

from starhold.errors import InputError
from starhold.models.wheels import authority
from starhold.report.failures import directions_lacking, draw, require_wheels, study, write_table
from starhold.scenario.reading import builtin_text, load, parse

BUILTIN = builtin_text("wheels-orbital")


@pytest.fixture(scope="module")
def pyramid():
    scenario = parse(BUILTIN, "here")
    return scenario, study(scenario, scenario.laws[0])


def test_a_pyramid_stands_any_single_loss_and_no_double_one(pyramid):
    scenario, found = pyramid
    assert [f.lost for f in found] == [(), (1,), (2,), (3,), (4,), (1, 2), (1, 3), (1, 4), (2, 3), (2, 4), (3, 4)]
    intact, singles, doubles = found[0], found[1:5], found[5:]
    assert intact.share == 1.0
    assert intact.condition == pytest.approx(1.0)
    for failure in singles:
        # By symmetry alike.
        assert failure.authority == pytest.approx(singles[0].authority, rel=1e-12)
        assert not failure.lacking
        assert failure.eta < failure.eta_intact == pytest.approx(intact.eta)
        assert failure.settling > intact.settling
        assert failure.gains["k_rate"] < intact.gains["k_rate"]
    axes = np.array(scenario.wheels.axes)
    for failure in doubles:
        left = [i for i in range(4) if i + 1 not in failure.lost]
        assert np.abs(axes[left] @ np.array(failure.lacking).T).max() < 1e-12
        assert failure.authority == 0.0
        assert failure.settling is None


def test_authority_is_below_what_any_allocation_could_give(pyramid):
    """The least over directions of the largest torque within the limits, by linear programming."""
    scenario, found = pyramid
    axes = np.array(scenario.wheels.axes)
    random = np.random.default_rng(0)
    for failure in found[:5]:
        limits = [0.0 if i + 1 in failure.lost else scenario.wheels.torque_limit[i] for i in range(4)]
        best = np.inf
        for direction in random.normal(size=(200, 3)):
            direction /= np.linalg.norm(direction)
            # Maximise t with sum a_i tau_i = t direction.
            solved = linprog(
                [0, 0, 0, 0, -1], A_eq=np.column_stack([axes.T, -direction]), b_eq=np.zeros(3),
                bounds=[*((-x, x) for x in limits), (0, None)],
            )  # fmt: skip
            best = min(best, -solved.fun)
        assert 0.6 * best < failure.authority <= best * (1.0 + 1e-9)
    assert found[0].authority == pytest.approx(authority(scenario.wheels))


def test_three_orthogonal_wheels_name_the_axis_that_is_lost():
    scenario = parse(BUILTIN.replace('"pyramid"', '"orthogonal"'), "here")
    found = study(scenario, scenario.laws[0])
    for axis, failure in enumerate(found[1:4]):
        assert np.abs(np.array(failure.lacking)) == pytest.approx(np.eye(3)[[axis]])
    assert len(found[4].lacking) == 2


def test_directions_lacking():
    assert directions_lacking(np.eye(3)).shape == (0, 3)
    assert np.abs(directions_lacking(np.eye(3)[:2])) == pytest.approx(np.array([[0.0, 0.0, 1.0]]))


def test_table_and_picture(pyramid, tmp_path):
    scenario, found = pyramid
    write_table(found, scenario.laws[0], tmp_path / "failures.csv")
    with (tmp_path / "failures.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(found)
    key = next(name for name in rows[0] if name.startswith("torque authority"))
    assert [float(row[key]) for row in rows] == [failure.authority for failure in found]
    draw(found, tmp_path / "a.png", "title")
    draw(found, tmp_path / "b.png", "title")
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    picture = matplotlib.image.imread(tmp_path / "a.png")
    assert len(np.unique(picture.reshape(-1, picture.shape[2]), axis=0)) > 10


def test_a_craft_without_wheels_is_refused():
    with pytest.raises(InputError, match="three-laws"):
        require_wheels(load("three-laws"))


def test_the_command(tmp_path):
    def run(*arguments):
        command = [sys.executable, "-m", "starhold", "failures", *arguments]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)

    first = run("wheels-orbital", "-o", "out")
    assert first.returncode == 0, first.stderr
    assert "3 and 4" in first.stdout
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"failures.csv", "failures.png"}
    again = run("wheels-orbital", "-o", "out")
    assert (again.returncode, again.stderr.count("\n")) == (2, 1)
    assert run("wheels-orbital", "-o", "out", "--force").returncode == 0
    none = run("three-laws", "-o", "other")
    assert (none.returncode, none.stderr.count("\n")) == (2, 1)
