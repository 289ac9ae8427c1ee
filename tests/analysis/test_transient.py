"""How long a turn under the law `modal` takes and its peaks, and the search for the fastest root within limits."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from starhold.algebra.structure import flatten, unflatten
from starhold.analysis.rigid_body import acceleration, measure
from starhold.analysis.roots import PUBLISHED, SlewProblem, TwoPieceFit, fit, search, unmet
from starhold.analysis.transient import Limits, Transient, Watcher
from starhold.laws.catalogue import catalogue
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.bodies.rigid_body import State
from starhold.parts.craft import make_craft
from starhold.simulation.lane import Recording, fly, label
from tests.making import ORBIT, ORBITAL, aimed

LAW = catalogue()["modal"]
ZERO = (0.0, 0.0, 0.0)
END = math.radians(0.1)
STEPS = 3000


def problem(inertia=(2.0, 3.0, 4.0), axis=(1.0, -2.0, 0.5), rate=(0.1, 0.2, -0.15), **options):
    start = State((1.0, 0.0, 0.0, 0.0), ZERO, ZERO, ZERO, ZERO)
    loop = ClosedLoop(make_craft(inertia, np.inf), LAW, LAW.examples()[0], start, 0.01, limit="none", **options)
    return SlewProblem(loop, STEPS, axis, rate, END, END, -0.01)


def of_run(run, angle_end, rate_end):
    """The transient of a recorded run, however late it ends."""
    count = len(run["time"])
    arrays = {"torque": np.zeros((count, 3)), "command": np.zeros((count, 3))} | run.arrays
    # A run that stays as it ends for long enough has nothing that is too late to count.
    held = {name: np.concatenate([values, np.repeat(values[-1:], 10 * count, axis=0)]) for name, values in arrays.items()}
    run = Recording(held, {"limit": "none", "torque_limit": math.inf} | run.attrs)
    found = measure(run, 1.0, 1.0, transient=(angle_end, rate_end))
    peaks = np.abs(acceleration(run)).max(axis=0).tolist()
    assert found["peak_acceleration"] == max(peaks)
    return Transient(found["transient_time"], found["peak_rate"], tuple(peaks))


def flown(made, angle, root):
    gains = LAW.gains((root,) * 3, (root,) * 3, made.b)
    loop = replace(made.loop, gains=gains, start=unflatten(made.start(angle), made.loop.start))
    return of_run(label(loop, *fly(loop, made.steps), 1), made.angle_end, made.rate_end)


@pytest.mark.parametrize("target", [(1.0, 0.0, 0.0, 0.0), (0.6, 0.0, 0.8, 0.0)])
def test_a_lane_and_a_recorded_run_give_the_same_bits(target):
    made = problem(parts=(aimed(target),))
    roots = np.linspace(-2.5, -0.05, 150)
    for angle in (0.3, 3.0):
        lanes = made.fly(angle, roots)
        for lane in (0, 60, 127, 128, 149):
            assert lanes[lane] == flown(made, angle, float(roots[lane]))
    assert math.isnan(lanes.time[-1])
    assert lanes[149].time is None


def test_the_inertia_does_not_matter():
    one, other = problem().fly(2.0, [-0.7])[0], problem(inertia=np.diag([30.0, 25.0, 12.0])).fly(2.0, [-0.7])[0]
    assert one.time == pytest.approx(other.time, rel=2e-3)
    assert one.peak_rate == pytest.approx(other.peak_rate, rel=2e-3)


def test_a_moving_target_is_refused():
    made = problem()
    watcher = Watcher(made.loop.with_parts(*ORBIT, ORBITAL), END, END)
    far = State((1.0, 0.0, 0.0, 0.0), ZERO, (7e6, 0.0, 0.0), (0.0, 7550.0, 0.0), ZERO)
    with pytest.raises(ValueError, match="target at rest"):
        watcher.fly(np.array([flatten(far)]).T, made.gains([-1.0]), 10)


def recorded(angles, rates, period=0.1, every=1, **attrs):
    """A run about one axis with these angles and rates (n,)."""
    q = np.zeros((len(angles), 4))
    q[:, 0], q[:, 2] = np.cos(0.5 * np.asarray(angles)), np.sin(0.5 * np.asarray(angles))
    w = np.zeros((len(angles), 3))
    w[:, 1] = rates
    times = np.arange(len(angles)) * period * every
    arrays = {"time": times, "attitude_error": q, "rate_error": w, "rate": w}
    return Recording(arrays, {"control_period": period, "record_every": every} | attrs)


@given(st.floats(0.5, 3.0), st.floats(0.2, 2.0), st.integers(1, 4))
def test_the_time_is_when_both_are_within_for_good(angle, pace, every):
    times = np.arange(0, 400) * 0.05 * every
    turn, rate = angle * np.exp(-pace * times), -pace * angle * np.exp(-pace * times)
    found = of_run(recorded(turn, rate, 0.05, every), 0.01, 0.01)
    exact = math.log(angle * max(1.0, pace) / 0.01) / pace
    if exact >= times[-2]:
        assert found.time is None or found.time >= times[-2] - 0.1 * every
    else:
        # Between samples it is read off a line through the squares.
        assert found.time == pytest.approx(max(exact, 0.0), abs=0.05 * every)
    assert found.peak_rate == pytest.approx(pace * angle)
    assert found.peak_acceleration[0] == found.peak_acceleration[2] == 0.0


def test_a_run_that_is_within_from_the_start_that_leaves_again_and_that_is_lost():
    still = np.zeros(20)
    assert of_run(recorded(still, still), 0.01, 0.01) == Transient(0.0, 0.0, ZERO)
    back = np.where(np.arange(20) == 12, 0.1, 0.0)
    assert 1.2 < of_run(recorded(back, still), 0.01, 0.01).time < 1.3
    assert of_run(recorded(still, np.linspace(0.0, 1.0, 20)), 0.01, 0.01).time is None
    assert of_run(recorded(still, still, diverged_at=2.0), 0.01, 0.01).time is None
    assert of_run(recorded([0.0], [0.0]), 0.01, 0.01) == Transient(0.0, 0.0, ZERO)


def test_acceleration_is_the_mean_from_sample_to_sample():
    run = recorded(np.zeros(4), [0.0, 0.1, 0.4, 0.3], 0.1, 2)
    assert acceleration(run)[:, 1] == pytest.approx([0.5, 1.5, -0.5, -0.5])
    assert of_run(run, 0.01, 0.01).peak_acceleration[1] == pytest.approx(1.5)


ROOTS = np.linspace(-2.6, -0.02, 160)
WIDE = Limits(0.7, 1.2)


@pytest.mark.parametrize("angle", [0.05, 0.9, 1.7, math.pi])
@pytest.mark.parametrize("limits", [WIDE, Limits(0.5, math.inf), Limits(math.inf, 0.4)])
def test_cutting_transients_short_loses_no_root(angle, limits):
    made = problem()
    flown = made.fly(angle, ROOTS)
    eased = Limits(1.1 * limits.rate, 1.2 * limits.acceleration)
    (found,) = search(made, [angle], ROOTS[::-1], limits, eased)
    for best, kind in ((found.hard, limits), (found.eased, eased)):
        times = np.where(flown.within(kind), flown.time, np.nan)
        lane = int(np.nanargmin(times))
        assert (best.root, best.transient) == (ROOTS[lane], flown[lane])
        assert best.time == times[lane]
    assert found.eased.time <= found.hard.time


def test_threads_change_nothing_and_every_angle_is_told():
    made, heard = problem(), []
    angles = [0.5, 1.0, 1.5]
    one = search(made, angles, ROOTS[::4], WIDE, WIDE, lambda done, total: heard.append((done, total)), threads=1)
    assert one == search(made, angles, ROOTS[::4], WIDE, WIDE, threads=3)
    assert heard == [(1, 3), (2, 3), (3, 3)]
    assert [item.hard for item in one] == [item.eased for item in one]


def test_what_no_root_achieves_is_told():
    made = problem()
    slow, gentle = Limits(0.2, math.inf), Limits(math.inf, 1e-3)
    assert search(made, [1.0], ROOTS, slow, slow)[0].hard is None
    rate, sharp = unmet(made, 1.0, ROOTS, slow), unmet(made, 1.0, ROOTS, gentle)
    assert (rate.what, sharp.what) == ("rate", "acceleration")
    # The start alone is too fast.
    assert rate.least == pytest.approx(math.hypot(*made.rate))
    flown = made.fly(1.0, [sharp.root])[0]
    assert max(flown.peak_acceleration) == sharp.least > gentle.acceleration
    assert unmet(replace(made, steps=20), 1.0, ROOTS, WIDE).what == "end"
    # The slow one swings past the target and gathers speed, the fast one brakes too hard.
    pair = replace(made, angle_end=3.0, rate_end=3.0)
    assert unmet(pair, 1.0, [-0.54, -0.02], Limits(0.5, 0.222)).what == "both"


@pytest.mark.slow
@settings(max_examples=6, deadline=None)
@given(
    st.tuples(st.floats(-2.0, -0.5), st.floats(-4.0, -0.5), st.floats(-1.5, -0.2)),
    st.tuples(st.floats(-3.0, -0.5), st.floats(-2.0, -0.2), st.floats(-1.0, -0.1)),
    st.integers(4, 30),
    st.floats(0.0, 2e-3),
)
def test_a_fit_gives_back_what_it_goes_through(below, above, cut, noise):
    angles = np.radians(np.arange(10.0, 181.0, 5.0))
    true = TwoPieceFit(below, above, 0.5 * float(angles[cut - 1] + angles[cut]))
    roots = true.at(angles) * (1.0 + noise * np.sin(7.0 * np.arange(len(angles))))
    found = fit(angles, roots)
    # No worse than the truth itself, whose errors are the noise.
    assert np.sum(found.errors(angles, roots) ** 2) <= np.sum(true.errors(angles, roots) ** 2) + 1e-9
    assert np.abs(found.errors(angles, true.at(angles))).max() < 3e-4 + 4.0 * noise


def test_the_published_fit_is_as_published():
    assert TwoPieceFit((-1.018, -2.071, -0.849), (-2.177, -0.726, -0.155), math.radians(85.0)) == PUBLISHED
    at = np.radians([10.0, 85.0, 85.001, 163.74])
    assert PUBLISHED.at(at) == pytest.approx([-1.558, -0.896, -0.897, -0.428], abs=1e-3)
