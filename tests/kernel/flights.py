"""Flights of a body with a held torque, many lanes at once, under pushes that are chosen against what is claimed: an own
motion in NumPy, which shares no code with the kernel or with what starhold flies."""

import numpy as np


def cross(a, b):
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def along(v):
    return v / np.maximum(np.linalg.norm(v, axis=0), 1e-300)


def rates(J, inverse, q, w, torque):
    own = q[1:]
    turned = np.concatenate([[-(own * w).sum(0)], q[0] * w + cross(own, w)]) / 2
    return turned, inverse @ (torque - cross(w, J @ w))


def moved(J, inverse, q, w, torque, h):
    """The state after a time in which the torque does not change (Runge and Kutta)."""
    a = rates(J, inverse, q, w, torque)
    b = rates(J, inverse, q + h / 2 * a[0], w + h / 2 * a[1], torque)
    c = rates(J, inverse, q + h / 2 * b[0], w + h / 2 * b[1], torque)
    d = rates(J, inverse, q + h * c[0], w + h * c[1], torque)
    q, w = (x + h / 6 * (a[k] + 2 * b[k] + 2 * c[k] + d[k]) for k, x in enumerate((q, w)))
    return q / np.linalg.norm(q, axis=0), w


def pushes(rng, lanes, h, slow):
    """Unit vectors as functions of the period and the state, one kind a quarter of the lanes: with w + c q, which feeds
    energy in; about one axis, with its own w + c q; as the axis swings, forever; and one way that changes now and then."""
    kinds = np.arange(lanes) % 4
    c = slow * 10.0 ** rng.uniform(-2, 0.5, lanes)
    axis = along(rng.normal(size=(3, lanes)))
    axis[:, lanes // 2 :] = np.eye(3)[:, rng.integers(3, size=lanes - lanes // 2)]
    swing, phase, hold = slow * rng.uniform(0.3, 1.5, lanes), rng.uniform(0, 2 * np.pi, lanes), rng.integers(5, 400, lanes)

    def chosen(n, q, w):
        s = w + c * q[1:]
        sign = np.select(
            [kinds == 1, kinds == 2, kinds == 3],
            [
                np.where((axis * s).sum(0) >= 0, 1, -1),
                np.where(np.sin(swing * n * h + phase) >= 0, 1, -1),
                1 - 2 * ((n // hold) % 2),
            ],
            1,
        )
        return np.where(kinds == 0, along(s), sign * axis)

    return chosen


class Fleet:
    """Lanes of a body under a law that is a function of (q, w); how fast it answers is told, for pushes in time with it."""

    def __init__(self, J, law, h, outside, error, slow, seed=1, lanes=400):
        self.J, self.law, self.h, self.outside, self.error = np.asarray(J, dtype=float), law, h, outside, error
        self.inverse, self.rng, self.lanes = np.linalg.inv(self.J), np.random.default_rng(seed), lanes
        self.push = pushes(self.rng, lanes, h, slow)

    def directions(self):
        return along(self.rng.normal(size=(3, self.lanes)))

    def at_rest(self, angle):
        q = np.concatenate([[np.full(self.lanes, np.cos(angle / 2))], np.sin(angle / 2) * self.directions()])
        return q, np.zeros((3, self.lanes))

    def fly(self, q, w, periods, parts=2):
        """Yield the states between and at samples."""
        for n in range(periods):
            unit = self.push(n, q, w)
            command = self.law(q, w) + self.error * unit
            for _ in range(parts):
                q, w = moved(self.J, self.inverse, q, w, command + self.outside * unit, self.h / parts)
                yield n + 1, q, w


def feedback(J, k_rate, k_attitude):
    """The law with which the gyroscopic torque cancels, written once more."""
    J = np.asarray(J, dtype=float)
    return lambda q, w: -k_rate * w - k_attitude * q[1:] + cross(w, J @ w)


def turn(q):
    """The angle of each lane (rad)."""
    return 2 * np.arcsin(np.minimum(np.linalg.norm(q[1:], axis=0), 1.0))
