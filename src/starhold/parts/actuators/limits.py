"""Saturation of a command: per axis, in norm, or none."""

from __future__ import annotations

from collections.abc import Callable

from starhold.algebra.scalar import Scalar
from starhold.algebra.vector import Vector, clip_axes, clip_norm


def limit_none(command: Vector, limit: Scalar) -> Vector:
    """Return the command unchanged."""
    return command


def limit_axis(command: Vector, limit: Scalar) -> Vector:
    """Saturate each component at +-limit, as wheels or thruster pairs along the axes do."""
    return clip_axes(command, limit)


def limit_norm(command: Vector, limit: Scalar) -> Vector:
    """Saturate the norm at the limit; the direction is kept."""
    return clip_norm(command, limit)


LIMITS: dict[str, Callable[[Vector, Scalar], Vector]] = {"axis": limit_axis, "norm": limit_norm, "none": limit_none}
