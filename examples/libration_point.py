"""A circle about L2

Two years near L2 of the Sun and the Earth, with control for the circle and 10 % to spare: smooth feedback ends on the
circle; a relay without a layer holds a band, and may stay on another circle of it."""

import sys

import matplotlib.pyplot as plt
import numpy as np

import starhold as sh

scenario = sh.load("l2-circle")
figure, (plane, distance) = plt.subplots(1, 2, figsize=(7.5, 3.5), layout="constrained")
for law in ("smooth", "relay"):
    run = sh.simulate(scenario, law)
    x, y, z = run["position"].values.T
    plane.plot(y, z, label=law, linewidth=1)
    distance.plot(run["time"] / (2 * np.pi), np.hypot(y, z) - 1)
plane.set(xlabel="Y, Earth diameters", ylabel="Z", aspect="equal")
distance.set(xlabel="years", ylabel="distance from the circle, Earth diameters")
plane.legend()
figure.savefig(sys.argv[1], dpi=80)
