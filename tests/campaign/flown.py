"""A small campaign to fly, and to fly again."""

import math

import starhold as sh

SMALL = {
    "name": "small",
    "spacecraft": {"inertia": [2.0, 3.0, 4.0], "torque_limit": 0.3},
    "initial": {"attitude": [0.9, 0.1, -0.3, 0.2], "rate": [0.01, 0.0, -0.02]},
    "sensor": {"rate_noise": 1e-4},
    "environment": {"torque_noise": 1e-4},
    "simulation": {"duration": 40.0, "control_period": 0.2, "seed": 7},
    "settling": {"attitude_tolerance": 0.05, "rate_tolerance": 0.02},
    "law": [{"type": "pd", "k_rate": 2.0, "k_attitude": 0.8}, {"type": "lyapunov", "k_rate": 1.6, "k_attitude": 0.7}],
}
OVER = {
    "initial.attitude": {"distribution": "rotations"},
    "initial.rate": {"distribution": "shell", "low": "0.5 deg/s", "high": "4 deg/s"},
    "spacecraft.inertia": {"distribution": "normal", "sigma": "3 %", "relative": True, "judged_apart": True},
    "sensor.rate_noise": {"distribution": "log-normal", "sigma": 0.4},
    "law.pd.k_rate": {"distribution": "uniform", "low": 1.5, "high": 2.5},
}
ASKED = [
    {"metric": "settling_time", "at_most": "30 s", "share": 0.9, "confidence": 0.9},
    {"name": "pointing", "metric": "final_attitude_error", "at_most": "0.5 deg", "share": "90 %"},
    {"name": "kept", "metric": "lost"},
    {
        "name": "sun",
        "metric": "exclusion-cone",
        "axis": [0, 0, 1],
        "direction": [0, 1, 0],
        "at_least": "1 deg",
        "share": 0.9,
    },
]


def small(**changes):
    """The small scenario, with other entries at some keys, dots as underscores doubled."""
    scenario = sh.scenario(SMALL)
    return scenario.with_({key.replace("__", "."): value for key, value in changes.items()}) if changes else scenario


def fly(folder=None, **options):
    """A small campaign, by one thread and without search unless more is said."""
    asked = {"runs": 90, "over": OVER, "requirement": ASKED, "threads": 1, "search": False} | options
    return sh.campaign(asked.pop("scenario", None) or small(), folder, **asked)


def same(a, b):
    """Whether two values are the same number, or both none."""
    return a == b or (math.isnan(a) and math.isnan(b))
