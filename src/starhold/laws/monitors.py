"""Monitors detect failures: each watches a reading or an estimate, and trips when the value is out of range, changes too
fast, is stuck, or differs too much from the estimate."""

from __future__ import annotations

import math
from functools import reduce
from typing import Any, Literal, NamedTuple, TypeAlias, cast

from starhold.algebra.quaternion import half_angle_sine, relative
from starhold.algebra.scalar import Scalar, Truth, absolute, both, either, less, less_equal, minimum, opposite, where
from starhold.algebra.structure import chosen
from starhold.algebra.vector import Vector, norm
from starhold.laws.conditions import Facts, sine_of_half
from starhold.laws.interface import Field, Gain

Kind: TypeAlias = Literal["range", "rate", "stuck", "residual"]
KINDS: dict[Kind, str] = {
    "range": "largest size",
    "rate": "largest change per second, from one value to the next that differs",
    "stuck": "longest time without a change",
    "residual": "largest difference of a new reading from the estimate",
}
"""The kinds of monitors, each with the meaning of its limit."""
TIMES = Gain("1", at_least=1.0, text="how many values in a row, or instants for a range, must be beyond the limit")


class Monitor(NamedTuple):
    """A monitor: its name, its kind, the name of a reading or an estimated quantity, its unit, and the index of the sensor,
    from 0, among those that give the reading (None for an estimate)."""

    name: str
    kind: Kind
    watches: str
    unit: str
    size: int = 1
    """Number of components of the quantity: 4 for an attitude, whose unit is rad."""
    sensor: int | None = 0
    modes: tuple[int, ...] = ()
    """The modes in which it is active, counted from 0; () for all."""

    def fields(self) -> list[Field]:
        """The fields of its numbers under their keys."""
        unit = "s" if self.kind == "stuck" else f"{self.unit}/s" if self.kind == "rate" else self.unit
        limit = Gain(unit.replace("s/s", "s^2"), above=0.0, text=KINDS[self.kind])
        return [Field("limit", limit, True), Field("times", TIMES, False, 1.0)]

    @property
    def at_start(self) -> Guard:
        """The initial memory of the monitor."""
        return Guard(0.0 if self.size == 1 else (0.0,) * self.size, -1.0, 0.0)


class Guard(NamedTuple):
    """The memory of a monitor: the last value, the number of control instants since it changed (-1: no value yet), and the
    number of values in a row beyond the limit."""

    value: Any
    stood: Scalar
    beyond: Scalar


def value_of(monitor: Monitor, now: Facts) -> Any:
    """Return the value that a monitor watches."""
    if monitor.sensor is None:
        return getattr(now.sight.estimate, monitor.watches)
    there = [reading for reading in now.sight.readings if hasattr(reading, monitor.watches)]
    return getattr(there[monitor.sensor], monitor.watches)


def watched(monitor: Monitor, guard: Guard, now: Facts, limit: Scalar, times: Scalar) -> tuple[Truth, Guard]:
    """Return whether a monitor is tripped at this control instant, and its new memory."""
    value, period = value_of(monitor, now), now.measurement.period
    first, changed = less(guard.stood, -0.5), _differ(value, guard.value)
    new, elapsed = either(first, changed), (guard.stood + 1.0) * period
    if monitor.kind == "stuck":
        stood = where(new, 0.0, guard.stood + 1.0)
        return now.later(stood, limit), Guard(chosen(new, value, guard.value), stood, guard.beyond)
    if monitor.kind == "range":
        wrong = less(limit, _size(value))
    elif monitor.kind == "rate":
        wrong = both(opposite(first), _apart(value, guard.value, limit * elapsed))
    else:
        wrong = _apart(value, getattr(now.sight.estimate, monitor.watches), limit)
    beyond = where(wrong, guard.beyond + 1.0, 0.0)
    beyond = beyond if monitor.kind == "range" else where(new, beyond, guard.beyond)
    kept = Guard(chosen(new, value, guard.value), where(new, 0.0, guard.stood + 1.0), beyond)
    return less_equal(times - 0.5, beyond), kept


def _differ(a: Any, b: Any) -> Truth:
    """Return whether two values differ in any number."""
    truths = [either(less(x, y), less(y, x)) for x, y in zip(_numbers(a), _numbers(b), strict=True)]
    return reduce(either, truths)


def _numbers(value: Any) -> tuple[Scalar, ...]:
    return cast(tuple[Scalar, ...], value) if isinstance(value, tuple) else (value,)


def _size(value: Any) -> Scalar:
    """Return the absolute value of a number, or the norm of a vector."""
    numbers = _numbers(value)
    return absolute(numbers[0]) if len(numbers) == 1 else norm(cast(Vector, numbers))


def _apart(a: Any, b: Any, limit: Scalar) -> Truth:
    """Return whether two values differ by more than a limit; for attitudes, by the angle (rad) between them."""
    if len(_numbers(a)) == 4:
        # Two attitudes differ by at most half a turn.
        most = where(less(limit, math.pi), sine_of_half(minimum(limit, math.pi)), 2.0)
        return less(most, half_angle_sine(relative(b, a)))
    return less(limit, _size(tuple(x - y for x, y in zip(_numbers(a), _numbers(b), strict=True))))
