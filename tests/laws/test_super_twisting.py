"""The super-twisting law against SciPy's integration of the scalar algorithm, its published Lyapunov function, and sliding
mode with a boundary layer."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import solve_continuous_are

import starhold as sh
from starhold.laws import sliding, super_twisting
from starhold.laws.interface import Measurement, NoMemory
from starhold.parts.craft import make_craft
from tests.laws.motion import fly
from tests.tiers import fewer

INERTIA = np.array([[2.0, 0.1, -0.2], [0.1, 3.0, 0.15], [-0.2, 0.15, 4.0]])
CRAFT = make_craft(INERTIA)
SLOPE = np.array([[0.08, 0.01, 0.0], [0.01, 0.1, 0.0], [0.0, 0.0, 0.12]])
GAINS = super_twisting.Gains(tuple(map(tuple, SLOPE.tolist())), (4e-4, 3e-4, 2e-4), (1e-4, 8e-5, 5e-5))
SIZE, BEAT = np.array([3e-4, -2e-4, 4e-4]), 0.2
START, RATE = np.array([np.sqrt(0.19), 0.5, -0.7, np.sqrt(0.07)]), np.array([0.04, 0.03, 0.02])


def push(t):
    """A disturbance torque (N m) that swings about a mean."""
    return SIZE * (0.5 + np.sin(BEAT * t))


def surface(attitudes, rates):
    return rates + attitudes[:, 1:] @ SLOPE.T


def algorithm(axis, initial, times):
    """s (rad/s) of s' = -sqrt(k1 |s|) sign(s) + v + d, v' = -k2 sign(s), by SciPy; d is what the disturbance makes of it.
    The sign is a steep slope within 1e-7 rad/s, without which no integrator gets past s = 0."""
    k1, k2 = GAINS.k1[axis], GAINS.k2[axis]

    def slope(t, x):
        sign = np.clip(x[0] / 1e-7, -1.0, 1.0)
        return [-np.sqrt(k1 * abs(x[0])) * sign + x[1] + (np.linalg.inv(INERTIA) @ push(t))[axis], -k2 * sign]

    span = (times[0], times[-1])
    return solve_ivp(slope, span, [initial, 0.0], "LSODA", times, rtol=1e-9, atol=1e-12, max_step=0.05).y[0]


def test_every_axis_runs_the_published_algorithm():
    """The equivalent torque takes the body's motion away: s obeys the scalar algorithm, with an error that shrinks as the
    control period."""
    worst = []
    for period in (0.1, 0.05):
        steps = round(40.0 / period)
        flown = fly(super_twisting, GAINS, CRAFT, INERTIA, START, RATE, period, steps, push)
        found, times = surface(*flown[:2]), period * np.arange(steps)
        expected = np.array([algorithm(axis, found[0, axis], times) for axis in range(3)]).T
        worst.append(np.abs(found - expected).max() / np.abs(found).max())
    assert worst[0] < 0.02
    assert worst[1] < 0.6 * worst[0]


def test_surface_is_held_to_the_square_of_the_period_without_chatter():
    """After a finite time |s| stays of the order of k T^2, where a boundary layer keeps its share of the disturbance and the
    sign chatters by its whole torque."""
    period, steps = 0.1, 2000
    layered = sliding.Gains(GAINS.surface_gain, (5e-3,) * 3, 2e-3)
    found = {
        name: fly(law, gains, CRAFT, INERTIA, START, RATE, period, steps, push)
        for name, law, gains in (
            ("twisting", super_twisting, GAINS),
            ("layer", sliding, layered),
            ("sign", sliding, layered._replace(boundary_layer=0.0)),
        )
    }
    ends = {name: np.abs(surface(*flown[:2]))[-1000:].max() for name, flown in found.items()}
    jumps = {name: np.abs(np.diff(flown[2], axis=0))[-1000:].max() for name, flown in found.items()}
    assert ends["twisting"] < 3.0 * (max(GAINS.k1) + max(GAINS.k2)) * period**2
    assert ends["layer"] > 20.0 * ends["twisting"]
    assert jumps["sign"] > 5e-3
    assert jumps["twisting"] < 0.05 * jumps["sign"]
    # On the surface the body goes to the target, and the torque is the disturbance's negative.
    assert np.abs(found["twisting"][0][-1, 1:]).max() < 1e-3
    assert found["twisting"][2][-500:] == pytest.approx(-np.array([push(0.1 * k) for k in range(1500, 2000)]), abs=1.5e-4)


def test_lyapunov_function_of_moreno_and_osorio_falls_under_the_torque():
    """V = x'Px, x = (sqrt(|s|) sign(s), v + d), falls at random states where the card's condition on L holds; P solves the
    Riccati equation of the bounded real lemma."""
    random, period = np.random.default_rng(8), 1e-9
    inverse = np.linalg.inv(INERTIA)
    for trial in range(fewer(60)):
        k1, k2 = (10.0 ** random.uniform(-5.0, -2.0, size=2)).tolist()
        most = k2 if k1 >= 4.0 * k2 else np.sqrt(k1 / 4.0 * (2.0 * k2 - k1 / 4.0))
        bound = 0.98 * most
        # In units of time and of s in which k2 is 1: x1 = sqrt(|s|) sign(s), d' = k2 w, |w| <= bound / k2.
        root, share = np.sqrt(k1 / k2), bound / k2
        a, b = np.array([[-0.5 * root, 0.5], [-1.0, 0.0]]), np.array([[0.0], [1.0]])
        weight = np.diag([share**2, 0.0]) + 1e-7 * np.eye(2)
        p = solve_continuous_are(a, b, weight, np.array([[-1.0]]))
        assert np.linalg.eigvalsh(p)[0] > 0.0
        gains = super_twisting.Gains((0.08,) * 3, (k1,) * 3, (k2,) * 3)
        for _ in range(20):
            s, x2 = random.normal(size=2) * (1.0, np.sqrt(k2))
            memory = super_twisting.Memory((x2, 0.0, 0.0))
            at = Measurement((1.0, 0.0, 0.0, 0.0), (s, 0.0, 0.0), (0.0,) * 3, *((0.0,) * 3 for _ in range(4)), period)
            u, after = super_twisting.torque(at, gains, CRAFT, memory)
            # The equivalent torque is that of `sliding` without its switching term.
            rest, _ = sliding.torque(at, sliding.Gains((0.08,) * 3, (0.0,) * 3), CRAFT, NoMemory())
            s_rate = (inverse @ (np.array(u) - rest))[0]
            v_rate = (after.acceleration[0] - x2) / period + bound * random.choice([-1.0, 1.0])
            x = np.array([np.sqrt(abs(s)) * np.sign(s), x2 / np.sqrt(k2)])
            x_rate = np.array([s_rate / (2.0 * np.sqrt(abs(s))), v_rate / np.sqrt(k2)])
            assert x @ p @ x_rate < 0.0, trial


def test_slope_that_leads_off_the_target_is_refused():
    for good in super_twisting.examples():
        super_twisting.check(good, CRAFT)
    with pytest.raises(ValueError, match="leads off the target"):
        super_twisting.check(GAINS._replace(surface_gain=(0.08, -0.01, 0.08)), CRAFT)
    scenario = sh.load("three-laws")
    with pytest.raises(sh.InputError, match="leads off the target; --allow-unstable"):
        scenario.with_({"law": [{"type": "super-twisting", "surface_gain": -0.1, "k1": 1e-4, "k2": "1e-5 rad/s^3"}]})
