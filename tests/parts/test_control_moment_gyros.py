"""Variable-speed control-moment gyros against Basilisk; momentum of the whole; steering against NumPy's least
squares, next to singularities and at its limits."""

import importlib.util
import math
import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from starhold.algebra.cosines import from_angles
from starhold.algebra.vector import ZERO, dot
from starhold.analysis.linear import linearise
from starhold.parts.catalogue import find
from starhold.parts.effectors import control_moment_gyros as gyros
from starhold.parts.part import Fitted, Part
from tests.making import HUB, flown, hub
from tests.oracles.basilisk import need, simulation

ANGLES, RATE = (0.9, -0.4, 0.5), (0.05, -0.08, 0.06)
AROUND = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))
FLAT, UP = math.sqrt(2.0 / 3.0), math.sqrt(1.0 / 3.0)
AXES = [(FLAT * x, FLAT * y, UP, -y, x, 0.0) for x, y in AROUND]
"""Gimbals and spin axes of a pyramid whose sides are at 54.74 degrees."""
UNEQUAL = tuple(
    (*axes, *moments, 1.0, 0.2, 0.01, 0.6, angle, held)
    for axes, moments, angle, held in zip(
        AXES,
        [(8e-4, 1e-3, 6e-4, 8e-4), (9e-4, 1.3e-3, 8e-4, 7e-4), (7e-4, 9e-4, 1e-3, 6e-4), (8e-4, 1.1e-3, 7e-4, 9e-4)],
        (0.3, -0.5, 0.8, -0.2),
        (0.4, 0.35, -0.45, 0.4),
        strict=True,
    )
)


def pyramid(*angles, torque=0.01, limit=0.6, motor=0.2, rate=1.0):
    """Rows of four equal units, their gimbals at these angles (deg)."""
    own = (8e-4, 1e-3, 6e-4, 8e-4, rate, motor, torque, limit)
    return tuple((*axes, *own, math.radians(angle), 0.4) for axes, angle in zip(AXES, angles, strict=False))


def made(units, effector=None, rate=RATE, angles=ANGLES, substeps=10, limit=0.2, period=0.1, **params):
    """A slew by these units to the inertial axes; the inertia of the whole is HUB with the gimbals at angle zero."""
    own = Fitted(effector or find("effector", "control-moment-gyros"), gyros.Params(units, **params))
    options = {"gains": (0.9, 0.3), "limit": "norm", "command_limit": limit}
    return hub(own, rate=rate, attitude=from_angles(*angles), period=period, substeps=substeps, **options)


def prescribed(monkeypatch, motors):
    """The part with these torques (N m) of gimbals and rotors, functions of the command, in place of what it steers."""
    name = f"prescribed_{motors.__name__}"
    spec = importlib.util.spec_from_file_location(name, gyros.__file__)
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, name, module)
    spec.loader.exec_module(module)
    module.motors = lambda own, units, command, params: motors(command)
    return Part("control-moment-gyros", module)


def whole(units, run):
    """The angular momentum (N m s, inertial axes) of hub, gimbals and rotors over time."""
    attitudes, rate = Rotation.from_quat(run["attitude"], scalar_first=True), run["rate"]
    hub = HUB - sum(moving(row, 0.0)[0] for row in units)
    momentum = rate @ hub
    columns = zip(units, run["gimbal_angle"].T, run["gimbal_rate"].T, run["rotor_momentum"].T, strict=True)
    for row, angles, turning, held in columns:
        for k, (angle, speed, h) in enumerate(zip(angles, turning, held, strict=True)):
            both, g, s = moving(row, angle)
            w = rate[k] + speed * g
            momentum[k] += both @ w + h * s
    return attitudes.apply(momentum)


def moving(row, angle):
    """The inertia of a unit, and its gimbal and spin axes, with the gimbal at an angle."""
    g, s = np.array(row[:3]), Rotation.from_rotvec(angle * np.array(row[:3])).apply(row[3:6])
    t = np.cross(g, s)
    return row[7] * np.outer(s, s) + row[8] * np.outer(t, t) + row[9] * np.outer(g, g), g, s


@pytest.mark.slow
def test_a_slew_keeps_the_angular_momentum_of_the_whole():
    run = flown(made(UNEQUAL, substeps=40), 900)
    momentum = whole(UNEQUAL, run)
    assert np.abs(momentum - momentum[0]).max() < 1e-10 * np.linalg.norm(momentum[0])
    # The gimbals moved much of it about.
    assert np.ptp(run["rate"] @ HUB, axis=0).min() > 0.05
    assert np.ptp(run["gimbal_angle"], axis=0).min() > 0.2


def test_gimbals_rotors_and_body_move_as_in_basilisk(monkeypatch):
    need()
    from Basilisk.architecture import messaging
    from Basilisk.simulation import spacecraft, vscmgStateEffector

    shares = ((4e-3, -2e-3, 1e-3), (-3e-3, 4e-3, 2e-3), (1e-3, 2e-3, -5e-3), (2e-3, 3e-3, 3e-3))

    def shared(command):
        return tuple(dot(row, command) for row in shares), tuple(2.0 * dot(row[::-1], command) for row in shares)

    # Gimbals that nothing steers move chaotically: of longer flights rounding decides.
    steps, substeps = 60, 20
    run = flown(made(UNEQUAL, prescribed(monkeypatch, shared), substeps=substeps), steps)
    craft = spacecraft.Spacecraft()
    craft.hub.mHub, craft.hub.r_BcB_B = 100.0, [[0.0]] * 3
    craft.hub.IHubPntBc_B = (HUB - sum(moving(row, 0.0)[0] for row in UNEQUAL)).tolist()
    x, y, z = Rotation.from_quat(run["attitude"][0], scalar_first=True).as_mrp()
    craft.hub.sigma_BNInit, craft.hub.omega_BN_BInit = [[x], [y], [z]], [[w] for w in RATE]
    effector = vscmgStateEffector.VSCMGStateEffector()
    for row in UNEQUAL:
        one = messaging.VSCMGConfigMsgPayload()
        one.ggHat_B, one.gsHat0_B = ([[a] for a in axis] for axis in (row[:3], row[3:6]))
        one.gtHat0_B = [[a] for a in np.cross(row[:3], row[3:6])]
        one.rGB_B, one.rGcG_G = [[0.0]] * 3, [[0.0]] * 3
        one.IW1, one.IW2, one.IW3 = row[6], 0.5 * row[6], 0.5 * row[6]
        one.IG1, one.IG2, one.IG3 = row[7] - row[6], row[8] - 0.5 * row[6], row[9] - 0.5 * row[6]
        one.massW, one.massG, one.VSCMGModel = 1.0, 1.0, 0
        one.u_s_max, one.u_s_min, one.u_g_max, one.u_g_min, one.Omega_max, one.gammaDot_max = (-1.0,) * 6
        one.gamma, one.gammaDot, one.Omega = row[14], 0.0, row[15] / row[6]
        effector.AddVSCMG(one)
    craft.addStateEffector(effector)
    asked = messaging.VSCMGArrayTorqueMsg()
    effector.cmdsInMsg.subscribeTo(asked)
    logs = craft.scStateOutMsg.recorder(), effector.speedOutMsg.recorder()
    _running, run_to = simulation(0.1 / substeps, effector, craft, *logs)
    for k in range(steps):
        torques = messaging.VSCMGArrayTorqueMsgPayload()
        torques.gimbalTorque, torques.wheelTorque = run["gimbal_torque"][k].tolist(), run["rotor_torque"][k].tolist()
        asked.write(torques)
        run_to(0.1 * (k + 1))
    assert np.abs(run["rate"] - logs[0].omega_BN_B[::substeps]).max() < 1e-11
    # Its message of the gimbals is written before a step is taken.
    theirs = [array[1::substeps, :4] for array in (logs[1].gimbalAngles, logs[1].gimbalRates, logs[1].wheelSpeeds)]
    speed = run["rotor_momentum"] / np.array([row[6] for row in UNEQUAL])
    for own, array, bound in zip((run["gimbal_angle"], run["gimbal_rate"], speed), theirs, (1e-10, 1e-9, 1e-9), strict=True):
        assert np.abs(own[:-1] - array).max() < bound
        assert np.ptp(array, axis=0).min() > 0.5
    assert np.ptp(run["rate"], axis=0).min() > 0.1


def columns(row, angle, held, rate):
    """What the body loses for a unit of gimbal rate, by a difference of the unit's momentum, and the spin axis."""
    spin = moving(row, angle)[2]
    kept = held + row[6] * (spin @ rate)

    def carried(x):
        both, _, s = moving(row, x)
        return both @ rate - row[6] * s * (s @ rate) + kept * s

    return (carried(angle + 1e-4) - carried(angle - 1e-4)) / 2e-4, spin


def test_steering_is_weighted_least_squares_that_keeps_the_line_of_the_torque():
    random = np.random.default_rng(3)
    params = gyros.prepare(gyros.Params(UNEQUAL, rotor_weight=30.0, singularity=0.3), 0.1)
    limits = np.array([1.0] * 4 + [0.01] * 4)
    saturated = 0
    for _ in range(60):
        angles, held = random.uniform(-3.0, 3.0, 4), random.uniform(0.2, 0.5, 4) * random.choice([-1.0, 1.0], 4)
        rate, wanted = random.normal(scale=0.2, size=3), random.normal(scale=random.choice([0.05, 1.0]), size=3)
        own = gyros.State(tuple(angles), (0.0,) * 4, tuple(held))
        asked = gyros.steer(gyros.turned(own, tuple(rate), params), tuple(wanted), params)
        parts = [columns(row, x, h, rate) for row, x, h in zip(UNEQUAL, angles, held, strict=True)]
        turning, spins = (np.array(part).T for part in zip(*parts, strict=True))
        best = sum(row[15] ** 2 for row in UNEQUAL) / 3.0
        size = np.linalg.det(turning @ turning.T) / best**3
        assert asked.determinant == pytest.approx(size, rel=1e-5, abs=1e-9)
        weights = np.array([1.0] * 4 + [30.0 / (1.0 + size / 0.3) ** 4] * 4)
        effect = np.hstack([turning, spins]) * limits
        shares = np.sqrt(weights) * np.linalg.lstsq(effect * np.sqrt(weights), -wanted, rcond=None)[0]
        given = np.array([*asked.rate, *asked.torque]) / limits
        most = np.abs(shares).max()
        assert given == pytest.approx(shares / max(1.0, most), rel=1e-5, abs=1e-7)
        saturated += most > 1.0
    assert 10 < saturated < 50


def about_x(angle, damping=0.0, **units):
    """A slew about the first axis, which takes the gimbals of a pyramid to a singularity if it is long."""
    loop = made(pyramid(0.0, 0.0, 0.0, 0.0, **units), rate=ZERO, substeps=5, damping=damping)
    return replace(loop, start=loop.start._replace(attitude=(math.cos(angle / 2.0), math.sin(angle / 2.0), 0.0, 0.0)))


def test_rotors_give_the_torque_that_gimbals_next_to_a_singularity_do_not():
    slews = about_x(1.0), about_x(2.8, torque=0.02), about_x(2.8, torque=0.0), about_x(2.8, torque=0.0, damping=0.01)
    short, driven, idle, damped = (flown(loop, 900) for loop in slews)
    for run in (short, driven, idle, damped):
        assert 2.0 * np.abs(run["attitude_error"][-1, 1:]).max() < 1e-5
        assert np.abs(run["rate"][-1]).max() < 1e-5
    missed = [np.linalg.norm(run["torque"] - run["command"], axis=1)[3:].max() for run in (short, driven, idle)]
    assert driven["gimbal_determinant"].min() < 1e-3 < 0.1 < short["gimbal_determinant"].min()
    # A gimbal's servo lags behind by a tenth of a second.
    assert missed[1] < 0.02
    assert missed[2] > 0.05
    assert np.abs(damped["gimbal_rate_command"]).max() < 0.9 * np.abs(idle["gimbal_rate_command"]).max()
    # Far from the singularity the rotors are left alone.
    assert np.abs(short["rotor_torque"]).max() < 1e-5
    assert np.abs(driven["rotor_torque"]).max() > 0.01


def caught(torque, **limits):
    """A turn about the axis of a pyramid whose gimbals all have their torque across it."""
    loop = made(pyramid(90.0, 90.0, 90.0, 90.0, torque=torque, **limits), rate=ZERO, limit=0.02)
    return flown(replace(loop, start=loop.start._replace(attitude=(0.9, 0.0, 0.0, math.sqrt(0.19)))), 100)


@pytest.mark.slow
def test_rotors_turn_a_craft_whose_gimbals_are_caught_in_a_singularity():
    driven, idle = caught(0.02), caught(0.0)
    assert driven["gimbal_determinant"].max() < 1e-6
    assert np.abs(driven["torque"] - driven["command"])[:50].max() < 2e-4
    assert driven["rate"][-1, 2] < -0.04
    # Without them there is no torque, and no number that is none.
    assert not idle["rate"].any()
    assert np.abs(idle["command"]).max() == pytest.approx(0.02)


@pytest.mark.slow
def test_nothing_goes_beyond_its_limit():
    slow, full = flown(about_x(2.8, motor=0.03, rate=0.3), 600), caught(0.003, limit=0.41)
    for run, name, limit in (
        (slow, "gimbal_rate_command", 0.3),
        (slow, "gimbal_torque", 0.03),
        (full, "rotor_torque", 0.003),
    ):
        assert np.abs(run[name]).max() == pytest.approx(limit, rel=1e-12), name
    # The motor fades out over the last hundredth of the momentum.
    assert 0.407 < np.abs(full["rotor_momentum"]).max() < 0.41
    assert np.abs(full["rotor_torque"][-1]).max() < 0.002


def test_the_linear_loop_has_the_servo_and_foretells_a_small_motion():
    loop = made(pyramid(0.0, 0.0, 0.0, 0.0), rate=ZERO, angles=(1e-4, -2e-4, 3e-4), bandwidth=4.0)
    linear, run = linearise(loop), flown(loop, 300)
    # A gimbal keeps so much of its rate in a control period.
    assert sum(abs(pole - math.exp(-0.4)) < 0.04 for pole in linear.poles) == 4
    step = linear.stepped_closed.A
    state = np.concatenate([2.0 * run["attitude_error"][0, 1:], np.zeros(len(step) - 3)])
    found = []
    for _ in run["time"]:
        found.append(state[:6])
        state = step @ state
    flight = np.hstack([2.0 * run["attitude_error"][:, 1:], run["rate"]])
    assert np.abs(flight - found).max() < 1e-3 * np.abs(flight).max()
    assert np.abs(flight[-1]).max() < 0.05 * np.abs(flight[0]).max()
