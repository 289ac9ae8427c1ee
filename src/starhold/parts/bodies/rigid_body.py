"""Rotation of a rigid body and motion of its centre of mass: the state and its time derivative."""

from __future__ import annotations

from typing import Any, NamedTuple

from starhold.algebra.quaternion import Quaternion, derivative, renormalise, to_reference
from starhold.algebra.scalar import Scalar
from starhold.algebra.vector import ZERO, Vector, add, apply, dot, gyroscopic_torque, subtract
from starhold.parts.craft import Craft


class State(NamedTuple):
    """Attitude q_BN (inertial to body), rate omega_BN_B (rad/s), position and velocity (inertial; m, m/s), and the
    torque the actuators give (body, N m), which has dynamics of its own when the actuators lag."""

    attitude: Quaternion
    rate: Vector
    position: Vector
    velocity: Vector
    torque: Vector


def angular_acceleration(rate: Vector, torque: Vector, craft: Craft) -> Vector:
    """Euler's equation solved for the rate's derivative (rad/s2): J w' = torque - w x J w."""
    return apply(craft.inverse_inertia, subtract(torque, gyroscopic_torque(craft.inertia, rate)))


def motion(
    state: State, torque: Vector, acceleration: Vector, torque_rate: Vector | None, craft: Craft
) -> tuple[Quaternion, Vector, Vector, Vector, Vector | None]:
    """d(state)/dt under the total torque (body), the acceleration of the centre of mass (inertial) and the rate of the
    actuator torque (None: held), in the order of State."""
    turning = derivative(state.attitude, state.rate)
    return (turning, angular_acceleration(state.rate, torque, craft), state.velocity, acceleration, torque_rate)


def tidy(state: State) -> State:
    """The state with its quaternion brought back to unit length."""
    return state._replace(attitude=renormalise(state.attitude))


def with_torque(state: State, torque: Vector) -> State:
    """The state with another actuator torque."""
    return state._replace(torque=torque)


def rates(
    state: State,
    outside: Vector,
    acceleration: Vector,
    torque_rate: Vector | None,
    craft: Craft,
    wheels: Any,
    share: Any,
) -> tuple[Quaternion, Vector, Vector, Vector, Vector | None]:
    """d(state)/dt under the actuators' torque and one from outside (body, N m); a body without wheels has none to share."""
    return motion(state, add(state.torque, outside), acceleration, torque_rate, craft)


def wheel_momentum(state: State, wheels: Any) -> Vector:
    """The angular momentum of parts that spin (N m s): none."""
    return ZERO


def record(body: Any, state: State, wheels: Any, share: Any) -> Any:
    """What is recorded: the body's sample."""
    return body


def kinetic_energy(rate: Vector, craft: Craft) -> Scalar:
    """Rotational energy (J)."""
    return 0.5 * dot(rate, apply(craft.inertia, rate))


def angular_momentum(state: State, craft: Craft) -> Vector:
    """Angular momentum about the centre of mass in inertial axes (N m s)."""
    return to_reference(state.attitude, apply(craft.inertia, state.rate))
