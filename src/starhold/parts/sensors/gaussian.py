"""What the control law is told of the state."""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

from starhold.algebra.quaternion import Quaternion, multiply, normalise
from starhold.algebra.vector import Vector, add
from starhold.parts.random import Word, normal_vector

Key: TypeAlias = tuple[Word, Word]
"""Seed and number of a run."""


class Noise(NamedTuple):
    """Standard deviations: external torque (N m per axis, held for a control period), measured attitude (rad,
    rotation about each body axis) and measured rate (rad/s)."""

    torque: float
    attitude: float
    rate: float


SILENT = Noise(0.0, 0.0, 0.0)
TORQUE, ATTITUDE, RATE = 0, 3, 6
"""Places of the random numbers of a step, three each."""


def exact(attitude: Quaternion, rate: Vector, noise: Noise, key: Key, step: Word) -> tuple[Quaternion, Vector]:
    """The true attitude and rate."""
    return attitude, rate


def noisy(attitude: Quaternion, rate: Vector, noise: Noise, key: Key, step: Word) -> tuple[Quaternion, Vector]:
    """Attitude turned by Gaussian angles about the body axes, rate with a Gaussian error."""
    # Of a small turn the quaternion's vector part is half the angle.
    d = normal_vector(key, step, ATTITUDE, 0.5 * noise.attitude)
    seen = normalise(multiply(attitude, (1.0, d[0], d[1], d[2])))
    return seen, add(rate, normal_vector(key, step, RATE, noise.rate))


def no_disturbance(noise: Noise, key: Key, step: Word) -> Vector:
    """No random torque."""
    return (0.0, 0.0, 0.0)


def gaussian_disturbance(noise: Noise, key: Key, step: Word) -> Vector:
    """A random external torque (body, N m), new each control step."""
    return normal_vector(key, step, TORQUE, noise.torque)
