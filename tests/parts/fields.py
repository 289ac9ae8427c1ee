"""States of craft about the Earth, and its magnetic field by ppigrf, for tests."""

from types import SimpleNamespace

import numpy as np
import ppigrf

from starhold.parts.sun import EARTH


def reference(positions, date):
    """The full field (T) in the same axes, by ppigrf, whose equations are those of the angles."""
    x, y, z = positions.T
    distance = np.linalg.norm(positions, axis=1)
    colatitude, longitude = np.arctan2(np.hypot(x, y), z), np.arctan2(y, x)
    parts = ppigrf.igrf_gc(distance / 1e3, np.degrees(colatitude), np.degrees(longitude), date)
    outward, south, east = (1e-9 * np.ravel(part)[:, None] for part in parts)
    (st, ct), (sp, cp) = ((np.sin(a), np.cos(a)) for a in (colatitude, longitude))
    axes = [(st * cp, st * sp, ct), (ct * cp, ct * sp, -st), (-sp, cp, 0.0 * cp)]
    return sum(size * np.stack(axis, axis=1) for size, axis in zip((outward, south, east), axes, strict=True))


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
