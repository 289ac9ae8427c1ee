"""Equations that laws near a libration point share.

They use the scaled units of `parts.bodies.libration_point`: the axes turn at rate 1, and the scenario chooses the unit of
length.
"""

from __future__ import annotations

from starhold.algebra.scalar import Scalar, less, maximum, sqrt, where
from starhold.algebra.vector import Vector, dot, scale, subtract
from starhold.parts.bodies.libration_point import Libration, PointMeasurement, linear, nonlinear
from starhold.synthesis.circle import best_rate

MODELS = ("linear", "nonlinear")
"""Models of the motion; gains contain the index of one."""


def least_rate(plant: Libration) -> float:
    """Return the rate (scaled) of a circle's least demand, sqrt(C - 2 Omega^2). Raise ValueError if there is none."""
    if plant.stiffness <= 2.0 * plant.rate**2:
        raise ValueError(f"no rate has a least demand where C = {plant.stiffness:g} is not above 2")
    return plant.rate * best_rate(plant)


def undo_remainder(control: Vector, measurement: PointMeasurement, plant: Libration, model: int) -> Vector:
    """Return the control minus the nonlinear remainder of the acceleration at this point if `model` is nonlinear."""
    if MODELS[model] == "linear":
        return control
    position, velocity = measurement.position, measurement.velocity
    return subtract(control, subtract(nonlinear(position, velocity, plant), linear(position, velocity, plant)))


def check_x(k_position: float, k_velocity: float, plant: Libration) -> None:
    """Raise ValueError if the feedback of `hold_x` leaves motion along X unstable: x'' = (Omega^2 + 2 C) x + control."""
    least = plant.rate**2 + 2.0 * plant.stiffness
    if k_position <= least or k_velocity <= 0.0:
        raise ValueError(f"k_x must be above {least:.6g} and the velocity along X fed back, or X is unstable")


def hold_x(measurement: PointMeasurement, k_position: Scalar, k_velocity: Scalar, plant: Libration) -> Scalar:
    """Return the control along X, which cancels the Coriolis acceleration and feeds back position and velocity."""
    coriolis = 2.0 * plant.rate * measurement.velocity[1]
    return -coriolis - k_position * measurement.position[0] - k_velocity * measurement.velocity[0]


def along(direction: Vector, size: Scalar, layer: Scalar) -> Vector:
    """Return a vector of length `size` in a direction, scaled by |direction| / layer inside the layer; zero for a zero
    direction."""
    length = maximum(sqrt(dot(direction, direction)), layer)
    return scale(where(less(0.0, length), size / where(less(0.0, length), length, 1.0), 0.0), direction)
