"""A Sun sensor: the Sun's direction, if it is in the field of view and the Earth does not hide it."""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from starhold.algebra.quantity import Quantity
from starhold.algebra.quaternion import to_body
from starhold.algebra.scalar import Scalar, both, less, less_equal, opposite, where
from starhold.algebra.vector import ZERO, Vector, add, dot, unit
from starhold.algebra.words import number_of
from starhold.parts import as_built, sun
from starhold.parts.boresight import BORESIGHT, THIRD, field_cosine, unit_boresight
from starhold.parts.contract import Card, Direction, Parameter, Sky
from starhold.parts.ephemeris import EPHEMERIS
from starhold.parts.epoch import EPOCH, START, Date
from starhold.parts.outage import INTERVAL, NEVER, OUTAGE, Silence, Window, in_steps, is_out, steps_of
from starhold.parts.random import Dice

CARD = Card(
    title="Sun sensor",
    summary="s_m = unit(s + noise) where s is within half_angle of the boresight and half of the Sun is in view, else 0",
    sources=(*sun.SOURCES, "Fundamentals of Spacecraft Attitude Determination and Control (2014)"),
    assumptions=(*sun.ASSUMPTIONS, sun.SHADOW, "no light from the Earth", "white noise from control step to control step"),
)
ROLE = "sensor"
NEEDS = ("two-body",)
ABOUT = "Earth"
FIRST = {"sun": ZERO, "sun_is_seen": 0.0}


class Params(NamedTuple):
    """The errors of the sensor, its boresight, and the epoch."""

    noise: Annotated[float, Parameter("rad", at_least=0.0, text="standard deviation about each axis")] = 0.0
    boresight: Annotated[Vector, BORESIGHT] = THIRD
    half_angle: Annotated[
        float, Parameter("rad", above=0.0, at_most=math.pi, text="of the field of view; half a turn sees all")
    ] = math.pi
    epoch: Annotated[Date, EPOCH] = START
    outage: Annotated[Window, OUTAGE] = NEVER
    mounting_error: Annotated[Vector, as_built.MOUNTING] = ZERO
    jitter: Annotated[float, as_built.JITTER] = 0.0
    delay: Annotated[float, as_built.DELAY] = 0.0
    ephemeris: Annotated[int, EPHEMERIS] = 0
    interval: Annotated[float, INTERVAL] = 0.0


class Numbers(NamedTuple):
    """The standard deviation (rad), the unit vector of the boresight, the cosine of the field of view's half angle, the
    Sun, the control period (s), and outage and interval (control steps); its axes, () for none, and the delay."""

    noise: Scalar
    boresight: Vector
    cosine: Scalar
    sun: sun.Numbers
    period: Scalar
    outage: Silence
    axes: as_built.Axes = ()
    late: as_built.Late = ()


class Reading(NamedTuple):
    """The measured direction, zero if it does not see the Sun."""

    sun: Annotated[Vector, Quantity("1", "direction as measured, 0 if unseen, body axes", "axis")]
    sun_is_seen: Annotated[float, Quantity("1", "1 where the sensor sees the Sun, else 0")]


def prepare(params: Params, period: float) -> Numbers:
    """Return the numbers of a flight. Raise ValueError for a boresight without direction, a bad epoch, a bad outage and too
    long a delay."""
    cosine = field_cosine(params.half_angle)
    outage = in_steps(params.outage, period, params.interval)
    axes = as_built.axes_of(params.mounting_error, ZERO)
    boresight = unit_boresight(params.boresight)
    return Numbers(
        params.noise,
        boresight,
        cosine,
        sun.prepared(params.epoch, params.ephemeris),
        period,
        outage,
        axes,
        as_built.late_by(params.delay, period, params.jitter),
    )


remember = as_built.see_start


def measure(state: Any, memory: Any, params: Numbers, dice: Dice, step: int) -> tuple[Reading, Any]:
    """Return the Sun's direction at this control step, and the memory."""
    state, memory, waiting = as_built.arrived(state, memory, params.late, as_built.PLACE, dice, 3)
    seen = sun.sun(number_of(step) * params.period, params.sun)
    toward = as_built.along(params.axes, to_body(state.attitude, seen.direction))
    inside = less_equal(params.cosine, dot(toward, params.boresight))
    lit = less(0.5, sun.in_view(state.position, seen))
    visible = both(both(inside, lit), opposite(is_out(step, params.outage)))
    # Noise along the direction itself has no effect.
    shown = unit(add(toward, dice.vector(0, params.noise)))
    reading: Any = tuple(where(visible, x, 0.0) for x in shown)
    return Reading(reading, where(visible, 1.0, 0.0)), as_built.kept(memory, waiting)


def direction(params: Params, period: float, sky: Sky) -> Direction:
    """Return the mounting error and the noise of a direction that is seen; no bound with jitter."""
    error = math.inf if as_built.is_given(params.jitter) else as_built.stretch(as_built.axes_of(params.mounting_error, ZERO))
    return Direction("sun", error, params.noise, params.delay, int(steps_of(params.interval, period)))


def examples() -> list[Params]:
    """Return a fine one, and one without noise that sees all directions and is misaligned."""
    return [
        Params(math.radians(0.1), (1.0, 0.0, 1.0), math.radians(60.0)),
        Params(epoch=(2027.0, 6.0, 21.0, 12.0, 30.0, 15.0), mounting_error=(0.01, 0.0, -0.02)),
    ]
