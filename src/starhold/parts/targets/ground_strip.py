"""A body axis points at a place that moves along a strip on the ground, from one end to the other in a given time."""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from starhold.algebra.circular import cosine_sine
from starhold.algebra.quaternion import Quaternion
from starhold.algebra.scalar import Scalar, both, less, less_equal, maximum, minimum, sqrt, where
from starhold.algebra.vector import ZERO, Matrix, Vector, add, cross, dot, norm, scale, subtract, unit
from starhold.algebra.words import number_of
from starhold.parts.contract import UNLIMITED, Card, Motion, Orbit, Parameter
from starhold.parts.craft import EARTH
from starhold.parts.epoch import EPOCH, START, Date, days_of, sidereal, spun, turned
from starhold.parts.roles import Goal
from starhold.parts.targets.alignment import (
    AXIS,
    GRAVITY,
    POLAR,
    RADIUS,
    SPIN,
    Moving,
    Turning,
    aligned,
    body_axes,
    bounded,
    geodetic,
    lines_of_sight,
    orbiting,
)

CARD = Card(
    title="Ground strip",
    summary="a body axis at a place that moves along the great circle between two, another along the strip's normal",
    sources=("Fundamentals of Astrodynamics and Applications (2013): sites on the ellipsoid of WGS 84",),
    assumptions=(
        "two-body motion",
        "inertial axes of the equator and equinox of date, without the motion of the pole",
        "the place stands at the first end before it begins to move and at the second one afterwards",
        "in view or not",
    ),
)
ROLE = "target"
NEEDS = ("two-body",)
ABOUT = "Earth"
FOLLOWS = True
LATITUDE = Parameter("rad", at_least=-0.5 * math.pi, at_most=0.5 * math.pi, text="geodetic, of an end of the strip")
LONGITUDE = Parameter("rad", at_least=-math.pi, at_most=math.tau, text="of this end, to the east")


class Params(NamedTuple):
    """The ends of the strip, when the place moves from the first to the second, the body axes, and the epoch."""

    latitude: Annotated[float, LATITUDE]
    longitude: Annotated[float, LONGITUDE]
    to_latitude: Annotated[float, LATITUDE]
    to_longitude: Annotated[float, LONGITUDE]
    begin: Annotated[
        float, Parameter("s", at_least=0.0, text="when the place begins to move, since the start of the flight")
    ]
    duration: Annotated[float, Parameter("s", above=0.0, text="from one end to the other")]
    axis: Annotated[Vector, AXIS] = (0.0, 0.0, 1.0)
    other: Annotated[
        Vector,
        Parameter("1", shape=(3,), spread=False, text="body axis that points as near as it can to the strip's normal"),
    ] = (0.0, 1.0, 0.0)
    epoch: Annotated[Date, EPOCH] = START
    gravity: Annotated[float, GRAVITY] = EARTH


class Numbers(NamedTuple):
    """In axes of the Earth the directions of the first end, square to it along the strip, and of the normal; when the place
    begins to move (s), for how long (s) and at what rate (rad/s); the triad of the body axes, the turns of the Earth at the
    start, the gravitational parameter (m3/s2), and the control period (s)."""

    end: Vector
    along: Vector
    normal: Vector
    begin: Scalar
    duration: Scalar
    rate: Scalar
    axes: Matrix
    turn: Scalar
    gravity: Scalar
    period: Scalar


def prepare(params: Params, period: float) -> Numbers:
    """The numbers of a flight. ValueError for ends between which no single shortest way leads, for axes that leave the
    attitude open, and for an epoch that is no date."""
    first, last = (unit(geodetic(latitude, longitude, 0.0)[0]) for latitude, longitude in (params[:2], params[2:4]))
    normal = cross(first, last)
    if not norm(normal) > 1e-9:
        raise ValueError("the ends of the strip are one place, or opposite ones")
    angle, normal = math.atan2(norm(normal), dot(first, last)), unit(normal)
    axes, turn = body_axes(params.axis, params.other), sidereal(days_of(params.epoch))
    timing = params.begin, params.duration, angle / params.duration
    return Numbers(first, cross(normal, first), normal, *timing, axes, turn, params.gravity, period)


def goal(params: Numbers, state: Any, step: int, before: Quaternion) -> Goal:
    """The attitude at this control step."""
    time = number_of(step) * params.period
    since = time - params.begin
    moves = both(less_equal(0.0, since), less(since, params.duration))
    rate = where(moves, params.rate, 0.0)
    cosine, sine = cosine_sine(params.rate / math.tau * minimum(maximum(since, 0.0), params.duration))
    direction = add(scale(cosine, params.end), scale(sine, params.along))
    ahead = scale(rate, subtract(scale(cosine, params.along), scale(sine, params.end)))
    place = _on_ground(Moving(direction, ahead, scale(-rate * rate, direction)))
    turning = cosine_sine(turned(params.turn, time))
    craft = orbiting(state.position, state.velocity, params.gravity)
    seen = Moving(*(subtract(a, b) for a, b in zip(_carried(place, *turning), craft, strict=True)))
    normal = _carried(Moving(params.normal, ZERO, ZERO), *turning)
    return aligned(seen, normal, params.axes, before)


def _on_ground(direction: Moving) -> Moving:
    """The place (m) on the ellipsoid in a direction from the Earth's centre, of length one."""
    a, b = 1.0 / RADIUS**2, 1.0 / POLAR**2

    def product(p: Vector, q: Vector) -> Scalar:
        return a * (p[0] * q[0] + p[1] * q[1]) + b * (p[2] * q[2])

    u, v, w = direction
    square, slope = product(u, u), 2.0 * product(u, v)
    bend = 2.0 * (product(v, v) + product(u, w))
    inverse = 1.0 / square
    r = sqrt(inverse)
    r1 = -0.5 * r * inverse * slope
    r2 = r * inverse * (0.75 * inverse * slope * slope - 0.5 * bend)
    second = add(add(scale(r2, u), scale(2.0 * r1, v)), scale(r, w))
    return Moving(scale(r, u), add(scale(r1, u), scale(r, v)), second)


def _carried(fixed: Moving, cosine: Scalar, sine: Scalar) -> Moving:
    """A vector in axes of the Earth as it moves in inertial axes."""
    value, first, second = (spun(vector, cosine, sine) for vector in fixed)
    twice = scale(2.0, first)
    carried = add(first, (-SPIN * value[1], SPIN * value[0], 0.0))
    turning = (-SPIN * twice[1] - SPIN**2 * value[0], SPIN * twice[0] - SPIN**2 * value[1], 0.0)
    return Moving(value, carried, add(second, turning))


def motion(params: Params, orbit: Orbit) -> Motion:
    """Bounds until the strip's end, with a jump as the place begins to move; infinite where the line to it may come along
    the strip's normal. With an angle x between the planes of strip and orbit a craft at r is at most r sin x from that of
    the strip, in which it is at least r cos x from the centre, and the place no more than the Earth's radius."""
    strip = prepare(params, 1.0)
    until = params.begin + params.duration
    normal = spun(strip.normal, *cosine_sine(strip.turn))
    apart = math.acos(min(1.0, abs(dot(normal, orbit.normal)))) + (SPIN + orbit.off_rate) * until
    if not apart < 0.5 * math.pi:
        return UNLIMITED
    off, across = orbit.nearest * math.sin(apart), orbit.nearest * math.cos(apart) - RADIUS
    # The ellipsoid's radius changes by its flattening at most as the direction turns.
    widest, most = math.acos(max(across, 0.0) / math.hypot(across, off)), Motion(0.0, 0.0)[:4]
    for seen in lines_of_sight(orbit, params.gravity, RADIUS, 0.5 * math.pi, 1.01 * strip.rate + SPIN):
        if not seen.distance > 0.0:
            return UNLIMITED
        # From the plane the line is no farther than the craft's vertical and its angle to this one together, or than the
        # craft's distance from the plane tells.
        away = min(widest, apart + math.asin(seen.most), math.asin(min(off / seen.distance, 1.0)))
        sine = math.sin(0.5 * math.pi - away)
        most = tuple(map(max, most, bounded(seen.turning(), Turning(SPIN, SPIN**2), sine)[:4]))
    return Motion(*most[:4], until=until, jumps=params.begin > 0.0)


def examples() -> list[Params]:
    """A strip across the equator, and a short one with other axes."""
    across = Params(-0.1, 0.0, 0.1, 0.05, 5.0, 60.0, epoch=(2026.0, 1.0, 1.0, 17.0, 16.0, 0.0))
    return [across, Params(1.0, 2.0, 1.01, 2.0, 0.0, 20.0, (1.0, 0.0, 0.0), (0.0, 1.0, 1.0))]
