"""Holds an equilibrium beside the libration point, where the smaller body does not hide the Sun from the panels."""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from starhold.algebra.vector import Vector
from starhold.laws.interface import Card, Gain, NoMemory
from starhold.laws.point import MODELS, PointMeasurement, check_x, hold_x, undo_remainder
from starhold.parts.bodies.libration_point import Libration

CARD = Card(
    title="Rest beside a libration point",
    summary="u = constant feed-forward + feedback axis by axis, the Coriolis acceleration cancelled",
    sources=("published study of the direct Lyapunov method for compact invariant sets: holding a point near L2",),
    assumptions=("linear motion near the point", "control not limited"),
    claims="local",
)


class Gains(NamedTuple):
    """The equilibrium, and the feedback of each axis; all scaled."""

    y: Annotated[float, Gain(dimension="length", text="equilibrium along Y, lengths")]
    z: Annotated[float, Gain(dimension="length", text="equilibrium along Z, lengths")]
    k_x: Annotated[float, Gain(above=0.0, text="on the position along X")]
    k_velocity: Annotated[Vector, Gain(shape=(3,), text="on the velocity, by axis")]
    model: Annotated[int, Gain(choices=MODELS, text="nonlinear: also cancels the nonlinear remainder")] = 0


class Degree(NamedTuple):
    """The form gives the feedback of the largest decay rate (degree of stability) that does not change the natural
    stiffness along Y and Z."""

    y: Annotated[float, Gain(dimension="length", text="equilibrium along Y, lengths")] = 0.0
    z: Annotated[float, Gain(dimension="length", text="equilibrium along Z, lengths")] = 0.0
    model: Annotated[int, Gain(choices=MODELS, text="nonlinear: also cancels the nonlinear remainder")] = 0


FORMS: dict[str, Any] = {"degree": Degree}


def design(plant: Libration, spec: Degree) -> Gains:
    """Return gains with the double root -s along X, where x'' = s^2 x + u, and critical damping at the natural frequency
    along Y and Z."""
    square = plant.rate**2
    x, y, z = square + 2.0 * plant.stiffness, plant.stiffness - square, plant.stiffness
    velocity = (2.0 * math.sqrt(x), 2.0 * math.sqrt(y), 2.0 * math.sqrt(z))
    return Gains(spec.y, spec.z, 2.0 * x, velocity, spec.model)


def check(gains: Gains, plant: Libration) -> None:
    """Raise ValueError if motion along X is unstable, or the velocity along Y or Z is not fed back."""
    check_x(gains.k_x, gains.k_velocity[0], plant)
    if min(gains.k_velocity) <= 0.0:
        raise ValueError("k_velocity must be above 0 on every axis, or motion along it does not die out")


def feedback(measurement: PointMeasurement, gains: Gains, plant: Libration) -> Vector:
    """Return the control acceleration for the linear model (scaled)."""
    square = plant.rate * plant.rate
    k = gains.k_velocity
    return (
        hold_x(measurement, gains.k_x, k[0], plant),
        (plant.stiffness - square) * gains.y + 2.0 * plant.rate * measurement.velocity[0] - k[1] * measurement.velocity[1],
        plant.stiffness * gains.z - k[2] * measurement.velocity[2],
    )


def control(measurement: PointMeasurement, gains: Gains, plant: Libration, memory: NoMemory) -> tuple[Vector, NoMemory]:
    """Return the control acceleration (scaled)."""
    return undo_remainder(feedback(measurement, gains, plant), measurement, plant, gains.model), memory


def rest(gains: Gains) -> Vector:
    """Return the equilibrium (scaled)."""
    return (0.0, gains.y, gains.z)


def examples() -> list[Gains]:
    """Return gains for the Sun and the Earth, one Earth diameter off the line."""
    return [Gains(1.0, 0.0, 17.8, (6.0, 3.4, 4.0)), Gains(0.0, 1.0, 17.8, (6.0, 3.4, 4.0), 1)]
