"""What is proved, over a gain

For each stiffness the certifier looks for the largest turn from rest on which the torque is proved to stay within its limit,
the law and the spacecraft being exactly as given. The turns that bars reach are proved; nothing is said of those above."""

import sys

import matplotlib.pyplot as plt
import numpy as np

import starhold as sh

scenario = sh.scenario(
    {
        "name": "proved",
        "spacecraft": {"inertia": [12.0, 14.0, 9.0], "torque_limit": "50 mN m"},
        "simulation": {"duration": "4 min", "control_period": 0.2},
        "law": [{"type": "lyapunov", "k_rate": 2.0, "k_attitude": 0.1}],
    }
)
stiffnesses = np.array([0.05, 0.08, 0.13, 0.2])
turns = []
for stiffness in stiffnesses:
    (certificate,) = sh.certify(scenario.with_({"law.lyapunov.k_attitude": float(stiffness)}))
    turns.append(np.degrees(certificate.claim("torque-limit").numbers["slew_angle"]))

figure, axes = plt.subplots(figsize=(6, 3.2), layout="constrained")
axes.bar([f"{1e3 * stiffness:g}" for stiffness in stiffnesses], turns, width=0.5)
axes.set(xlabel="k_attitude, mN m", ylabel="proved turn from rest, degrees")
figure.savefig(sys.argv[1], dpi=80)
