"""PD feedback with the gyroscopic torque and the modelled external torque cancelled."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from starhold.algebra.quaternion import vector_part
from starhold.algebra.scalar import Scalar
from starhold.algebra.vector import Vector, add, apply, dot, gyroscopic_torque, scale, subtract
from starhold.laws.interface import Card, Gain, Measurement, NoMemory
from starhold.parts.craft import Craft
from starhold.synthesis import response

CARD = Card(
    title="Lyapunov",
    summary="u = -k_rate w - k_attitude q + w x Jw - M_ext: V is non-increasing whatever the modelled torque",
    sources=("published comparison of Lyapunov, sliding-mode and predictive attitude control, eq. (9)",),
    assumptions=("rigid body", "inertia known", "external torque known", "torque not limited"),
    claims="almost-global",
)


class Gains(NamedTuple):
    """The gains are damping and stiffness."""

    k_rate: Annotated[float, Gain("N m s", above=0.0, text="damping")]
    k_attitude: Annotated[float, Gain("N m", above=0.0, text="stiffness against the quaternion's vector part")]


def torque(measurement: Measurement, gains: Gains, craft: Craft, memory: NoMemory) -> tuple[Vector, NoMemory]:
    """Return the control torque (N m, body)."""
    feedback = add(scale(-gains.k_rate, measurement.rate), scale(-gains.k_attitude, vector_part(measurement.attitude)))
    gyroscopic = gyroscopic_torque(craft.inertia, measurement.body_rate)
    model = add(subtract(gyroscopic, measurement.external_torque), apply(craft.inertia, measurement.target_acceleration))
    return add(feedback, model), memory


FORMS = response.FORMS
complete = response.complete
design, explain, design_all = response.designs(Gains, torque)


def lyapunov(measurement: Measurement, gains: Gains, craft: Craft) -> Scalar:
    """Return V = w.Jw/2 + 2 k_attitude (1 - q0) (J); V' = -k_rate |w|^2."""
    energy = 0.5 * dot(measurement.rate, apply(craft.inertia, measurement.rate))
    return energy + 2.0 * gains.k_attitude * (1.0 - measurement.attitude[0])


def examples() -> list[Gains]:
    """Return the published gains, and stiffer ones."""
    return [Gains(0.09, 0.009), Gains(0.5, 0.05)]
