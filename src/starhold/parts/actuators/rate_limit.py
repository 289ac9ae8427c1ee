"""A rate limit on the command, without lag."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from starhold.algebra.scalar import Scalar
from starhold.algebra.vector import Vector, clip_axes, scale, subtract
from starhold.parts.contract import Card, Late, Parameter

CARD = Card(
    title="Rate limit",
    summary="u moves to the command along a straight line, each component of u' within the limit",
    sources=("Spacecraft Dynamics and Control (1997)",),
    assumptions=("starts from the applied torque",),
)
ROLE = "actuator"
BODY = ""


class Params(NamedTuple):
    """The rate limit of the output."""

    rate_limit: Annotated[float, Parameter("N m/s", above=0.0, text="largest rate of each component")]


def rates(output: Vector, target: Vector, begun: Vector, substep: Scalar, params: Params) -> Vector:
    """Return d(output)/dt: the straight line from the output at the start of the substep to the command, or as far towards
    it as the limit allows."""
    return clip_axes(scale(1.0 / substep, subtract(target, begun)), params.rate_limit)


def late(params: Params, period: float) -> Late:
    """How late the output is: it comes to the command along a straight line within the control period, if it may."""
    return Late(0.0, 0.5, params.rate_limit * period)


def examples() -> list[Params]:
    """Return a slow one."""
    return [Params(0.02)]
