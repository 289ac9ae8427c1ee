"""Layouts of reaction wheels: unit spin axes in body axes."""

from __future__ import annotations

import math

from starhold.algebra.vector import Vector


def three_orthogonal() -> tuple[Vector, ...]:
    """Return three wheels along the body axes."""
    return ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def pyramid(elevation: float = math.atan(math.sqrt(0.5))) -> tuple[Vector, ...]:
    """Return four wheels about the z axis, at this elevation above the xy plane (rad) and halfway between the x and y axes;
    with the default all three body axes are alike. Raise ValueError if the elevation is not between 0 and pi/2."""
    if not 0.0 < elevation < 0.5 * math.pi:
        raise ValueError(f"the elevation of a pyramid must be between 0 and pi/2 rad, not {elevation:g}")
    flat, up = math.cos(elevation) * math.sqrt(0.5), math.sin(elevation)
    return ((flat, flat, up), (-flat, flat, up), (-flat, -flat, up), (flat, -flat, up))


def nasa_standard() -> tuple[Vector, ...]:
    """Return four wheels: three along the body axes and a spare at equal angles to them."""
    skewed = math.sqrt(1.0 / 3.0)
    return (*three_orthogonal(), (skewed, skewed, skewed))
