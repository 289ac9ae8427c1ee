"""How long a turn takes and its peaks: one recorded run, and many lanes."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from starhold.algebra.structure import unflatten
from starhold.analysis.rigid_body import acceleration
from starhold.analysis.transient import Limits, Transient, Watcher, of_run
from starhold.parts.bodies.rigid_body import State
from starhold.simulation.lane import Recording, fly, label
from tests.analysis.turns import END, LAW, ZERO, problem
from tests.making import ORBIT, ORBITAL, aimed


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


def test_threads_and_company_change_nothing():
    made = problem()
    roots = np.linspace(-2.0, -0.3, 300)
    gains, start = made.gains(roots), np.array([made.start(1.0)]).T
    watcher = made.watcher()
    one, other = (watcher.fly(np.repeat(start, 300, axis=1), gains, 1500, threads=count) for count in (1, 3))
    alone = watcher.fly(start, made.gains(roots[100:101]), 1500)
    for name in ("time", "peak_rate", "peak_acceleration"):
        assert np.array_equal(getattr(one, name), getattr(other, name), equal_nan=True)
        assert getattr(alone, name).tolist() == getattr(one, name)[..., 100:101].tolist()


def test_the_inertia_does_not_matter():
    one, other = problem().fly(2.0, [-0.7])[0], problem(inertia=np.diag([30.0, 25.0, 12.0])).fly(2.0, [-0.7])[0]
    assert one.time == pytest.approx(other.time, rel=2e-3)
    assert one.peak_rate == pytest.approx(other.peak_rate, rel=2e-3)


def test_a_moving_target_is_refused():
    made = problem()
    watcher = Watcher(made.loop.with_parts(*ORBIT, ORBITAL), END, END)
    far = State((1.0, 0.0, 0.0, 0.0), ZERO, (7e6, 0.0, 0.0), (0.0, 7550.0, 0.0), ZERO)
    from starhold.algebra.structure import flatten

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


def test_limits():
    seen = Transient(3.0, 0.5, (0.1, 0.9, 0.2))
    assert seen.keeps(Limits(0.5, 0.9))
    assert not seen.keeps(Limits(0.499, 0.9))
    assert not seen.keeps(Limits(math.inf, 0.899))
