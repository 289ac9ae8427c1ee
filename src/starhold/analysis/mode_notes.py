"""Notes on the modes of a flight: when they first begin, and whether losses that are noticed were there."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from starhold.algebra.scalar import absolute, both, either, less, opposite, where
from starhold.analysis.meter import INSTANT, Metric

ALARMS = ("false_alarms", "missed_detections")
"""Losses that were noticed before any fault happened, and whether no loss was noticed from the first fault on."""


class Wanted(NamedTuple):
    """The modes whose begin is wanted for, counted from 1, and the instant of the first fault: infinite without any, none
    where losses are not noticed."""

    begins: tuple[float, ...] = ()
    fault: tuple[float, ...] = ()


class Modal(NamedTuple):
    """Notes on modes: the last instants before each first begins, and the counts of `ALARMS`."""

    begins: tuple[float, ...]
    alarms: tuple[float, ...]


def begun(wanted: Wanted) -> Any:
    """The notes before a flight; none where nothing is wanted."""
    return Modal((-1.0,) * len(wanted.begins), (0.0, 0.0) * len(wanted.fault)) if wanted.begins or wanted.fault else ()


def noted(seen: Any, quantities: Mapping[str, Any], now: Any, wanted: Wanted) -> Any:
    """The notes of an instant."""
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
    return Modal(begins, alarms)


def table(names: tuple[str, ...], rows: Any, wanted: Wanted, period: float) -> dict[str, Metric]:
    """The metrics of notes that lie at these rows; names: of the begins. Nothing is missed where there is no fault."""
    if not rows:
        return {}
    begins = {name: Metric("s", INSTANT, (row,), (period,), kept=0.0) for name, row in zip(names, rows.begins, strict=True)}
    alarms = {name: Metric("1", "number", (row,)) for name, row in zip(ALARMS, rows.alarms, strict=False)}
    if wanted.fault == (math.inf,):
        del alarms[ALARMS[1]]
    return begins | alarms


def _is(mode: Any, place: Any) -> Any:
    return less(absolute(mode - place), 0.5)
