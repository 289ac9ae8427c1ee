"""A body under a law and any torque from outside, flown by a plain loop of its own for tests of laws."""

import numpy as np

from starhold.laws.interface import Measurement, NoMemory


def _cross(a, b):
    """The vector product; NumPy's own takes most of a flight's time."""
    return a[[1, 2, 0]] * b[[2, 0, 1]] - a[[2, 0, 1]] * b[[1, 2, 0]]


def _turning(q, w):
    """q' = q (0, w) / 2, scalar first."""
    v = q[1:]
    return 0.5 * np.concatenate(([-v @ w], q[0] * w + _cross(v, w)))


def fly(law, gains, craft, inertia, attitude, rate, period, steps, outside=lambda t: np.zeros(3), substeps=1):
    """Attitudes (steps, 4), rates (steps, 3) and torques (steps, 3) at the control instants of a slew to the inertial axes.

    Euler's equations are integrated by fourth-order Runge-Kutta, the torque held for each period, by NumPy alone.
    law: its module. outside(t): the disturbance torque (N m, body axes).
    """
    inverse = np.linalg.inv(inertia)
    memory = law.remember(gains, craft, period) if hasattr(law, "remember") else NoMemory()
    x, zero = np.concatenate((attitude, rate)), (0.0, 0.0, 0.0)
    found = ([], [], [])

    def slope(t, x, u):
        w = x[4:]
        return np.concatenate((_turning(x[:4], w), inverse @ (u + outside(t) - _cross(w, inertia @ w))))

    for step in range(steps):
        w = tuple(x[4:].tolist())
        seen = Measurement(tuple(x[:4].tolist()), w, w, zero, zero, zero, zero, period)
        told, memory = law.torque(seen, gains, craft, memory)
        u, h, t = np.array(told), period / substeps, step * period
        for rows, value in zip(found, (x[:4], x[4:], u), strict=True):
            rows.append(value)
        for part in range(substeps):
            now = t + part * h
            k1 = slope(now, x, u)
            k2 = slope(now + h / 2, x + h / 2 * k1, u)
            k3 = slope(now + h / 2, x + h / 2 * k2, u)
            k4 = slope(now + h, x + h * k3, u)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            x[:4] /= np.linalg.norm(x[:4])
    return tuple(np.array(rows) for rows in found)
