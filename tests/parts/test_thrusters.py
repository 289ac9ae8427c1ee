"""Thrusters: against SciPy with torques that jump where pulses begin and end, and a plain state machine for the trigger."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import starhold as sh
from starhold.algebra.vector import ZERO
from starhold.laws.catalogue import catalogue
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.bodies.rigid_body import State
from starhold.parts.catalogue import find, fit
from starhold.parts.craft import make_craft
from starhold.scenario.reading import parse
from starhold.simulation.lane import fly, label
from tests.parts.files import BODY, PD, part
from tests.refusals import refused

THRUSTERS = find("effector", "thrusters")
INERTIA = np.array([[2.0, 0.1, -0.2], [0.1, 3.0, 0.15], [-0.2, 0.15, 4.0]])
TORQUE, PERIOD = np.array([0.02, 0.03, 0.04]), 0.5


def flown(steps, rate=(0.02, -0.03, 0.025), substeps=10, attitude=(0.6, 0.0, 0.8, 0.0), **params):
    """The recording of a flight under PD feedback."""
    numbers = THRUSTERS.params(**({"torque": tuple(TORQUE.tolist())} | params))
    law = catalogue()["pd"]
    start = State(attitude, rate, ZERO, ZERO, ZERO)
    craft = make_craft(INERTIA.tolist())
    parts = (fit("effector", "thrusters", *numbers),)
    loop = ClosedLoop(craft, law, law.gains(0.6, 0.05), start, PERIOD, substeps, parts=parts, limit="none")
    return label(loop, *fly(loop, steps), 1)


def integrated(run, steps):
    """Rates by SciPy, from pulse to pulse."""
    rate = run["rate"][0]
    found = [rate]
    for times in run["thruster_time"][:steps]:
        # The torque is steady between the ends of pulses.
        edges = sorted({0.0, PERIOD, *np.abs(times)})
        for begin, end in pairwise(edges):
            torque = TORQUE * np.sign(times) * (np.abs(times) > begin)

            def slope(_, w, torque=torque):
                return np.linalg.solve(INERTIA, torque - np.cross(w, INERTIA @ w))

            rate = solve_ivp(slope, (begin, end), rate, "DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
        found.append(rate)
    return np.array(found)


def test_pulses_act_as_long_as_they_say():
    on, minimum = (0.004, 0.004, 0.004), 0.05
    errors = []
    for substeps in (10, 40):
        run = flown(80, rate=(0.04, -0.05, 0.06), substeps=substeps, on=on, off=(0.001,) * 3, minimum=minimum)
        # Of a substep in which a pulse ends the torque is the mean: what that leaves falls with the square of the substep.
        errors.append(np.abs(run["rate"] - integrated(run, 80)).max())
    times = np.abs(run["thruster_time"])
    assert times[times > 0.0].min() == pytest.approx(minimum)
    assert times.max() == PERIOD
    assert np.unique(times).size > 20
    assert errors[0] < 3e-6
    assert errors[1] < errors[0] / 8.0


def test_whole_pulses_are_integrated_to_the_order_of_the_method():
    run = flown(80, on=(0.004,) * 3, off=(0.001,) * 3, pulses=1)
    assert set(np.abs(run["thruster_time"]).ravel()) == {0.0, PERIOD}
    assert np.abs(run["rate"] - integrated(run, 80)).max() < 1e-10


def test_the_trigger_and_the_width_are_those_of_a_plain_state_machine():
    on, off, minimum = (0.006, 0.01, 0.004), (0.002, 0.001, 0.004), 0.08
    run = flown(300, on=on, off=off, minimum=minimum)
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


def test_impulse_and_propellant_are_those_of_the_pulses():
    lever, specific = 0.4, 70.0
    run = flown(100, on=(0.004,) * 3, lever=lever, specific_impulse=specific)
    used = np.cumsum(np.abs(run["thruster_time"][:-1]) * TORQUE, axis=0)
    assert np.abs(run["thruster_impulse"][1:] - used).max() < 1e-14
    assert np.allclose(run["propellant"][1:], used.sum(1) / (lever * specific * 9.80665), rtol=1e-12)
    # The mean torque of each control period is what is recorded as the torque that acts.
    assert np.abs(run["torque"] - run["thruster_time"] * TORQUE / PERIOD).max() < 1e-17


def test_the_rest_is_a_limit_cycle_of_shortest_pulses():
    minimum = 0.03
    run = flown(
        4000, rate=(0.0, 0.0, 0.004), attitude=(1.0, 0.0, 0.0, 0.0), on=(0.002,) * 3, off=(0.001,) * 3, minimum=minimum
    )
    times = run["thruster_time"][2000:, 2]
    fired = times[times != 0.0]
    assert fired.size > 2
    assert np.abs(fired) == pytest.approx(minimum)
    # It drifts to and fro between pulses of both senses, each of which changes the rate by what its impulse gives.
    assert set(np.sign(fired)) == {-1.0, 1.0}
    alone = (times != 0.0) & ~run["thruster_time"][2000:, :2].any(axis=1)
    jumps = np.diff(run["rate"][2000:, 2])[alone[:-1]]
    assert np.abs(jumps) == pytest.approx(TORQUE[2] * minimum * np.linalg.inv(INERTIA)[2, 2], rel=1e-3)
    assert 2.0 * np.abs(run["attitude"][2000:, 3]).max() < 2.0 * 0.002 / 0.05 * 1.2


TEXT = part('type = "thrusters"\ntorque = "50 mN m"\nminimum = "20 ms"\non = "5 mN m"\noff = "2 mN m"\n')


def test_thrusters_fly_from_a_scenario_and_claims_leave_them_out():
    run = sh.simulate(parse(BODY.replace("10.0", "60.0") + TEXT + PD, "own"))
    assert run.thruster_time.dims == ("time", "axis")
    assert run.propellant.attrs["units"] == "kg"
    assert float(run.attitude_error[-1, 0]) > 0.99
    (certificate,) = sh.certify(parse(BODY + TEXT + PD, "own"))
    assert all("without the effector thrusters" in claim.assumptions for claim in certificate.claims)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ("off = 0.1\n", "off must be at most on"),
        ("minimum = 0.2\n", "the shortest pulse must be at most the control period of 0.1 s, not 0.2 s"),
        ('[[part]]\ntype = "lag"\nlag = 0.5\n', "none before thrusters, which takes the command at control instants alone"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(more, words):
    text = BODY + part('type = "thrusters"\ntorque = "50 mN m"\n' + more) + PD
    with refused(words):
        sh.simulate(parse(text, "own"))
