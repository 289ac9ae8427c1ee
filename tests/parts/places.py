"""States of craft about the Earth, for tests."""

from types import SimpleNamespace

import numpy as np

from starhold.parts.sun import EARTH


def states(count=10, seed=6):
    """Attitudes, positions (m), velocities (m/s) and rates (rad/s) about the Earth, a third of them in its shadow."""
    random = np.random.default_rng(seed)
    for _ in range(count):
        q, r, v, w = (random.normal(size=size) for size in (4, 3, 3, 3))
        r *= (EARTH + random.uniform(3e5, 1e6)) / np.linalg.norm(r)
        v = np.cross(r, v)
        v *= 7.6e3 / np.linalg.norm(v)
        vectors = (tuple(map(float, x)) for x in (q / np.linalg.norm(q), r, v, 0.01 * w))
        yield SimpleNamespace(**dict(zip(("attitude", "position", "velocity", "rate"), vectors, strict=True)))
