"""A torque over time from a table, as of plume impingement, a release, or a disturbance from telemetry."""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple, TypeAlias, cast

import numpy as np

from starhold.algebra.quaternion import to_body
from starhold.algebra.scalar import both, less, less_equal, where
from starhold.algebra.structured import Buffer, repeat
from starhold.algebra.vector import ZERO, Vector, add, scale, subtract
from starhold.algebra.words import number_of
from starhold.parts.contract import Card, Envelope, Parameter, Push
from starhold.parts.craft import Craft
from starhold.parts.random import Dice

CARD = Card(
    title="Torque from a table",
    summary="M(t) along straight lines between the rows of a table, none before the first and after the last",
    sources=("definition",),
    assumptions=("unknown to all laws", "held for a control period at its value at the start"),
)
ROLE = "environment"
Row: TypeAlias = tuple[float, float, float, float]


class Params(NamedTuple):
    """The rows, and their axes."""

    table: Annotated[
        tuple[Row, ...],
        Parameter("s, N m, N m, N m", columns=("time", "x", "y", "z"), text="times, increasing, and torques"),
    ]
    axes: Annotated[int, Parameter(choices=("body", "inertial"), text="in which x, y and z are given")] = 0


class Numbers(NamedTuple):
    """The rows in memory, the control period (s), and which axes."""

    rows: Buffer
    period: float
    axes: int


def prepare(params: Params, period: float) -> Numbers:
    """Return the table as kernels read it. Raise ValueError if its times do not increase, or it has fewer than two rows."""
    times = np.array([row[0] for row in params.table])
    if len(times) < 2 or not (np.diff(times) > 0.0).all():
        raise ValueError("the table needs at least two rows, with times that increase")
    return Numbers(Buffer([x for row in params.table for x in row]), period, params.axes)


def remember(params: Numbers) -> Vector:
    """Return the initial memory, without torque."""
    return ZERO


def update(memory: Vector, state: Any, params: Numbers, dice: Dice, step: int) -> Vector:
    """Return the torque at the start of the control step, in the table's axes (N m)."""
    time = number_of(step) * params.period

    def piece(k: Any, value: Vector) -> tuple[Vector]:
        (begin, *first), (end, *last) = params.rows.row(k, 4), params.rows.row(k + 1, 4)
        share = (time - begin) / (end - begin)
        start, stop = cast(Vector, tuple(first)), cast(Vector, tuple(last))
        here = add(start, scale(share, subtract(stop, start)))
        inside = both(less_equal(begin, time), less(time, end))
        return (tuple(where(inside, x, y) for x, y in zip(here, value, strict=True)),)  # type: ignore[return-value]

    return repeat(params.rows.size // 4 - 1, piece, ZERO)[0]


def torque(state: Any, params: Numbers, craft: Craft, memory: Vector) -> Vector:
    """Return the torque on the body (N m, body axes)."""
    return to_body(state.attitude, memory) if params.axes else memory


def bound(params: Params, envelope: Envelope) -> Push:
    """Return the largest norm of the torque: along a straight line it is largest at an end."""
    return Push(max(math.hypot(*row[1:]) for row in params.table))


def examples() -> list[Params]:
    """Return a push of two seconds, in body and in inertial axes."""
    rows = ((1.0, 0.0, 0.0, 0.0), (2.0, 1e-4, 0.0, -5e-5), (3.0, 0.0, 0.0, 0.0))
    return [Params(rows), Params(rows, 1)]
