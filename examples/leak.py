"""The torque of a tank that empties through a leak."""

import math
from typing import Annotated, NamedTuple

from starhold.algebra.vector import Vector, norm, scale
from starhold.parts.contract import Card, Parameter, Push

CARD = Card(
    title="Leak",
    summary="M' = -M / time",
    sources=("a leak proportional to the mass that is left",),
    assumptions=("unknown to all laws",),
)
ROLE = "environment"


class Params(NamedTuple):
    torque: Annotated[Vector, Parameter("N m", shape=(3,), spread=False, text="at the start, body axes")]
    time: Annotated[float, Parameter("s", above=0.0, text="after which 1/e of it is left")]


class Numbers(NamedTuple):
    torque: Vector
    kept: float


def prepare(params, period):
    return Numbers(params.torque, math.exp(-period / params.time))


def remember(params):
    return params.torque


def update(memory, state, params, dice, step):
    return scale(params.kept, memory)


def torque(state, params, craft, memory):
    return memory


def bound(params, envelope):
    """The largest norm that it has, which certificates take it in by."""
    return Push(norm(params.torque))


def examples():
    return [Params((1e-3, -5e-4, 0.0), 60.0)]
