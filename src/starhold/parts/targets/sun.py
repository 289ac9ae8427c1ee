"""A body axis points at the Sun."""

from __future__ import annotations

from math import atan2, sin
from typing import Annotated, Any, NamedTuple

from starhold.algebra.quaternion import Quaternion
from starhold.algebra.scalar import Scalar
from starhold.algebra.vector import ZERO, Matrix, Vector, norm
from starhold.algebra.words import number_of
from starhold.parts import sun
from starhold.parts.contract import UNLIMITED, Card, Motion, Orbit, Parameter
from starhold.parts.ephemeris import EPHEMERIS
from starhold.parts.epoch import EPOCH, START, Date
from starhold.parts.roles import Goal
from starhold.parts.targets.alignment import AXIS, OTHER, Moving, aligned, body_axes, towards_sun

CARD = Card(
    title="Sun",
    summary="a body axis along the Sun's direction, another as near as it can to a fixed direction",
    sources=sun.SOURCES,
    assumptions=(*sun.ASSUMPTIONS, "in the Earth's shadow too"),
)
ROLE = "target"
ABOUT = "Earth"
FOLLOWS = True


class Params(NamedTuple):
    """The body axes to be aligned, their directions, and the epoch."""

    axis: Annotated[Vector, AXIS] = (0.0, 0.0, 1.0)
    other: Annotated[Vector, OTHER] = (1.0, 0.0, 0.0)
    reference: Annotated[
        Vector,
        Parameter("1", shape=(3,), spread=False, text="the second direction, inertial axes; the Earth's pole if absent"),
    ] = (0.0, 0.0, 1.0)
    epoch: Annotated[Date, EPOCH] = START
    ephemeris: Annotated[int, EPHEMERIS] = 0


class Numbers(NamedTuple):
    """The triad of the body axes, the second direction, the Sun, and the control period (s)."""

    axes: Matrix
    reference: Vector
    sun: sun.Numbers
    period: Scalar


def prepare(params: Params, period: float) -> Numbers:
    """Return the numbers of a flight. Raise ValueError for axes that do not determine the attitude, or a bad epoch."""
    if not norm(params.reference) > 0.0:
        raise ValueError("the reference needs a direction")
    light = sun.prepared(params.epoch, params.ephemeris)
    return Numbers(body_axes(params.axis, params.other), params.reference, light, period)


def goal(params: Numbers, state: Any, step: int, before: Quaternion) -> Goal:
    """Return the goal at this control step."""
    seen = towards_sun(number_of(step) * params.period, params.sun)
    return aligned(seen, Moving(params.reference, ZERO, ZERO), params.axes, before)


def motion(params: Params, orbit: Orbit) -> Motion:
    """Bounds of the rate (rad/s) and the acceleration (rad/s2) of the attitude; infinite for a reference that the Sun may
    come to. At an angle x between them, a motion of the Sun by its rate turns the attitude by no more than it over sin x."""
    across, up = norm((params.reference[0], params.reference[1], 0.0)), params.reference[2]
    # The Sun is nowhere farther from the equator than the ecliptic.
    off = atan2(abs(up), across) - sun.STEEPEST
    if off <= 0.0:
        return UNLIMITED
    sine = sin(off)
    return Motion(sun.FASTEST / sine, 2.0 * sun.QUICKENING / sine + 3.0 * (sun.FASTEST / sine) ** 2)


def examples() -> list[Params]:
    """Return the third axis at the Sun, and an inclined axis at another time."""
    return [Params(), Params((0.0, 1.0, 1.0), (0.0, 0.0, 1.0), (1.0, 2.0, 3.0), (2027.0, 6.0, 21.0, 12.0, 30.0, 15.0))]
