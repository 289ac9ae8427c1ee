"""Loops with star trackers, a gyro and the Kalman filter, for tests."""

import math

from scipy.spatial.transform import Rotation

import starhold as sh

ARCSEC = math.radians(1.0 / 3600.0)
GYRO = {"type": "gyro", "noise": 2e-5, "bias_walk": 1e-4}
COMPLEMENTARY = {"type": "complementary-filter", "attitude_gain": 0.2, "bias_gain": 0.01}
ORBIT = {"position": [6.9e6, 0.0, 0.0], "velocity": [0.0, 5.0e3, 5.7e3]}
MEKF = {"type": "mekf", "noise": 2e-5, "bias_walk": 1e-4, "bias": 3e-4}


def tracker(cross, roll, boresight=(0.0, 0.0, 1.0), **more):
    return {"type": "star-tracker", "cross": cross, "roll": roll, "boresight": list(boresight)} | more


def row(table):
    return [table["cross"], table["roll"], *table["boresight"]]


def scenario(*parts, orbit=None, **simulation):
    """A body that turns, with these parts."""
    return sh.scenario(
        {
            "name": "several",
            "spacecraft": {"inertia": [2.0, 3.0, 4.0], "torque_limit": 0.02},
            "initial": {"angles": [0.7, 0.0, 0.2], "rate": [0.01, -0.02, 0.01]},
            "simulation": {"duration": "40 s", "control_period": 0.5} | simulation,
            "part": list(parts),
            "law": [{"type": "lyapunov", "k_rate": 0.2, "k_attitude": 0.03}],
        }
        | ({} if orbit is None else {"orbit": orbit})
    )


FIRST, SECOND = tracker(10.0 * ARCSEC, 80.0 * ARCSEC), tracker(6.0 * ARCSEC, 60.0 * ARCSEC, (1.0, 0.0, 0.0), interval=1.5)
FILTER = MEKF | {"cross": FIRST["cross"], "roll": FIRST["roll"], "boresight": FIRST["boresight"]}
TWO = FILTER | {"more_trackers": [row(SECOND)]}


def errors(run):
    """The errors of the estimated attitude (rad, body axes) at all samples."""
    true, told = (Rotation.from_quat(run[name].values, scalar_first=True) for name in ("attitude", "mekf_attitude"))
    return (true.inv() * told).as_rotvec()
