"""Turns about a fixed axis, from rest to rest, at a limited acceleration and rate; paths of one or two such turns that keep
a body axis away from the Sun.

A path is relative to its end, which may move: it begins at an attitude relative to the end, and its turns lead there."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from starhold.algebra.circular import cosine_sine
from starhold.algebra.quaternion import (
    Quaternion,
    multiply,
    nearer,
    normalise,
    relative,
    stretch,
    to_body,
    to_reference,
    vector_part,
)
from starhold.algebra.rotation import rotation_vector
from starhold.algebra.scalar import Scalar, absolute, both, less, less_equal, maximum, minimum, side, sqrt, where
from starhold.algebra.structure import chosen
from starhold.algebra.vector import ZERO, Vector, add, apply, cross, dot, most, norm, scale, subtract
from starhold.parts.contract import Parameter
from starhold.parts.roles import Goal

RATE = Parameter("rad/s", above=0.0, text="largest")
ACCELERATION = Parameter("rad/s^2", above=0.0, text="as the slew begins and ends")
AXIS = Parameter("1", shape=(3,), spread=False, text="body axis that keeps away from the Sun")
KEEP_OUT = Parameter("rad", at_least=0.0, at_most=math.pi, text="angle to the Sun that it keeps; none if 0")
"""The declarations of a slew's limits."""
DETOURS = (0.03, 0.1, 0.2, 0.35, 0.5)
"""Detours past the cone's edge, as shares of the way to the point opposite the Sun; the first that stays clear is used."""
TINY = 1e-12


class Leg(NamedTuple):
    """A turn: its axis, the times of acceleration and of coasting (s), and the acceleration (rad/s2)."""

    axis: Vector
    speeding: Scalar
    coasting: Scalar
    acceleration: Scalar


class Cone(NamedTuple):
    """A keep-out cone about the Sun: the body axis that stays out of it, the cosine of its half angle, and the cosines and
    sines of the angles to the Sun at which detours pass it."""

    axis: Vector
    cosine: Scalar
    ways: tuple[tuple[Scalar, Scalar], ...]


def cone_of(axis: Vector, keep_out: float) -> Cone | tuple[()]:
    """Return the cone of an axis and an angle (rad), () for none. Raise ValueError for an axis without direction."""
    if not keep_out:
        return ()
    if not norm(axis) > 0.0:
        raise ValueError("the axis needs a direction")
    angles = [keep_out + share * (math.pi - keep_out) for share in DETOURS]
    return Cone(scale(1.0 / norm(axis), axis), math.cos(keep_out), tuple((math.cos(x), math.sin(x)) for x in angles))


def leg_of(turn: Quaternion, rate: Scalar, acceleration: Scalar) -> Leg:
    """Return the leg of a turn, the shorter way."""
    vector = rotation_vector(turn)
    angle = norm(vector)
    speeding = minimum(rate / acceleration, sqrt(maximum(angle, TINY) / acceleration))
    coasting = maximum(angle / (acceleration * speeding) - speeding, 0.0)
    return Leg(scale(1.0 / maximum(angle, TINY), vector), speeding, coasting, acceleration)


def torque_of(leg: Leg, inertia: Any) -> Scalar:
    """Return the largest torque (N m) about a body axis that a leg needs on a rigid body."""
    along, across = _loads(leg.axis, inertia)
    rate = leg.acceleration * leg.speeding
    a, b, c = (leg.acceleration * x + rate * rate * y for x, y in zip(along, across, strict=True))
    return maximum(a, maximum(b, c))


def within(turn: Quaternion, rate: Scalar, acceleration: Scalar, torque: Scalar, inertia: Any) -> Leg:
    """Return the leg of a turn with rate and acceleration reduced to keep a torque limit (N m) about each body axis, of
    which the gyroscopic torque takes at most half."""
    along, across = _loads(leg_of(turn, rate, acceleration).axis, inertia)
    rate = minimum(rate, sqrt(0.5 * torque / maximum(most(across), TINY)))
    for x, y in zip(along, across, strict=True):
        acceleration = minimum(acceleration, (torque - rate * rate * y) / maximum(x, TINY))
    return leg_of(turn, rate, acceleration)


def _loads(axis: Vector, inertia: Any) -> tuple[Vector, Vector]:
    """Return the absolute torques (N m) about the body axes for 1 rad/s2, and at 1 rad/s, about an axis."""
    momentum = apply(inertia, axis)
    (a, b, c), (x, y, z) = momentum, cross(axis, momentum)
    return (absolute(a), absolute(b), absolute(c)), (absolute(x), absolute(y), absolute(z))


def turned(start: Quaternion, legs: tuple[Leg, ...], time: Scalar) -> Goal:
    """Return the goal on a path at a time (s) after its begin, with rate and acceleration in its own axes."""
    attitude, rate, slope = start, ZERO, ZERO
    for leg in legs:
        up, flat, a = leg.speeding, leg.coasting, leg.acceleration
        rising, level, falling = _clipped(time, up), _clipped(time - up, flat), _clipped(time - up - flat, up)
        angle = 0.5 * a * (rising * rising - falling * falling) + a * up * (level + falling)
        speeds = both(less_equal(0.0, time), less(time, up))
        slows = both(less_equal(up + flat, time), less(time, up + flat + up))
        cosine, sine = cosine_sine(angle / (2.0 * math.tau))
        attitude = multiply(attitude, (cosine, *scale(sine, leg.axis)))
        rate = add(rate, scale(a * (rising - falling), leg.axis))
        slope = add(slope, scale(where(speeds, a, where(slows, -a, 0.0)), leg.axis))
        time = time - (up + flat + up)
    return Goal(attitude, rate, slope)


def _clipped(time: Scalar, longest: Scalar) -> Scalar:
    return minimum(maximum(time, 0.0), longest)


def onto(goal: Goal, path: Goal, before: Quaternion) -> Goal:
    """Return the goal on a path relative to a moving goal; of its two quaternions, the one nearer to `before`."""
    carried, pushed = to_body(path.attitude, goal.rate), to_body(path.attitude, goal.acceleration)
    acceleration = add(add(pushed, path.acceleration), cross(carried, path.rate))
    return Goal(nearer(multiply(goal.attitude, path.attitude), before), add(carried, path.rate), acceleration)


def turns_of(
    start: Quaternion, end: Quaternion, cone: Cone | tuple[()], seen: Vector
) -> tuple[tuple[Quaternion, ...], Scalar]:
    """Return the turns of a path between two attitudes, one, or with a cone two, the second zero if the first alone stays
    out of the cone; and the cosine of the least angle to the Sun, whose direction is `seen`, on the way."""
    direct = _short(relative(start, end))
    if not cone:
        return (direct,), -1.0
    turns, nearest = (direct, (1.0, 0.0, 0.0, 0.0)), nearest_cosine(start, direct, cone.axis, seen)
    halfway = multiply(start, normalise((1.0 + direct[0], *vector_part(direct))))
    middle = to_reference(halfway, cone.axis)
    away = subtract(middle, scale(dot(middle, seen), seen))
    # A path through the Sun itself may be moved to either side.
    other = cross(seen, to_reference(start, cone.axis))
    away = chosen(less(norm(away), 1e-6), other, away)
    away = scale(1.0 / maximum(norm(away), TINY), away)
    beside = cross(seen, away)
    asides = away, scale(-1.0, away), beside, scale(-1.0, beside)
    pasts = [add(scale(c, seen), scale(s, aside)) for c, s in cone.ways for aside in asides]
    for rolled in (halfway, start, end):
        begun = to_reference(rolled, cone.axis)
        for past in pasts:
            via = multiply(normalise((maximum(1.0 + dot(begun, past), TINY), *cross(begun, past))), rolled)
            legs = _short(relative(start, via)), _short(relative(via, end))
            worst = maximum(nearest_cosine(start, legs[0], cone.axis, seen), nearest_cosine(via, legs[1], cone.axis, seen))
            better = both(less(cone.cosine, nearest), less(worst, nearest))
            turns, nearest = chosen(better, legs, turns), where(better, worst, nearest)
    return turns, nearest


def _short(turn: Quaternion) -> Quaternion:
    return stretch(side(turn[0]), turn)


def nearest_cosine(start: Quaternion, turn: Quaternion, axis: Vector, seen: Vector) -> Scalar:
    """Return the cosine of the least angle between a body axis and a direction on a turn of at most 180 deg."""
    size = norm(vector_part(turn))
    begun, about = to_reference(start, axis), to_reference(start, scale(1.0 / maximum(size, TINY), vector_part(turn)))
    # After a turn by x it is along + c cos x + s sin x.
    along = dot(begun, about) * dot(about, seen)
    c, s = dot(begun, seen) - along, dot(cross(about, begun), seen)
    cosine, sine = 1.0 - 2.0 * size * size, 2.0 * turn[0] * size
    rises, falls = less(0.0, s), less(s * cosine - c * sine, 0.0)
    ends = maximum(along + c, along + c * cosine + s * sine)
    return where(both(rises, falls), along + sqrt(c * c + s * s), ends)
