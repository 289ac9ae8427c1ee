"""The PID law against linear theory (SciPy, NumPy) and against the error that PD keeps under a constant torque."""

import numpy as np
import pytest
from scipy.linalg import expm

import starhold as sh
from starhold.laws import pd, pid
from starhold.parts.craft import make_craft
from tests.laws.motion import fly
from tests.refusals import refused

INERTIA = np.array([[2.0, 0.1, -0.2], [0.1, 3.0, 0.15], [-0.2, 0.15, 4.0]])
CRAFT = make_craft(INERTIA)
MOMENTS, AXES = np.linalg.eigh(INERTIA)
PUSH = np.array([4e-4, -7e-4, 1e-4])
NO_TURN, STILL = np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3)


def angles(attitudes):
    return 2.0 * np.arcsin(np.minimum(1.0, np.linalg.norm(attitudes[:, 1:], axis=1)))


def test_constant_torque_leaves_no_error_where_pd_keeps_torque_over_stiffness():
    plain, whole = pd.Gains(0.3, 0.03), pid.Gains(0.3, 0.03, 8e-4, 2e-3)
    left, _, _ = fly(pd, plain, CRAFT, INERTIA, NO_TURN, STILL, 0.4, 1200, lambda t: PUSH)
    held, _, torques = fly(pid, whole, CRAFT, INERTIA, NO_TURN, STILL, 0.4, 1200, lambda t: PUSH)
    assert left[-1, 1:] == pytest.approx(PUSH / plain.k_attitude, rel=1e-6)
    assert angles(held).max() > 0.03
    assert angles(held)[-1] < 1e-5
    assert torques[-1] == pytest.approx(-PUSH, rel=1e-4)


def test_torque_beyond_the_integral_limit_leaves_what_the_limit_does_not_hold():
    gains = pid.Gains(0.3, 0.03, 5e-4, 5e-4)
    held, _, _ = fly(pid, gains, CRAFT, INERTIA, NO_TURN, STILL, 0.4, 1200, lambda t: PUSH)
    # Along the second axis 7e-4 N m acts and the integral gives 5e-4 at most.
    assert held[-1, 1:] == pytest.approx([0.0, -2e-4 / 0.03, 0.0], abs=1e-5)


def test_clamp_bounds_the_overshoot_of_a_long_slew():
    """An integral of free size winds up in a slew of 170 degrees; one with a small clamp does not."""
    far = np.array([np.cos(np.radians(85.0)), *(np.sin(np.radians(85.0)) * AXES[:, 2])])
    turned = {}
    for limit in (1e-3, 1.0):
        gains = pid.Gains(0.3, 0.03, 8e-4, limit)
        flown, _, _ = fly(pid, gains, CRAFT, INERTIA, far, STILL, 0.4, 2000)
        turned[limit] = (flown[:, 1:] @ AXES[:, 2]).min()
        assert angles(flown)[-1] < 1e-4
    assert turned[1.0] < -0.6
    assert -0.2 < turned[1e-3] < 0.0


def test_small_slew_is_that_of_the_held_linear_loop():
    """SciPy's matrix exponential gives the exact samples of the linear loop about each principal axis."""
    gains, period, steps = pid.Gains(0.3, 0.03, 1e-3, 1.0), 0.5, 200
    start = 1e-7 * np.array([1.0, -2.0, 0.5])
    attitude = np.array([1.0, *(AXES @ start / 2)])
    flown, rates, _ = fly(pid, gains, CRAFT, INERTIA, attitude, STILL, period, steps)
    for axis, moment in enumerate(MOMENTS):
        held = expm(period * np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0 / moment], [0.0, 0.0, 0.0]]))
        x, integral, scale = np.array([start[axis], 0.0]), 0.0, abs(start[axis])
        for k in range(steps):
            assert 2.0 * flown[k, 1:] @ AXES[:, axis] == pytest.approx(x[0], abs=1e-6 * scale)
            assert rates[k] @ AXES[:, axis] == pytest.approx(x[1], abs=1e-6 * scale)
            integral += period * x[0] / 2.0
            u = -gains.k_rate * x[1] - gains.k_attitude * x[0] / 2.0 - gains.k_integral * integral
            x = held[:2, :2] @ x + held[:2, 2] * u


def test_gains_are_refused_exactly_where_a_root_is_not_to_the_left():
    random, seen = np.random.default_rng(3), set()
    for _ in range(300):
        gains = pid.Gains(*(10.0 ** random.uniform(-2.0, 1.0, size=3)).tolist(), 1.0)
        roots = [np.roots([j, gains.k_rate, gains.k_attitude / 2, gains.k_integral / 2]) for j in MOMENTS]
        stable = bool(np.real(roots).max() < 0.0)
        seen.add(stable)
        if stable:
            pid.check(gains, CRAFT)
        else:
            with pytest.raises(ValueError, match="k_integral must be below"):
                pid.check(gains, CRAFT)
    assert seen == {True, False}


def scenario(*laws):
    return sh.scenario(
        {
            "name": "pulled",
            # A product of inertia of this size makes the gravity gradient constant and large in the orbital frame.
            "spacecraft": {"inertia": [[200.0, 40.0, 30.0], [40.0, 300.0, -20.0], [30.0, -20.0, 400.0]]},
            "orbit": {"altitude": "400 km", "inclination": "50 deg"},
            "target": {"mode": "orbital"},
            "initial": {"relative_to": "target", "angles": ["2 deg", "-1 deg", "1 deg"], "rate": [0.0, 0.0, 0.0]},
            "environment": {"gravity_gradient": True},
            "simulation": {"duration": "3000 s", "control_period": 0.5, "record_every": 10},
            "law": list(laws),
        }
    )


PLAIN = {"type": "pd", "k_rate": 6.0, "k_attitude": 0.1}
WHOLE = PLAIN | {"type": "pid", "k_integral": 5e-4, "integral_limit": "1 mN m"}


@pytest.mark.slow
def test_gravity_gradient_in_the_orbital_frame_is_held_off():
    flights = {flight.law: flight.run for flight in sh.compare(scenario(PLAIN, WHOLE))}
    ends = {name: angles(run["attitude_error"].values)[-1] for name, run in flights.items()}
    assert ends["pd"] > 1e-3
    assert ends["pid"] < 1e-2 * ends["pd"]


def test_unstable_gains_of_a_scenario_are_one_line():
    with refused("k_integral must be below ", " N m/s, or the linear loop is unstable; ", "--allow-unstable"):
        scenario(WHOLE | {"k_integral": 1.0})
