"""Equations of starhold's parts called with what the unit tests have at hand: places and attitudes."""

from types import SimpleNamespace
from typing import Any

from starhold.algebra.quaternion import to_reference
from starhold.algebra.vector import ZERO, apply
from starhold.parts.environments import gravity_gradient as gradient
from starhold.parts.environments import two_body as attraction


def angular_momentum(state: Any, craft: Any) -> Any:
    """Angular momentum about the centre of mass in inertial axes (N m s)."""
    return to_reference(state.attitude, apply(craft.inertia, state.rate))


def two_body(position: Any, attitude: Any, craft: Any) -> Any:
    """Acceleration and torque in the field of a point mass."""
    return attraction.acceleration(SimpleNamespace(position=position), (), craft, ()), ZERO


def two_body_gravity_gradient(position: Any, attitude: Any, craft: Any) -> Any:
    """The same with the gravity gradient."""
    here = SimpleNamespace(position=position, attitude=attitude)
    return attraction.acceleration(here, (), craft, ()), gradient.torque(here, (), craft, ())
