"""Damping alone."""

from typing import Annotated, NamedTuple

from starhold.algebra.vector import scale
from starhold.laws.interface import Card, Gain

CARD = Card(
    title="Rate damping",
    summary="u = -k w",
    sources=("textbook",),
    assumptions=("rigid body",),
    claims="none",
    quaternion_sign="even",
)


class Gains(NamedTuple):
    """Damping."""

    k: Annotated[float, Gain("N m s", above=0.0, text="damping")]


def torque(measurement, gains, craft, memory):
    return scale(-gains.k, measurement.rate), memory


def examples():
    return [Gains(0.1)]
