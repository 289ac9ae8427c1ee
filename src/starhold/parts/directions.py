"""Attitude from directions known in inertial axes, propagated by the gyro while these are missing."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, Any, NamedTuple

from starhold.algebra.quantity import Quantity
from starhold.algebra.quaternion import NO_TURN, Quaternion, multiply, nearer, normalise
from starhold.algebra.rotation import short_turn
from starhold.algebra.scalar import Scalar, Truth, less, where
from starhold.algebra.structure import chosen
from starhold.algebra.vector import ZERO, Vector, add, scale
from starhold.parts.contract import Parameter
from starhold.parts.stated_attitude import VALID

APART = Parameter("rad", at_least=0.0, at_most=math.pi / 2, text="least angle between the lines of two directions")
"""The declaration of the least angle between directions, common to all estimators."""


class Estimate(NamedTuple):
    """The attitude, the gyro's uncorrected rate, the age of the last attitude measurement, and whether there was one."""

    attitude: Annotated[Quaternion, Quantity("1", "estimated attitude, inertial to body, scalar first", "quaternion")]
    rate: Annotated[Vector, Quantity("rad/s", "angular velocity as the gyro measures it, body axes", "axis")]
    attitude_age: Annotated[float, Quantity("s", "time since directions gave an attitude")]
    is_valid: Annotated[float, VALID]


class Memory(NamedTuple):
    """Attitude and gyro reading (rad/s) of the previous control step, the attitude's age (s), and the control steps so
    far."""

    attitude: Quaternion
    rate: Vector
    age: Scalar
    steps: Scalar


def attitude_at_start(params: Any, state: Any) -> Memory:
    """Return the initial memory: before the first measurement the attitude is that of the inertial axes."""
    return Memory(NO_TURN, ZERO, 0.0, 0.0)


def measured_or_carried(
    readings: Any, memory: Memory, period: Scalar, observe: Callable[[Scalar], tuple[Quaternion, Truth]]
) -> tuple[Estimate, Memory]:
    """Return the attitude observed at a time (s) if it is usable, else the previous one propagated by the gyro."""
    rate, time = readings.rate, memory.steps * period
    mean = scale(0.5, add(memory.rate, rate))
    carried = normalise(multiply(memory.attitude, short_turn(scale(0.5 * period, mean))))
    measured, usable = observe(time)
    attitude = chosen(usable, nearer(measured, carried), carried)
    age = where(usable, 0.0, memory.age + period)
    # Without any measurement the age is the time of flight plus a period.
    valid = where(less(age, time + 0.5 * period), 1.0, 0.0)
    return Estimate(attitude, rate, age, valid), Memory(attitude, rate, age, memory.steps + 1.0)
