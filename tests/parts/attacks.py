"""What attacks on the bounds of parts share: random orbits, epochs and vectors, and climbs from the worst states."""

from typing import NamedTuple

import numpy as np

from starhold.parts.orbit import BODIES
from tests.tiers import fewer

GRAVITY, EARTH = BODIES["Earth"].gravity, 6378137.0


def along(x):
    return x / np.maximum(np.linalg.norm(x, axis=-1, keepdims=True), 1e-300)


def turned(q, v):
    """Vectors (n, 3) in axes that attitudes (n, 4) turn to."""
    s, u = q[:, :1], -q[:, 1:]
    return v + 2.0 * np.cross(u, np.cross(u, v) + s * v)


class Orbit(NamedTuple):
    """Size of an orbit (m), its eccentricity, and its plane's axes."""

    perigee: float
    eccentricity: float
    axes: np.ndarray

    @property
    def fastest(self):
        return (GRAVITY * (1.0 + self.eccentricity) / self.perigee) ** 0.5

    def at(self, anomaly):
        """Positions and velocities (n, 3) in inertial axes."""
        e, p = self.eccentricity, self.perigee * (1.0 + self.eccentricity)
        c, s, v = np.cos(anomaly)[:, None], np.sin(anomaly)[:, None], (GRAVITY / p) ** 0.5
        x, y = self.axes[0], self.axes[1]
        return p / (1.0 + e * c) * (c * x + s * y), v * (-s * x + (e + c) * y)


def orbit(random):
    perigee = EARTH + 10.0 ** random.uniform(np.log10(2e5), np.log10(3.6e7))
    eccentricity = float(random.choice([0.0, random.uniform(0.0, 0.8)]))
    return Orbit(perigee, eccentricity, np.linalg.qr(random.normal(size=(3, 3)))[0])


def size(random, low, high):
    return float(10.0 ** random.uniform(np.log10(low), np.log10(high)))


def vector(random, length):
    return tuple((length * along(random.normal(size=3))).tolist())


def epoch(random, first=1965, last=2035):
    year, month, day = random.integers(first, last), random.integers(1, 13), random.integers(1, 29)
    return (float(year), float(month), float(day), float(random.integers(24)), 0.0, 0.0)


def climbed(share, x, random):
    """The largest share near states, by random steps that shrink."""
    best, step = share(x), 0.5
    for _ in range(fewer(60, 3)):
        tried = x + step * random.normal(size=x.shape) * (random.uniform(size=x.shape) < 0.5)
        found = share(tried)
        better = found > best
        x, best, step = np.where(better[:, None], tried, x), np.maximum(found, best), 0.93 * step
    return float(best.max())
