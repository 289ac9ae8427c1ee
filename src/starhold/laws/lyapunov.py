"""PD feedback with the gyroscopic and the modelled external torque cancelled."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from starhold.algebra.quaternion import vector_part
from starhold.algebra.scalar import Scalar
from starhold.algebra.vector import Vector, add, apply, dot, scale, subtract, swing
from starhold.laws import response
from starhold.laws.interface import Card, Gain, NoMemory, Seen
from starhold.models.craft import Craft

CARD = Card(
    title="Lyapunov",
    summary="u = -k_rate w - k_attitude q + w x Jw - M_ext: V falls whatever the modelled torque",
    sources=("published comparison of Lyapunov, sliding-mode and predictive attitude control, eq. (9)",),
    assumptions=("rigid body", "inertia known", "external torque known", "torque not limited"),
    claims="almost-global",
)


class Gains(NamedTuple):
    """Damping and stiffness."""

    k_rate: Annotated[float, Gain("N m s", above=0.0, text="damping")]
    k_attitude: Annotated[float, Gain("N m", above=0.0, text="stiffness against the quaternion's vector part")]


def torque(seen: Seen, gains: Gains, craft: Craft, memory: NoMemory) -> tuple[Vector, NoMemory]:
    """Control torque (N m, body)."""
    feedback = add(scale(-gains.k_rate, seen.rate), scale(-gains.k_attitude, vector_part(seen.attitude)))
    gyroscopic = swing(craft.inertia, seen.body_rate)
    model = add(subtract(gyroscopic, seen.external_torque), apply(craft.inertia, seen.target_acceleration))
    return add(feedback, model), memory


FORMS = response.FORMS
complete = response.complete
design, explain = response.designs(Gains, torque)


def lyapunov(seen: Seen, gains: Gains, craft: Craft) -> Scalar:
    """V = w.Jw/2 + 2 k_attitude (1 - q0) (J); V' = -k_rate |w|2."""
    energy = 0.5 * dot(seen.rate, apply(craft.inertia, seen.rate))
    return energy + 2.0 * gains.k_attitude * (1.0 - seen.attitude[0])


def examples() -> list[Gains]:
    """The published gains, and stiffer ones."""
    return [Gains(0.09, 0.009), Gains(0.5, 0.05)]
