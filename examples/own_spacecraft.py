"""Three laws on a spacecraft of your own

A 120 kg satellite turns its camera. Two laws get their gains from a requirement, by `form`; all three fly with a star
tracker's and a gyro's noise and the gravity gradient."""

import sys

import matplotlib.pyplot as plt
import numpy as np

import starhold as sh

scenario = sh.scenario(
    {
        "name": "minisat",
        "spacecraft": {"inertia": [[12.0, 0.2, 0.0], [0.2, 14.0, -0.1], [0.0, -0.1, 9.0]], "torque_limit": "50 mN m"},
        "orbit": {"altitude": "620 km", "inclination": "97.9 deg"},
        "environment": {"gravity_gradient": True},
        "sensor": {"attitude_noise": "10 arcsec", "rate_noise": "0.001 deg/s"},
        "initial": {"angles": ["40 deg", "-15 deg", 0]},
        "simulation": {"duration": "4 min", "control_period": 0.2},
        "settling": {"attitude_tolerance": "0.1 deg", "rate_tolerance": "0.01 deg/s"},
        "law": [
            {"type": "pd", "form": "settling", "time": "2 min"},
            {"type": "lyapunov", "form": "bandwidth", "bandwidth": 0.08, "damping": 0.9},
            {"type": "sliding", "surface_gain": 0.1, "switching_gain": "10 mN m", "boundary_layer": "0.2 deg/s"},
        ],
    }
)
figure, axes = plt.subplots(figsize=(6, 3.4), layout="constrained")
for law in ("pd", "lyapunov", "sliding"):
    run = sh.simulate(scenario, law)
    q = run["attitude_error"].values
    angle = 2 * np.degrees(np.arctan2(np.linalg.norm(q[:, 1:], axis=1), abs(q[:, 0])))
    settled = sh.metrics(run)["settling_time"]
    axes.semilogy(run["time"], angle, label=f"{law}, settled after {settled:.0f} s")
axes.axhline(0.1, color="grey", linewidth=0.8)
axes.set(xlabel="time, s", ylabel="error angle, degrees")
axes.legend()
figure.savefig(sys.argv[1], dpi=80)
