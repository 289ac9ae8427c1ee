"""The gravity-gradient torque of a point mass."""

from __future__ import annotations

from math import hypot
from typing import Any

import numpy as np

from starhold.algebra.quaternion import to_body
from starhold.algebra.scalar import Scalar
from starhold.algebra.vector import Vector, gyroscopic_torque, scale
from starhold.parts.contract import Card, Envelope, NoParams, Push
from starhold.parts.craft import Craft, tensor, total_inertia
from starhold.parts.environments.two_body import attraction

CARD = Card(
    title="Gravity gradient",
    summary="M = 3 mu/r^5 R x J R, to first order in the body's size over r",
    sources=("Fundamentals of Spacecraft Attitude Determination and Control (2014)",),
    assumptions=("point mass", "a body small beside its orbit"),
)
ROLE = "environment"
TABLE = "environment"
NEEDS = ("two-body",)
MODELLED = True
Params = NoParams


def torque(state: Any, params: NoParams, craft: Craft, memory: Any) -> Vector:
    """Return the torque on the body (N m, body axes)."""
    n2, inverse_square = attraction(state.position, craft)
    return gravity_gradient(to_body(state.attitude, state.position), 3.0 * n2 * inverse_square, craft)


def gravity_gradient(position: Vector, strength: Scalar, craft: Craft) -> Vector:
    """Return the gravity-gradient torque (N m) for the position in body axes (m) and strength 3 mu/r^5 (1/(m2 s2))."""
    # R x J R has the form of a gyroscopic torque.
    return scale(strength, gyroscopic_torque(total_inertia(craft), position))


def torque_change(params: NoParams, craft: Craft, envelope: Envelope) -> Push:
    """Return a bound on the rate of change of the torque. In body axes the direction n turns with the body's rate and the
    transverse velocity over r, and |(n x Jn)'| <= (largest - least moment) |n'|; the relative rate of change of 3 mu/r^3 is
    at most 3 radial velocity/r, and |n x Jn| is at most half the difference of moments."""
    moments = np.linalg.eigvalsh(tensor(total_inertia(craft)))
    # Slightly more, because the moments are floats.
    spread = float(moments[-1] - moments[0] + 1e-14 * moments[-1])
    strength = 3.0 * craft.gravity / envelope.distance**3 * spread
    return Push(strength * hypot(1.0, 1.5) * envelope.speed / envelope.distance, strength)


def examples() -> list[NoParams]:
    """Return the only instance."""
    return [NoParams()]
