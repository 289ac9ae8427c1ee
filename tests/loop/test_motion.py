"""The closed loop against an integrator starhold did not write, and against the invariants of mechanics."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from starhold.algebra.quaternion import NO_TURN
from starhold.algebra.structure import flatten, unflatten
from starhold.laws.catalogue import catalogue
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.bodies.rigid_body import State, kinetic_energy
from starhold.parts.craft import make_craft
from starhold.parts.targets import orbital
from starhold.parts.targets.history import tabulate
from starhold.simulation.lane import fly
from tests.equations import angular_momentum
from tests.making import HUB as J
from tests.making import ORBIT, ORBITAL, aimed

MU = 3.986e14
START = State((0.1, 0.5, -0.5, 0.7), (0.04, 0.03, -0.02), (7e6, 0.0, 0.0), (0.0, 7.0e3, 2.75e3), (0.0, 0.0, 0.0))
START = START._replace(attitude=tuple(np.array(START.attitude) / np.linalg.norm(START.attitude)))


def loop(name="lyapunov", gains=None, start=START, **options):
    law = catalogue()[name]
    settings = {"period": 0.5, "parts": ORBIT} | options
    return ClosedLoop(make_craft(J, 0.01), law, law.examples()[0] if gains is None else gains, start, **settings)


def independent_motion(torque_of_time):
    """The equations of motion typed anew with NumPy."""

    def right_side(t, x):
        q, w, r, v = x[:4], x[4:7], x[7:10], x[10:13]
        q = q / np.linalg.norm(q)
        inward = r + 2 * q[0] * np.cross(r, q[1:]) + 2 * np.cross(np.cross(r, q[1:]), q[1:])
        gravity = 3 * MU / np.linalg.norm(r) ** 5 * np.cross(inward, J @ inward)
        dw = np.linalg.solve(J, torque_of_time(t) + gravity - np.cross(w, J @ w))
        dq = np.r_[-0.5 * w @ x[1:4], 0.5 * (x[0] * w + np.cross(x[1:4], w))]
        return np.r_[dq, dw, v, -MU * r / np.linalg.norm(r) ** 3]

    return right_side


def fly_independently(flown, torques, count):
    """Each control period by DOP853 from the end of the one before, under the torques of the flown run."""
    x = np.array(flatten(flown.start)[:13])
    for k in range(count):
        motion = independent_motion(lambda t, u=torques[:, k]: u)
        x = solve_ivp(motion, (0, flown.period), x, "DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
        x[:4] /= np.linalg.norm(x[:4])
    return x


def test_agrees_with_dop853_and_error_falls_16_fold():
    steps, errors = 20, []
    base = loop(period=2.0)
    torques = None
    for substeps in (1, 2, 4):
        samples, _ = fly(replace(base, substeps=substeps), steps)
        torques = samples[13:16]
        # The torques of each run, so that only the integration is compared.
        errors.append(np.abs(samples[:7, steps] - fly_independently(base, torques, steps)[:7]).max())
    assert errors[0] < 1e-6
    assert 12 < errors[0] / errors[1] < 20
    assert 12 < errors[1] / errors[2] < 20


def test_default_step_agrees_to_rounding():
    flown = loop(period=0.1)
    samples, _ = fly(flown, 100)
    reference = fly_independently(flown, samples[13:16], 100)
    assert np.abs(samples[:7, 100] - reference[:7]).max() < 1e-11
    assert np.abs(samples[7:10, 100] - reference[7:10]).max() < 1e-5  # of 7e6 m


def test_free_motion_conserves_momentum_and_energy():
    free = loop("pd", parts=(), period=0.1, limit="axis")
    # No control torque at all: a limit so small that it vanishes beside every other number.
    still = replace(free, craft=free.craft._replace(torque_limit=5e-324))
    samples, carry = fly(still, 20_000)
    first, last = unflatten(samples[:16, 0], START), carry.state
    h0, h1 = (np.array(angular_momentum(s, still.craft)) for s in (first, last))
    e0, e1 = (kinetic_energy(s.rate, still.craft) for s in (first, last))
    assert np.linalg.norm(h1 - h0) < 1e-10 * np.linalg.norm(h0)
    assert abs(e1 - e0) < 1e-10 * e0
    assert abs(np.linalg.norm(last.attitude) - 1.0) < 1e-14


def test_motion_too_fast_to_follow_is_reported_and_ends_the_samples():
    wild = loop("pd", gains=catalogue()["pd"].gains(40.0, 0.01), parts=(), limit="none", period=0.5)
    samples, carry = fly(wild, 2000)
    assert 0 < carry.lost_at < 2000
    assert samples.shape[1] == carry.lost_at
    assert np.isfinite(samples).all()
    chunked, other = fly(wild, 2000, progress=lambda done, total: None)
    assert other.lost_at == carry.lost_at
    assert np.array_equal(samples, chunked)


def test_history_is_tracked_to_the_hold_error():
    errors = []
    for period in (0.2, 0.1):
        times = np.arange(0.0, 61.0, 2.0)
        angle = 0.4 * np.sin(0.1 * times)
        axis = np.array([0.6, 0.0, 0.8])
        attitudes = np.c_[np.cos(angle / 2), np.sin(angle / 2)[:, None] * axis]
        table = tabulate(times, attitudes, np.arange(round(60 / period) + 1) * period)
        start = START._replace(attitude=tuple(table[0, :4]), rate=tuple(table[0, 4:7]))
        flown = loop("lyapunov", start=start, parts=(*ORBIT, aimed(table)), period=period, limit="none")
        samples, _ = fly(flown, round(60 / period))
        errors.append(np.abs(samples[20:23]).max())
    # Without feed-forward the acceleration of 4e-3 rad/s2 would cost J a / k, about 0.7 of the vector part.
    assert errors[1] < 2e-3
    assert errors[1] < 0.65 * errors[0]


@pytest.mark.parametrize("name", ["pd", "matrix-pd", "lyapunov", "sliding"])
def test_orbital_frame_is_held_from_the_start(name):
    goal = orbital.goal((), START, 0, NO_TURN)
    start = START._replace(attitude=goal.attitude, rate=goal.rate)
    samples, _ = fly(loop(name, start=start, parts=(*ORBIT, ORBITAL), period=0.1), 12_000)
    # Twelve hundred seconds are a fifth of an orbit: a law that ignored the motion would be off by 70 degrees.
    assert np.abs(samples[20:23]).max() < (3e-3 if name == "sliding" else 2e-3)
    assert samples[19].min() > 0.99
