"""A law of your own

`rate_damping.py`, in the same folder, is a whole law: u = -k w. Named by `file` it flies beside the laws of starhold. It
stops a tumbling CubeSat, and leaves it wherever it then points."""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import starhold as sh

scenario = sh.scenario(
    {
        "name": "tumbling",
        "spacecraft": {"inertia": [0.13, 0.10, 0.05], "torque_limit": "2 mN m"},
        "initial": {"rate": ["6 deg/s", "-4 deg/s", "9 deg/s"]},
        "simulation": {"duration": "90 s", "control_period": 0.1},
        "law": [
            {"file": "rate_damping.py", "k": 0.01},
            {"type": "pd", "k_rate": 0.02, "k_attitude": 0.002},
        ],
    },
    folder=Path(__file__).parent,
)
figure, (rates, angles) = plt.subplots(1, 2, figsize=(7, 3.2), layout="constrained")
for law in scenario.laws:
    run = sh.simulate(scenario, law.name)
    q = run["attitude_error"].values
    rates.plot(run["time"], np.degrees(np.linalg.norm(run["rate"], axis=1)), label=law.name)
    angles.plot(run["time"], 2 * np.degrees(np.arctan2(np.linalg.norm(q[:, 1:], axis=1), abs(q[:, 0]))))
rates.set(xlabel="time, s", ylabel="rate, degrees/s")
angles.set(xlabel="time, s", ylabel="error angle, degrees")
rates.legend()
figure.savefig(sys.argv[1], dpi=80)
