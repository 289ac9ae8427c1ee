"""From the commanded torque to the torque the body gets: limits, lag and rate limit."""

from __future__ import annotations

import math
from typing import NamedTuple

from starhold.algebra.scalar import Scalar
from starhold.algebra.vector import Vector, clip_axes, clip_norm, scale, subtract


class Dynamics(NamedTuple):
    """Time constant of the lag T u' + u = command (s) and the largest rate of each torque component (N m/s)."""

    lag: float
    rate_limit: float


IDEAL = Dynamics(0.0, math.inf)


def limit_none(command: Vector, limit: Scalar) -> Vector:
    """The command as it is."""
    return command


def limit_axis(command: Vector, limit: Scalar) -> Vector:
    """Each component within +-limit, as wheels or thruster pairs along the axes give."""
    return clip_axes(command, limit)


def limit_norm(command: Vector, limit: Scalar) -> Vector:
    """The vector shortened to the limit, its direction kept."""
    return clip_norm(command, limit)


def start_ideal(torque: Vector, command: Vector) -> Vector:
    """An ideal actuator gives the command at once."""
    return command


def start_lagging(torque: Vector, command: Vector) -> Vector:
    """A lagging actuator starts from the torque it has."""
    return torque


def ideal(torque: Vector, command: Vector, begun: Vector, step: Scalar, dynamics: Dynamics) -> None:
    """d(torque)/dt of an ideal actuator: none, the command is held."""
    return


def lagging(torque: Vector, command: Vector, begun: Vector, step: Scalar, dynamics: Dynamics) -> Vector:
    """d(torque)/dt of a first-order lag, within the rate limit."""
    return clip_axes(scale(1.0 / dynamics.lag, subtract(command, torque)), dynamics.rate_limit)


def ramping(torque: Vector, command: Vector, begun: Vector, step: Scalar, dynamics: Dynamics) -> Vector:
    """d(torque)/dt without lag: the straight line from the torque at the start of the substep to the command, or as far
    towards it as the rate limit lets."""
    return clip_axes(scale(1.0 / step, subtract(command, begun)), dynamics.rate_limit)
