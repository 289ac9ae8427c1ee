"""Chunks: the results of a block of consecutive runs of one law, with a row of numbers per run and totals over the runs."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Counts: TypeAlias = dict[str, NDArray[np.int64]]
Extremes: TypeAlias = dict[str, NDArray[np.float64]]
LEAST, MOST = ".least", ".most"
"""Suffixes of the names of extremes that are merged by taking the minimum and the maximum."""


@dataclass(frozen=True)
class Chunk:
    """The results of one law's runs `first` to `first + count - 1`.

    rows: columns by name, each an array (count,) of float64 (NaN: the run has no such value), int64, bool or text. The
        column `run` holds the runs' numbers in order.
    counts: histograms of any shape by name; those of several chunks are added.
    extremes: arrays of any shape and unit by name, which ends in `.least` or `.most`; NaN where nothing was measured."""

    law: str
    first: int
    rows: dict[str, NDArray[Any]]
    counts: Counts = field(default_factory=dict)
    extremes: Extremes = field(default_factory=dict)

    def __post_init__(self) -> None:
        numbers = self.rows.get("run")
        if numbers is None or not np.array_equal(numbers, np.arange(self.first, self.first + len(numbers))):
            raise ValueError(f"a chunk's column 'run' must hold its runs in order, from {self.first}")
        if wrong := [name for name, values in self.rows.items() if values.shape != numbers.shape]:
            raise ValueError(f"columns that differ in length from 'run': {', '.join(wrong)}")
        if wrong := [name for name in self.extremes if not name.endswith((LEAST, MOST))]:
            raise ValueError(f"names of extremes that end neither in {LEAST} nor in {MOST}: {', '.join(wrong)}")

    @property
    def count(self) -> int:
        """The number of runs."""
        return len(self.rows["run"])


def merge(parts: Iterable[tuple[Counts, Extremes]]) -> tuple[Counts, Extremes]:
    """Merge the counts and extremes of several chunks, with the same bits for any order and grouping of the parts.
    ValueError where two parts have different names or shapes."""
    counts: Counts = {}
    extremes: Extremes = {}
    for number, (more, others) in enumerate(parts):
        if number == 0:
            counts = {name: values.copy() for name, values in more.items()}
            extremes = {name: _plain(values) for name, values in others.items()}
            continue
        _check_shapes(counts, more)
        _check_shapes(extremes, others)
        for name, values in more.items():
            counts[name] += values
        for name, values in others.items():
            pick = np.fmin if name.endswith(LEAST) else np.fmax
            extremes[name] = _plain(pick(extremes[name], values))
    return counts, extremes


def _plain(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return values with only one kind of NaN and of zero, because it depends on the order which of several NaNs, or of 0
    and -0, a minimum returns."""
    return np.where(np.isnan(values), np.nan, values + 0.0)


def _check_shapes(ours: dict[str, NDArray[Any]], others: dict[str, NDArray[Any]]) -> None:
    if {name: values.shape for name, values in ours.items()} != {name: values.shape for name, values in others.items()}:
        raise ValueError(f"chunks of other names or shapes: {sorted(ours)} and {sorted(others)}")
