"""Slews that begin with a mode, onto targets that move: by differences over time, by SciPy, and in every reader."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from starhold.scenario.reading import parse
from tests.making import built, flown
from tests.missions import cubesat, mode
from tests.refusals import refused
from tests.sky import MARCH, to_sun

INERTIA = np.array([0.05, 0.065, 0.025])
PERIOD, RATE, ACCELERATION, TORQUE = 0.5, math.radians(0.8), math.radians(0.01), 5e-6
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


@pytest.mark.parametrize(("more", "target"), [("", NADIR), (', torque_limit = "0.005 mN m"', YAW)])
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
        assert limits[1] < 0.9 * ACCELERATION
    least = away[onto] / limits[0] + limits[0] / limits[1]
    if away[onto] < limits[0] ** 2 / limits[1]:
        least = 2.0 * math.sqrt(away[onto] / limits[1])
    assert np.argmax(away[onto:] < 1e-12) * PERIOD == pytest.approx(least, abs=PERIOD)


def test_a_mode_slews_around_the_sun():
    """A turn that leads an axis right through the Sun goes around it; the angle at every instant is by ERFA."""
    sun = to_sun(MARCH)
    held = Rotation.from_euler("ZYX", [-20, 35, 80], degrees=True)
    normal = np.cross(held.apply([0, 0, -1]), sun)
    angle = math.atan2(np.linalg.norm(normal), held.apply([0, 0, -1]) @ sun)
    end = Rotation.from_rotvec(2.0 * angle * normal / np.linalg.norm(normal)) * held
    target = f'target = {{ mode = "inertial", attitude = {end.as_quat(scalar_first=True).tolist()} }}'
    nearest = []
    for keep in ("", ', axis = [0, 0, -1], keep_out = "30 deg"'):
        run = flown(built(mission(keep, target, SLEW.replace("0.01 deg", "0.05 deg"), duration=360)), 719)
        attitude, _ = reference(run)
        nearest.append(math.degrees(np.arccos(np.clip(attitude.apply([0, 0, -1]) @ sun, -1.0, 1.0)).min()))
        assert (attitude[-1].inv() * end).magnitude() < 1e-12
    assert nearest[0] < 0.5
    assert 29.99 < nearest[1] < 45.0
    with refused("law[1].mode[2].slew", "the axis needs a direction"):
        mission(', axis = [0, 0, 0], keep_out = "30 deg"')
    with refused("law[1].mode[2].slew.rate", "nothing"):
        mission(slew='slew = {{ acceleration = "0.01 deg/s^2" }}')
