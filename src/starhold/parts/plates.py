"""A spacecraft as flat plates, for the torques of air and of sunlight."""

from __future__ import annotations

from math import hypot
from typing import Any, NamedTuple

from starhold.algebra.scalar import Scalar
from starhold.algebra.vector import Vector, scale

COLUMNS = ("area", "normal_x", "normal_y", "normal_z", "x", "y", "z")
"""The columns of a table of plates: area (m2), outward normal, and centre from the centre of mass (m), body axes."""
TEXT = "areas, outward normals and centres from the centre of mass, body axes; no plate shades another"
BOX = (
    (0.06, 1.0, 0.0, 0.0, 0.052, -0.01, 0.02),
    (0.06, -1.0, 0.0, 0.0, -0.048, -0.01, 0.02),
    (0.03, 0.0, 1.0, 0.0, 0.002, 0.09, 0.02),
    (0.03, 0.0, -1.0, 0.0, 0.002, -0.11, 0.02),
    (0.02, 0.0, 0.0, 1.0, 0.002, -0.01, 0.17),
    (0.02, 0.0, 0.0, -1.0, 0.002, -0.01, -0.13),
)
"""The six sides of a 6U CubeSat, 0.1 by 0.2 by 0.3 m, with its centre of mass off the middle: an example."""


class Plates(NamedTuple):
    """Areas (m2), unit normals and centres (m)."""

    areas: tuple[Scalar, ...]
    normals: tuple[Vector, ...]
    centres: tuple[Vector, ...]


def plates_of(rows: Any) -> Plates:
    """The plates of a table. ValueError for one without rows, a negative area or a normal without direction."""
    if not rows:
        raise ValueError("the table of plates needs a row")
    normals: list[Vector] = []
    for number, (area, x, y, z, *_) in enumerate(rows, 1):
        size = hypot(x, y, z)
        if not (area >= 0.0 and size > 0.0):
            raise ValueError(f"plate {number} needs an area of at least 0 and a normal with a direction")
        normals.append(scale(1.0 / size, (x, y, z)))
    return Plates(tuple(row[0] for row in rows), tuple(normals), tuple((row[4], row[5], row[6]) for row in rows))
