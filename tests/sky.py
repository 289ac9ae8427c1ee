"""The Sun by the IAU's routines, in the mean axes of date, for tests."""

import erfa
import numpy as np

MARCH = sum(erfa.cal2jd(2026, 3, 5)) + 6.5 / 24.0 - 2451545.0
"""Days from J2000 to the epoch of `missions.cubesat`."""


def directions(vectors):
    """These vectors as unit vectors."""
    return vectors / np.linalg.norm(vectors, axis=-1)[..., None]


def to_sun(days):
    """The unit vectors from the Earth's centre to the Sun so many days after J2000."""
    earth = erfa.epv00(2451545.0, days)[0]["p"]
    return directions(np.einsum("...ij,...j->...i", erfa.pmat06(2451545.0, days), -earth))
