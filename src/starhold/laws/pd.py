"""Proportional-derivative feedback on the quaternion."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from starhold.algebra.quaternion import vector_part
from starhold.algebra.scalar import Scalar, less
from starhold.algebra.structure import chosen
from starhold.algebra.vector import Vector, add, apply, clip_axes, dot, scale, subtract
from starhold.laws.interface import Card, Gain, Measurement, NoMemory, tracking_torque
from starhold.parts.craft import Craft
from starhold.synthesis import response

CARD = Card(
    title="Quaternion PD",
    summary="u = -k_rate w - k_attitude q: the classical law, without a model at rest; may clip its damping",
    sources=(
        "Quaternion feedback regulator for spacecraft eigenaxis rotations (1989)",
        "published study of inertial stabilisation by closed-form linear-quadratic laws: the classical PD",
    ),
    assumptions=("rigid body", "no external torque", "torque not limited"),
    claims="almost-global",
)


class Gains(NamedTuple):
    """The gains are damping and stiffness."""

    k_rate: Annotated[float, Gain("N m s", above=0.0, text="damping")]
    k_attitude: Annotated[float, Gain("N m", above=0.0, text="stiffness against the quaternion's vector part")]
    limit: Annotated[int, Gain(choices=("none", "axis"), text="axis: damping clipped to the torque left by k_attitude")] = 0


def remember(gains: Gains, craft: Craft, period: float) -> NoMemory:
    """Return the empty memory. Raise ValueError if stiffness leaves no torque for the damping."""
    if gains.limit and not gains.k_attitude < craft.torque_limit < math.inf:
        shown = f"the torque limit of {craft.torque_limit:g} N m"
        raise ValueError(f'limit = "axis" needs k_attitude below {shown}, not {gains.k_attitude:g} N m')
    return NoMemory()


def torque(measurement: Measurement, gains: Gains, craft: Craft, memory: NoMemory) -> tuple[Vector, NoMemory]:
    """Return the control torque (N m, body)."""
    damping = scale(gains.k_rate, measurement.rate)
    within = clip_axes(damping, craft.torque_limit - gains.k_attitude)
    damping = chosen(less(0.5, gains.limit), within, damping)
    feedback = add(damping, scale(gains.k_attitude, vector_part(measurement.attitude)))
    return subtract(tracking_torque(measurement, craft), feedback), memory


FORMS = response.FORMS
complete = response.complete
design, explain, design_all = response.designs(Gains, torque)


def lyapunov(measurement: Measurement, gains: Gains, craft: Craft) -> Scalar:
    """Return V = w.Jw/2 + 2 k_attitude (1 - q0) (J); V' = -w.damping."""
    energy = 0.5 * dot(measurement.rate, apply(craft.inertia, measurement.rate))
    return energy + 2.0 * gains.k_attitude * (1.0 - measurement.attitude[0])


def examples() -> list[Gains]:
    """Return gains for a body of a few kg m2."""
    return [Gains(0.09, 0.009), Gains(0.5, 0.05), Gains(0.09, 0.009, 1)]
