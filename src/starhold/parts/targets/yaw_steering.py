"""A body axis points at the Earth's centre, and the body turns about it so that another faces the Sun."""

from __future__ import annotations

from math import asin
from typing import Annotated, Any, NamedTuple

from starhold.algebra.quaternion import Quaternion
from starhold.algebra.scalar import Scalar
from starhold.algebra.vector import Matrix, Vector, dot
from starhold.algebra.words import number_of
from starhold.parts import sun
from starhold.parts.contract import Card, Motion, Orbit
from starhold.parts.craft import EARTH
from starhold.parts.ephemeris import EPHEMERIS
from starhold.parts.epoch import DAY, EPOCH, START, Date
from starhold.parts.roles import Goal
from starhold.parts.targets.alignment import (
    AXIS,
    GRAVITY,
    OTHER,
    Turning,
    aligned,
    body_axes,
    bounded,
    nadir,
    opposite_of,
    orbiting,
    towards_sun,
)

CARD = Card(
    title="Yaw steering",
    summary="a body axis to the centre of attraction, another as near as it can to the Sun",
    sources=(*sun.SOURCES, "GNSS satellite geometry and attitude models (2015)"),
    assumptions=(
        *sun.ASSUMPTIONS,
        "two-body motion",
        "the Sun is off the line through craft and Earth: near that line the yaw rate is unbounded",
    ),
)
ROLE = "target"
NEEDS = ("two-body",)
ABOUT = "Earth"
FOLLOWS = True


class Params(NamedTuple):
    """The body axes to be aligned, their directions, and the epoch."""

    axis: Annotated[Vector, AXIS] = (0.0, 0.0, 1.0)
    other: Annotated[Vector, OTHER] = (1.0, 0.0, 0.0)
    epoch: Annotated[Date, EPOCH] = START
    gravity: Annotated[float, GRAVITY] = EARTH
    ephemeris: Annotated[int, EPHEMERIS] = 0


class Numbers(NamedTuple):
    """The triad of the body axes, the Sun, the gravitational parameter (m3/s2), and the control period (s)."""

    axes: Matrix
    sun: sun.Numbers
    gravity: Scalar
    period: Scalar


def prepare(params: Params, period: float) -> Numbers:
    """The numbers of a flight. ValueError for axes that leave the attitude open, and for an epoch that is no date."""
    light = sun.prepared(params.epoch, params.ephemeris)
    return Numbers(body_axes(params.axis, params.other), light, params.gravity, period)


def goal(params: Numbers, state: Any, step: int, before: Quaternion) -> Goal:
    """The attitude at this control step."""
    down = opposite_of(orbiting(state.position, state.velocity, params.gravity))
    return aligned(down, towards_sun(number_of(step) * params.period, params.sun), params.axes, before)


def motion(params: Params, orbit: Orbit) -> Motion:
    """Bounds for the first day, by the angle of the Sun to the plane of the orbit; infinite where the Sun may come into it,
    as it does in every year."""
    high = asin(min(1.0, abs(dot(orbit.normal, sun.sun(0.0, sun.prepared(params.epoch, params.ephemeris)).direction))))
    least = high - (sun.FASTEST + orbit.off_rate) * DAY
    slow, most = Turning(sun.FASTEST, sun.QUICKENING), Motion(0.0, 0.0)[:4]
    for down, sine in nadir(orbit, max(least, 0.0)):
        most = tuple(map(max, most, bounded(down, slow, sine)[:4]))
    return Motion(*most[:4], until=DAY)


def examples() -> list[Params]:
    """The usual axes, and others at another time."""
    return [Params(), Params((0.0, -1.0, 0.0), (0.0, 0.0, 1.0), (2027.0, 6.0, 21.0, 12.0, 30.0, 15.0))]
