"""The measures of publication E against closed forms, brute force and the loops that fly; and its verdicts."""

import math

import numpy as np
import pytest
from scipy.linalg import expm

from starhold.certification.invariant import System, load
from starhold.publications.desk import Desk
from starhold.publications.papers.E import loops, stations, sunlight
from starhold.studies.phase_portraits import paths

DESK = Desk("E")
BELOW = np.array([[0.0, 1.0], [-2.0, -3.0]])


@pytest.mark.parametrize("c", [0.05, 0.4, 0.95])
def test_loops_are_flown_as_their_closed_form(c):
    """An arc of the circle of radius c about (c, 0) at rate 1, then a linear node."""
    begun, end = 0.3, 5.0
    start = (c * (1.0 - math.cos(begun)), c * math.sin(begun))
    _, states = loops.flown(start, end)
    assert states[:, -1] == pytest.approx(expm((end - math.pi + begun) * BELOW) @ [2.0 * c, 0.0], abs=1e-7)
    assert loops.constant(*np.array([start, (2.0 * c, -1e-12)]).T) == pytest.approx([c, c], rel=1e-9)
    # Back in time the circle is run through the other way, to the origin.
    times, _ = loops.flown(start, -2.0, 1e-6)
    assert times[-1] == pytest.approx(-begun, abs=1e-4)


def test_outside_of_the_loops_motions_turn_about_one():
    _, states = loops.flown((-0.5, 0.0), 2.0)
    assert states[:, -1] == pytest.approx([1.0 - 1.5 * math.cos(2.0), 1.5 * math.sin(2.0)], abs=1e-6)


def test_the_example_goes_where_the_built_in_system_goes():
    """The certified system is a positive multiple of it."""
    problem = load("switching")
    starts = loops.draws(60)
    steps = paths(problem.system, problem.claims[0].box, starts.T, 1e-4, 1)
    for start, path in zip(starts, steps, strict=True):
        rates = np.array(loops.rates(*start))
        assert path[:, 1] - path[:, 0] == pytest.approx(1e-4 * rates / np.linalg.norm(rates), abs=2e-7)


def test_paths_are_followed_by_arc_length():
    turning = System.of(("x", "y"), lambda x, y: (-1.0 * y, x))
    ahead, back = (paths(turning, [(-2.0, 2.0)] * 2, [[1.0], [0.0]], way)[0] for way in (1.0, -1.0))
    assert ahead[:, -1] == pytest.approx([math.cos(1.0), math.sin(1.0)], abs=1e-9)
    assert back[:, -1] == pytest.approx([math.cos(1.0), -math.sin(1.0)], abs=1e-9)
    sink = System.of(("x", "y"), lambda x, y: (-1.0 * x, -1.0 * y))
    ended = paths(sink, [(-2.0, 2.0)] * 2, [[1.0, 0.3], [0.0, 0.4]], 3.0)
    assert np.abs(ended[:, :, -1]).max() < 0.01


def test_roots_are_those_of_the_characteristic_polynomial():
    C = 3.94
    plant = stations.plant_of(DESK, C)
    polynomial = np.polymul([1.0, 0.0, 2.0 - C, 0.0, (1.0 + 2.0 * C) * (1.0 - C)], [1.0, 0.0, C])
    ours, theirs = np.linalg.eigvals(stations.matrix(plant)), np.roots(polynomial)
    assert np.abs(ours[:, None] - theirs).min(axis=0).max() < 1e-9
    assert np.abs(ours[:, None] - theirs).min(axis=1).max() < 1e-9


def test_the_largest_start_is_found_by_halving():
    assert stations.largest(lambda x: x < 0.7, 1.0, 20) == pytest.approx(0.7, abs=2e-6)


def test_the_unit_axis_moves_as_its_closed_form():
    """x + x' = s grows as s' = s - 1 beyond the linear zone."""
    run = DESK.recording(stations.REST, "beside Y", {**stations._unit(DESK), "initial.position": [1.05, 0.0, 0.0]})
    s, time = math.sqrt(1.0 + 2.0 * stations.plant_of(DESK).stiffness), run["time"]
    ours = run["position"][:, 0] + run["velocity"][:, 0] / s
    assert ours[time < 1.0] == pytest.approx(1.0 + 0.05 * np.exp(s * time[time < 1.0]), rel=1e-3)


def test_paths_apart_are_the_distances_of_all_pairs():
    law, lag = "deficit 10", 0.0086
    short = {"simulation.duration": "200 days"}
    assert stations._apart(DESK, stations.DEFICIT, law, 1e-3) < stations._apart(DESK, stations.DEFICIT, law, lag)
    path, late = (
        DESK.recording(stations.DEFICIT, law, {**short, **more})["position"] for more in ({}, stations._lagging(law, lag))
    )
    wide = np.ptp(path, axis=0)
    found = [
        np.linalg.norm((late[:, None, pair] - path[None, :, pair]) / wide[pair], axis=2).min(axis=1).max()
        for pair in ([0, 1], [1, 2])
    ]
    assert max(found) == pytest.approx(stations.farthest_place(path, late), rel=1e-12)


def test_a_sail_without_lag_flies_as_the_loop():
    """SciPy with a sail's settings against the loop with a control that is held for an hour or so."""
    flown = sunlight.fly_sail(DESK, 0.1, 0.0, 0.5)
    run = DESK.recording("l2-circle", "smooth", {"initial.position": [0.0, 0.0, 0.0], "simulation.duration": "0.5 yr"})
    ours = [np.interp(run["time"], np.linspace(0.0, math.pi, 501), column) for column in flown["position"].T]
    assert np.abs(np.array(ours).T - run["position"]).max() < 3e-3
    asked = flown["asked"]
    assert 0.4 < asked[:, 0].min() < asked[:, 0].max() < 1.0 / 1.1 + 1e-3


def test_a_sail_whose_angles_lag_is_late_by_the_lag():
    flown = sunlight.fly_sail(DESK, 0.1, 12.0, 0.5)
    half = len(flown["time"]) // 2
    late = np.remainder(flown["asked"][half:, 2] - flown["set"][half:, 2] + 180.0, 360.0) - 180.0
    speed = np.gradient(np.unwrap(np.radians(flown["asked"][half:, 2])), np.linspace(0.0, math.pi, 501)[half:])
    lag = 43200.0 / sunlight.station().units.time
    assert np.abs(late - np.degrees(speed) * lag).max() < 0.05


def test_angles_of_discs_are_those_of_right_triangles():
    sun, earth = sunlight.discs()
    # 1.5 million km beyond the Earth, 149.6 million km from the Sun.
    assert earth == pytest.approx(math.degrees(2.0 * math.atan(6371.0 / 1.5076e6)), rel=1e-3)
    assert sun == pytest.approx(math.degrees(2.0 * math.atan(695_700.0 / (149.6e6 + 1.5076e6))), rel=1e-3)
