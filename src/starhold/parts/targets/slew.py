"""A slew from rest to rest at limited acceleration and rate: one turn from an attitude to another, or two, one after the
other, that lead an axis around the Sun."""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from starhold.algebra.quaternion import NO_TURN, Quaternion, to_reference
from starhold.algebra.scalar import Scalar
from starhold.algebra.vector import Vector, dot
from starhold.algebra.words import number_of
from starhold.parts import sun
from starhold.parts.contract import Card, Motion, Orbit, Parameter
from starhold.parts.craft import Craft
from starhold.parts.ephemeris import EPHEMERIS
from starhold.parts.epoch import EPOCH, START, Date
from starhold.parts.roles import Goal
from starhold.parts.stated_attitude import unit_quaternion
from starhold.parts.targets.alignment import ROOM
from starhold.parts.targets.eigenaxis import (
    ACCELERATION,
    AXIS,
    KEEP_OUT,
    RATE,
    Leg,
    cone_of,
    leg_of,
    torque_of,
    turned,
    turns_of,
)

CARD = Card(
    title="Slew",
    summary="q = q_start (cos x/2, e sin x/2): x'' is the acceleration, zero at the rate limit, then against it, to rest",
    sources=("Spacecraft Vehicle Dynamics and Control (2008): eigenaxis rotations", *sun.SOURCES),
    assumptions=(
        "the shorter way about the axis from one attitude to the other, at rest before and after",
        "a way around the Sun rests between its two turns",
        "the torque of the profile is that of the rigid body, without disturbances and the momentum of wheels",
        "the Sun stands, for the cone that is kept out of, where it does as the slew begins",
    ),
)
ROLE = "target"


class Params(NamedTuple):
    """Two attitudes, the limits of the slew between them, and a keep-out cone about the Sun for an axis."""

    attitude: Annotated[Quaternion, Parameter("1", shape=(4,), spread=False, text="at the end, scalar first")]
    rate: Annotated[float, RATE]
    acceleration: Annotated[float, ACCELERATION]
    start: Annotated[Quaternion, Parameter("1", shape=(4,), spread=False, text="attitude before, scalar first")] = NO_TURN
    begin: Annotated[float, Parameter("s", at_least=0.0, text="when it begins, since the start of the flight")] = 0.0
    torque_limit: Annotated[
        float, Parameter("N m", above=0.0, text="largest about each body axis, beyond which the slew is refused")
    ] = math.inf
    axis: Annotated[Vector, AXIS] = (0.0, 0.0, 1.0)
    keep_out: Annotated[float, KEEP_OUT] = 0.0
    epoch: Annotated[Date, EPOCH] = START
    ephemeris: Annotated[int, EPHEMERIS] = 0


class Numbers(NamedTuple):
    """The attitude before, the turns, their begin (s), the largest torque about a body axis (N m), and the control period
    (s)."""

    start: Quaternion
    legs: tuple[Leg, ...]
    begin: Scalar
    torque_limit: Scalar
    period: Scalar


def prepare(params: Params, period: float) -> Numbers:
    """Return the numbers of a flight. Raise ValueError for an invalid attitude, and if the axis begins or ends in the cone
    about the Sun, or no path goes around it."""
    start, end = unit_quaternion(params.start), unit_quaternion(params.attitude)
    seen, cone = (
        sun.sun(params.begin, sun.prepared(params.epoch, params.ephemeris)).direction,
        cone_of(params.axis, params.keep_out),
    )
    turns, nearest = turns_of(start, end, cone, seen)
    if cone:
        for word, attitude in (("begins", start), ("ends", end)):
            if (there := dot(to_reference(attitude, cone.axis), seen)) > cone.cosine:
                raise ValueError(f"the axis is {_degrees(there)} from the Sun where the slew {word}; {_kept(params)}")
        if nearest > cone.cosine:
            passed = f"the axis passes the Sun at {_degrees(nearest)} on the best detour of two turns"
            raise ValueError(f"{passed}; {_kept(params)}")
    legs = tuple(leg_of(turn, params.rate, params.acceleration) for turn in turns)
    return Numbers(start, legs, params.begin, params.torque_limit, period)


def _degrees(cosine: float) -> str:
    return f"{math.degrees(math.acos(max(-1.0, min(1.0, cosine)))):.4g} deg"


def _kept(params: Params) -> str:
    return f"it is to keep {math.degrees(params.keep_out):.4g} deg"


def check(params: Numbers, craft: Craft) -> None:
    """Raise ValueError if the profile needs more torque than its limit about a body axis."""
    most = max(torque_of(leg, craft.inertia) for leg in params.legs)
    if most > params.torque_limit:
        raise ValueError(f"the slew takes up to {most:.4g} N m about a body axis, more than {params.torque_limit:.4g} N m")


def goal(params: Numbers, state: Any, step: int, before: Any) -> Goal:
    """Return the goal at this control step."""
    return turned(params.start, params.legs, number_of(step) * params.period - params.begin)


def motion(params: Params, orbit: Orbit) -> Motion:
    """The largest rate and acceleration of its turns: the rate is steady as it begins and ends, the acceleration is not."""
    legs = prepare(params, 1.0).legs
    return Motion(max(leg.acceleration * leg.speeding for leg in legs) * ROOM, max(leg.acceleration for leg in legs))


def examples() -> list[Params]:
    """Return a slew with coasting, and one without, which begins later and keeps away from the Sun."""
    wide = Params((0.0, 1.0, 1.0, 0.2), math.radians(0.5), math.radians(0.05), begin=20.0)
    short = Params((0.99, 0.1, 0.0, 0.05), 0.05, 2e-4, (1.0, 0.0, 0.1, 0.0), 10.0, axis=(0.0, 1.0, 0.0), keep_out=0.2)
    return [wide, short]
