"""What is noted along many flights is what recordings of every control step are measured to be."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from starhold.algebra.rotation import rotation_vector
from starhold.algebra.structure import flatten, unflatten
from starhold.analysis.rigid_body_meter import EXTRAS, Cone
from starhold.scenario.building import build
from starhold.scenario.reading import load
from starhold.simulation.lane import fly
from starhold.simulation.lanes import Crew, carry_columns
from starhold.simulation.metered import begin_metered
from starhold.studies.body import study_of
from starhold.studies.compare import name_samples

SHORT = {
    "three-laws": ("lyapunov", {"simulation.duration": 700.0}),
    "three-laws-noise": ("sliding", {"simulation.duration": 90.0}),
    "wheels-orbital": (None, {"simulation.duration": 260.0}),
    "cubesat-slew": (None, {}),
    "l2-circle": (None, {}),
    "l2-equilibrium": (None, {}),
}
CONE = Cone((0.0, 0.6, 0.8), (1.0, 0.0, 0.0))


def starts(loop, lanes):
    """Other attitudes, or other places, for each lane."""
    first = np.array(flatten((loop.start, *loop.carry().effectors)), dtype=float)
    found = np.repeat(first[:, None], lanes, axis=1)
    draws = np.random.default_rng(3)
    if loop.aims:
        q = draws.normal(size=(4, lanes))
        found[:4] = q / np.linalg.norm(q, axis=0)
    else:
        found[:3] *= 1.0 + 0.01 * draws.normal(size=(3, lanes))
    return found


@pytest.mark.parametrize("name", SHORT)
def test_metrics_are_those_of_recordings(name):
    law, changes = SHORT[name]
    scenario = load(name).with_({"simulation.record_every": 1, **changes})
    loop = build(scenario, scenario.pick(law or scenario.laws[0].name))
    study, steps = study_of(scenario.body), scenario.table.simulation.steps
    meter = study.meter(scenario, loop, loop.gains, *((EXTRAS, {"cone": CONE}) if loop.aims else ()))
    begun = starts(loop, 20)
    carries, rows = carry_columns(loop, begun), [window.row for window in meter.windows.values()]
    phases = loop.phases(steps)
    with Crew(2) as crew:
        flown = begin_metered(
            loop, carries, phases, 5, meter.observers, meter.begun(20), meter.cuts(), meter.marks[-1], rows, crew
        )()
    assert (flown.ends[-1] < 0.0).all()
    found = meter.metrics(flown.notes, flown.windows, flown.ends[-1])
    assert set(found) == {*meter.units, "diverged_at"}
    size = len(flatten(loop.start))
    for lane in (0, 7, 19):
        own = replace(loop, start=unflatten(begun[:size, lane], loop.start))
        run = name_samples(scenario, own, *fly(own, steps, run=5 + lane))
        want = study.metrics_of(run)
        shared = set(want) & set(found)
        assert len(shared) >= 6
        for metric in shared:
            value = math.nan if want[metric] is None else want[metric]
            np.testing.assert_allclose(found[metric][lane], value, rtol=1e-12, atol=1e-15, err_msg=metric)
        if loop.aims:
            away = [math.acos(np.clip(np.dot(turned(q, CONE.axis), CONE.direction), -1.0, 1.0)) for q in run["attitude"]]
            assert found["cone"][lane] == pytest.approx(min(away), abs=1e-7)
            peak = np.linalg.norm(run["torque"], axis=1)
            assert found["peak_torque_norm"][lane] == pytest.approx(peak.max(), rel=1e-14)
            windows = np.sqrt(flown.windows[:, list(meter.windows).index("torque"), lane])
            ends = [0, *meter.cuts()[:-1], steps + 1]
            assert windows == pytest.approx([peak[a:b].max() for a, b in itertools.pairwise(ends)], rel=1e-14)


def turned(q, axis):
    """A vector of body axes in inertial ones, by the matrix of directions."""
    w, x, y, z = q
    matrix = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.array(matrix) @ axis


@given(st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4).filter(lambda q: np.linalg.norm(q) > 0.1))
def test_rotation_vectors(numbers):
    q = np.array(numbers) / np.linalg.norm(numbers)
    angle = 2.0 * math.atan2(np.linalg.norm(q[1:]), abs(q[0]))
    found = np.array(rotation_vector(tuple(q.tolist())))
    assert np.linalg.norm(found) == pytest.approx(angle, rel=2e-15, abs=1e-300)
    if angle > 1e-9 and q[0] != 0.0:
        assert found / angle == pytest.approx(math.copysign(1.0, q[0]) * q[1:] / np.linalg.norm(q[1:]), abs=1e-14)
