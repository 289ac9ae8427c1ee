"""Among all controls within the limit, chooses the one under which a given V decreases fastest. V compares the velocity with
one that leads to the circle, y' = -rate z - pull f1 y and z' = rate y - pull f1 z with f1 = y^2 + z^2 - radius^2. With pull
= 0 it would be the V of `l2-circle`, and full control would hold any circle near the intended one, because there that V is
constant for every control."""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from starhold.algebra.scalar import Scalar
from starhold.algebra.vector import Vector
from starhold.laws.interface import Card, Gain, NoMemory
from starhold.laws.point import PointMeasurement, along, least_rate
from starhold.parts.bodies.libration_point import Libration

CARD = Card(
    title="Steepest descent to a circle",
    summary="u = -limit g/|g|, g = dV/dv: V of the circle and of X decreases as fast as the limit allows",
    sources=("published study of the direct Lyapunov method for compact invariant sets: the law that is best for a V",),
    assumptions=("linear motion near the point", "control limited in norm"),
    claims="none",
)


class Gains(NamedTuple):
    """The circle and the weights of V; all scaled."""

    radius: Annotated[float, Gain(above=0.0, dimension="length", text="of the circle, lengths")]
    rate: Annotated[float, Gain(dimension="rate", text="at which it is followed, from Y to Z; negative the other way")]
    alpha: Annotated[float, Gain(above=0.0, text="weight of the distance from the circle")]
    beta: Annotated[float, Gain(above=0.0, text="weight of x' + slope x")]
    surface_gain: Annotated[float, Gain(above=0.0, text="rate at which x then decreases")]
    pull: Annotated[float, Gain(above=0.0, text="of the demanded velocity towards the circle")]
    boundary_layer: Annotated[float, Gain(at_least=0.0, text="|g| within which the control is proportional to it")] = 0.0


class Best(NamedTuple):
    """The form takes the rate that needs the least control on the circle, and the natural rate along X."""

    radius: Annotated[float, Gain(above=0.0, dimension="length", text="of the circle, lengths")]
    alpha: Annotated[float, Gain(above=0.0, text="weight of the distance from the circle")] = 1.0
    beta: Annotated[float, Gain(above=0.0, text="weight of x' + slope x")] = 1.0
    pull: Annotated[float, Gain(above=0.0, text="of the demanded velocity towards the circle")] = 1.0
    boundary_layer: Annotated[float, Gain(at_least=0.0, text="|g| within which the control is proportional to it")] = 0.05


FORMS: dict[str, Any] = {"best": Best}


def design(plant: Libration, spec: Best) -> Gains:
    """Return gains with rate = sqrt(C - 2 Omega^2), slope = sqrt(Omega^2 + 2 C). Raise ValueError if C < 2 Omega^2."""
    rates = least_rate(plant), math.sqrt(plant.rate**2 + 2.0 * plant.stiffness)
    return Gains(spec.radius, rates[0], spec.alpha, spec.beta, rates[1], spec.pull, spec.boundary_layer)


def _off(measurement: PointMeasurement, gains: Gains) -> Scalar:
    """Return f1."""
    p = measurement.position
    return p[1] * p[1] + p[2] * p[2] - gains.radius * gains.radius


def _slopes(measurement: PointMeasurement, gains: Gains) -> Vector:
    """Return dV/dv."""
    p, v = measurement.position, measurement.velocity
    pull = gains.pull * _off(measurement, gains)
    return (
        gains.beta * (v[0] + gains.surface_gain * p[0]),
        v[1] + gains.rate * p[2] + pull * p[1],
        v[2] - gains.rate * p[1] + pull * p[2],
    )


def control(measurement: PointMeasurement, gains: Gains, plant: Libration, memory: NoMemory) -> tuple[Vector, NoMemory]:
    """Return the control acceleration (scaled): V' is linear in it, so its minimum lies on the limit, against dV/dv."""
    return along(_slopes(measurement, gains), -measurement.limit, gains.boundary_layer), memory


def lyapunov(measurement: PointMeasurement, gains: Gains, plant: Libration) -> Scalar:
    """Return V = (alpha f1^2 + f2^2 + f3^2 + beta (x' + slope x)^2)/2 with f2 and f3 the velocity errors along Y and Z."""
    g, f1 = _slopes(measurement, gains), _off(measurement, gains)
    return 0.5 * (gains.alpha * f1 * f1 + g[1] * g[1] + g[2] * g[2] + g[0] * g[0] / gains.beta)


def examples() -> list[Gains]:
    """Return a circle round L2 of the Sun and the Earth."""
    return [Gains(1.0, 1.393, 1.0, 1.0, 2.98, 1.0, 0.05)]
