"""What a station-keeping law sees, and what it declares: `CARD`, `Gains`, `examples()` and the equation
`control(measurement, gains, plant, memory) -> (control, memory)`; `FORMS` with `design(plant, spec)` if it likes.

All in the scaled units of `models.libration`: the axes turn at rate 1, lengths count in a unit that the scenario chooses.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, ClassVar, NamedTuple

from starhold.algebra.quantity import Quantity
from starhold.algebra.scalar import Scalar, less, maximum, sqrt, where
from starhold.algebra.vector import Vector, dot, scale, subtract
from starhold.laws import catalogue as laws
from starhold.parts.bodies.libration_point import Libration, linear, nonlinear
from starhold.synthesis.circle import best_rate

MODELS = ("linear", "nonlinear")
"""Of the motion, in the order of the numbers that gains hold for them."""


class PointMeasurement(NamedTuple):
    """What a law is told at a control instant; scaled."""

    position: Annotated[Vector, Quantity("length", "from the libration point, turning axes")]
    velocity: Annotated[Vector, Quantity("length Omega", "relative to the turning axes")]
    period: Annotated[float, Quantity("1/Omega", "for which the control will be held")]
    limit: Annotated[float, Quantity("length Omega^2", "of the control's norm or of each axis; infinite for none")]


@dataclass(frozen=True)
class StationLaw(laws.Law):
    """A law file for a libration point as an object."""

    equation: ClassVar[str] = "control"

    @property
    def torque(self) -> Callable[..., Any]:
        """There is none; `control` is the equation."""
        raise AttributeError("a station-keeping law gives a control, no torque")

    @property
    def control(self) -> Callable[..., Any]:
        """The equation of the control acceleration."""
        return self.module.control

    def check(self, gains: Any, plant: Libration | None = None) -> None:
        """ValueError where gains, each within its bounds, make a loop about this point that cannot be stable."""
        teller = getattr(self.module, "check", None)
        if teller is not None:
            teller(gains, plant)


@cache
def station_laws() -> dict[str, StationLaw]:
    """All station-keeping laws that are installed, by name: modules of this package with a `CARD`, and those that the entry
    points `starhold.laws` of other packages name and that have a `control`."""
    return laws.installed("starhold.laws", StationLaw)


def least_rate(plant: Libration) -> float:
    """The rate (scaled) at which a circle asks least of the control, sqrt(C - 2 Omega^2). ValueError where there is none."""
    if plant.stiffness <= 2.0 * plant.rate**2:
        raise ValueError(f"no rate has a least demand where C = {plant.stiffness:g} is not above 2")
    return plant.rate * best_rate(plant)


def nonlinear_remainder(measurement: PointMeasurement, plant: Libration, model: Scalar) -> Vector:
    """What the full problem adds to the linear acceleration here, where `model` asks for it, else zero."""
    more = subtract(
        nonlinear(measurement.position, measurement.velocity, plant),
        linear(measurement.position, measurement.velocity, plant),
    )
    return (model * more[0], model * more[1], model * more[2])


def check_x(k_position: float, k_velocity: float, plant: Libration) -> None:
    """ValueError where the feedback of `hold_x` leaves the motion along X unstable, x'' = (Omega^2 + 2 C) x + control."""
    steep = plant.rate**2 + 2.0 * plant.stiffness
    if k_position <= steep or k_velocity <= 0.0:
        raise ValueError(f"k_x must be above {steep:.6g} and the velocity along X fed back, or X is unstable")


def hold_x(measurement: PointMeasurement, k_position: Scalar, k_velocity: Scalar, plant: Libration) -> Scalar:
    """Control along X that undoes the Coriolis acceleration and feeds back."""
    coriolis = 2.0 * plant.rate * measurement.velocity[1]
    return -coriolis - k_position * measurement.position[0] - k_velocity * measurement.velocity[0]


def along(direction: Vector, size: Scalar, layer: Scalar) -> Vector:
    """The vector of this size in a direction, shorter in proportion where the direction's length is within the layer; zero
    for no direction at all."""
    length = maximum(sqrt(dot(direction, direction)), layer)
    return scale(where(less(0.0, length), size / where(less(0.0, length), length, 1.0), 0.0), direction)
