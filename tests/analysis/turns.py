"""Turns under the law `modal` whose transients are looked at."""

import math

import numpy as np

from starhold.analysis.roots import SlewProblem
from starhold.laws.catalogue import catalogue
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.bodies.rigid_body import State
from starhold.parts.craft import make_craft

LAW = catalogue()["modal"]
ZERO = (0.0, 0.0, 0.0)
END = math.radians(0.1)
STEPS = 3000


def problem(inertia=(2.0, 3.0, 4.0), axis=(1.0, -2.0, 0.5), rate=(0.1, 0.2, -0.15), **options):
    start = State((1.0, 0.0, 0.0, 0.0), ZERO, ZERO, ZERO, ZERO)
    loop = ClosedLoop(make_craft(inertia, np.inf), LAW, LAW.examples()[0], start, 0.01, limit="none", **options)
    return SlewProblem(loop, STEPS, axis, rate, END, END, -0.01)
