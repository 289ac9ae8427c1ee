"""A slew from rest to rest about one axis: the attitude turns at a limited acceleration and rate from one to another."""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from starhold.algebra.circular import cosine_sine
from starhold.algebra.quaternion import NO_TURN, Quaternion, multiply, relative, stretch, to_reference, vector_part
from starhold.algebra.scalar import Scalar, both, less, less_equal, maximum, minimum, where
from starhold.algebra.vector import Vector, apply, cross, dot, norm, scale
from starhold.algebra.words import number_of
from starhold.parts import sun
from starhold.parts.contract import Card, Parameter
from starhold.parts.craft import Craft
from starhold.parts.ephemeris import EPHEMERIS
from starhold.parts.epoch import EPOCH, START, Date
from starhold.parts.roles import Goal
from starhold.parts.stated_attitude import unit_quaternion

CARD = Card(
    title="Slew",
    summary="q = q_start (cos x/2, e sin x/2): x'' is the acceleration, zero at the rate limit, then against it, to rest",
    sources=("Spacecraft Vehicle Dynamics and Control (2008): eigenaxis rotations", *sun.SOURCES),
    assumptions=(
        "the shorter way about the axis from one attitude to the other, at rest before and after",
        "the torque of the profile is that of the rigid body, without disturbances and the momentum of wheels",
        "the Sun stands, for the cone that is kept out of, where it does as the slew begins",
    ),
)
ROLE = "target"


class Params(NamedTuple):
    """Two attitudes, the limits of the slew between them, and a cone about the Sun that an axis keeps out of."""

    attitude: Annotated[Quaternion, Parameter("1", shape=(4,), spread=False, text="at the end, scalar first")]
    rate: Annotated[float, Parameter("rad/s", above=0.0, text="largest")]
    acceleration: Annotated[float, Parameter("rad/s^2", above=0.0, text="as the slew begins and ends")]
    start: Annotated[Quaternion, Parameter("1", shape=(4,), spread=False, text="attitude before, scalar first")] = NO_TURN
    begin: Annotated[float, Parameter("s", at_least=0.0, text="when it begins, since the start of the flight")] = 0.0
    torque_limit: Annotated[
        float, Parameter("N m", above=0.0, text="largest about each body axis, beyond which the slew is refused")
    ] = math.inf
    axis: Annotated[Vector, Parameter("1", shape=(3,), spread=False, text="body axis that keeps away from the Sun")] = (
        0.0,
        0.0,
        1.0,
    )
    keep_out: Annotated[
        float, Parameter("rad", at_least=0.0, at_most=math.pi, text="angle to the Sun that it keeps; none if 0")
    ] = 0.0
    epoch: Annotated[Date, EPOCH] = START
    ephemeris: Annotated[int, EPHEMERIS] = 0


class Numbers(NamedTuple):
    """The attitude before, the axis, when the slew begins, how long it accelerates and then coasts (s), the acceleration
    (rad/s2), the largest torque about a body axis (N m), and the control period (s)."""

    start: Quaternion
    axis: Vector
    begin: Scalar
    speeding: Scalar
    coasting: Scalar
    acceleration: Scalar
    torque_limit: Scalar
    period: Scalar


def prepare(params: Params, period: float) -> Numbers:
    """The numbers of a flight. ValueError for an attitude that is none, and for a path that enters the cone about the Sun,
    with the angle at which it passes."""
    start, end = unit_quaternion(params.start), unit_quaternion(params.attitude)
    turn = relative(start, end)
    turn = turn if turn[0] >= 0.0 else stretch(-1.0, turn)
    size = math.hypot(*vector_part(turn))
    axis, angle = (scale(1.0 / size, vector_part(turn)), 2.0 * math.atan2(size, turn[0])) if size else ((1.0, 0.0, 0.0), 0.0)
    speeding = min(params.rate / params.acceleration, math.sqrt(angle / params.acceleration))
    coasting = angle / (params.acceleration * speeding) - speeding if angle else 0.0
    if params.keep_out:
        nearest, passed = _nearest(params, start, axis, angle)
        if nearest < params.keep_out:
            raise ValueError(
                f"the axis passes the Sun at {math.degrees(nearest):.4g} deg, after {math.degrees(passed):.4g} deg of "
                f"{math.degrees(angle):.4g} deg; it is to keep {math.degrees(params.keep_out):.4g} deg"
            )
    limits = max(coasting, 0.0), params.acceleration, params.torque_limit
    return Numbers(start, axis, params.begin, speeding, *limits, period)


def _nearest(params: Params, start: Quaternion, axis: Vector, angle: float) -> tuple[float, float]:
    """The least angle (rad) of the body axis to the Sun on the way, and the angle that is turned by then."""
    if not norm(params.axis) > 0.0:
        raise ValueError("the axis needs a direction")
    seen = sun.sun(params.begin, sun.prepared(params.epoch, params.ephemeris)).direction
    begun, about = to_reference(start, scale(1.0 / norm(params.axis), params.axis)), to_reference(start, axis)
    # The cosine of the angle to the Sun, along + c cos x + s sin x, after a turn by x.
    along = dot(begun, about) * dot(about, seen)
    c, s = dot(begun, seen) - along, dot(cross(about, begun), seen)
    places = [0.0, angle, *(x for x in (math.atan2(s, c) % math.tau,) if x < angle)]
    passed = max(places, key=lambda x: c * math.cos(x) + s * math.sin(x))
    cosine = along + c * math.cos(passed) + s * math.sin(passed)
    return math.acos(max(-1.0, min(1.0, cosine))), passed


def check(params: Numbers, craft: Craft) -> None:
    """ValueError where the profile takes more torque than its limit about a body axis."""
    momentum, rate = apply(craft.inertia, params.axis), params.acceleration * params.speeding
    turning = cross(params.axis, momentum)
    pairs = zip(momentum, turning, strict=True)
    most = max(params.acceleration * abs(m) + rate * rate * abs(g) for m, g in pairs)
    if most > params.torque_limit:
        raise ValueError(f"the slew takes up to {most:.4g} N m about a body axis, more than {params.torque_limit:.4g} N m")


def goal(params: Numbers, state: Any, step: int, before: Any) -> Goal:
    """The attitude at this control step, with its rate and acceleration."""
    time, up, flat = number_of(step) * params.period - params.begin, params.speeding, params.coasting
    rising, level, falling = _within(time, up), _within(time - up, flat), _within(time - up - flat, up)
    a, peak = params.acceleration, params.acceleration * up
    angle = 0.5 * a * (rising * rising - falling * falling) + peak * (level + falling)
    speeds = both(less_equal(0.0, time), less(time, up))
    slows = both(less_equal(up + flat, time), less(time, up + flat + up))
    slope = where(speeds, a, where(slows, -a, 0.0))
    cosine, sine = cosine_sine(angle / (2.0 * math.tau))
    attitude = multiply(params.start, (cosine, *scale(sine, params.axis)))
    return Goal(attitude, scale(a * (rising - falling), params.axis), scale(slope, params.axis))


def _within(time: Scalar, most: Scalar) -> Scalar:
    """A time that is at least 0 and at most this."""
    return minimum(maximum(time, 0.0), most)


def examples() -> list[Params]:
    """One with a coast, and one without that begins later and keeps away from the Sun."""
    wide = Params((0.0, 1.0, 1.0, 0.2), math.radians(0.5), math.radians(0.05), begin=20.0)
    short = Params((0.99, 0.1, 0.0, 0.05), 0.05, 2e-4, (1.0, 0.0, 0.1, 0.0), 10.0, axis=(0.0, 1.0, 0.0), keep_out=0.2)
    return [wide, short]
