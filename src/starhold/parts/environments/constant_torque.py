"""A constant torque in body or inertial axes, as of a leak, a residual dipole in a steady field, or a thruster stuck
open."""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from starhold.algebra.quaternion import to_body
from starhold.algebra.vector import Vector
from starhold.parts.contract import Card, Envelope, Parameter, Push
from starhold.parts.craft import Craft

CARD = Card(title="Constant torque", summary="M = constant", sources=("definition",), assumptions=("unknown to all laws",))
ROLE = "environment"


class Params(NamedTuple):
    """The torque and its axes."""

    torque: Annotated[Vector, Parameter("N m", shape=(3,), spread=False, plain=(100.0, "mN m"), text="on the body")]
    axes: Annotated[int, Parameter(choices=("body", "inertial"), text="in which it is constant")] = 0


def torque(state: Any, params: Params, craft: Craft, memory: Any) -> Vector:
    """Return the torque on the body (N m, body axes)."""
    return to_body(state.attitude, params.torque) if params.axes else params.torque


def bound(params: Params, envelope: Envelope) -> Push:
    """Return the norm of the torque."""
    return Push(math.hypot(*params.torque))


def examples() -> list[Params]:
    """Return a torque of the size of air drag on a small satellite, in body and in inertial axes."""
    return [Params((1e-5, -2e-5, 5e-6)), Params((1e-5, -2e-5, 5e-6), 1)]
