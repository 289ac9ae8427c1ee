"""Sensors that look along a boresight: its direction, and the field of view around it."""

from __future__ import annotations

import math

from starhold.algebra.vector import Vector, scale
from starhold.parts.contract import Parameter

BORESIGHT = Parameter("1", shape=(3,), spread=False, text="where it looks, body axes")
"""The declaration of a boresight, common to all sensors."""
THIRD: Vector = (0.0, 0.0, 1.0)


def unit_boresight(boresight: Vector) -> Vector:
    """Return the unit vector of a boresight. ValueError for one without direction."""
    size = math.hypot(*boresight)
    if not size > 0.0:
        raise ValueError("the boresight needs a direction")
    return scale(1.0 / size, boresight)


def field_cosine(half_angle: float) -> float:
    """Return the cosine of half a field of view; the margin for rounding lets half a turn see all."""
    return math.cos(half_angle) - 1e-12
