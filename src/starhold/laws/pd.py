"""Proportional-derivative feedback on the quaternion."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from starhold.algebra.quaternion import vector_part
from starhold.algebra.scalar import Scalar, equation
from starhold.algebra.vector import Vector, add, apply, dot, scale
from starhold.laws.interface import Card, Gain, NoMemory, Seen, tracking_torque
from starhold.models.craft import Craft

CARD = Card(
    title="Quaternion PD",
    summary="u = -k_rate w - k_attitude q: the classical law, needs no model of the spacecraft at rest",
    sources=(
        "Quaternion feedback regulator for spacecraft eigenaxis rotations (1989)",
        "published study of inertial stabilisation by closed-form linear-quadratic laws: the classical PD",
    ),
    assumptions=("rigid body", "no external torque", "torque not limited"),
    claims="almost-global",
)


class Gains(NamedTuple):
    """Damping and stiffness."""

    k_rate: Annotated[float, Gain("N m s", above=0.0, text="damping")]
    k_attitude: Annotated[float, Gain("N m", above=0.0, text="stiffness against the quaternion's vector part")]


@equation
def torque(seen: Seen, gains: Gains, craft: Craft, memory: NoMemory) -> tuple[Vector, NoMemory]:
    """Control torque (N m, body)."""
    feedback = add(scale(-gains.k_rate, seen.rate), scale(-gains.k_attitude, vector_part(seen.attitude)))
    return add(feedback, tracking_torque(seen, craft)), memory


@equation
def lyapunov(seen: Seen, gains: Gains, craft: Craft) -> Scalar:
    """V = w.Jw/2 + 2 k_attitude (1 - q0) (J); V' = -k_rate |w|2."""
    energy = 0.5 * dot(seen.rate, apply(craft.inertia, seen.rate))
    return energy + 2.0 * gains.k_attitude * (1.0 - seen.attitude[0])


def examples() -> list[Gains]:
    """Gains for a body of a few kg m2."""
    return [Gains(0.09, 0.009), Gains(0.5, 0.05)]
