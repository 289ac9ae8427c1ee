"""The Earth's magnetic field by ppigrf, for tests."""

import numpy as np
import ppigrf


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
