"""Attraction by both bodies near a libration point, to first order in the distance from the point."""

from __future__ import annotations

from starhold.algebra.vector import Vector
from starhold.parts.bodies.libration_point import Libration, PointState, linear
from starhold.parts.contract import Card, NoParams

CARD = Card(
    title="Linear field of a libration point",
    summary="a = linear(r, v) of the turning axes",
    sources=("published study of the direct Lyapunov method for compact invariant sets: motion near L2",),
    assumptions=("two bodies on circles about each other", "small distance from the point"),
)
ROLE = "environment"
TABLE = "libration"
BODY = "libration-point"
Params = NoParams


def acceleration(state: PointState, params: NoParams, craft: Libration, memory: object) -> Vector:
    """Return the acceleration without control, in the turning axes (scaled)."""
    return linear(state.position, state.velocity, craft)


def examples() -> list[NoParams]:
    """Return the only instance."""
    return [NoParams()]
