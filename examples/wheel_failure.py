"""A reaction wheel is lost

Wheel 2 of a pyramid of four is lost after a minute. With nothing done its share of every command is missing; from the
diagnosis ten seconds later, `both` allocates the torque to the other three and designs the gains anew."""

import sys

import matplotlib.pyplot as plt
import numpy as np

import starhold as sh

scenario = sh.load("wheels-orbital")
lost = {"time": "60 s", "wheel": 2, "lost": True, "delay": "10 s"}
figure, (angles, momenta) = plt.subplots(1, 2, figsize=(7.5, 3.2), layout="constrained")
for action in ("none", "both"):
    run = sh.simulate(scenario.with_({"fault": [{**lost, "action": action}]}), "wheel")
    q = run["attitude_error"].values
    angle = 2 * np.degrees(np.arctan2(np.linalg.norm(q[:, 1:], axis=1), abs(q[:, 0])))
    angles.semilogy(run["time"], angle, label=f'action = "{action}"')
momenta.plot(run["time"], 1e3 * run["wheel_momentum"], label=["1", "2, lost", "3", "4"])
for axes in (angles, momenta):
    axes.axvline(60, color="grey", linewidth=0.8)
angles.set(xlabel="time, s", ylabel="error angle, degrees")
momenta.set(xlabel="time, s", ylabel="wheel momentum, mN m s", title='action = "both"')
angles.legend()
momenta.legend(title="wheel")
figure.savefig(sys.argv[1], dpi=80)
