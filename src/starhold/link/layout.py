"""The order of the numbers that flight software reads at a control instant."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.structure import buffers, flatten
from starhold.loop.closed_loop import ClosedLoop
from starhold.simulation.stepper import Readings, Stepper, sensed_of


class Field(NamedTuple):
    """A named block of numbers: its offset after the time, and its length."""

    name: str
    first: int
    size: int


class Layout:
    """The fields of the readings of a loop, after the time: the inputs of its own law (`measurement`), each sensor by its
    name (`sensors`), the estimate (`estimate`), then the truth, which flight software does not have in orbit: the body
    (`state`), each effector by its name (`effectors`), and a target that follows a table (`target`)."""

    def __init__(self, loop: ClosedLoop) -> None:
        carry, sensed = loop.carry(), sensed_of(loop)
        sensors = zip((fitted.called for fitted in loop.used("sensor")), sensed[1], strict=True)
        effectors = zip((fitted.called for fitted in loop.used("effector")), carry.effectors, strict=True)
        values: list[tuple[str, Any]] = [("measurement", sensed[0])]
        values += [(f"sensors.{name}", reading) for name, reading in sensors]
        values += [("estimate", sensed[2]), ("state", carry.state)]
        values += [(f"effectors.{name}", inner) for name, inner in effectors]
        target, numbers = loop.composition().target, loop.setup().target
        self._target = target if target is not None and buffers((numbers,)) and not target.flag("BY_MODE") else None
        if self._target is not None:
            goal = self._target.module.goal(numbers, loop.start, 0, None)
            values.append(("target", goal))
        self.fields: list[Field] = []
        for prefix, value in values:
            for name, part in _named(prefix, value):
                self.fields.append(Field(name, self.size, len(flatten((part,)))))

    @property
    def size(self) -> int:
        """The number of numbers after the time."""
        return self.fields[-1].first + self.fields[-1].size if self.fields else 0

    @property
    def check(self) -> int:
        """The CRC-32 of names and sizes, which must be equal at both ends."""
        return zlib.crc32("".join(f"{one.name} {one.size}\n" for one in self.fields).encode())

    def numbers(self, flight: Stepper, readings: Readings) -> NDArray[np.float64]:
        """Return the time and the numbers of all fields at this instant of a flight with these readings."""
        parts = [[readings.time], readings.numbers, flight.truth]
        if self._target is not None:
            parts.append(flatten(self._target.module.goal(flight.setup.target, flight.state, flight.steps, None)))
        return np.concatenate(parts)

    def place(self, name: str) -> Field:
        """Return the field of a name. Raise KeyError if there is none."""
        return {one.name: one for one in self.fields}[name]


def _named(prefix: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Yield the fields of nested NamedTuples with dotted names, except those without numbers."""
    if hasattr(value, "_fields"):
        for name, part in zip(cast(Any, value)._fields, value, strict=True):
            yield from _named(f"{prefix}.{name}", part)
    elif flatten((value,)):
        yield prefix, value
