"""Thrusters: against SciPy with torques that jump where pulses begin and end, and a plain state machine for the trigger."""

from itertools import pairwise

import numpy as np
import pytest

from starhold.parts.catalogue import find, fit
from tests.making import HUB, flown, hub, spun

TORQUE, PERIOD = np.array([0.02, 0.03, 0.04]), 0.5


def fired(steps, rate=(0.02, -0.03, 0.025), substeps=10, attitude=(0.6, 0.0, 0.8, 0.0), **params):
    """The recording of a flight under PD feedback."""
    numbers = find("effector", "thrusters").params(**({"torque": tuple(TORQUE.tolist())} | params))
    start = {"rate": rate, "attitude": attitude, "period": PERIOD, "substeps": substeps}
    return flown(hub(fit("effector", "thrusters", *numbers), **start, gains=(0.6, 0.05), limit="none"), steps)


def integrated(run, steps):
    """Rates by SciPy, from pulse to pulse."""
    attitude, rate = run["attitude"][0], run["rate"][0]
    found = [rate]
    for times in run["thruster_time"][:steps]:
        # The torque is steady between the ends of pulses.
        for begin, end in pairwise(sorted({0.0, PERIOD, *np.abs(times)})):
            torque = TORQUE * np.sign(times) * (np.abs(times) > begin)
            attitudes, rates = spun(lambda t, q, torque=torque: torque, [begin, end], attitude, rate)
            attitude, rate = attitudes[-1], rates[-1]
        found.append(rate)
    return np.array(found)


def test_pulses_act_as_long_as_they_say():
    on, minimum = (0.004, 0.004, 0.004), 0.05
    errors = []
    for substeps in (10, 40):
        run = fired(80, rate=(0.04, -0.05, 0.06), substeps=substeps, on=on, off=(0.001,) * 3, minimum=minimum)
        # Of a substep in which a pulse ends the torque is the mean: what that leaves falls with the square of the substep.
        errors.append(np.abs(run["rate"] - integrated(run, 80)).max())
    times = np.abs(run["thruster_time"])
    assert times[times > 0.0].min() == pytest.approx(minimum)
    assert times.max() == PERIOD
    assert np.unique(times).size > 20
    assert errors[0] < 3e-6
    assert errors[1] < errors[0] / 8.0


def test_whole_pulses_are_integrated_to_the_order_of_the_method():
    run = fired(80, on=(0.004,) * 3, off=(0.001,) * 3, pulses=1)
    assert set(np.abs(run["thruster_time"]).ravel()) == {0.0, PERIOD}
    assert np.abs(run["rate"] - integrated(run, 80)).max() < 1e-10


def test_trigger_width_impulse_and_propellant_are_those_of_a_plain_state_machine():
    on, off, minimum, lever, specific = (0.006, 0.01, 0.004), (0.002, 0.001, 0.004), 0.08, 0.4, 70.0
    run = fired(300, on=on, off=off, minimum=minimum, lever=lever, specific_impulse=specific)
    firing, seen = [0.0, 0.0, 0.0], set()
    for command, times in zip(run["command"], run["thruster_time"], strict=True):
        for axis in range(3):
            u = command[axis]
            if firing[axis] and np.sign(u) == firing[axis]:
                state = "held" if abs(u) > off[axis] else "ended"
            else:
                state = "begun" if abs(u) > on[axis] else "idle"
            firing[axis] = np.sign(u) if state in ("held", "begun") else 0.0
            wanted = firing[axis] * min(max(abs(u) / TORQUE[axis] * PERIOD, minimum), PERIOD)
            assert times[axis] == pytest.approx(wanted, rel=1e-14, abs=1e-300)
            seen.add(state)
            seen.add("between" if state == "held" and abs(u) < on[axis] else "")
    assert seen >= {"held", "ended", "begun", "idle", "between"}
    used = np.cumsum(np.abs(run["thruster_time"][:-1]) * TORQUE, axis=0)
    assert np.abs(run["thruster_impulse"][1:] - used).max() < 1e-13
    assert np.allclose(run["propellant"][1:], used.sum(1) / (lever * specific * 9.80665), rtol=1e-12)
    # The mean torque of each control period is what is recorded as the torque that acts.
    assert np.abs(run["torque"] - run["thruster_time"] * TORQUE / PERIOD).max() < 1e-17


def test_the_rest_is_a_limit_cycle_of_shortest_pulses():
    start, minimum = {"rate": (0.0, 0.0, 0.004), "attitude": (1.0, 0.0, 0.0, 0.0)}, 0.03
    run = fired(4000, **start, on=(0.002,) * 3, off=(0.001,) * 3, minimum=minimum)
    times = run["thruster_time"][2000:, 2]
    pulses = times[times != 0.0]
    assert pulses.size > 2
    assert np.abs(pulses) == pytest.approx(minimum)
    # It drifts to and fro between pulses of both senses, each of which changes the rate by what its impulse gives.
    assert set(np.sign(pulses)) == {-1.0, 1.0}
    alone = (times != 0.0) & ~run["thruster_time"][2000:, :2].any(axis=1)
    jumps = np.diff(run["rate"][2000:, 2])[alone[:-1]]
    assert np.abs(jumps) == pytest.approx(TORQUE[2] * minimum * np.linalg.inv(HUB)[2, 2], rel=1e-3)
    assert 2.0 * np.abs(run["attitude"][2000:, 3]).max() < 2.0 * 0.002 / 0.05 * 1.2
