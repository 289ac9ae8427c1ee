"""PD feedback by magnetorquers: only the component perpendicular to the magnetic field acts."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from starhold.algebra.quaternion import vector_part
from starhold.algebra.scalar import divide, less, where
from starhold.algebra.vector import Vector, add, cross, dot, scale
from starhold.laws.interface import Card, Gain, Measurement, NoMemory
from starhold.parts.craft import Craft

CARD = Card(
    title="Cross-product law",
    summary="u = m x B with m = -B x (k_rate w + k_attitude q) / |B|^2",
    sources=("Spacecraft Dynamics and Control (1997)",),
    assumptions=("the field rotates along the orbit", "small gains: averaged over an orbit all axes are held"),
    claims="none",
)
READS = ("magnetic_field",)
FROM_OUTSIDE = True


class Gains(NamedTuple):
    """The gains are damping and stiffness."""

    k_rate: Annotated[float, Gain("N m s", above=0.0, text="damping")]
    k_attitude: Annotated[float, Gain("N m", above=0.0, text="stiffness against the quaternion's vector part")]


def torque(measurement: Measurement, gains: Gains, craft: Craft, memory: NoMemory) -> tuple[Vector, NoMemory]:
    """Return the torque of the dipole (N m, body axes)."""
    field = measurement.magnetic_field
    square = dot(field, field)
    feedback = add(scale(gains.k_rate, measurement.rate), scale(gains.k_attitude, vector_part(measurement.attitude)))
    dipole = scale(where(less(0.0, square), divide(-1.0, square), 0.0), cross(field, feedback))
    return cross(dipole, field), memory


def examples() -> list[Gains]:
    """Return gains for a CubeSat in a low orbit, and for a body of a few kg m2."""
    return [Gains(2e-4, 2e-7), Gains(0.02, 2e-5)]
