"""The limit of a command: of each axis, of the norm, or none."""

from __future__ import annotations

from collections.abc import Callable

from starhold.algebra.scalar import Scalar
from starhold.algebra.vector import Vector, clip_axes, clip_norm


def limit_none(command: Vector, limit: Scalar) -> Vector:
    """The command as it is."""
    return command


def limit_axis(command: Vector, limit: Scalar) -> Vector:
    """Each component within +-limit, as wheels or thruster pairs along the axes give."""
    return clip_axes(command, limit)


def limit_norm(command: Vector, limit: Scalar) -> Vector:
    """The vector shortened to the limit, its direction kept."""
    return clip_norm(command, limit)


LIMITS: dict[str, Callable[[Vector, Scalar], Vector]] = {"axis": limit_axis, "norm": limit_norm, "none": limit_none}
