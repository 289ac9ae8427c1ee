"""Attraction by the point mass that the body orbits."""

from __future__ import annotations

from typing import Any

from starhold.algebra.scalar import Scalar, sqrt
from starhold.algebra.vector import Vector, dot, scale
from starhold.parts.contract import Card, NoParams
from starhold.parts.craft import Craft

CARD = Card(
    title="Two-body motion",
    summary="r'' = -mu r/|r|^3",
    sources=("Fundamentals of Astrodynamics and Applications (2013)",),
    assumptions=("point mass", "no other forces"),
)
ROLE = "environment"
TABLE = "orbit"
Params = NoParams


def acceleration(state: Any, params: NoParams, craft: Craft, memory: Any) -> Vector:
    """Return the acceleration of the centre of mass (inertial, m/s2)."""
    return scale(-attraction(state.position, craft)[0], state.position)


def attraction(position: Vector, craft: Craft) -> tuple[Scalar, Scalar]:
    """Return mu/r^3 and 1/r^2, with one division."""
    inverse_square = 1.0 / dot(position, position)
    return craft.gravity * inverse_square * sqrt(inverse_square), inverse_square


def examples() -> list[NoParams]:
    """Return the only instance."""
    return [NoParams()]
