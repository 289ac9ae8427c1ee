"""A law that only damps the rate while its estimate is not valid."""

from typing import Annotated, NamedTuple

from starhold.algebra.quaternion import vector_part
from starhold.algebra.scalar import less, where
from starhold.algebra.vector import add, apply, dot, scale, subtract
from starhold.laws.interface import Card, Gain, tracking_torque

CARD = Card(
    title="Cautious",
    summary="u = -k_rate w - k_attitude q, the second term only with a valid estimate",
    sources=("a test",),
    assumptions=("rigid body",),
    claims="almost-global",
)
READS = ("is_valid",)


class Gains(NamedTuple):
    k_rate: Annotated[float, Gain("N m s", above=0.0, text="damping")]
    k_attitude: Annotated[float, Gain("N m", above=0.0, text="stiffness")]


def torque(measurement, gains, craft, memory):
    stiffness = where(less(0.5, measurement.is_valid), gains.k_attitude, 0.0)
    feedback = add(scale(gains.k_rate, measurement.rate), scale(stiffness, vector_part(measurement.attitude)))
    return subtract(tracking_torque(measurement, craft), feedback), memory


def lyapunov(measurement, gains, craft):
    energy = 0.5 * dot(measurement.rate, apply(craft.inertia, measurement.rate))
    return energy + 2.0 * gains.k_attitude * (1.0 - measurement.attitude[0])


def examples():
    return [Gains(0.2, 0.03)]
