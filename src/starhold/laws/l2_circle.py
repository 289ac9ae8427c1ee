"""Makes a circle around the line through the libration point attractive as a set of states, not as a motion in time."""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from starhold.algebra.scalar import Scalar, less, where
from starhold.algebra.vector import Vector, scale, subtract
from starhold.laws.interface import Card, Gain, NoMemory
from starhold.laws.point import MODELS, PointMeasurement, along, check_x, hold_x, least_rate, undo_remainder
from starhold.parts.bodies.libration_point import Libration
from starhold.synthesis.circle import demand

CARD = Card(
    title="Circle round a libration point",
    summary="V = (alpha f1^2 + f2^2 + f3^2)/2 decreases to zero on y^2 + z^2 = radius^2, run through at a constant rate; a "
    "relay without a layer holds a whole band of circles",
    sources=("published study of the direct Lyapunov method for compact invariant sets: a limit cycle round L2",),
    assumptions=("linear motion near the point", "control not limited"),
    claims="local",
)

LAYER = Gain(at_least=0.0, dimension="velocity", text="velocity error within which the relay is proportional")


class Gains(NamedTuple):
    """The circle, the feedback towards it, and the feedback along X; all scaled."""

    radius: Annotated[float, Gain(above=0.0, dimension="length", text="of the circle, lengths")]
    rate: Annotated[float, Gain(dimension="rate", text="at which it is followed, from Y to Z; negative the other way")]
    alpha: Annotated[float, Gain(above=0.0, text="weight of the distance from the circle")]
    k: Annotated[float, Gain(above=0.0, text="feedback on the velocity error; size of a relay's thrust")]
    k_x: Annotated[float, Gain(above=0.0, text="on the position along X")]
    k_velocity: Annotated[float, Gain(above=0.0, text="on the velocity along X")]
    feedback: Annotated[int, Gain(choices=("smooth", "relay"), text="relay: k in the direction against the error")] = 0
    boundary_layer: Annotated[float, LAYER] = 0.0
    model: Annotated[int, Gain(choices=MODELS, text="nonlinear: also cancels the nonlinear remainder")] = 0


class Best(NamedTuple):
    """The form takes the rate that needs the least control, and along X the double root of the natural rate."""

    radius: Annotated[float, Gain(above=0.0, dimension="length", text="of the circle, lengths")]
    alpha: Annotated[float, Gain(above=0.0, text="weight of the distance from the circle")] = 1.0
    k: Annotated[float, Gain(above=0.0, text="feedback on the velocity error; size of a relay's thrust")] = 1.0
    feedback: Annotated[int, Gain(choices=("smooth", "relay"), text="relay: k in the direction against the error")] = 0
    boundary_layer: Annotated[float, LAYER] = 0.0
    model: Annotated[int, Gain(choices=MODELS, text="nonlinear: also cancels the nonlinear remainder")] = 0


FORMS: dict[str, Any] = {"best": Best}


def design(plant: Libration, spec: Best) -> Gains:
    """Return gains with rate = sqrt(C - 2 Omega^2), at which the peak demand is 2 Omega sqrt(C - Omega^2) radius. Raise
    Raise ValueError if C is not above 2 Omega^2."""
    rate, growth = least_rate(plant), plant.rate**2 + 2.0 * plant.stiffness
    x = (2.0 * growth, 2.0 * math.sqrt(growth))
    return Gains(spec.radius, rate, spec.alpha, spec.k, *x, spec.feedback, spec.boundary_layer, spec.model)


def check(gains: Gains, plant: Libration) -> None:
    """Raise ValueError if motion along X is unstable."""
    check_x(gains.k_x, gains.k_velocity, plant)


def explain(plant: Libration, spec: Best) -> list[tuple[str, Any]]:
    """Return the rate of the circle and figures of the control that it demands."""
    rate = design(plant, spec).rate
    peak = peak_demand(plant, rate) * spec.radius
    return [("rate", rate), ("period (of the turning axes)", plant.rate / abs(rate)), ("peak demand (scaled)", peak)]


def peak_demand(plant: Libration, rate: float) -> float:
    """Return the largest norm of the control on a circle of radius one: sqrt(4 Omega^2 rate^2 + (C - rate^2)^2), or C -
    Omega^2 - rate^2 in the Y direction where that is more."""
    return max(demand(rate / plant.rate, plant), abs(plant.stiffness - plant.rate**2 - rate**2))


def errors(measurement: PointMeasurement, gains: Gains) -> Vector:
    """Return f1 = y^2 + z^2 - radius^2, f2 = y' + rate z, f3 = z' - rate y, which vanish on the circle."""
    y, z = measurement.position[1], measurement.position[2]
    return (
        y * y + z * z - gains.radius * gains.radius,
        measurement.velocity[1] + gains.rate * z,
        measurement.velocity[2] - gains.rate * y,
    )


def neutral(measurement: PointMeasurement, gains: Gains, plant: Libration) -> Vector:
    """Return the control that keeps V constant (scaled)."""
    y, z, v = measurement.position[1], measurement.position[2], measurement.velocity
    pull, square = 2.0 * gains.alpha * errors(measurement, gains)[0], plant.rate * plant.rate
    return (
        hold_x(measurement, gains.k_x, gains.k_velocity, plant),
        2.0 * plant.rate * v[0] + (plant.stiffness - square) * y - gains.rate * v[2] - pull * y,
        plant.stiffness * z + gains.rate * v[1] - pull * z,
    )


def feedback(measurement: PointMeasurement, gains: Gains, plant: Libration) -> Vector:
    """Return the control acceleration for the linear model (scaled): the part that keeps V constant, and the part that
    decreases it."""
    off = errors(measurement, gains)
    wrong = (0.0, off[1], off[2])
    smooth, relayed = scale(gains.k, wrong), along(wrong, gains.k, gains.boundary_layer)
    relay = less(0.5, gains.feedback)
    damping = (0.0, where(relay, relayed[1], smooth[1]), where(relay, relayed[2], smooth[2]))
    return subtract(neutral(measurement, gains, plant), damping)


def control(measurement: PointMeasurement, gains: Gains, plant: Libration, memory: NoMemory) -> tuple[Vector, NoMemory]:
    """Return the control acceleration (scaled)."""
    return undo_remainder(feedback(measurement, gains, plant), measurement, plant, gains.model), memory


def lyapunov(measurement: PointMeasurement, gains: Gains, plant: Libration) -> Scalar:
    """Return V = (alpha f1^2 + f2^2 + f3^2)/2, zero on the circle; V' = -k (f2^2 + f3^2), or -k |(f2, f3)| with a relay."""
    off = errors(measurement, gains)
    return 0.5 * (gains.alpha * off[0] * off[0] + off[1] * off[1] + off[2] * off[2])


def examples() -> list[Gains]:
    """Return circles round L2 of the Sun and the Earth, smooth and by relay."""
    smooth = Gains(1.0, 1.393, 1.0, 1.0, 17.8, 6.0)
    return [smooth, smooth._replace(feedback=1, k=0.5, boundary_layer=1e-3, model=1)]
