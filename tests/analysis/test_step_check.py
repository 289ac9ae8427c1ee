"""What half the integration step changes."""

from dataclasses import replace

import numpy as np
import pytest

from starhold.algebra.quaternion import multiply
from starhold.scenario.reading import load
from starhold.studies.compare import build, halved, record, step_error


def recordings(name, count=3):
    scenario = load(name)
    loop, found = build(scenario, scenario.laws[0]), []
    for _ in range(count):
        found.append(record(scenario, loop))
        loop = halved(loop)
    return found


@pytest.mark.parametrize(("name", "quantity"), [("cubesat-slew", "attitude"), ("l2-circle", "position")])
def test_error_falls_as_the_fourth_power_of_the_step(name, quantity):
    coarse, middle, fine = recordings(name)
    ratio = step_error(coarse, middle, [quantity])[quantity] / step_error(middle, fine, [quantity])[quantity]
    assert 12.0 < ratio < 24.0


def test_difference_of_attitudes_is_the_angle_between_them():
    (run,) = recordings("three-laws", 1)
    turn = 1e-9
    other = np.array(
        [multiply(tuple(q), (np.cos(turn / 2), 0.0, np.sin(turn / 2), 0.0)) for q in run["attitude"][:5].tolist()]
    )
    first = replace(run, arrays={name: values[:5] for name, values in run.arrays.items()})
    moved = replace(first, arrays=first.arrays | {"attitude": -other})
    found = step_error(first, moved, ["attitude", "rate"])
    assert found["attitude"] == pytest.approx(turn, rel=1e-6)
    assert found["rate"] == 0.0


def test_runs_of_other_length_have_no_difference():
    (run,) = recordings("three-laws", 1)
    lost = replace(run, arrays={name: values[:-7] for name, values in run.arrays.items()})
    assert step_error(run, lost, ["attitude", "rate"]) == {"attitude": None, "rate": None}
