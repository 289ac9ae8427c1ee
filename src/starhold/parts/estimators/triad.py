"""Attitude from the Sun and the magnetic field, as measured and as computed for the place and time; the gyro carries it on
where one of them is missing."""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from starhold.algebra.cosines import to_quaternion
from starhold.algebra.quantity import Quantity
from starhold.algebra.quaternion import NO_TURN, Quaternion, multiply, nearer, normalise
from starhold.algebra.rotation import short_turn
from starhold.algebra.scalar import Scalar, Truth, both, less, maximum, sqrt, where
from starhold.algebra.structure import chosen
from starhold.algebra.vector import IDENTITY, ZERO, Matrix, Vector, add, cross, dot, scale, transpose
from starhold.algebra.vector import multiply as product
from starhold.parts import magnetic_field, sun
from starhold.parts.contract import Card, Parameter
from starhold.parts.craft import Craft
from starhold.parts.epoch import EPOCH, START, Date

CARD = Card(
    title="TRIAD",
    summary="A = [s, u, s x u] measured times [s, u, s x u] computed, transposed, with u = unit(s x B)",
    sources=(
        "A passive system for determining the attitude of a satellite (1964)",
        *sun.SOURCES,
        magnetic_field.SOURCE,
    ),
    assumptions=(
        *magnetic_field.ASSUMPTIONS,
        "the Sun is better known than the field: its direction is kept, and of the field only the plane through both",
        "the gyro's bias is small while the Sun is out of sight",
    ),
)
ROLE = "estimator"
ABOUT = "Earth"
NEEDS = ("sun", "sun_is_seen", "magnetic_field", "position", "rate")
FIRST = {"attitude_age": 0.0}
TINY = 1e-30


class Params(NamedTuple):
    """When the flight begins, and how near to each other the two directions may be."""

    epoch: Annotated[Date, EPOCH] = START
    apart: Annotated[
        float, Parameter("rad", at_least=0.0, at_most=math.pi / 2, text="least angle between the Sun and the field's line")
    ] = math.radians(5.0)


class Numbers(NamedTuple):
    """The Sun, the field, and the squared sine of the least angle."""

    sun: sun.Numbers
    field: magnetic_field.Numbers
    sine_squared: Scalar


class Estimate(NamedTuple):
    """The attitude, the gyro's rate as it is, and how old the last measurement of the attitude is."""

    attitude: Annotated[Quaternion, Quantity("1", "estimated attitude, inertial to body, scalar first", "quaternion")]
    rate: Annotated[Vector, Quantity("rad/s", "angular velocity as the gyro measures it, body axes", "axis")]
    attitude_age: Annotated[float, Quantity("s", "time since Sun and magnetic field gave an attitude")]


class Memory(NamedTuple):
    """The attitude and the gyro's reading (rad/s) of the control step before, its age (s), and control steps so far."""

    attitude: Quaternion
    rate: Vector
    age: Scalar
    steps: Scalar


def prepare(params: Params, period: float) -> Numbers:
    """The numbers of a flight. ValueError for an epoch at which the field is not known."""
    return Numbers(sun.prepared(params.epoch), magnetic_field.prepared(params.epoch), math.sin(params.apart) ** 2)


def remember(params: Numbers, state: Any) -> Memory:
    """Nothing is known before the first measurement: the attitude is that of the inertial axes."""
    return Memory(NO_TURN, ZERO, 0.0, 0.0)


def estimate(readings: Any, memory: Memory, params: Numbers, craft: Craft, period: Scalar) -> tuple[Estimate, Memory]:
    """The attitude by both directions where they are there, else by the gyro."""
    rate, time = readings.rate, memory.steps * period
    mean = scale(0.5, add(memory.rate, rate))
    carried = normalise(multiply(memory.attitude, short_turn(scale(0.5 * period, mean))))
    there = both(less(0.5, readings.sun_is_seen), less(0.5, getattr(readings, "magnetic_field_is_new", 1.0)))
    axes, clear = triad(readings.sun, readings.magnetic_field, params.sine_squared)
    reference, _ = triad(
        sun.sun(time, params.sun).direction, magnetic_field.field(readings.position, time, params.field), 0.0
    )
    usable = both(there, clear)
    # An unusable measurement is replaced by something finite.
    matrix = chosen(usable, product(axes, transpose(reference)), IDENTITY)
    attitude = chosen(usable, nearer(to_quaternion(matrix), carried), carried)
    age = where(usable, 0.0, memory.age + period)
    return Estimate(attitude, rate, age), Memory(attitude, rate, age, memory.steps + 1.0)


def triad(first: Vector, second: Vector, sine_squared: Scalar) -> tuple[Matrix, Truth]:
    """Return three axes as columns, the first along the first vector (of unit length), the second across both; and whether
    they are further apart than an angle of this squared sine."""
    across = cross(first, second)
    square = dot(across, across)
    clear = less(sine_squared * dot(second, second), square)
    middle = scale(1.0 / sqrt(maximum(square, TINY)), across)
    return transpose((first, middle, cross(first, middle))), clear


def examples() -> list[Params]:
    """The default epoch, and another one."""
    return [Params(), Params((2027.0, 6.0, 21.0, 12.0, 30.0, 15.0), math.radians(20.0))]
