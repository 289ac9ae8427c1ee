"""The boresight of a sensor, and the field of view around it."""

from __future__ import annotations

import math

from starhold.algebra.vector import Vector, scale
from starhold.parts.contract import Parameter

BORESIGHT = Parameter("1", shape=(3,), spread=False, text="where it looks, body axes")
"""The declaration of a boresight, common to all sensors."""
THIRD: Vector = (0.0, 0.0, 1.0)


def unit_boresight(boresight: Vector) -> Vector:
    """Return the unit vector of a boresight. Raise ValueError if it is zero."""
    size = math.hypot(*boresight)
    if not size > 0.0:
        raise ValueError("the boresight needs a direction")
    return scale(1.0 / size, boresight)


def field_cosine(half_angle: float) -> float:
    """Return the cosine of a field of view's half angle, with a margin for rounding so that half a turn sees everything."""
    return math.cos(half_angle) - 1e-12
