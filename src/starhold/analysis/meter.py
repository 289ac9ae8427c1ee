"""Metrics of flights: notes (accumulated numbers) that an equation takes at each control instant, and the metrics computed
from them at the end. The same notes are taken inside a kernel, for many flights at once without storing samples, and from a
recording, whose samples are the instants. A row of a table defines how a metric follows from the notes; the report's page
reads that table too."""

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.quantity import Quantity, quantities
from starhold.algebra.scalar import less, less_equal, sqrt, where
from starhold.algebra.structure import flatten
from starhold.algebra.vector import dot, most
from starhold.algebra.words import number_of
from starhold.loop.closed_loop import ClosedLoop, Composition, is_recorded
from starhold.loop.kernels import Arguments, Kernel, Observer, form, make_step
from starhold.loop.programs import over_samples
from starhold.parts.contract import IS_VALID
from starhold.simulation.lane import Recording
from starhold.trace.program import Program

TOLD = "told."
"""Prefix of the names of the quantities that the law gets from sensors or its estimator."""
LAST = 0.25
"""The share of the run over which chatter and the final error are measured."""
ALMOST = 1.0 - 1e-9
"""The share of a limit from which on it counts as reached."""
KEPT = 0.1
"""The last share of the run, in which nothing counts as settled: an oscillating motion, or one that would leave again in a
longer run, may be within its bounds there by chance."""


def stays_within(values: Any, bound: float) -> int | None:
    """Return the index from which on all values are at most the bound, or None."""
    outside = np.flatnonzero(~(np.asarray(values) <= bound))
    first = int(outside[-1]) + 1 if outside.size else 0
    return first if first < len(values) else None


def on_limit(u: NDArray[np.float64], limit: float, kind: str) -> NDArray[np.bool_]:
    """Return a mask (n,) of the samples (n, components) that are on their limit; none without a limit."""
    if kind == "none" or not np.isfinite(limit):
        return np.zeros(len(u), dtype=bool)
    size = np.linalg.norm(u, axis=1) if kind == "norm" else np.abs(u).max(axis=1)
    return size >= limit * ALMOST


Array: TypeAlias = NDArray[np.float64]
Metrics: TypeAlias = dict[str, Array]
"""Metrics by name, (lanes,), NaN for no value."""
Columns: TypeAlias = tuple[tuple[str, tuple[int, ...]], ...]
"""Recorded quantities by name, with the shape of a sample: () or (components,)."""
Note: TypeAlias = Callable[[Any, Mapping[str, Any], Any, Any, Any], Any]
"""An equation: note(noted, quantities, instant, limit, numbers) -> noted. `quantities` are the recorded ones by name."""


WINDOWS = 40
"""The approximate number of time windows of envelopes."""
PIECE = 2**16
"""The number of samples of a recording that are copied and processed at once."""


class Window(NamedTuple):
    """A quantity whose largest value in each window of time gives an envelope over the runs: its index among the notes,
    which restart in each window, a function from the note to the quantity, its meaning, and its unit."""

    row: int
    value: Callable[[Array], Array]
    meaning: str
    unit: str


class Metric(NamedTuple):
    """A metric, computed from the notes at `rows` by the rule `kind`, multiplied by the factors `times` in order.

    over: the number of instants for a mean, "samples" or "tail" (changes between those of the last quarter), with a factor;
    since: the rows are of windows, and the metric is the maximum from "start", "half" or "tail" on; final: it describes the
    end of a flight, so a flight that diverges has none; kept: the last share of the flight, in which nothing counts as
    settled."""

    unit: str
    kind: str
    rows: tuple[int, ...]
    times: tuple[float, ...] = ()
    over: tuple[str, float] | None = None
    since: str | None = None
    final: bool = False
    kept: float = KEPT


INSTANT, CROSSING = "instant", "crossing"
TIMES = (INSTANT, CROSSING)
"""Kinds of times from which something holds, counted in instants."""
KINDS: Mapping[str, Callable[..., Array]] = {
    "number": lambda x: x,
    "root": np.sqrt,
    # From the squared sine of half the angle.
    "angle": lambda x: 2.0 * np.arcsin(np.sqrt(np.minimum(x, 1.0))),
    # From the squared distance between the ends of two unit vectors.
    "apart": lambda x: 2.0 * np.arcsin(0.5 * np.sqrt(x)),
    # From two vectors.
    "distance": lambda *x: np.sqrt(sum((a - b) ** 2 for a, b in zip(x[:3], x[3:], strict=True))),
    # From the initial angle, and the share of it beyond the target; zero for a start on target.
    "overshoot": lambda a, b, c, x: np.where(a**2 + b**2 + c**2 < 1e-18, 0.0, np.maximum(x, 0.0)),
    # The time from which on values stay within their bounds, from the last instants outside (-1: never).
    INSTANT: lambda *x: np.maximum.reduce(x) + 1.0,
    # The same, interpolated between instants, from two numbers that are at most 1 within their bounds, and the times at
    # which each last reached its bound.
    CROSSING: lambda a, b, *x: np.where((a > 1.0) | (b > 1.0), np.inf, np.maximum.reduce(x)),
    "most": lambda *x: np.maximum.reduce(x),
}
"""Functions from notes (lanes,) to a metric. `report/assets/flight.js` does the same for one flight."""


@dataclass(frozen=True)
class Meter:
    """The notes to take of flights, and the metrics computed from them. first: the notes before a flight; numbers:
    arguments of the notes; notes: the equations before the last of `marks`, and from it on; table: metrics by name;
    windows: quantities of envelopes by name; steps: control steps of a flight, of `instant` seconds each (or in the body's
    own unit of time, if that is unknown); marks: instants at which windows must end, in order."""

    first: Any
    numbers: Any
    notes: tuple[Note, Note]
    table: Mapping[str, Metric]
    windows: Mapping[str, Window]
    steps: int
    instant: float
    marks: tuple[int, ...]

    @property
    def units(self) -> dict[str, str]:
        """Units of the metrics by name."""
        return {name: metric.unit for name, metric in self.table.items()}

    def observers(self, parts: Composition) -> tuple[Observer, Observer]:
        """Return the observers of a kernel of these parts: one before the last of `marks`, and one from it on."""
        early, late = (Observer(_observing(note, parts), self.first, self.numbers) for note in self.notes)
        return early, late

    def begun(self, lanes: int) -> Array:
        """Return the notes of lanes before they fly, (numbers, lanes)."""
        return np.repeat(np.array(flatten(self.first), dtype=float)[:, None], lanes, axis=1)

    def cuts(self) -> list[int]:
        """The control steps at which windows end, including every mark."""
        return window_ends(self.steps, self.marks)

    def metrics(self, noted: Array, windows: Array, lost: Array) -> Metrics:
        """Return the metrics of lanes from their notes (numbers, lanes), those of windows (windows, quantities, lanes), and
        the control steps at which they diverged (lanes,), -1 for lanes that did not, whose `diverged_at` is NaN. All other
        metrics of a lane that diverged are NaN."""
        kept = lost < 0.0
        metrics = {"diverged_at": np.where(kept, np.nan, lost * self.instant)}
        for name, metric in self.table.items():
            values = self._values(metric, noted, windows, self.cuts())
            if metric.kind in TIMES:
                values = np.where((values <= self.steps) & ~self._late(metric, values), values, np.nan)
            metrics[name] = np.where(kept, self._scaled(metric, values), np.nan)
        return metrics

    def of_recording(self, run: Recording, limit: float) -> dict[str, Any]:
        """Return the metrics of a recording whose samples are the instants, None for no value; `cut_off` names the times
        that are too late to count, `diverged_at` is the time at which the motion diverged."""
        lost, ends = run.attrs.get("diverged_at"), [*self.marks, self.steps + 1]
        noted, windows = self._replayed(run, limit, ends)
        metrics: dict[str, Any] = {"diverged_at": lost, "cut_off": []}
        for name, metric in self.table.items():
            values = self._values(metric, noted, windows, ends)
            there = lost is None or not (metric.final or metric.kind in TIMES)
            if there and metric.kind in TIMES:
                there = bool(values[0] <= self.steps)
                if there and self._late(metric, values)[0]:
                    metrics["cut_off"].append(name)
                    there = False
            value = float(self._scaled(metric, values)[0])
            value = int(value) if there and metric.kind in TIMES and metric.unit == "1" else value
            metrics[name] = value if there and not math.isnan(value) else None
        return metrics

    def program(self, columns: Columns, limit: float) -> Program:
        """Return the program of the notes from the last mark on, for samples with these columns; see `over_samples`."""
        return over_samples(self.notes[1], self.first, (self.numbers, limit), columns)

    def _late(self, metric: Metric, instants: Array) -> NDArray[np.bool_]:
        return instants > (1.0 - metric.kept) * self.steps

    def _values(self, metric: Metric, noted: Array, windows: Array, ends: Sequence[int]) -> Array:
        """Return a metric (lanes,) from the notes. `ends` are the ends of the windows."""
        if metric.since is None:
            given = [noted[row] for row in metric.rows]
        else:
            mark = {"start": 0, "half": middle(self.steps), "tail": tail_start(self.steps)}[metric.since]
            rows, later = [window.row for window in self.windows.values()], [end > mark for end in ends]
            given = [windows[later, rows.index(row)].max(axis=0) for row in metric.rows]
        with np.errstate(invalid="ignore", over="ignore"):
            return KINDS[metric.kind](*given)

    def _scaled(self, metric: Metric, values: Array) -> Array:
        for factor in metric.times:
            values = values * factor
        if metric.over is None:
            return values
        count = self.steps + 1 if metric.over[0] == "samples" else max(self.steps - tail_start(self.steps), 1)
        return values / (count * metric.over[1])

    def _replayed(self, run: Recording, limit: float, ends: Sequence[int]) -> tuple[Array, Array]:
        """Return the notes of a recording, (numbers, 1), and of its windows, (windows, quantities, 1)."""
        # Only quantities with numbers for each sample, because users may add anything to a Dataset.
        numbers = {name: values for name, values in run.arrays.items() if values.dtype.kind in "fiu" and name != "time"}
        sampled = {name: x for name, x in numbers.items() if x.ndim in (1, 2) and len(x) == len(run["time"])}
        columns = tuple((name, values.shape[1:]) for name, values in sampled.items())
        kernels = [_replay(note, self.first, (self.numbers, limit), columns) for note in self.notes]
        shared = Arguments(self.numbers, limit).shared
        rows = [window.row for window in self.windows.values()]
        noted, by_window, done = self.begun(1), np.empty((len(ends), len(rows), 1)), 0
        for window, end in enumerate(ends):
            while done < end:
                last = min(end, done + PIECE)
                # The kernel reads doubles, sample by sample.
                rows_of = np.column_stack([sampled[name][done:last] for name, _ in columns])
                record = np.ascontiguousarray(rows_of, dtype=float)
                memories = {"record": record, "noted": noted, "shared": shared, "own": shared, "tables": shared}
                kernels[done >= self.marks[-1]](memories, done, last - done)
                done = last
            by_window[window] = noted[rows]
            noted[rows] = 0.0
        return noted, by_window


_KERNELS: dict[Any, Kernel] = {}


def _replay(note: Note, first: Any, numbers: tuple[Any, float], columns: Columns) -> Kernel:
    key = note, form((first, numbers)), columns
    if key not in _KERNELS:
        _KERNELS[key] = Kernel(over_samples(note, first, numbers, columns), 1)
    return _KERNELS[key]


@cache
def _observing(note: Note, parts: Composition) -> Callable[..., Any]:
    """Return the `note` of an `Observer`, the same function for all loops that one kernel serves."""
    read = sampled(parts)

    def observe(seen: Any, decided: Any, carry: Any, step: Any, setup: Any, numbers: Any) -> Any:
        return note(seen, read(decided, step, setup), number_of(step), setup.limit, numbers)

    return observe


def sampled(parts: Composition) -> Callable[..., dict[str, Any]]:
    """Return the function read(decided, step, setup) of the quantities of a control instant by name: the recorded ones of
    body and effectors, the inputs of the law, and whether the estimate is valid."""

    def read(decided: Any, step: Any, setup: Any) -> dict[str, Any]:
        read = {name: value for part in _recorded(parts, decided, step, setup) for name, value in part._asdict().items()}
        read |= {f"{TOLD}{name}": value for name, value in _told(parts, decided.memories).items()}
        return read | ({IS_VALID: decided.memories.estimate.is_valid} if says_valid(parts) else {})

    return read


def _told(parts: Composition, memories: Any) -> dict[str, Any]:
    """Return the estimate, or without one the first recorded reading of each name."""
    if parts.estimator is not None:
        return memories.estimate._asdict()
    recorded = zip(filter(is_recorded, parts.sensors), memories.readings, strict=False)
    return {name: value for _, reading in reversed([*recorded]) for name, value in reading._asdict().items()}


def says_valid(parts: Composition) -> bool:
    """Return whether an estimator states its validity."""
    return parts.estimator is not None and IS_VALID in parts.estimator.module.Estimate._fields


def recorded_of(loop: ClosedLoop) -> dict[str, Quantity]:
    """Return the recorded quantities of the body and of effectors by name."""
    there = _recorded(loop.composition(), loop.carry(), 0, loop.setup())
    return {name: quantity for part in there for name, quantity in quantities(type(part)).items()}


def _recorded(parts: Composition, decided: Any, step: Any, setup: Any) -> Iterator[Any]:
    """Return the recorded quantities of effectors, the last first, and of the body, whose names take precedence."""
    body, records, _, _ = make_step(parts).sample(decided, step, setup)
    return reversed((body, *records))


def window_ends(steps: int, marks: Sequence[int]) -> list[int]:
    """Return the control steps at which windows of a flight end, including every mark. The last window includes the last
    instant; if that is a mark, it has a window of its own."""
    edges = [0, *marks, steps]
    ends: set[int] = set()
    for first, last in itertools.pairwise(edges):
        count = max(1, round(WINDOWS * (last - first) / steps))
        ends |= {round(cut) for cut in np.linspace(first, last, count + 1)[1:].tolist()}
    return sorted(ends - {0}) + [steps + 1] * (steps in marks)


def tail_start(steps: int) -> int:
    """Return the first instant of the last quarter of a run."""
    return int((steps + 1) * (1.0 - LAST))


def middle(steps: int) -> int:
    """Return the first instant of the second half of a run."""
    return (steps + 1) // 2


def outside(then: Any, square: Any, bound: Any, now: Any) -> Any:
    """Return the last instant at which a square exceeded its bound; NaN exceeds it."""
    return where(less_equal(square, bound), then, now)


def is_on_limit(command: Any, limit: Any, kind: str) -> Any:
    """Return whether a command is on its limit, as `on_limit` for samples; never without a limit."""
    size = sqrt(dot(command, command)) if kind == "norm" else most(command)
    return less(size, -1.0) if kind == "none" else less_equal(limit * ALMOST, size)
