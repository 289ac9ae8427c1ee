"""Feedback on the modified Rodrigues parameters of the rotation below 180 degrees."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from starhold.algebra.rotation import modified_rodrigues
from starhold.algebra.vector import Vector, add, scale, subtract
from starhold.laws.interface import Card, Gain, Measurement, NoMemory, tracking_torque
from starhold.parts.craft import Craft
from starhold.synthesis import response

CARD = Card(
    title="MRP feedback",
    summary="u = -k_rate w - k_attitude s, s = q/(1 + |q0|) towards the nearer of q and -q: its torque never winds up",
    sources=("Analytical Mechanics of Space Systems (2018): nonlinear feedback on modified Rodrigues parameters",),
    assumptions=("rigid body", "no external torque", "torque not limited"),
    claims="none",
    quaternion_sign="even",
)


class Gains(NamedTuple):
    """Damping and stiffness; for small angles the parameters are a quarter of the angle."""

    k_rate: Annotated[float, Gain("N m s", above=0.0, text="damping")]
    k_attitude: Annotated[float, Gain("N m", above=0.0, text="stiffness against the modified Rodrigues parameters")]


def torque(measurement: Measurement, gains: Gains, craft: Craft, memory: NoMemory) -> tuple[Vector, NoMemory]:
    """Return the control torque (N m, body)."""
    stiffness = modified_rodrigues(measurement.attitude, gains.k_attitude)
    feedback = add(scale(gains.k_rate, measurement.rate), stiffness)
    return subtract(tracking_torque(measurement, craft), feedback), memory


FORMS = response.FORMS
complete = response.complete
design, explain, design_all = response.designs(Gains, torque, share=0.5)


def examples() -> list[Gains]:
    """Return gains for a body of a few kg m2."""
    return [Gains(0.09, 0.036), Gains(0.5, 0.2)]
