"""The metrics of a body of which nothing is known but what is recorded of it, noted along its flight."""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np

from starhold.algebra.quantity import quantities
from starhold.algebra.scalar import less, maximum, sqrt, where
from starhold.algebra.structure import flatten, leaves, places
from starhold.algebra.words import number_of
from starhold.analysis.any_body import COMMAND
from starhold.analysis.meter import Flown, Meter, Metrics, Window, largest_since, most, sampled, tail_start
from starhold.loop.closed_loop import ClosedLoop, Composition
from starhold.loop.kernels import Observer, make_step


class Noted(NamedTuple):
    """Notes on a lane: of the command the peak of its components and the sum of its norm; of a window the largest square of
    the length of each recorded quantity."""

    peak: float
    total: float
    windows: tuple[float, ...]


def make_meter(loop: ClosedLoop, steps: int) -> Meter:
    """The meter of a loop for flights of so many control steps, in the units of recordings."""
    told = _recorded(loop)
    first = Noted(0.0, 0.0, (0.0,) * len(told))
    tail, clock = tail_start(steps), getattr(loop.body.module, "TIME_UNIT", "s")
    rows = places(first).windows
    windows = {
        name: Window(row, np.sqrt, quantity.text, quantity.unit)
        for row, (name, quantity) in zip(rows, told.items(), strict=True)
    }
    note = _note(loop.composition(), tuple(told))
    units = {f"final_{name}": quantity.unit for name, quantity in told.items()}
    if COMMAND in told:
        units |= {"peak_command": told[COMMAND].unit, "effort": f"{told[COMMAND].unit} {clock}"}
    meter: Meter

    def finish(flown: Flown) -> Metrics:
        cuts = meter.cuts()
        found = {f"final_{name}": np.sqrt(largest_since(tail, flown.windows[name], cuts)) for name in told}
        if COMMAND in told:
            found |= {"peak_command": flown.end.peak, "effort": flown.end.total * loop.period}
        return found

    observer = Observer(note, first, float(steps))
    meter = Meter(first, (observer, observer), finish, units, windows, steps, loop.period, (tail,))
    return meter


def _recorded(loop: ClosedLoop) -> dict[str, Any]:
    """The recorded quantities of the body and of effectors by name; of quaternions the length says nothing."""
    own, records, _, _ = make_step(loop.composition()).sample(loop.carry(), 0, loop.setup())
    found = {name: told for part in reversed((own, *records)) for name, told in quantities(type(part)).items()}
    return {name: told for name, told in found.items() if told.dimension != "quaternion"}


@cache
def _note(parts: Composition, names: tuple[str, ...]) -> Any:
    """The equations of the notes; one function for loops that one kernel flies."""
    read = sampled(parts)

    def note(seen: Noted, decided: Any, carry: Any, step: Any, setup: Any, last: Any) -> Noted:
        own = read(decided, step, setup)
        squares = {name: _square(own[name]) for name in names}
        peak, total = seen.peak, seen.total
        if COMMAND in squares:
            peak = maximum(peak, most(tuple(leaves((own[COMMAND],)))))
            total = total + where(less(number_of(step), last), sqrt(squares[COMMAND]), 0.0)
        windows = tuple(maximum(then, squares[name]) for then, name in zip(seen.windows, names, strict=True))
        return Noted(peak, total, windows)

    return note


def _square(value: Any) -> Any:
    numbers: list[Any] = flatten((value,))
    found = numbers[0] * numbers[0]
    for number in numbers[1:]:
        found = found + number * number
    return found
