"""Stiction, power limits and imbalance of wheels, against Basilisk's, and how [wheels] gives them."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

import starhold as sh
from starhold.algebra.structure import runge_kutta
from starhold.algebra.vector import ZERO
from starhold.conformance.verdicts import agree
from starhold.loop.kernels import numbers_of
from starhold.parts.effectors import wheels
from starhold.parts.effectors.wheel_motion import with_more
from starhold.scenario.building import build
from starhold.simulation.lane import fly
from tests.oracles.basilisk import need, simulation

NONE = {
    "static": (0.0,) * 3,
    "stribeck_speed": (0.0,) * 3,
    "power_limit": (math.inf,) * 3,
    "static_imbalance": (0.0,) * 3,
    "dynamic_imbalance": (0.0,) * 3,
    "position": (ZERO,) * 3,
}
J = 1e-3


def made(viscous=0.0, **more):
    return with_more(wheels.make_wheels(np.eye(3), J, 0.1, 0.5, viscous), **NONE | more)


def scenario(**table):
    given = {"layout": "orthogonal", "inertia": J, "torque_limit": 0.01, "momentum_limit": 0.5} | table
    return sh.scenario(
        {
            "name": "shaken",
            "spacecraft": {"inertia": [2.0, 3.0, 4.0]},
            "simulation": {"duration": "20 s", "control_period": 0.1, "substeps": 100},
            "wheels": {key: value for key, value in given.items() if value is not None},
            "law": [{"type": "lyapunov", "k_rate": 0.2, "k_attitude": 0.03}],
        }
    )


def in_basilisk(until, step, rpm, torque=0.0, **numbers):
    """The body's rates and the wheel's speeds by Basilisk: one wheel along the third axis; and its first side."""
    need()
    from Basilisk.architecture import messaging
    from Basilisk.simulation import reactionWheelStateEffector, spacecraft
    from Basilisk.utilities import simIncludeRW

    body, factory = spacecraft.Spacecraft(), simIncludeRW.rwFactory()
    body.hub.mHub, body.hub.IHubPntBc_B = 1e9, np.diag([2.0, 3.0, 4.0]).tolist()
    options = {key: numbers.pop(key) for key in [*numbers] if key in ("useRWfriction", "RWModel")}
    wheel = factory.create("custom", [0.0, 0.0, 1.0], Js=J, u_max=0.1, Omega=rpm, **options)
    for key, value in numbers.items():
        setattr(wheel, key, value)
    effector = reactionWheelStateEffector.ReactionWheelStateEffector()
    factory.addToSpacecraft("wheels", effector, body)
    command = messaging.ArrayMotorTorqueMsg().write(messaging.ArrayMotorTorqueMsgPayload(motorTorque=[torque]))
    effector.rwMotorCmdInMsg.subscribeTo(command)
    states, speeds = body.scStateOutMsg.recorder(), effector.rwSpeedOutMsg.recorder()
    kept, run = simulation(step, effector, body, states, speeds)
    run(until)
    return np.array(states.omega_BN_B), np.array(speeds.wheelSpeeds)[:, 0], np.ravel(wheel.w2Hat0_B), kept


def flown(params, speed, torque, angle, steps, step):
    """The body's rates and the third wheel's speeds under a constant torque of its motor."""
    inertia = np.diag([2.0, 3.0, 4.0 - J])

    def slope(moving):
        rate, state = moving
        body, command = SimpleNamespace(rate=rate), (0.0, 0.0, torque)
        turning = np.array(wheels.reaction(state, command, body, params)) - np.cross(rate, inertia @ rate)
        return tuple(turning / np.diag(inertia)), wheels.rates(state, command, body, None, params)

    advance, moving = runge_kutta(slope), (ZERO, wheels.State((0.0, 0.0, J * speed), angle))
    rows = [moving]
    for _ in range(steps):
        rows.append(moving := advance(moving, step))
    rates = np.array([rate for rate, _ in rows])
    return rates, np.array([state.momentum[2] / J for _, state in rows]) - rates[:, 2]


@pytest.mark.slow
def test_stiction_is_basilisk_s():
    static, speed, viscous, torque = 3e-4, 5.0, 1e-5, 6e-4
    numbers = {"fCoulomb": 0.0, "fStatic": static, "betaStatic": speed, "cViscous": viscous}
    _, expected, _, _ = in_basilisk(40.0, 0.02, 0.0, torque, useRWfriction=True, **numbers)
    params = made(viscous, static=(static,) * 3, stribeck_speed=(speed,) * 3)
    _, found = flown(params, 0.0, torque, (), 2000, 0.02)
    assert np.abs(found - expected).max() < 1e-6 * expected.max()
    assert expected.max() > 2.0 * speed
    # It is largest at its speed.
    friction = [-wheels.motor((0.0,) * 3, (0.0, 0.0, J * x), ZERO, params)[2] - viscous * x for x in (4.9, 5.0, 5.1)]
    assert max(friction) == friction[1] == pytest.approx(static, rel=1e-12)


def test_imbalance_shakes_as_in_basilisk():
    moment, product, place = 1e-3, 1e-5, (0.1, -0.05, 0.2)
    need()
    from Basilisk.architecture import messaging

    rows = [[x] for x in place]
    expected, speeds, side, _ = in_basilisk(
        1.0, 1e-3, 600.0, RWModel=messaging.JitterSimple, U_s=moment, U_d=product, rWB_B=rows
    )
    params = made(static_imbalance=(0.0, 0.0, moment), dynamic_imbalance=(0.0, 0.0, product), position=(ZERO, ZERO, place))
    first, second = (np.array(x) for x in params.unbalanced[2])
    # From its own side on.
    wanted = product * side + moment * np.cross(place, side)
    angle = math.atan2(*np.linalg.lstsq(np.array([second, first]).T, wanted)[0]) / math.tau
    found, _ = flown(params, speeds[0], 0.0, (0.0, 0.0, angle), 1000, 1e-3)
    assert np.abs(found - expected).max() < 1e-5 * np.abs(expected).max()


def test_a_motor_gives_the_power_it_has_as_it_drives():
    params = made(power_limit=(2.0,) * 3)
    for speed, asked, given in ((400.0, 0.05, 0.005), (400.0, -0.05, -0.05), (-400.0, -0.05, -0.005), (10.0, 0.05, 0.05)):
        found = wheels.motor((asked, 0.0, 0.0), (J * speed, 0.0, 0.0), ZERO, params)[0]
        assert found == pytest.approx(given, rel=1e-12), speed
    assert wheels.sure_torque(params, "norm") == pytest.approx(2.0 / 500.0)
    assert wheels.sure_torque(made(), "norm") == pytest.approx(0.1)


SHAKEN = {
    "momentum_limit": None,
    "top_speed": "3000 rpm",
    "speed": "1000 rpm",
    "static_friction": "0.1 mN m",
    "stribeck_speed": "50 rpm",
    "power_limit": "1 W",
    "static_imbalance": "1 g cm",
    "dynamic_imbalance": "10 g cm^2",
    "position": [0.1, 0.0, 0.0],
}


@pytest.mark.slow
def test_tables_in_data_sheet_units():
    given = scenario(**SHAKEN)
    loop = build(given, given.laws[0])
    assert loop.wheels.momentum_limit == pytest.approx((J * 3000.0 * math.tau / 60.0,) * 3)
    assert loop.rotors == pytest.approx((J * 1000.0 * math.tau / 60.0,) * 3)
    # 10 g cm2, and 1 g cm at 10 cm across it.
    assert np.linalg.norm(loop.wheels.unbalanced, axis=2).max() == pytest.approx(math.hypot(1e-6, 1e-6))
    agree(loop, [loop.start] * 3, (0,))
    plain = build(other := scenario(), other.laws[0])
    assert len(numbers_of(plain.carry().effectors[0])) == 3
    still, shaken = (np.abs(fly(one, 100)[1].state.rate).max() for one in (plain, loop))
    assert still < 1e-12 < 1e-7 < shaken


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"momentum_limit": None, "inertia": None, "top_speed": "6000 rpm"}, "wheel 1 has no inertia"),
        ({"top_speed": "6000 rpm"}, "either top_speed or momentum_limit"),
        ({"momentum_limit": "6000 rpm"}, "a quantity in N m s"),
        ({"static_friction": 1e-4}, "needs a stribeck_speed"),
        ({"static_friction": 1e-4, "stribeck_speed": 5.0, "coulomb": 2e-4}, "at least its Coulomb friction"),
        ({"dynamic_imbalance": 1e-6, "momentum_limit": 5.0}, "at least 1000 substeps"),
    ],
)
def test_what_wheels_lack_is_said(table, words):
    with pytest.raises(sh.InputError, match=words):
        sh.simulate(scenario(**table))
