"""Attraction by both bodies near a libration point: the circular restricted three-body problem."""

from __future__ import annotations

from starhold.algebra.vector import Vector
from starhold.parts.bodies.libration_point import Libration, PointState, nonlinear
from starhold.parts.contract import Card, NoParams

CARD = Card(
    title="Field of the restricted three-body problem",
    summary="a = gravity of both bodies, Coriolis and centrifugal acceleration",
    sources=("published study of the direct Lyapunov method for compact invariant sets: motion near L2",),
    assumptions=("two bodies on circles about each other",),
)
ROLE = "environment"
TABLE = "libration"
BODY = "libration-point"
Params = NoParams


def acceleration(state: PointState, params: NoParams, craft: Libration, memory: object) -> Vector:
    """Return the acceleration without control, in the turning axes (scaled)."""
    return nonlinear(state.position, state.velocity, craft)


def examples() -> list[NoParams]:
    """Return the only instance."""
    return [NoParams()]
