"""Equations of starhold's parts called with what the unit tests have at hand: places, attitudes, keys of random numbers."""

import math
from types import SimpleNamespace
from typing import Any, NamedTuple

from starhold.algebra.quaternion import to_reference
from starhold.algebra.vector import ZERO, apply
from starhold.parts.actuators import lag, rate_limit
from starhold.parts.environments import gravity_gradient as gradient
from starhold.parts.environments import random_torque
from starhold.parts.environments import two_body as attraction
from starhold.parts.random import Dice
from starhold.parts.sensors import gaussian
from starhold.parts.targets import history as table_target
from starhold.parts.targets import inertial as fixed_target
from starhold.parts.targets import orbital as orbital_target

TORQUE, ATTITUDE, RATE = 0, gaussian.NUMBERS_FROM, gaussian.NUMBERS_FROM + 3
"""First random numbers of a step."""


class Noise(NamedTuple):
    """Standard deviations of a torque (N m), an attitude (rad) and a rate (rad/s)."""

    torque: float
    attitude: float
    rate: float


class Dynamics(NamedTuple):
    """A lag (s) and a rate limit (N m/s)."""

    lag: float
    rate_limit: float = math.inf


def angular_momentum(state: Any, craft: Any) -> Any:
    """Angular momentum about the centre of mass in inertial axes (N m s)."""
    return to_reference(state.attitude, apply(craft.inertia, state.rate))


def _at(position: Any, attitude: Any = None, velocity: Any = None) -> Any:
    return SimpleNamespace(position=position, attitude=attitude, velocity=velocity)


def two_body(position: Any, attitude: Any, craft: Any) -> Any:
    """Acceleration and torque in the field of a point mass."""
    return attraction.acceleration(_at(position), (), craft, ()), ZERO


def two_body_gravity_gradient(position: Any, attitude: Any, craft: Any) -> Any:
    """The same with the gravity gradient."""
    here = _at(position, attitude)
    return attraction.acceleration(here, (), craft, ()), gradient.torque(here, (), craft, ())


def inertial(fixed: Any, position: Any, velocity: Any, step: Any, before: Any) -> Any:
    """A constant target."""
    return fixed_target.goal(fixed_target.Params(fixed), _at(position, None, velocity), step, before)


def orbital(params: Any, position: Any, velocity: Any, step: Any, before: Any) -> Any:
    """The orbital frame."""
    return orbital_target.goal((), _at(position, None, velocity), step, before)


def history(table: Any, position: Any, velocity: Any, step: Any, before: Any) -> Any:
    """A row of a table."""
    return table_target.goal(table, _at(position, None, velocity), step, before)


def noisy(attitude: Any, rate: Any, noise: Noise, key: Any, step: Any) -> Any:
    """Attitude and rate with noise."""
    state = SimpleNamespace(attitude=attitude, rate=rate)
    params = gaussian.Params(noise.attitude, noise.rate)
    return tuple(gaussian.measure(state, (), params, Dice(key, step, gaussian.NUMBERS_FROM), step)[0])


def gaussian_disturbance(noise: Noise, key: Any, step: Any) -> Any:
    """A random torque."""
    return random_torque.update(ZERO, None, random_torque.Params(noise.torque), Dice(key, step, 0), step)


def lagging(torque: Any, command: Any, begun: Any, step: Any, dynamics: Dynamics) -> Any:
    """The rate of a lag."""
    return lag.rates(torque, command, begun, step, lag.Params(*dynamics))


def ramping(torque: Any, command: Any, begun: Any, step: Any, dynamics: Dynamics) -> Any:
    """The rate of a ramp."""
    return rate_limit.rates(torque, command, begun, step, rate_limit.Params(dynamics.rate_limit))
