"""The orbital frame: third axis to the centre of attraction, second opposite to the orbit normal, first along the motion."""

from __future__ import annotations

from typing import Any

from starhold.algebra.cosines import to_quaternion
from starhold.algebra.quaternion import Quaternion, nearer
from starhold.algebra.scalar import sqrt
from starhold.algebra.vector import cross, dot, scale
from starhold.parts.contract import Card, Motion, NoParams, Orbit
from starhold.parts.roles import Goal

CARD = Card(
    title="Orbital frame",
    summary="nadir pointing: w = h/r^2 about the orbit normal",
    sources=("Spacecraft Dynamics and Control (1997)",),
    assumptions=("two-body motion",),
)
ROLE = "target"
TABLE = "target"
NEEDS = ("two-body",)
FOLLOWS = True
Params = NoParams


def goal(params: NoParams, state: Any, step: int, before: Quaternion) -> Goal:
    """Return the frame at this position and velocity.

    Its rate is h/r^2 about the normal, and its acceleration -2 h (r.v)/r^4, exact for two-body motion. Of its two
    quaternions the one nearer to `before` is returned, so that a law that feeds back q sees no jump."""
    position, velocity = state.position, state.velocity
    h = cross(position, velocity)
    r2, h2 = dot(position, position), dot(h, h)
    size = sqrt(h2)
    down, against = scale(-1.0 / sqrt(r2), position), scale(-1.0 / size, h)
    attitude = nearer(to_quaternion((cross(against, down), against, down)), before)
    rate = size / r2
    return Goal(attitude, (0.0, -rate, 0.0), (0.0, 2.0 * rate * dot(position, velocity) / r2, 0.0))


def motion(params: NoParams, orbit: Orbit) -> Motion:
    """That of the frame."""
    return Motion(orbit.rate, orbit.acceleration, orbit.off_rate, orbit.off_acceleration)


def examples() -> list[NoParams]:
    """Return the only instance."""
    return [NoParams()]
