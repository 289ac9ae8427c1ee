"""Sensors as built: misaligned, with scale-factor errors and non-orthogonal axes, quantised and saturating, delayed and
with sampling jitter. An error that is not declared does not change a sensor's equations."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from starhold.algebra.circular import nearest
from starhold.algebra.cosines import from_quaternion
from starhold.algebra.quaternion import Quaternion, normalise, to_reference
from starhold.algebra.scalar import Scalar
from starhold.algebra.several import each
from starhold.algebra.structure import leaves
from starhold.algebra.vector import IDENTITY, Matrix, Vector, add, apply, clip_axes, diagonal, multiply, scale
from starhold.parts.contract import DEVIATIONS, NoMemory, Parameter
from starhold.parts.random import Dice

Turn: TypeAlias = Quaternion | tuple[()]
Axes: TypeAlias = Matrix | tuple[()]
Step: TypeAlias = tuple[Scalar, ...]
MOUNTING = Parameter(
    "rad",
    shape=(3,),
    spread=False,
    at_least=-0.5,
    at_most=0.5,
    text="misalignment: small turn about the body axes that law and filter do not know",
)
"""The declaration of a mounting error, common to all parts."""
AXES = Parameter(
    shape=(3, 3),
    plain=(0.5, "ppm"),
    text="errors of its axes: scale-factor errors on the diagonal, non-orthogonality off it",
)
"""The declaration of errors of a sensor's axes, common to all sensors."""
JITTER = Parameter(
    "s", at_least=0.0, plain=(10.0, "ms"), text="deviation of the instant at which it is read from the control instant"
)
"""The declaration of sampling jitter, common to all sensors."""
DELAY = Parameter(
    "s", at_least=0.0, plain=(60.0, "ms"), text="dead time: from the instant at which it is read to its reading"
)
"""The declaration of dead time, common to all sensors."""
LONGEST = 64
"""The longest dead time, in control periods."""
ALMOST = 1e-9
"""A dead time this near to a multiple of the control period, in control periods, is rounded to it."""


def resolution(unit: str) -> Parameter:
    """Return the declaration of a sensor's resolution."""
    return Parameter(unit, at_least=0.0, text="resolution (step between readings) on an axis; none if 0")


def limit(unit: str) -> Parameter:
    """Return the declaration of a sensor's range on an axis."""
    return Parameter(unit, above=0.0, text="largest reading on an axis; none if absent")


def is_given(*numbers: Any) -> bool:
    """Return whether any of these is nonzero; a recorded number counts as nonzero, because runs may draw it."""
    return any(not isinstance(number, float | int) or number for number in leaves(numbers))


def turn_of(mounting: Vector) -> Turn:
    """Return the rotation from the body axes to those of the mounting, () for none."""
    return normalise((1.0, *scale(0.5, mounting))) if is_given(mounting) else ()


def axes_of(mounting: Vector, errors: Matrix | Vector) -> Axes:
    """Return the matrix from body axes to the actual axes of a sensor, () if they are the same."""
    turn = turn_of(mounting)
    if not turn and not is_given(errors):
        return ()
    rows = errors if isinstance(errors[0], tuple) else diagonal(errors)  # pyright: ignore[reportArgumentType]
    skewed: Matrix = tuple(map(add, IDENTITY, rows))  # pyright: ignore[reportAssignmentType, reportArgumentType]
    return multiply(skewed, from_quaternion(turn)) if turn else skewed


def along(axes: Axes, vector: Vector) -> Vector:
    """Return the components of a vector along the actual axes of a sensor."""
    return apply(axes, vector) if axes else vector


def in_body(turn: Turn, vector: Vector) -> Vector:
    """Return a vector given in the axes of a mounting in body axes."""
    return to_reference(turn, vector) if turn else vector


def step_of(size: float) -> Step:
    """Return the step in the form that equations take, () for none."""
    return (size,) if is_given(size) else ()


def shown(vector: Vector, step: Step, most: Scalar) -> Vector:
    """Return a vector quantised, and clipped to a limit on each axis."""
    if step:
        x, y, z = each(partial(_in_steps, step[0]), (vector,))
        vector = (x, y, z)
    return clip_axes(vector, most)


def _in_steps(step: Scalar, x: Scalar) -> Scalar:
    return step * nearest(x / step)


class Timing(NamedTuple):
    """The delay of a sensor in whole control periods, which are a constant of a kernel, and a fraction of one more; and its
    sampling jitter in control periods, () for none."""

    periods: int
    share: Step
    jitter: Step = ()


PLACE = ("attitude", "position")
"""The fields of the state on which readings of directions depend."""
Late: TypeAlias = Timing | tuple[()]


class Waiting(NamedTuple):
    """The memory of a sensor, and the states it saw at earlier control steps, the newest first."""

    sensor: Any
    seen: tuple[tuple[Any, ...], ...]


def late_by(delay: float, period: float, jitter: float = 0.0) -> Late:
    """Return dead time and jitter of a sensor, () for neither. Raise ValueError for a dead time that is too long."""
    if delay > LONGEST * period:
        raise ValueError(f"the delay must be at most {LONGEST} control periods, {LONGEST * period:g} s")
    steps = delay / period
    whole = math.floor(steps + ALMOST)
    share = steps - whole
    late = Timing(whole, step_of(share if share > ALMOST else 0.0), step_of(jitter / period))
    return late if any(late) else ()


def behind(delay: float) -> float:
    """Return how far back (s) the motion counts in proportion to which a delayed reading has errors.
    An attitude that is interpolated may be further back than in proportion to time: by less than a fortieth, where the body
    turns by no more than 2 rad in a period."""
    return 1.025 * delay


def latest(delay: float, jitter: float) -> float:
    """Return the longest time (s) from the instant at which a sensor is read, or to it, and the instant of the reading. One
    that lies outside the control period of the dead time is extrapolated, which is nearer than in proportion to time."""
    return delay + DEVIATIONS * jitter


def awaited(sensor: Any, late: Late, state: Any, names: Sequence[str]) -> Any:
    """Return the initial memory of a delayed sensor, with the sensor's own: before the start these fields were constant."""
    count = late.periods + bool(late.share or late.jitter) if late else 0
    return Waiting(sensor, (tuple(getattr(state, name) for name in names),) * count) if late else sensor


def see_start(params: Any, state: Any) -> Any:
    """Return the initial memory of a sensor of directions without memory of its own: the initial state if it is delayed."""
    return awaited(NoMemory(), params.late, state, PLACE)


def arrived(state: Any, memory: Any, late: Late, names: Sequence[str], dice: Dice, place: int) -> tuple[Any, Any, Any]:
    """Return the state with these fields as they were at the sampling instant, interpolated linearly between control steps;
    the sensor's own memory; and the states seen, for `kept`."""
    if not late:
        return state, memory, ()
    now = tuple(getattr(state, name) for name in names)
    seen = (now, *memory.seen)
    values = seen[late.periods]
    if late.share or late.jitter:
        moved = [*late.share, *(j * dice.normals(place, 1)[0] for j in late.jitter)]
        share = moved[0] if len(moved) == 1 else moved[0] + moved[1]
        pairs = zip(values, seen[late.periods + 1], strict=True)
        values = tuple(tuple(a + share * (b - a) for a, b in zip(*pair, strict=True)) for pair in pairs)
    then = dict(zip(names, values, strict=True))
    if "attitude" in then:
        then["attitude"] = normalise(then["attitude"])
    return state._replace(**then), memory.sensor, seen[: len(memory.seen)]


def kept(sensor: Any, seen: Any) -> Any:
    """Return a sensor's memory for the next control step, which includes this reading."""
    return Waiting(sensor, seen) if seen else sensor


def stretch(axes: Axes) -> float:
    """Return the largest relative change of a vector by the errors of the axes."""
    return float(np.linalg.norm(np.array(axes) - np.eye(3), 2)) if axes else 0.0


def off_step(size: float) -> float:
    """Return the largest error, in norm, of three quantised components."""
    return 0.5 * math.sqrt(3.0) * size
