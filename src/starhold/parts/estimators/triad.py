"""Attitude from the measured directions of the Sun and the magnetic field and those computed for position and time; the
gyro propagates it while one of them is missing."""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from starhold.algebra.cosines import to_quaternion
from starhold.algebra.quaternion import Quaternion
from starhold.algebra.scalar import Scalar, Truth, both, less, maximum, sqrt
from starhold.algebra.structure import chosen
from starhold.algebra.vector import IDENTITY, Matrix, Vector, cross, dot, scale, transpose
from starhold.algebra.vector import multiply as product
from starhold.parts import magnetic_field, sun
from starhold.parts.contract import Card
from starhold.parts.craft import Craft
from starhold.parts.directions import APART, Estimate, Memory, attitude_at_start, measured_or_carried
from starhold.parts.ephemeris import EPHEMERIS
from starhold.parts.epoch import EPOCH, START, Date

CARD = Card(
    title="TRIAD",
    summary="A = [s, u, s x u] measured times [s, u, s x u] computed, transposed, with u = unit(s x B)",
    sources=("A passive system for determining the attitude of a satellite (1964)", *sun.SOURCES, magnetic_field.SOURCE),
    assumptions=(
        *magnetic_field.ASSUMPTIONS,
        "the Sun is better known than the field: its direction is kept, and of the field only the plane through both",
        "the gyro's bias is small while the Sun is out of sight",
    ),
)
ROLE = "estimator"
ABOUT = "Earth"
NEEDS = ("sun", "sun_is_seen", "magnetic_field", "position", "rate")
FIRST = {"attitude_age": 0.0, "is_valid": 0.0}
TINY = 1e-30
remember = attitude_at_start


class Params(NamedTuple):
    """The epoch, and the least angle between the two directions."""

    epoch: Annotated[Date, EPOCH] = START
    apart: Annotated[float, APART] = math.radians(5.0)
    ephemeris: Annotated[int, EPHEMERIS] = 0


class Numbers(NamedTuple):
    """The Sun, the field, and the squared sine of the least angle."""

    sun: sun.Numbers
    field: magnetic_field.Numbers
    sine_squared: Scalar


def prepare(params: Params, period: float) -> Numbers:
    """Return the numbers of a flight. Raise ValueError for an epoch at which the field is not known."""
    light = sun.prepared(params.epoch, params.ephemeris)
    return Numbers(light, magnetic_field.prepared(params.epoch), math.sin(params.apart) ** 2)


def estimate(readings: Any, memory: Memory, params: Numbers, craft: Craft, period: Scalar) -> tuple[Estimate, Memory]:
    """Return the attitude from both directions if available, else the one propagated by the gyro, and the new memory."""

    def observe(time: Scalar) -> tuple[Quaternion, Truth]:
        there = both(less(0.5, readings.sun_is_seen), less(0.5, getattr(readings, "magnetic_field_is_new", 1.0)))
        axes, clear = triad(readings.sun, readings.magnetic_field, params.sine_squared)
        reference, _ = triad(
            sun.sun(time, params.sun).direction, magnetic_field.field(readings.position, time, params.field), 0.0
        )
        usable = both(there, clear)
        # An unusable measurement is replaced by finite numbers.
        return to_quaternion(chosen(usable, product(axes, transpose(reference)), IDENTITY)), usable

    return measured_or_carried(readings, memory, period, observe)


def triad(first: Vector, second: Vector, sine_squared: Scalar) -> tuple[Matrix, Truth]:
    """Return three axes as columns, the first along the first vector (of unit length), the second perpendicular to both;
    and whether the angle between them exceeds that of this squared sine."""
    across = cross(first, second)
    square = dot(across, across)
    clear = less(sine_squared * dot(second, second), square)
    middle = scale(1.0 / sqrt(maximum(square, TINY)), across)
    return transpose((first, middle, cross(first, middle))), clear


def examples() -> list[Params]:
    """Return the default epoch, and another one."""
    return [Params(), Params((2027.0, 6.0, 21.0, 12.0, 30.0, 15.0), math.radians(20.0))]
