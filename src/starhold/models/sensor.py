"""What the control law is told of the state."""

from __future__ import annotations

from typing import NamedTuple

from starhold.algebra.quaternion import Quaternion, normalise
from starhold.algebra.scalar import equation
from starhold.algebra.vector import Vector, add
from starhold.models.random import normal_vector


class Noise(NamedTuple):
    """Standard deviations: external torque (N m per axis, held for a control period), measured attitude (each component
    of the vector part) and measured rate (rad/s)."""

    torque: float
    attitude: float
    rate: float


SILENT = Noise(0.0, 0.0, 0.0)
TORQUE, ATTITUDE, RATE = 0, 2, 4
"""Channels of the random numbers."""


@equation
def exact(attitude: Quaternion, rate: Vector, noise: Noise, seed: int, run: int, step: int) -> tuple[Quaternion, Vector]:
    """The true attitude and rate."""
    return attitude, rate


@equation
def noisy(attitude: Quaternion, rate: Vector, noise: Noise, seed: int, run: int, step: int) -> tuple[Quaternion, Vector]:
    """Attitude with a Gaussian error added to the vector part (then normalised), rate with a Gaussian error."""
    d = normal_vector(seed, run, step, ATTITUDE, noise.attitude)
    seen = normalise((attitude[0], attitude[1] + d[0], attitude[2] + d[1], attitude[3] + d[2]))
    return seen, add(rate, normal_vector(seed, run, step, RATE, noise.rate))


@equation
def no_disturbance(noise: Noise, seed: int, run: int, step: int) -> Vector:
    """No random torque."""
    return (0.0, 0.0, 0.0)


@equation
def gaussian_disturbance(noise: Noise, seed: int, run: int, step: int) -> Vector:
    """A random external torque (body, N m), new each control step."""
    return normal_vector(seed, run, step, TORQUE, noise.torque)
