"""Metrics of many flights at once, noted along the way inside the kernel: no samples are kept.

A meter sees every control instant of a run from the first to the last, as a recording of every control step does, and its
metrics are those of such a recording.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.scalar import less, less_equal, sqrt, where
from starhold.algebra.structure import flatten, unflatten
from starhold.algebra.vector import dot, most
from starhold.analysis.metrics import ALMOST, KEPT, LAST
from starhold.loop.closed_loop import Composition
from starhold.loop.kernels import Observer, make_step

Array: TypeAlias = NDArray[np.float64]
Metrics: TypeAlias = dict[str, Array]
"""Metrics by name, (lanes,), NaN where one has no value."""


WINDOWS = 40
"""Windows of time that envelopes have, more or less."""


class Window(NamedTuple):
    """A quantity whose largest value in each window of time makes an envelope over the runs: its place among what is noted,
    where it begins anew in each window, what gives the quantity of the noted number, what it means, and its unit."""

    row: int
    value: Callable[[Array], Array]
    meaning: str
    unit: str


class Flown(NamedTuple):
    """The notes of lanes: at the end, with an array (lanes,) in place of each number, and by its name each
    window's quantity (windows, lanes), as it was noted."""

    end: Any
    windows: Mapping[str, Array]


@dataclass(frozen=True)
class Meter:
    """The notes to be taken of lanes, and what they come to. first: before a flight; observers: before the last of `marks`
    and from it on; finish(flown): metrics; units: those of the metrics; windows: quantities of envelopes by name; steps:
    control steps of a flight, of `instant` seconds each (or of the body's own unit of time, where that is unknown); marks:
    instants at which windows end, in order."""

    first: Any
    observers: tuple[Observer, Observer]
    finish: Callable[[Flown], Metrics]
    units: Mapping[str, str]
    windows: Mapping[str, Window]
    steps: int
    instant: float
    marks: tuple[int, ...]

    def begun(self, lanes: int) -> Array:
        """The notes of lanes before they fly, (numbers, lanes)."""
        return np.repeat(np.array(flatten(self.first), dtype=float)[:, None], lanes, axis=1)

    def cuts(self) -> list[int]:
        """The control steps at which windows end, every mark among them."""
        return window_ends(self.steps, self.marks)

    def metrics(self, noted: Array, windows: Array, lost: Array) -> Metrics:
        """Metrics of lanes from what is noted of them, (numbers, lanes), of windows (windows, quantities, lanes), and the
        control step at which each was lost (lanes,), -1 for those that were not, whose `diverged_at` is NaN. All others of a
        lost motion are."""
        named = {name: windows[:, place] for place, name in enumerate(self.windows)}
        with np.errstate(invalid="ignore", over="ignore"):
            found = self.finish(Flown(unflatten(list(noted), self.first), named))
        kept = lost < 0.0
        return {"diverged_at": np.where(kept, np.nan, lost * self.instant)} | {
            name: np.where(kept, values, np.nan) for name, values in found.items()
        }


def sampled(parts: Composition) -> Callable[..., dict[str, Any]]:
    """Return what gives the recorded quantities of a control instant, of the body and of effectors, by name:
    read(decided, step, setup)."""
    sample = make_step(parts).sample

    def read(decided: Any, step: Any, setup: Any) -> dict[str, Any]:
        own, records, _, _ = sample(decided, step, setup)
        return {name: value for part in reversed((own, *records)) for name, value in part._asdict().items()}

    return read


def window_ends(steps: int, marks: Sequence[int]) -> list[int]:
    """The control steps at which windows of a flight end, every mark among them."""
    edges = [0, *marks, steps]
    found: set[int] = set()
    for first, last in itertools.pairwise(edges):
        count = max(1, round(WINDOWS * (last - first) / steps))
        found |= {round(cut) for cut in np.linspace(first, last, count + 1)[1:].tolist()}
    return sorted(found - {0})


def largest_since(mark: int, values: Array, cuts: Sequence[int]) -> Array:
    """The largest, from an instant on at which a window ends, of what was noted in windows (windows, lanes)."""
    return values[[cut > mark for cut in cuts]].max(axis=0)


def tail_start(steps: int) -> int:
    """The first instant of the last quarter of a run."""
    return int((steps + 1) * (1.0 - LAST))


def within_since(last_outside: Array, steps: int, kept: float = KEPT) -> Array:
    """The instant from which on values stay within a bound, from that at which they were last outside (-1: never); NaN
    where they are outside at the end, or come to stay only in the last share of the run, as `stays_within` and `too_late`
    tell of samples."""
    since = last_outside + 1.0
    return np.where((since > steps) | (since > (1.0 - kept) * steps), np.nan, since)


def outside(then: Any, square: Any, bound: Any, now: Any) -> Any:
    """The last instant at which a square was beyond its bound; what is no number is beyond it."""
    return where(less_equal(square, bound), then, now)


def is_on_limit(command: Any, limit: Any, kind: str) -> Any:
    """Whether a command is on its limit, as `on_limit` tells of samples; never where there is none."""
    size = sqrt(dot(command, command)) if kind == "norm" else most(command)
    return less(size, -1.0) if kind == "none" else less_equal(limit * ALMOST, size)
