"""Coarse Sun sensors: photodiodes on faces of the craft, whose currents give the Sun's direction by the cosine law."""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple, TypeAlias

from starhold.algebra.quantity import Quantity
from starhold.algebra.quaternion import to_body
from starhold.algebra.scalar import Scalar, both, divide, less, maximum, opposite, where
from starhold.algebra.several import each, weighted
from starhold.algebra.vector import (
    ZERO,
    Matrix,
    Vector,
    along_axis,
    apply,
    combine,
    diagonal,
    dot,
    inverse,
    norm,
    scale,
    unit,
)
from starhold.algebra.words import number_of
from starhold.parts import as_built, sun
from starhold.parts.contract import Card, Parameter
from starhold.parts.ephemeris import EPHEMERIS
from starhold.parts.epoch import EPOCH, START, Date
from starhold.parts.outage import INTERVAL, NEVER, OUTAGE, Silence, Window, in_steps, is_out
from starhold.parts.random import RANGE, Dice

CARD = Card(
    title="Coarse Sun sensors",
    summary="I_i = max(n_i.s, 0) + albedo max(-n_i.r, 0) max(r.s, 0) + noise; s_m by least squares with weights I_i",
    sources=(*sun.SOURCES, "Fundamentals of Spacecraft Attitude Determination and Control (2014): cosine detectors"),
    assumptions=(
        *sun.ASSUMPTIONS,
        sun.SHADOW,
        "the Earth's light comes from its centre, at most `albedo` of the Sun's: a bound of what is scattered",
        "currents are shares of that of a diode that faces the Sun; noise is white from control step to control step",
        "faces do not shade one another",
    ),
)
ROLE = "sensor"
NEEDS = ("two-body",)
ABOUT = "Earth"
FIRST = {"sun": ZERO, "sun_is_seen": 0.0}
Row: TypeAlias = tuple[float, float, float]
CUBE: tuple[Row, ...] = (
    (1.0, 0.0, 0.0),
    (-1.0, 0.0, 0.0),
    (0.0, 1.0, 0.0),
    (0.0, -1.0, 0.0),
    (0.0, 0.0, 1.0),
    (0.0, 0.0, -1.0),
)
MOST = RANGE - 1
"""Most diodes: their random numbers leave one for the jitter."""
FAINT = 1e-6
"""Regularisation weight that draws undetermined components to zero."""


class Params(NamedTuple):
    """The faces with a diode each, the errors of the currents, and the epoch."""

    faces: Annotated[
        tuple[Row, ...], Parameter("1, 1, 1", columns=("x", "y", "z"), text="a row for each diode: its normal, body axes")
    ] = CUBE
    noise: Annotated[float, Parameter("1", at_least=0.0, text="standard deviation of a current")] = 0.0
    albedo: Annotated[float, Parameter("1", at_least=0.0, at_most=1.0, text="the Earth's light below the Sun")] = 0.0
    threshold: Annotated[
        float, Parameter("1", at_least=0.0, at_most=1.0, text="current below which a diode counts as dark")
    ] = 0.05
    epoch: Annotated[Date, EPOCH] = START
    outage: Annotated[Window, OUTAGE] = NEVER
    mounting_error: Annotated[Vector, as_built.MOUNTING] = ZERO
    ephemeris: Annotated[int, EPHEMERIS] = 0
    jitter: Annotated[float, as_built.JITTER] = 0.0
    delay: Annotated[float, as_built.DELAY] = 0.0
    interval: Annotated[float, INTERVAL] = 0.0


class Numbers(NamedTuple):
    """Unit normals as assumed by flight software; standard deviation, albedo and threshold; the Sun, the control period
    (s), outage and interval (control steps); the axes of the mounting, () for none, and the delay."""

    normals: tuple[Vector, ...]
    noise: Scalar
    albedo: Scalar
    threshold: Scalar
    sun: sun.Numbers
    period: Scalar
    outage: Silence
    axes: as_built.Axes
    late: as_built.Late = ()


class Reading(NamedTuple):
    """The direction from the currents, zero if all diodes are dark."""

    sun: Annotated[Vector, Quantity("1", "direction from the currents, 0 if unseen, body axes", "axis")]
    sun_is_seen: Annotated[float, Quantity("1", "1 where a diode is lit, else 0")]


def prepare(params: Params, period: float) -> Numbers:
    """Return the numbers of a flight. Raise ValueError for faces without direction, too many faces, a bad epoch, a bad
    outage and too long a delay."""
    if not 0 < len(params.faces) <= MOST:
        raise ValueError(f"from 1 to {MOST} diodes are taken, not {len(params.faces)}")
    if not all(math.hypot(*face) > 0.0 for face in params.faces):
        raise ValueError("each diode needs a normal with a direction")
    normals = tuple(scale(1.0 / math.hypot(*face), face) for face in params.faces)
    outage, axes = in_steps(params.outage, period, params.interval), as_built.axes_of(params.mounting_error, ZERO)
    shares = params.noise, params.albedo, params.threshold
    late = as_built.late_by(params.delay, period, params.jitter)
    return Numbers(normals, *shares, sun.prepared(params.epoch, params.ephemeris), period, outage, axes, late)


remember = as_built.see_start


def measure(state: Any, memory: Any, params: Numbers, dice: Dice, step: int) -> tuple[Reading, Any]:
    """Return the direction from the currents of this control step, and the memory."""
    state, memory, waiting = as_built.arrived(state, memory, params.late, as_built.PLACE, dice, MOST)
    seen = sun.sun(number_of(step) * params.period, params.sun)
    up = unit(state.position)
    light = sun.in_view(state.position, seen)
    below = params.albedo * maximum(dot(up, seen.direction), 0.0)
    toward, down = (as_built.along(params.axes, to_body(state.attitude, v)) for v in (seen.direction, scale(-1.0, up)))
    noises = dice.normals(0, len(params.normals))
    currents = each(_current, (params.normals, noises), toward, light, down, below, params.noise)
    weights = each(_weight, (currents,), params.threshold)
    gram: Matrix = diagonal((FAINT, FAINT, FAINT))
    for weight, face in zip(weights, params.normals, strict=True):
        gram = combine(1.0, gram, weight, along_axis(face, 1.0, 0.0))
    flowing = tuple(weight * current for weight, current in zip(weights, currents, strict=True))
    direction = apply(inverse(gram), weighted(flowing, params.normals))
    length = norm(direction)
    visible = both(less(params.threshold, length), opposite(is_out(step, params.outage)))
    shown: Any = tuple(where(visible, divide(x, length), 0.0) for x in direction)
    return Reading(shown, where(visible, 1.0, 0.0)), as_built.kept(memory, waiting)


def _current(
    face: Vector, noise: Scalar, toward: Vector, light: Scalar, down: Vector, below: Scalar, deviation: Scalar
) -> Scalar:
    direct, scattered = light * maximum(dot(face, toward), 0.0), below * maximum(dot(face, down), 0.0)
    return direct + scattered + deviation * noise


def _weight(current: Scalar, threshold: Scalar) -> Scalar:
    """Return a diode's weight, in proportion to its current, so that the Earth's light on the far side hardly matters."""
    return where(less(threshold, current), current, 0.0)


def examples() -> list[Params]:
    """Return diodes on a cube with the Earth's light, and on a pyramid of four without noise."""
    pyramid = tuple((x, y, 1.0) for x in (1.0, -1.0) for y in (1.0, -1.0))
    return [Params(CUBE, 0.01, 0.3), Params(pyramid, threshold=0.02, mounting_error=(0.0, 0.01, 0.0))]
