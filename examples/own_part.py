"""A disturbance of your own

`leak.py`, in the same folder, is a whole part: the torque of a tank that empties. An integral in the law is for a torque
that stays; of one that fades it gathers what it then has to give back."""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import starhold as sh

scenario = sh.scenario(
    {
        "name": "leaking",
        "spacecraft": {"inertia": [12.0, 14.0, 9.0], "torque_limit": "50 mN m"},
        "simulation": {"duration": "5 min", "control_period": 0.2},
        "part": [{"file": "leak.py", "torque": ["4 mN m", "-2 mN m", 0], "time": "40 s"}],
        "law": [
            {"type": "pd", "k_rate": 2.0, "k_attitude": 0.2},
            {"type": "pid", "k_rate": 2.0, "k_attitude": 0.2, "k_integral": 0.005, "integral_limit": "10 mN m"},
        ],
    },
    folder=Path(__file__).parent,
)
figure, axes = plt.subplots(figsize=(6, 3.2), layout="constrained")
for law in ("pd", "pid"):
    run = sh.simulate(scenario, law)
    axes.plot(run["time"], 2 * np.degrees(run["attitude_error"].sel(quaternion="q1")), label=law)
axes.axhline(0.0, color="grey", linewidth=0.8)
axes.set(xlabel="time, s", ylabel="error about x, degrees")
axes.legend()
figure.savefig(sys.argv[1], dpi=80)
