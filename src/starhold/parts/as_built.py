"""Sensors as they are built: mounted a little otherwise than law and filter take them, with axes of another scale that are
not at right angles, in steps and within limits, read late and a little off the control instant. What is not asked for leaves
a sensor's equations as they are."""

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
from starhold.parts.contract import NoMemory, Parameter
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
    text="small turn about the body axes by which it is mounted otherwise than law and filter take it",
)
"""The declaration of a mounting error, common to all parts."""
AXES = Parameter(
    shape=(3, 3),
    plain=(0.5, "ppm"),
    text="errors of its axes: of their scales on the diagonal, beside it those of non-orthogonal ones",
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
"""Control periods that a dead time may last."""
ALMOST = 1e-9
"""A dead time is rounded to a multiple of the control period if it is this near to one, in control periods."""


def resolution(unit: str) -> Parameter:
    """The declaration of the step of what a sensor shows."""
    return Parameter(unit, at_least=0.0, text="step between what it can show on an axis; none if 0")


def limit(unit: str) -> Parameter:
    """The declaration of the most that a sensor shows on an axis."""
    return Parameter(unit, above=0.0, text="most that it shows on an axis; none if absent")


def is_given(*numbers: Any) -> bool:
    """Whether any of these is nonzero; a number that is being recorded counts as nonzero, because runs may draw it."""
    return any(not isinstance(number, float | int) or number for number in leaves(numbers))


def turn_of(mounting: Vector) -> Turn:
    """The turn from the body axes to those of the mounting, () for none."""
    return normalise((1.0, *scale(0.5, mounting))) if is_given(mounting) else ()


def axes_of(mounting: Vector, errors: Matrix | Vector) -> Axes:
    """The matrix from body axes to the axes of a sensor as they are, () for the same."""
    turn = turn_of(mounting)
    if not turn and not is_given(errors):
        return ()
    rows = errors if isinstance(errors[0], tuple) else diagonal(errors)  # pyright: ignore[reportArgumentType]
    skewed: Matrix = tuple(map(add, IDENTITY, rows))  # pyright: ignore[reportAssignmentType, reportArgumentType]
    return multiply(skewed, from_quaternion(turn)) if turn else skewed


def along(axes: Axes, vector: Vector) -> Vector:
    """The components of a vector along the actual axes of a sensor."""
    return apply(axes, vector) if axes else vector


def in_body(turn: Turn, vector: Vector) -> Vector:
    """A vector along the axes of a mounting in body axes."""
    return to_reference(turn, vector) if turn else vector


def step_of(size: float) -> Step:
    """The step as equations take it, () for none."""
    return (size,) if is_given(size) else ()


def shown(vector: Vector, step: Step, most: Scalar) -> Vector:
    """A vector in steps, and within a limit of each axis."""
    if step:
        x, y, z = each(partial(_in_steps, step[0]), (vector,))
        vector = (x, y, z)
    return clip_axes(vector, most)


def _in_steps(step: Scalar, x: Scalar) -> Scalar:
    return step * nearest(x / step)


class Timing(NamedTuple):
    """How late a sensor shows a state: whole control periods, a constant of a kernel, and the share of one more; and the
    jitter of its instants in control periods; () for none."""

    periods: int
    share: Step
    jitter: Step = ()


PLACE = ("attitude", "position")
"""Sensors of directions show these fields of the state."""
Late: TypeAlias = Timing | tuple[()]


class Waiting(NamedTuple):
    """The memory of a sensor, and what it saw at earlier control steps, the newest first."""

    sensor: Any
    seen: tuple[tuple[Any, ...], ...]


def late_by(delay: float, period: float, jitter: float = 0.0) -> Late:
    """The dead time and the jitter of a sensor, () for neither. ValueError for a dead time that is too long."""
    if delay > LONGEST * period:
        raise ValueError(f"the delay must be at most {LONGEST} control periods, {LONGEST * period:g} s")
    steps = delay / period
    whole = math.floor(steps + ALMOST)
    share = steps - whole
    late = Timing(whole, step_of(share if share > ALMOST else 0.0), step_of(jitter / period))
    return late if any(late) else ()


def awaited(sensor: Any, late: Late, state: Any, names: Sequence[str]) -> Any:
    """The memory at the start, with that of a sensor itself: these fields of the state were always what they are then."""
    count = late.periods + bool(late.share or late.jitter) if late else 0
    return Waiting(sensor, (tuple(getattr(state, name) for name in names),) * count) if late else sensor


def see_start(params: Any, state: Any) -> Any:
    """The memory at the start of a sensor that remembers nothing itself and looks at the craft's place: the state where it
    is late."""
    return awaited(NoMemory(), params.late, state, PLACE)


def arrived(state: Any, memory: Any, late: Late, names: Sequence[str], dice: Dice, place: int) -> tuple[Any, Any, Any]:
    """The state with these fields as they were when the sensor was read, which change along a straight line between control
    steps; the memory of the sensor itself; and what it has seen, for `kept`."""
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
    """A sensor's memory for the next control step, which includes this reading."""
    return Waiting(sensor, seen) if seen else sensor


def stretch(axes: Axes) -> float:
    """The most by which the axes change a vector, as a share of it."""
    return float(np.linalg.norm(np.array(axes) - np.eye(3), 2)) if axes else 0.0


def off_step(size: float) -> float:
    """The largest error, in norm, of three components in steps."""
    return 0.5 * math.sqrt(3.0) * size
