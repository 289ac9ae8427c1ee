"""Flies one trajectory and labels its samples."""

from __future__ import annotations

import os
import shutil
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.quantity import Quantity, quantities
from starhold.algebra.structure import flatten
from starhold.errors import InputError
from starhold.laws.program import law_digest
from starhold.loop.closed_loop import Carry, ClosedLoop, is_recorded
from starhold.loop.kernels import Arguments, Kernel, Numbers, make_kernel, make_step, numbers_of, state_of
from starhold.loop.programs import one
from starhold.trace.machine import LONG

if TYPE_CHECKING:
    import xarray as xr

Progress: TypeAlias = Callable[[int, int], None]
"""Called with the number of steps done and their total."""

PULSE = 0.1
"""Seconds of work between two reports of progress."""

IN_MEMORY = 2**28
"""Most bytes of samples kept in memory; more go to a temporary file."""


class Variable(NamedTuple):
    """A recorded variable: names of its dimensions, values, and attributes such as the unit."""

    dimensions: tuple[str, ...]
    data: Any
    attrs: dict[str, str]


@dataclass(frozen=True, repr=False)
class Recording:
    """A trajectory as arrays: `time` (n,) and the quantities of `columns`, (n, components) or (n,) of single numbers."""

    arrays: dict[str, NDArray[np.float64]]
    attrs: dict[str, Any]
    columns: dict[str, Quantity] = field(default_factory=dict[str, Quantity])
    time_unit: str = "s"

    def __repr__(self) -> str:
        return f"<Recording {self.attrs.get('law')}: {len(self['time'])} samples of {', '.join(self.arrays)}>"

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        return self.arrays[name]

    @classmethod
    def of(cls, dataset: xr.Dataset) -> Recording:
        """Return the recording of a Dataset from `dataset`. Raise ValueError if it is not a run."""
        if not {"body", "control_period", "record_every"} <= set(dataset.attrs) or "time" not in dataset:
            raise ValueError("not a run; give a Dataset of `simulate`, or of a run.nc")
        arrays = {str(name): dataset[name].to_numpy() for name in ("time", *dataset.data_vars)}
        columns = {
            str(name): Quantity(values.attrs["units"], values.attrs["long_name"], *map(str, values.dims[1:]))
            for name, values in dataset.data_vars.items()
        }
        return cls(arrays, dict(dataset.attrs), columns, dataset["time"].attrs.get("units", "s"))

    def until(self, time: float) -> Recording:
        """Return the recording up to a time, at least its first sample."""
        kept = max(1, int(np.searchsorted(self["time"], time * (1.0 + 1e-9), side="right")))
        return replace(self, arrays={name: values[:kept] for name, values in self.arrays.items()})

    def dataset(self) -> xr.Dataset:
        """Return the recording as a Dataset with units."""
        # Loaded here, because loading takes longer than most flights, and metrics and figures do not need it.
        import xarray as xr

        data, coords = self.variables()
        return xr.Dataset(data, coords, self.attrs)

    def variables(self) -> tuple[dict[str, Variable], dict[str, Variable]]:
        """Return the recorded variables, and their coordinates, by name."""
        data: dict[str, Variable] = {}
        columns = {name: quantity for name, quantity in self.columns.items() if name in self.arrays}
        for name, (unit, meaning, dimension) in columns.items():
            dimensions = ("time", dimension) if dimension else ("time",)
            data[name] = Variable(dimensions, self[name], {"units": unit, "long_name": meaning})
        coords = {
            "time": Variable(("time",), self["time"], {"units": self.time_unit, "long_name": "time"}),
            "axis": Variable(("axis",), ["x", "y", "z"], {}),
        }
        if any(quantity.dimension == "quaternion" for quantity in columns.values()):
            coords["quaternion"] = Variable(("quaternion",), ["q0", "q1", "q2", "q3"], {})
        return data, coords


def fly(
    loop: ClosedLoop, steps: int, record_every: int = 1, run: int | None = None, progress: Progress | None = None
) -> tuple[NDArray[np.float64], Carry]:
    """Return the samples (number, sample) of a trajectory, one row for each number of a sample, and its final carry."""
    setup, phases = loop.setup(), loop.phases(steps)
    like = loop.carry(setup=setup)
    first = flatten(make_step(loop.composition()).sample(like, 0, setup))
    width, place = len(first), len(flatten(like)) - 1
    samples = _room(steps, record_every, width)
    carry, done, chunk = np.array(numbers_of(like)), 0, steps if progress is None else 1
    flight = _Flight(loop, like, record_every, loop.run if run is None else run, samples, steps >= LONG or None)
    while done < steps:
        begun = time.perf_counter()
        now = next(phase for phase in phases if done < phase.last)
        if done == now.first:
            carry = np.array(numbers_of(now.entered(state_of(carry, like))))
        count = flight.fly(now, carry, done, min(chunk, now.last - done))
        done += count
        if progress is not None:
            progress(done, steps)
            # Chunks grow until each takes about the reporting interval; the result does not depend on their lengths.
            chunk = max(1, int(chunk * min(8.0, PULSE / max(time.perf_counter() - begun, 1e-9))))
        lost_at = float(carry[place])
        if lost_at == 0.0:
            # No command was decided; the only sample is the start.
            samples[0] = first
        if lost_at >= 0.0:
            return samples[: max(1, int(np.ceil(lost_at / record_every)))].T, state_of(carry, like)
    if steps % record_every == 0 and phases:
        # The last sample contains the next command; the step after it is flown for that and discarded.
        flight.fly(phases[-1], carry.copy(), steps, 1)
    return samples.T, state_of(carry, like)


class _Flight:
    """A kernel with the memories of one flight."""

    def __init__(
        self, loop: Any, like: Any, every: int, run: int, samples: NDArray[np.float64], passes: bool | None
    ) -> None:
        self.loop, self.like, self.every, self.run, self.samples, self.passes = loop, like, every, run, samples, passes
        self._ready: dict[int, tuple[Arguments, Kernel]] = {}

    def _prepared(self, phase: Any) -> tuple[Arguments, Kernel]:
        """Return arguments and kernel of a phase, prepared once for all its chunks."""
        if phase.first not in self._ready:
            numbers = Numbers.of(phase)
            parts, more = self.loop.composition(), (self.like, numbers, self.loop.substeps, True)
            kernel = make_kernel(one, parts, 1, *more, passes=self.passes)
            self._ready[phase.first] = Arguments(*numbers), kernel
        return self._ready[phase.first]

    def fly(self, phase: Any, carry: NDArray[np.float64], first: int, count: int) -> int:
        """Fly up to `count` control steps from `first` on, to the next sample or by whole groups between samples. The carry
        changes in place. Return the number of steps flown."""
        arguments, kernel = self._prepared(phase)
        memories = {"carry": carry, "record": self.samples, "shared": arguments.shared, "tables": arguments.tables}
        memories["own"] = arguments.shared
        seed, into = self.loop.seed, first % self.every
        if into or count < self.every:
            # A part of a group: its sample, if it begins here, and the steps up to the next one.
            groups, each, place = 1, min(count, self.every - into), 0 if into == 0 else -1
        else:
            groups, each, place = count // self.every, self.every, 0
        kernel(memories, first, groups, each, place, -(-first // self.every), seed, self.run)
        return groups * each


def label(loop: ClosedLoop, samples: NDArray[np.float64], carry: Carry, record_every: int) -> Recording:
    """Return the recording of the samples of `fly`."""
    arrays = {"time": np.arange(samples.shape[1]) * (loop.period * record_every)}
    columns: dict[str, Quantity] = {}
    row = 0
    for name, quantity, size in recorded(loop):
        values = samples[row : row + size]
        arrays[name], columns[name] = values.T if quantity.dimension else values[0], quantity
        row += size
    attrs: dict[str, Any] = {
        "body": loop.body.name,
        "law": loop.law.name,
        "law_program": law_digest(loop.law, loop.gains, loop.known, loop.period),
        "control_period": loop.period,
        "record_every": record_every,
        f"{loop.body.module.COMMAND}_limit": loop.saturation_limit(),
        "limit": loop.limit,
        "parts": ", ".join(fitted.called for fitted in loop.parts if fitted.part.role != "body"),
    }
    if watchers := loop.used("watcher"):
        attrs["watchers"] = ", ".join(fitted.called for fitted in watchers)
    if carry.lost_at >= 0.0:
        attrs["diverged_at"] = carry.lost_at * loop.period
    return Recording(arrays, attrs, columns, getattr(loop.body.module, "TIME_UNIT", "s"))


def recorded(loop: ClosedLoop) -> list[tuple[str, Quantity, int]]:
    """Return the recorded quantities in the order of samples: name, quantity and its number of components. Names of sensors'
    and estimators' quantities begin with the part's name; so do those of effectors where a name would occur twice."""
    sample = make_step(loop.composition()).sample(loop.carry(), 0, loop.setup())
    body_sample, records, readings, estimate = sample
    effectors = [f for f in loop.used("effector") if f.part.hook("record") is not None]
    sensors = [f for f in loop.used("sensor") if is_recorded(f.part)]
    estimators = loop.used("estimator")
    columns: list[tuple[str, Quantity, int]] = []
    taken: set[str] = set()
    groups = [("", body_sample), *(("", one) for one in records)]
    callers = ["", *(f.called for f in effectors), *([loop.law.name] if loop.law.hook("record") is not None else [])]
    sensors += loop.used("watcher")
    groups += [(f.called, one) for f, one in zip(sensors, readings, strict=True)]
    groups += [(f.called, estimate) for f in estimators]
    callers += [f.called for f in (*sensors, *estimators)]
    for (prefix, values), caller in zip(groups, callers, strict=True):
        declared = quantities(type(values))
        for name, value in zip(values._fields, values, strict=True):
            stem = prefix or (caller if name in taken else "")
            full = f"{stem.replace('-', '_')}_{name}" if stem else name
            taken.add(full)
            columns.append((full, declared[name], len(flatten((value,)))))
    return columns


def _room(steps: int, record_every: int, width: int) -> NDArray[np.float64]:
    """Return the storage of a run's samples, a row each: memory or, for many samples, an unnamed file that the system caches
    as memory allows. Raise InputError if the disk is too small for that file, or memory for metrics of the samples."""
    count = steps // record_every + 1
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") if hasattr(os, "sysconf") else 2**33
    # Computing metrics needs a dozen numbers per sample at a time.
    most, mapped = memory // (8 * 16), 8 * count * width >= IN_MEMORY
    if mapped:
        most = min(most, shutil.disk_usage(tempfile.gettempdir()).free // (8 * width))
    if count > most:
        raise InputError("", "simulation.record_every", f"{record_every}, {count} samples", f"at least {-(-steps // most)}")
    if not mapped:
        return np.full((count, width), np.nan)
    with tempfile.TemporaryFile() as file:
        if hasattr(os, "posix_fallocate"):
            # A disk that fills up under a mapped file would kill the process.
            os.posix_fallocate(file.fileno(), 0, 8 * count * width)
        return np.memmap(file, np.float64, "w+", shape=(count, width))
