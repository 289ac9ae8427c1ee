"""A body axis points at a ground station while the craft is in its sky, else at the Earth's centre."""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from starhold.algebra.circular import cosine_sine
from starhold.algebra.quaternion import Quaternion
from starhold.algebra.scalar import Scalar, less, where
from starhold.algebra.vector import ZERO, Matrix, Vector, cross, dot, norm, scale, subtract
from starhold.algebra.words import number_of
from starhold.parts.contract import UNLIMITED, Card, Motion, Orbit, Parameter
from starhold.parts.craft import EARTH
from starhold.parts.epoch import EPOCH, START, Date, days_of, sidereal, spun, turned
from starhold.parts.roles import Goal
from starhold.parts.targets.alignment import (
    AXIS,
    GRAVITY,
    OTHER,
    SPIN,
    Moving,
    Turning,
    aligned,
    body_axes,
    bounded,
    geodetic,
    lines_of_sight,
    opposite_of,
    orbiting,
)

CARD = Card(
    title="Ground station",
    summary="a body axis at a place on the turning Earth above an elevation, else at the Earth's centre; another against h",
    sources=("Fundamentals of Astrodynamics and Applications (2013): sites on the ellipsoid of WGS 84",),
    assumptions=(
        "two-body motion",
        "inertial axes of the equator and equinox of date, without the motion of the pole",
        "the target jumps as the station comes into view and as it leaves",
    ),
)
ROLE = "target"
LEANING = 0.0034
"""The largest angle (rad) of the vertical to the direction from the Earth's centre."""
NEEDS = ("two-body",)
ABOUT = "Earth"
FOLLOWS = True


class Params(NamedTuple):
    """The position of the station, the body axes that point at it, and the epoch."""

    latitude: Annotated[
        float, Parameter("rad", at_least=-0.5 * math.pi, at_most=0.5 * math.pi, text="geodetic, of the station")
    ]
    longitude: Annotated[float, Parameter("rad", at_least=-math.pi, at_most=math.tau, text="to the east")]
    height: Annotated[float, Parameter("m", at_least=-500.0, at_most=9000.0, text="above the ellipsoid")] = 0.0
    elevation: Annotated[
        float, Parameter("rad", at_least=0.0, at_most=1.5, text="above which the craft points at the station")
    ] = math.radians(5.0)
    axis: Annotated[Vector, AXIS] = (0.0, 0.0, 1.0)
    other: Annotated[Vector, OTHER] = (0.0, 1.0, 0.0)
    epoch: Annotated[Date, EPOCH] = START
    gravity: Annotated[float, GRAVITY] = EARTH


class Numbers(NamedTuple):
    """The station's place (m) and vertical in axes of the Earth, the sine of the least elevation, the triad of the body
    axes, the turns of the Earth at the start, the gravitational parameter (m3/s2), and the control period (s)."""

    place: Vector
    up: Vector
    least: Scalar
    axes: Matrix
    turn: Scalar
    gravity: Scalar
    period: Scalar


def prepare(params: Params, period: float) -> Numbers:
    """The numbers of a flight. ValueError for axes that leave the attitude open, and for an epoch that is no date."""
    place, up = geodetic(params.latitude, params.longitude, params.height)
    axes, turn = body_axes(params.axis, params.other), sidereal(days_of(params.epoch))
    return Numbers(place, up, math.sin(params.elevation), axes, turn, params.gravity, period)


def goal(params: Numbers, state: Any, step: int, before: Quaternion) -> Goal:
    """The attitude at this control step: the second direction is against the orbit's normal, as in the orbital frame."""
    cosine, sine = cosine_sine(turned(params.turn, number_of(step) * params.period))
    place, up = spun(params.place, cosine, sine), spun(params.up, cosine, sine)
    craft = orbiting(state.position, state.velocity, params.gravity)
    station = Moving(place, (-SPIN * place[1], SPIN * place[0], 0.0), (-(SPIN**2) * place[0], -(SPIN**2) * place[1], 0.0))
    seen = Moving(*(subtract(there, here) for there, here in zip(station, craft, strict=True)))
    in_view = less(params.least * norm(seen.value), -dot(up, seen.value))
    pairs = zip(seen, opposite_of(craft), strict=True)
    ahead: Any = [tuple(where(in_view, x, y) for x, y in zip(*pair, strict=True)) for pair in pairs]
    against = scale(-1.0, cross(state.position, state.velocity))
    return aligned(Moving(*ahead), Moving(against, ZERO, ZERO), params.axes, before)


def motion(params: Params, orbit: Orbit) -> Motion:
    """Bounds between its jumps: those of the orbital frame, and of the line to the station, of which the lowest craft are
    nearest. It is no farther from the orbit's plane than the angle at the craft between station and centre."""
    place, _ = geodetic(params.latitude, params.longitude, params.height)
    lowest = min(0.5 * math.pi - params.elevation + LEANING, 0.5 * math.pi)
    normal = Turning(orbit.off_rate, orbit.off_acceleration, orbit.off_rate, orbit.off_acceleration)
    most: tuple[float, ...] = orbit.rate, orbit.acceleration, orbit.off_rate, orbit.off_acceleration
    for seen in lines_of_sight(orbit, params.gravity, norm(place), lowest, SPIN):
        if not seen.distance > 0.0:
            return UNLIMITED
        for pair in seen.sides():
            most = tuple(map(max, most, bounded(pair[0], normal, pair[1])))
    return Motion(*most[:4], jumps=True)


def examples() -> list[Params]:
    """A station below the orbits that checks fly, and one out of sight with other axes."""
    below = Params(0.0, 0.0, 100.0, 0.1, epoch=(2026.0, 1.0, 1.0, 17.0, 16.0, 0.0))
    return [below, Params(1.0, 2.0, 0.0, 0.2, (1.0, 0.0, 0.0), (0.0, 1.0, 1.0))]
