"""What is noted inside kernels, and of recordings, is what NumPy makes of whole recordings."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from starhold.algebra.rotation import rotation_vector
from starhold.algebra.structure import flatten, unflatten
from starhold.analysis.any_body import measure as measure_any
from starhold.analysis.libration_point import goal_of
from starhold.analysis.rigid_body import EXTRAS, Cone
from starhold.parts.bodies.libration_point import Units
from starhold.scenario.building import build
from starhold.scenario.reading import load
from starhold.simulation.batched import Flights, begin_metered
from starhold.simulation.lane import fly
from starhold.simulation.lanes import ThreadPool, carry_columns
from starhold.studies.body import study_of
from starhold.studies.compare import name_samples
from tests.analysis.by_numpy import of_any_body, of_libration_point, of_rigid_body
from tests.parts.trackers import FILTER, FIRST, GYRO, SECOND, TWO
from tests.parts.trackers import scenario as tracked

SHORT = {
    "three-laws": ("lyapunov", {"simulation.duration": 700.0}),
    "three-laws-noise": ("sliding", {"simulation.duration": 90.0}),
    "wheels-orbital": (None, {"simulation.duration": 260.0}),
    "cubesat-slew": (None, {}),
    "l2-circle": (None, {}),
    "l2-equilibrium": (None, {}),
}
LOST = {
    "simulation.control_period": 15.0,
    "simulation.substeps": 1,
    "simulation.duration": 6e3,
    "spacecraft.torque_limit": None,
}
"""With a torque held for so long the motion is lost after three samples."""
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
    compare_metrics(load(name).with_({"simulation.record_every": 1, **changes}), law)


def test_validity_of_an_estimate_is_that_of_recordings():
    """Not valid before the first fix, nor long after the last of a tracker that is lost between."""
    lost = FIRST | {"outage": [8.0, 30.0]}
    late = SECOND | {"outage": [0.0, 25.0]}
    within = {"valid_within": "100 arcsec"}
    for parts in ((lost, FILTER | within), (lost | {"outage": [0.0, 30.0]}, late, TWO | within)):
        compare_metrics(tracked(GYRO, *parts, record_every=1), None)


@pytest.mark.parametrize("steps", [1, 2, 3, 4])
@pytest.mark.parametrize("name", ["three-laws", "l2-circle", "l2-equilibrium"])
def test_metrics_of_very_short_flights_are_those_of_recordings(name, steps):
    """The last quarter of up to three steps is the last instant alone."""
    scenario = load(name)
    duration = scenario.table.simulation.duration * steps / scenario.table.simulation.steps
    short = scenario.with_({"simulation.record_every": 1, "simulation.duration": duration})
    assert short.table.simulation.steps == steps
    compare_metrics(short, SHORT[name][0])


def compare_metrics(scenario, law):
    loop = build(scenario, scenario.pick(law or scenario.laws[0].name))
    study, steps = study_of(scenario.body), scenario.table.simulation.steps
    meter = study.meter(scenario, loop, loop.gains, *((EXTRAS, {"cone": CONE}) if loop.aims else ()))
    begun = starts(loop, 20)
    carries, rows = carry_columns(loop, begun), [window.row for window in meter.windows.values()]
    phases, observers = loop.phases(steps), meter.observers(loop.composition())
    with ThreadPool(2) as pool:
        noted = meter.begun(20), meter.cuts(), meter.marks[-1], rows
        flown = begin_metered(pool, Flights(loop, carries, phases, 5, observers, *noted))()
    assert (flown.ends[-1] < 0.0).all()
    found = meter.metrics(flown.notes, flown.windows, flown.ends[-1])
    assert set(found) == {*meter.units, "diverged_at"}
    size = len(flatten(loop.start))
    for lane in (0, 7, 19):
        own = replace(loop, start=unflatten(begun[:size, lane], loop.start))
        run = name_samples(scenario, own, *fly(own, steps, run=5 + lane))
        want = by_numpy(scenario, loop.gains, run)
        agree(study.metrics_of(run), want)
        shared = set(want) & set(found)
        assert len(shared) >= 6
        for metric in shared:
            value = math.nan if want[metric] is None else want[metric]
            np.testing.assert_allclose(found[metric][lane], value, rtol=1e-12, atol=1e-15, err_msg=metric)
        if loop.aims:
            axes = Rotation.from_quat(run["attitude"], scalar_first=True).apply(CONE.axis)
            nearest = np.arccos(np.clip(axes @ CONE.direction, -1.0, 1.0).max())
            assert found["cone"][lane] == pytest.approx(nearest, abs=1e-7)
            peak = np.linalg.norm(run["torque"], axis=1)
            assert found["peak_torque_norm"][lane] == pytest.approx(peak.max(), rel=1e-14)
            windows = np.sqrt(flown.windows[:, list(meter.windows).index("torque"), lane])
            ends = [0, *meter.cuts()[:-1], steps + 1]
            assert windows == pytest.approx([peak[a:b].max() for a, b in itertools.pairwise(ends)], rel=1e-14)


def by_numpy(scenario, gains, run):
    """The metrics of a run as NumPy takes them."""
    attrs, settling = run.attrs, scenario.table.settling
    if scenario.body == "rigid-body":
        return of_rigid_body(run, settling.attitude_tolerance, settling.rate_tolerance)
    units = Units(attrs["length_unit_m"], attrs["rate_unit_rad_per_s"])
    return of_libration_point(run, units, goal_of(gains), settling.tolerance)


def agree(found, want):
    """The same metrics, of the same type, but for what rounding makes of them."""
    assert set(found) == set(want)
    for metric, value in want.items():
        assert type(found[metric]) is type(value), metric
        if isinstance(value, float):
            np.testing.assert_allclose(found[metric], value, rtol=1e-11, atol=1e-15, err_msg=metric)
        else:
            assert found[metric] == value, metric


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("three-laws", {"simulation.record_every": 7}),
        ("three-laws", {"simulation.duration": 3.0}),
        # Too short to settle for good, and on the limit.
        ("three-laws", {"simulation.duration": 60.0, "settling.attitude_tolerance": 0.4, "settling.rate_tolerance": 0.4}),
        ("three-laws", LOST),
        ("wheels-orbital", {"simulation.record_every": 4}),
        ("l2-circle", {"simulation.record_every": 5}),
        ("l2-equilibrium", {}),
    ],
)
def test_metrics_of_recordings(name, changes):
    scenario = load(name).with_(changes)
    for entry in scenario.laws[:2]:
        loop, timing = build(scenario, entry), scenario.table.simulation
        run = name_samples(scenario, loop, *fly(loop, timing.steps, timing.record_every))
        assert ("diverged_at" in run.attrs) == (changes is LOST)
        agree(study_of(scenario.body).metrics_of(run), by_numpy(scenario, entry.gains, run))


def test_recordings_of_a_body_that_is_not_known():
    scenario = load("l2-circle")
    loop, timing = build(scenario, scenario.laws[0]), scenario.table.simulation
    run = name_samples(scenario, loop, *fly(loop, timing.steps, timing.record_every))
    agree(measure_any(run), of_any_body(run))


@given(st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4).filter(lambda q: np.linalg.norm(q) > 0.1))
def test_rotation_vectors(numbers):
    q = Rotation.from_quat(numbers, scalar_first=True)
    found = rotation_vector(tuple(q.as_quat(scalar_first=True).tolist()))
    if q.magnitude() < 3.14159:
        assert found == pytest.approx(q.as_rotvec(), rel=1e-12, abs=1e-15)
