"""A dipole that opposes the change of the measured magnetic field slows a tumbling body."""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

import numpy as np

from starhold.algebra.scalar import Scalar, divide, less, where
from starhold.algebra.vector import ZERO, Vector, cross, dot, scale, subtract
from starhold.laws.interface import Card, Gain, Measurement
from starhold.parts.craft import Craft, tensor

CARD = Card(
    title="B-dot",
    summary="u = m x B with m = -k B'/|B|^2, B' from one measurement to the next; about -k w across the field",
    sources=(
        "Magnetic detumbling of a rigid spacecraft (2012): the design",
        "Fundamentals of Spacecraft Attitude Determination and Control (2014)",
    ),
    assumptions=("the field changes because the body turns", "less than half a turn in a control period"),
    claims="none",
    quaternion_sign="even",
)
READS = ("magnetic_field",)
FROM_OUTSIDE = True


class Gains(NamedTuple):
    """The gain is the damping."""

    k: Annotated[float, Gain("N m s", above=0.0, text="damping across the field")]


class Orbit(NamedTuple):
    """The form takes the gain from the orbit: the field must rotate along the orbit before all axes are slowed."""

    orbit_period: Annotated[float, Gain("s", above=0.0, text="of the orbit")]
    inclination: Annotated[float, Gain("rad", at_least=0.0, at_most=math.pi, text="of the orbit to the magnetic equator")]


FORMS: dict[str, Any] = {"orbit": Orbit}


class Memory(NamedTuple):
    """The field at the previous call (T, body axes), and whether there was one."""

    field: Vector
    known: Scalar


def design(craft: Craft, spec: Orbit) -> Gains:
    """Return k = 2 n (1 + sin i) J_min with n the orbital rate: fast, but slow enough to leave no rate along the field."""
    least = float(np.linalg.eigvalsh(tensor(craft.inertia))[0])
    return Gains(2.0 * math.tau / spec.orbit_period * (1.0 + math.sin(spec.inclination)) * least)


def remember(gains: Gains, craft: Craft, period: float) -> Memory:
    """Return the initial memory, without a field."""
    return Memory(ZERO, 0.0)


def torque(measurement: Measurement, gains: Gains, craft: Craft, memory: Memory) -> tuple[Vector, Memory]:
    """Return the torque of the dipole (N m, body axes)."""
    field = measurement.magnetic_field
    square = dot(field, field)
    # The rate of change of the field needs two measurements.
    share = where(less(0.0, square), divide(-gains.k / measurement.period, square), 0.0)
    dipole = scale(memory.known * share, subtract(field, memory.field))
    return cross(dipole, field), Memory(field, where(less(0.0, square), 1.0, 0.0))


def examples() -> list[Gains]:
    """Return gains for a CubeSat and for a body of a few kg m2."""
    return [Gains(1e-4), Gains(0.01)]
