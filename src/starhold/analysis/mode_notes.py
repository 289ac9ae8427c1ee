"""Notes on the modes of a flight: their first begins, false alarms and missed detections of losses, and the largest errors
in a mode or a window."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from starhold.algebra.scalar import absolute, both, either, less, maximum, opposite, where
from starhold.analysis.meter import INSTANT, Metric

ALARMS = ("false_alarms", "missed_detections")
"""The number of losses noticed before any fault, and whether no loss was noticed from the first fault on."""


PEAKS = {"peak_attitude_error": "angle", "peak_rate_error": "root"}
"""Largest errors of a flight, or of the part covered by a requirement, with the kinds of metrics."""


class Span(NamedTuple):
    """A part of a flight: a mode, counted from 1 (None for the whole flight), and its begin and end, in seconds since the
    mode began, or in instants of the flight."""

    mode: tuple[float, ...]
    begin: float
    end: float

    def covers(self, quantities: Mapping[str, Any], now: Any) -> Any:
        """Return whether an instant lies in it."""
        since = quantities["time_in_mode"] if self.mode else now
        inside = both(less(self.begin, since), less(since, self.end))
        return both(_is(quantities["mode"], self.mode[0]), inside) if self.mode else inside


def span(mode: int | None, begin: float, end: float, period: float) -> Span:
    """Return the part of a flight with the control instants between two times (s)."""
    first, last = math.ceil(begin / period - 1e-9) - 0.5, end / period + 0.5
    return Span((), first, last) if mode is None else Span((float(mode),), first * period, last * period)


class Wanted(NamedTuple):
    """The modes whose first begin is noted, counted from 1; the instant of the first fault (infinite without faults, None
    if losses are not noticed); and the parts of a flight in which angles, and rates, are noted."""

    begins: tuple[float, ...] = ()
    fault: tuple[float, ...] = ()
    angles: tuple[Span, ...] = ()
    rates: tuple[Span, ...] = ()


class Modal(NamedTuple):
    """Notes on modes: the last instants before each first begins, the counts of `ALARMS`, and the largest squares of the
    sine of half the angle and of the rate error in parts of the flight (-1: the part was not flown)."""

    begins: tuple[float, ...]
    alarms: tuple[float, ...]
    angles: tuple[float, ...]
    rates: tuple[float, ...]


def begun(wanted: Wanted) -> Any:
    """Return the notes before a flight; none if nothing is wanted."""
    none: Any = tuple((-1.0,) * len(each) for each in (wanted.begins, wanted.angles, wanted.rates))
    return Modal(none[0], (0.0, 0.0) * len(wanted.fault), *none[1:]) if any(wanted) else ()


def noted(seen: Any, quantities: Mapping[str, Any], now: Any, wanted: Wanted, angle: Any, rate: Any) -> Any:
    """Return the notes after an instant, given the squares of the sine of half the angle and of the rate error."""
    if not seen:
        return seen
    begins = tuple(
        where(both(less(now - 1.5, before), opposite(_is(quantities["mode"], mode))), now, before)
        for before, mode in zip(seen.begins, wanted.begins, strict=True)
    )
    alarms = seen.alarms
    if alarms:
        trips, early = quantities["trips"], less(now, wanted.fault[0])
        false = where(early, trips, alarms[0])
        alarms = (false, where(either(early, less(false + 0.5, trips)), 0.0, 1.0))
    peaks = (
        tuple(where(one.covers(quantities, now), maximum(most, square), most) for most, one in zip(*pair, strict=True))
        for square, pair in ((angle, (seen.angles, wanted.angles)), (rate, (seen.rates, wanted.rates)))
    )
    return Modal(begins, alarms, *peaks)


def table(
    names: tuple[str, ...], spans: Mapping[str, tuple[str, Span]], rows: Any, wanted: Wanted, period: float
) -> dict[str, Metric]:
    """Return the metrics of notes at these rows; names: of the begins; spans: parts of a flight by the names of their
    metrics, with the error to measure. Without a fault no detection is missed."""
    if not rows:
        return {}
    begins = {name: Metric("s", INSTANT, (row,), (period,), kept=0.0) for name, row in zip(names, rows.begins, strict=True)}
    alarms = {name: Metric("1", "number", (row,)) for name, row in zip(ALARMS, rows.alarms, strict=False)}
    if wanted.fault == (math.inf,):
        del alarms[ALARMS[1]]
    peaks: dict[str, Metric] = {}
    for (metric, kind), unit, places in zip(PEAKS.items(), ("rad", "rad/s"), (rows.angles, rows.rates), strict=True):
        called = [name for name, (of, _) in spans.items() if of == metric]
        peaks |= {name: Metric(unit, kind, (row,)) for name, row in zip(called, places, strict=True)}
    return begins | alarms | peaks


def _is(mode: Any, place: Any) -> Any:
    return less(absolute(mode - place), 0.5)
