"""Slews that begin with a mode, onto targets that move: by differences over time, by SciPy, and in every reader."""

import math
from dataclasses import replace

import erfa
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from starhold.algebra.structure import flatten
from starhold.loop.kernels import fly_plainly
from starhold.scenario.reading import parse
from starhold.simulation.lane import fly
from tests.loop.test_modes import same_in_every_lane
from tests.making import built, flown
from tests.missions import cubesat, mode
from tests.refusals import refused

INERTIA = np.array([0.05, 0.065, 0.025])
PERIOD, RATE, ACCELERATION, TORQUE = 0.5, math.radians(0.8), math.radians(0.01), 1e-5
LAW = '[[law]]\nname = "mission"\ntype = "modes"\nquaternion_sign = "hysteresis"\n'
SLEW = 'slew = {{ rate = "0.8 deg/s", acceleration = "0.01 deg/s^2"{} }}'
NADIR = 'target = { mode = "orbital" }'
YAW = 'target = { type = "yaw-steering" }'


def mission(more="", target=NADIR, slew=SLEW, duration=900):
    """A craft that holds an attitude, slews onto a target, and back."""
    held, angles = 'target = { mode = "inertial", angles = ANGLES }', '["-20 deg", "35 deg", "80 deg"]'
    modes = mode("hold", held, 'until = { after = "30 s" }')
    modes += mode("onto", target, slew.format(more), 'until = { after = "330 s" }') + mode("again", held, slew.format(""))
    text = cubesat(LAW, modes.replace("ANGLES", angles), duration=duration, angles=angles, rate=(0.0, 0.0, 0.0))
    return parse(text, "mission.toml")


def reference(run):
    """The attitudes, rates and accelerations of the reference in its own axes, from what is recorded."""
    error = Rotation.from_quat(run["attitude_error"], scalar_first=True)
    attitude = Rotation.from_quat(run["attitude"], scalar_first=True) * error.inv()
    return attitude, error.apply(run["rate"] - run["rate_error"])


@pytest.mark.parametrize("more, target", [("", NADIR), (', torque_limit = "0.01 mN m"', YAW)])
def test_a_mode_slews_from_the_attitude_of_the_craft_onto_a_target_that_moves(more, target):
    run = flown(built(mission(more, target)), 1800)
    attitude, rate = reference(run)
    onto, again = (np.flatnonzero(run["mode"] == k)[0] for k in (2, 3))
    angles = 2.0 * np.linalg.norm(run["attitude_error"][:, 1:], axis=1)
    # The reference begins where the craft is, which stays on it but for the rate of the target that it meets at once.
    assert angles[[onto, again]].max() < 1e-14
    met = [np.linalg.norm(rate[k] - rate[k - 1]) for k in (onto, again)]
    assert angles.max() < 0.006 / 0.0008 * max(met)
    # Its rate is that of its attitude, but for half a step of an acceleration that jumps.
    steps = (attitude[:-1].inv() * attitude[1:]).as_rotvec() / PERIOD
    off = np.linalg.norm(steps - 0.5 * (rate[1:] + rate[:-1]), axis=1)
    within = np.r_[0 : onto - 1, onto : again - 1, again : len(off)]
    assert off[within].max() < 0.5 * ACCELERATION * PERIOD
    assert np.sort(off[within])[-9] < 1e-6
    # It ends on the target itself, in the time of the textbooks.
    directly, _ = reference(flown(built(mission(target=target, slew="")), 1800))
    away = (attitude.inv() * directly).magnitude()
    assert max(away[again - 1], away[-1]) < 1e-12
    limits = RATE, ACCELERATION
    axis = (directly[onto].inv() * attitude[onto]).as_rotvec() / away[onto]
    if more:
        momentum = INERTIA * axis
        along, across = np.abs(momentum), np.abs(np.cross(axis, momentum))
        most = min(RATE, math.sqrt(0.5 * TORQUE / across.max()))
        limits = most, min(ACCELERATION, ((TORQUE - most**2 * across) / along).min())
        assert limits[1] < 0.5 * ACCELERATION
    least = away[onto] / limits[0] + limits[0] / limits[1]
    if away[onto] < limits[0] ** 2 / limits[1]:
        least = 2.0 * math.sqrt(away[onto] / limits[1])
    assert np.argmax(away[onto:] < 1e-12) * PERIOD == pytest.approx(least, abs=PERIOD)


def test_a_mode_slews_around_the_sun():
    """The axis stays out of the cone but for what the target turns meanwhile; what is flown straight passes through it."""
    nearest = []
    sun = sun_of(sum(erfa.cal2jd(2026, 3, 5)) + 6.5 / 24.0)
    held = Rotation.from_euler("ZYX", [-20, 35, 80], degrees=True)
    end = Rotation.from_rotvec(np.radians(120.0) * held.inv().apply(sun))
    for keep in ("", ', axis = AXIS, keep_out = "30 deg"'):
        target = f'target = {{ mode = "inertial", attitude = {(held * end).as_quat(scalar_first=True).tolist()} }}'
        print(target)
