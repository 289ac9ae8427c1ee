"""A rigid body turned by reaction wheels: its state holds the momenta of the rotors, exchanged exactly with the body.

Each function stands for that of a body without wheels in `rigid_body`, and takes the same arguments.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from starhold.algebra.quaternion import Quaternion, renormalise
from starhold.algebra.several import weighted
from starhold.algebra.vector import Vector, add, scale
from starhold.parts.bodies.rigid_body import motion
from starhold.parts.craft import Craft
from starhold.parts.effectors.wheels import Wheels, available, on_body
from starhold.parts.effectors.wheels import motor as turn_rotors
from starhold.parts.effectors.wheels import wheel_momentum as momentum_of


class WheeledState(NamedTuple):
    """Attitude q_BN, rate omega_BN_B (rad/s), position and velocity (inertial; m, m/s), the torque asked of the wheels
    (body, N m), and the absolute angular momentum of each rotor about its spin axis (N m s)."""

    attitude: Quaternion
    rate: Vector
    position: Vector
    velocity: Vector
    torque: Vector
    momentum: tuple[float, ...]


class WheelSample(NamedTuple):
    """What is recorded of the wheels beside the body: momenta (N m s), and their rates, the torques (N m); the torque asked
    of each motor, and the most that it gives in that direction (N m)."""

    momentum: tuple[float, ...]
    torque: tuple[float, ...]
    command: tuple[float, ...]
    available: tuple[float, ...]


def tidy(state: WheeledState) -> WheeledState:
    """The state with its quaternion brought back to unit length."""
    return state._replace(attitude=renormalise(state.attitude))


def with_torque(state: WheeledState, torque: Vector) -> WheeledState:
    """The state with another torque asked of the wheels."""
    return state._replace(torque=torque)


def rates(
    state: WheeledState,
    outside: Vector,
    acceleration: Vector,
    torque_rate: Vector | None,
    craft: Craft,
    wheels: Wheels,
    share: Any,
) -> Any:
    """d(state)/dt, in the order of WheeledState, under a torque from outside (body, N m). `share` is the allocation."""
    rotors = turn_rotors(share(state.torque, wheels), state.momentum, state.rate, wheels)
    total = add(on_body(rotors, state.momentum, state.rate, wheels), outside)
    body = motion(state, total, acceleration, torque_rate, craft)  # type: ignore[arg-type]
    return (*body, rotors)


def wheel_momentum(state: WheeledState, wheels: Wheels) -> Vector:
    """The rotors' momentum in body axes (N m s)."""
    return momentum_of(state.momentum, wheels)


def record(body: Any, state: WheeledState, wheels: Wheels, share: Any) -> Any:
    """What is recorded: the body's sample, with the torque that motors and friction of the wheels give it (less than what
    is asked where they are at their limits or lost), and the wheels'."""
    command = share(state.torque, wheels)
    rotors = turn_rotors(command, state.momentum, state.rate, wheels)
    given = body._replace(torque=scale(-1.0, weighted(rotors, wheels.axes)))
    return (given, WheelSample(state.momentum, rotors, command, available(command, state.momentum, wheels)))
