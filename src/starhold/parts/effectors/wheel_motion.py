"""Imperfections of wheels: stiction, limited motor power, and imbalance.

Stiction is Stribeck's friction, sqrt(e) (static - coulomb) (W/s) exp(-(W/s)^2/2) in addition to the other kinds, with W the
speed and s the speed at which it is largest. An unbalanced rotor exerts a torque that turns with it, W^2 times the product
of inertia (dynamic), or times the mass moment and its lever arm (static): it shakes the craft at the wheel's frequency. The
effect of the static imbalance's force on the orbit is neglected.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from starhold.algebra.circular import cosine_sine
from starhold.algebra.elementary import exp
from starhold.algebra.scalar import Scalar, absolute, less, maximum, minimum, where
from starhold.algebra.several import each
from starhold.algebra.vector import ZERO, Vector, add, cross, dot, scale
from starhold.parts.as_built import in_body, is_given, turn_of
from starhold.parts.craft import vector

if TYPE_CHECKING:
    from starhold.parts.effectors.wheels import Numbers, Wheels

PEAK = math.sqrt(math.e)
TINY = 1e-12


def with_more(
    wheels: Wheels,
    static: Sequence[float],
    stribeck_speed: Sequence[float],
    power_limit: Sequence[float],
    static_imbalance: Sequence[float],
    dynamic_imbalance: Sequence[float],
    position: Sequence[Vector],
) -> Wheels:
    """Return the wheels with static friction (N m), 0 for none besides Coulomb's, its speed (rad/s), power limits (W), and
    rotors with mass moments (kg m) and products of inertia (kg m2) at positions from the centre of mass (m, body axes).

    Raise ValueError if static friction is less than Coulomb's or has no speed, or if a top speed is needed but absent."""
    for i, (coulomb, most, speed) in enumerate(zip(wheels.coulomb, static, stribeck_speed, strict=True), 1):
        if most and not (most >= coulomb and speed > 0.0):
            raise ValueError(
                f"the static friction of wheel {i} needs a stribeck_speed, and must be at least its Coulomb friction"
            )
    shaking = any(static_imbalance) or any(dynamic_imbalance)
    for i, limit in enumerate(wheels.momentum_limit, 1):
        if (shaking or min(power_limit) < math.inf) and math.isinf(limit):
            raise ValueError(f"wheel {i} needs a momentum_limit or a top_speed: its imbalance or power has no bound without")
    sides = [_sides(axis) for axis in wheels.axes]
    columns = zip(sides, static_imbalance, dynamic_imbalance, position, strict=True)
    unbalanced = tuple(
        tuple(add(scale(product, side), scale(moment, cross(place, side))) for side in pair)
        for pair, moment, product, place in columns
    )
    stuck = tuple(max(most - coulomb, 0.0) for most, coulomb in zip(static, wheels.coulomb, strict=True))
    return wheels._replace(
        sticking=stuck if any(stuck) else (),
        stribeck_speed=tuple(speed or 1.0 for speed in stribeck_speed) if any(stuck) else (),
        power_limit=tuple(power_limit) if min(power_limit) < math.inf else (),
        unbalanced=unbalanced if shaking else (),
    )


def mounted(wheels: Wheels, errors: Sequence[Vector]) -> Wheels:
    """Return the wheels with each spin axis turned by a small rotation vector (rad, body axes) that laws and allocation do
    not know."""
    if not is_given(*errors):
        return wheels
    axes = tuple(in_body(turn_of(error), axis) for error, axis in zip(errors, wheels.axes, strict=True))
    return wheels._replace(axes=axes, known_axes=wheels.axes)


def as_known(wheels: Wheels) -> Wheels:
    """Return the wheels with the axes that laws and allocation assume."""
    return wheels._replace(axes=wheels.known_axes, known_axes=()) if wheels.known_axes else wheels


def _sides(axis: Vector) -> tuple[Vector, Vector]:
    """Return two unit vectors that make a right-handed triad with an axis."""
    least = np.eye(3)[int(np.argmin(np.abs(axis)))]
    side = np.cross(axis, least) / np.linalg.norm(np.cross(axis, least))
    return vector(side), vector(np.cross(axis, side))


def has_friction(wheels: Wheels) -> bool:
    """Return whether a bearing has friction of any kind."""
    return any((*wheels.viscous, *wheels.coulomb, *wheels.sticking))


def without_friction(wheels: Wheels) -> Wheels:
    """Return the wheels on ideal bearings, and balanced."""
    none = (0.0,) * len(wheels.axes)
    return wheels._replace(viscous=none, coulomb=none, sticking=(), stribeck_speed=(), unbalanced=())


def speeds(momentum: Numbers, rate: Vector, wheels: Wheels) -> Numbers:
    """Return the speeds (rad/s) of the rotors relative to the body."""
    return each(_speed, (momentum, wheels.axes, wheels.inertia), rate)


def _speed(momentum: Scalar, axis: Vector, inertia: Scalar, rate: Vector) -> Scalar:
    return momentum * (1.0 / inertia) - dot(axis, rate)


def limited(command: Numbers, momentum: Numbers, rate: Vector, wheels: Wheels) -> Wheels:
    """Return the wheels with torque limits reduced by their power limits for these commands; braking needs no power."""
    if not wheels.power_limit:
        return wheels
    columns = (command, speeds(momentum, rate, wheels), wheels.torque_limit, wheels.power_limit)
    return wheels._replace(torque_limit=each(_within, columns))


def _within(command: Scalar, speed: Scalar, limit: Scalar, power: Scalar) -> Scalar:
    driving = minimum(limit, power / maximum(absolute(speed), TINY))
    return where(less(0.0, command * speed), driving, limit)


def at_top_speed(wheels: Wheels) -> Wheels:
    """Return the wheels with the torque limits available at their momentum limits."""
    if not wheels.power_limit:
        return wheels
    columns = zip(wheels.torque_limit, wheels.power_limit, top_speeds(wheels), strict=True)
    return wheels._replace(torque_limit=tuple(min(limit, power / speed) for limit, power, speed in columns))


def top_speeds(wheels: Wheels) -> Numbers:
    """Return the speeds (rad/s) at the momentum limits."""
    return tuple(limit / inertia for limit, inertia in zip(wheels.momentum_limit, wheels.inertia, strict=True))


def sticking(momentum: Numbers, rate: Vector, wheels: Wheels) -> Numbers:
    """Return Stribeck's friction on the rotors (N m), in addition to the other kinds."""
    return each(_stuck, (speeds(momentum, rate, wheels), wheels.sticking, wheels.stribeck_speed))


def slopes(wheels: Wheels) -> Numbers:
    """Return the slope of Stribeck's friction of each rotor at standstill (N m s)."""
    if not wheels.sticking:
        return (0.0,) * len(wheels.axes)
    return tuple(PEAK * most / over for most, over in zip(wheels.sticking, wheels.stribeck_speed, strict=True))


def _stuck(speed: Scalar, most: Scalar, over: Scalar) -> Scalar:
    share = speed * (1.0 / over)
    return -(PEAK * most) * (share * exp(-0.5 * (share * share)))


def shaken(angle: Numbers, momentum: Numbers, rate: Vector, wheels: Wheels) -> Vector:
    """Return the torque of unbalanced rotors on the body (N m), at angles in turns."""
    torque: Any = ZERO
    for turn, speed, (first, second) in zip(angle, speeds(momentum, rate, wheels), wheels.unbalanced, strict=True):
        cosine, sine = cosine_sine(turn)
        torque = add(torque, scale(speed * speed, add(scale(cosine, first), scale(sine, second))))
    return torque
