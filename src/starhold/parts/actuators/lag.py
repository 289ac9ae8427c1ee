"""A first-order lag with a rate limit."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from starhold.algebra.scalar import Scalar
from starhold.algebra.vector import Vector, clip_axes, scale, subtract
from starhold.parts.contract import Card, Late, Parameter

CARD = Card(
    title="First-order lag",
    summary="lag u' + u = command, each component of u' within the rate limit",
    sources=("Spacecraft Dynamics and Control (1997)",),
    assumptions=("starts from the applied torque",),
)
ROLE = "actuator"
BODY = ""


class Params(NamedTuple):
    """The time constant of the lag."""

    lag: Annotated[float, Parameter("s", above=0.0, text="time constant")]
    rate_limit: Annotated[float, Parameter("N m/s", above=0.0, text="largest rate of each component; none if absent")] = (
        math.inf
    )


def rates(output: Vector, target: Vector, begun: Vector, substep: Scalar, params: Params) -> Vector:
    """Return d(output)/dt towards the command."""
    return clip_axes(scale(1.0 / params.lag, subtract(target, output)), params.rate_limit)


def fastest(params: Params) -> float:
    """Return the fastest rate (1/s) at which it settles, which the integration must resolve."""
    return 1.0 / params.lag


def late(params: Params, period: float) -> Late:
    """How late the output is: its distance from the command falls exponentially, while it is within the rate limit."""
    kept, share = math.exp(-period / params.lag), params.lag / period
    mean = share * -math.expm1(-period / params.lag)
    return Late(kept, mean, params.lag * params.rate_limit, share * (1.0 - mean))


def examples() -> list[Params]:
    """Return a fast lag, and one with a rate limit."""
    return [Params(0.3), Params(0.3, 0.02)]
