"""An Earth horizon sensor: the direction of the Earth's centre, from the limb within its field of view."""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from starhold.algebra.quantity import Quantity
from starhold.algebra.quaternion import to_body
from starhold.algebra.scalar import Scalar, both, less, maximum, opposite, sqrt, where
from starhold.algebra.vector import ZERO, Vector, add, dot, norm, scale, unit
from starhold.parts import as_built
from starhold.parts.boresight import BORESIGHT, THIRD, field_cosine, unit_boresight
from starhold.parts.contract import Card, Direction, Parameter, Sky
from starhold.parts.orbit import BODIES
from starhold.parts.outage import INTERVAL, NEVER, OUTAGE, Silence, Window, in_steps, is_out, steps_of
from starhold.parts.random import Dice

CARD = Card(
    title="Earth horizon sensor",
    summary="n_m = unit(n + limb_height t / sqrt(r^2 - R^2) + noise) where the limb is in the field of view, else 0",
    sources=("Fundamentals of Spacecraft Attitude Determination and Control (2014): horizon sensors",),
    assumptions=(
        "the limb is that of a sphere, seen in the infrared by day and night",
        "an arc of it is as good as all of it; height that nobody supposes moves the centre along t, to its nearest point",
        "white noise from control step to control step",
    ),
)
ROLE = "sensor"
NEEDS = ("two-body",)
ABOUT = "Earth"
FIRST = {"nadir": ZERO, "nadir_is_seen": 0.0}
RADIUS = BODIES["Earth"].radius
TINY = 1e-30


class Params(NamedTuple):
    """The errors of the sensor, and where it looks."""

    noise: Annotated[float, Parameter("rad", at_least=0.0, text="standard deviation about each axis")] = 0.0
    boresight: Annotated[Vector, BORESIGHT] = THIRD
    half_angle: Annotated[
        float, Parameter("rad", above=0.0, at_most=math.pi, text="of the field of view; half a turn scans all around")
    ] = math.pi
    limb_height: Annotated[float, Parameter("m", text="of the limb above the height that flight software assumes")] = 0.0
    outage: Annotated[Window, OUTAGE] = NEVER
    mounting_error: Annotated[Vector, as_built.MOUNTING] = ZERO
    jitter: Annotated[float, as_built.JITTER] = 0.0
    delay: Annotated[float, as_built.DELAY] = 0.0
    interval: Annotated[float, INTERVAL] = 0.0


class Numbers(NamedTuple):
    """The standard deviation (rad), the unit vector of the boresight, the cosine of the field of view's half angle, the
    limb's height (m), outage and interval (control steps); the axes of the mounting, () for none, and the delay."""

    noise: Scalar
    boresight: Vector
    cosine: Scalar
    height: Scalar
    outage: Silence
    axes: as_built.Axes
    late: as_built.Late = ()


class Reading(NamedTuple):
    """The measured direction, zero if it sees no limb."""

    nadir: Annotated[Vector, Quantity("1", "direction of the Earth's centre, 0 if unseen, body axes", "axis")]
    nadir_is_seen: Annotated[float, Quantity("1", "1 where the sensor sees the limb, else 0")]


def prepare(params: Params, period: float) -> Numbers:
    """Return the numbers of a flight. Raise ValueError for a zero boresight, a bad outage and too long a delay."""
    return Numbers(
        params.noise,
        unit_boresight(params.boresight),
        field_cosine(params.half_angle),
        params.limb_height,
        in_steps(params.outage, period, params.interval),
        as_built.axes_of(params.mounting_error, ZERO),
        as_built.late_by(params.delay, period, params.jitter),
    )


remember = as_built.see_start


def measure(state: Any, memory: Any, params: Numbers, dice: Dice, step: int) -> tuple[Reading, Any]:
    """Return the direction of the Earth's centre at this control step, and the memory."""
    state, memory, waiting = as_built.arrived(state, memory, params.late, as_built.PLACE, dice, 3)
    distance = norm(state.position)
    down = as_built.along(params.axes, to_body(state.attitude, scale(-1.0 / distance, state.position)))
    toward = dot(down, params.boresight)
    beside = add(params.boresight, scale(-toward, down))
    across = sqrt(maximum(dot(beside, beside), TINY))
    # Sine and cosine of the limb's angle from the centre, and the boresight's angle from the limb.
    sine = RADIUS / distance
    cosine = sqrt(maximum(1.0 - sine * sine, TINY))
    within = less(params.cosine, toward * cosine + across * sine)
    visible = both(within, opposite(is_out(step, params.outage)))
    moved = scale(params.height / (distance * cosine * across), beside)
    shown = unit(add(add(down, moved), dice.vector(0, params.noise)))
    reading: Any = tuple(where(visible, x, 0.0) for x in shown)
    return Reading(reading, where(visible, 1.0, 0.0)), as_built.kept(memory, waiting)


def direction(params: Params, period: float, sky: Sky) -> Direction:
    """Return what mounting, the limb's height and a delay of the position do to a direction that is seen, and its noise; no
    bound with jitter, and in an orbit through the Earth."""
    every, square = int(steps_of(params.interval, period)), sky.distance * sky.distance - RADIUS * RADIUS
    if as_built.is_given(params.jitter) or square <= 0.0:
        return Direction("nadir", math.inf, every=every)
    skewed = as_built.stretch(as_built.axes_of(params.mounting_error, ZERO))
    error = skewed + abs(params.limb_height) / math.sqrt(square) + params.delay * sky.speed / sky.distance
    return Direction("nadir", error, params.noise, params.delay, every)


def examples() -> list[Params]:
    """Return one with a narrow field at the limb of low orbits, and one that scans all around."""
    return [
        Params(math.radians(0.2), (0.0, 0.9, 0.45), math.radians(20.0), 5e3),
        Params(outage=(0.5, 1.0), mounting_error=(0.0, 0.01, 0.0)),
    ]
