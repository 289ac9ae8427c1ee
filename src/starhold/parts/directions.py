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
from starhold.algebra.vector import ZERO, Vector, add, apply, diagonal, scale, subtract
from starhold.parts.as_built import behind
from starhold.parts.contract import NO_ERRORS, Direction, Errors, Noise, Parameter, Recursion
from starhold.parts.kalman import turned
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


def fixed(directions: tuple[Direction, ...], error: float, deviation: float) -> tuple[Errors, Noise] | None:
    """Return errors and noise of an attitude computed from directions, which is off by an error (rad) and by a Gaussian
    rotation of this deviation (rad) about each axis; None where directions are not all as late and as often new."""
    (late, every), *others = {(one.late, one.every) for one in directions}
    if others or not max(error, deviation) < math.inf:
        return None
    errors = NO_ERRORS._replace(attitude=error, turning=behind(late), ago=late)
    return errors, Noise(diagonal((deviation, deviation, deviation)), every)


def recursion(params: Any, noise: Noise, period: float, rate: Vector) -> Recursion | None:
    """Return the recursion of the errors of an attitude that directions give and the gyro propagates until they give the
    next, and of the gyro's last reading, on a body at a constant rate (rad/s, body axes); None with a bias that walks, which
    nothing corrects."""
    if noise.walk:
        return None
    _, axes, drift = turned(rate, period)

    def carried(errors: tuple[Vector, ...], random: tuple[Vector, ...]) -> tuple[tuple[Vector, ...], Vector, Vector]:
        (turn, last), now = errors, scale(noise.rate, random[0])
        ahead = subtract(apply(axes, turn), apply(drift, scale(0.5, add(last, now))))
        return (ahead, now), ahead, now

    def corrected(errors: tuple[Vector, ...], random: tuple[Vector, ...]) -> tuple[tuple[Vector, ...], Vector, Vector]:
        turn, now = apply(noise.attitude, random[2]), scale(noise.rate, random[0])
        return (turn, now), turn, now

    return Recursion(corrected, carried, noise.every, 2, biased=True)
