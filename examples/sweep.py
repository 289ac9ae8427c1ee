"""A map of the gains

400 flights, side by side on the lanes of a vector: how soon a CubeSat settles after a turn of 90 degrees, over both gains
of the Lyapunov law. White: not within two minutes. The line: gains of a damping ratio of one about the axis of the largest
moment of inertia."""

import sys

import matplotlib.pyplot as plt
import numpy as np

import starhold as sh

scenario = sh.scenario(
    {
        "name": "cubesat",
        "spacecraft": {"inertia": [0.04, 0.05, 0.02], "torque_limit": "2 mN m"},
        "initial": {"angles": ["90 deg", "20 deg", 0]},
        "simulation": {"duration": "2 min", "control_period": 0.1},
        "law": [{"type": "lyapunov", "k_rate": 0.01, "k_attitude": 0.0008}],
    }
)
rates, stiffnesses = np.linspace(0.002, 0.025, 20), np.linspace(2e-4, 3e-3, 20)
table = sh.sweep(scenario, {"law.lyapunov.k_rate": rates, "law.lyapunov.k_attitude": stiffnesses})
times = table["settling_time"].to_numpy(dtype=float).reshape(20, 20)

figure, axes = plt.subplots(figsize=(6, 3.8), layout="constrained")
mesh = axes.pcolormesh(1e3 * stiffnesses, 1e3 * rates, times, cmap="viridis_r")
figure.colorbar(mesh, label="settling time, s")
axes.plot(1e3 * stiffnesses, 1e3 * np.sqrt(2 * 0.05 * stiffnesses), color="black", linewidth=1)
axes.set(xlabel="k_attitude, mN m", ylabel="k_rate, mN m s", ylim=(2, 25))
best = np.unravel_index(np.nanargmin(times), times.shape)
axes.plot(1e3 * stiffnesses[best[1]], 1e3 * rates[best[0]], "r*")
figure.savefig(sys.argv[1], dpi=80)
