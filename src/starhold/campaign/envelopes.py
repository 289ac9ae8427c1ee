"""Envelopes over time, from histograms of the values in each time window, which can be added over any blocks of runs."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from starhold.analysis.meter import Array, Window

FINE = 4
"""The number of leading mantissa bits that select the bin in an octave: sixteen bins."""
LEAST, OCTAVES = -90, 110
"""The range of the bins, 2^LEAST to 2^(LEAST + OCTAVES); smaller and larger values go into the end bins."""
BINS = OCTAVES << FINE
_SHIFT = 52 - FINE
_FIRST = (1023 + LEAST) << FINE
NAME = "envelope"


@dataclass(frozen=True)
class Envelope:
    """The envelope of a quantity over time. For each window, which ends at `times` (s), statistics over the runs that were
    not lost of the largest value in the window: minimum, 5 % quantile, median, 95 % quantile, maximum; all (windows,). The
    quantiles are read off a histogram and accurate to within 3 %, for angles above 150 degrees to within 15 degrees; the
    extremes are exact."""

    name: str
    unit: str
    meaning: str
    times: Array = field(repr=False)
    least: Array = field(repr=False)
    low: Array = field(repr=False)
    median: Array = field(repr=False)
    high: Array = field(repr=False)
    most: Array = field(repr=False)


def count(windows: Array) -> tuple[NDArray[np.int64], Array, Array]:
    """Return the histogram (windows, quantities, BINS) and the extremes (windows, quantities) of nonnegative numbers
    (windows, quantities, lanes)."""
    shape = windows.shape[:2]
    counts = np.zeros((*shape, BINS), dtype=np.int64)
    if not windows.shape[2]:
        return counts, np.full(shape, np.nan), np.full(shape, np.nan)
    # The leading bits of a double, exponent and all, number the bins.
    bins = (np.ascontiguousarray(windows).view(np.int64) >> _SHIFT) - _FIRST
    np.clip(bins, 0, BINS - 1, out=bins)
    for row in np.ndindex(shape):
        counts[row] = np.bincount(bins[row], minlength=BINS)
    return counts, windows.min(axis=2), windows.max(axis=2)


def edges() -> Array:
    """Return the edges (BINS + 1,) of the bins, which are equal parts of octaves."""
    at = np.arange(BINS + 1)
    return np.ldexp(1.0 + (at % (1 << FINE)) / (1 << FINE), LEAST + (at >> FINE))


def quantile(counts: NDArray[np.int64], share: float, least: Array, most: Array) -> Array:
    """Return a quantile (...) of histograms (..., BINS), interpolated linearly within its bin and limited to the extremes
    (...); NaN for empty histograms."""
    total = counts.sum(axis=-1)
    upto = np.cumsum(counts, axis=-1)
    wanted = share * np.maximum(total - 1, 0)
    place = (upto <= wanted[..., None]).sum(axis=-1).clip(max=BINS - 1)
    inside = np.take_along_axis(counts, place[..., None], -1)[..., 0]
    before = np.take_along_axis(upto, place[..., None], -1)[..., 0] - inside
    sides = edges()
    low, high = np.maximum(sides[place], least), np.minimum(sides[place + 1], most)
    part = ((wanted - before + 0.5) / np.maximum(inside, 1)).clip(0.0, 1.0)
    # Not from the low end alone, because a bin that holds infinity has no width.
    values = np.where(low == high, low, low * (1.0 - part) + high * part)
    return np.where(total > 0, np.clip(values, least, most), np.nan)


def read(
    counts: NDArray[np.int64], least: Array, most: Array, windows: Mapping[str, Window], times: Array
) -> tuple[Envelope, ...]:
    """Return the envelopes by quantity, from histograms (windows, quantities, BINS), extremes (windows, quantities) and the
    times (s) at which windows end."""
    low, median, high = (quantile(counts, share, least, most) for share in (0.05, 0.5, 0.95))
    envelopes: list[Envelope] = []
    for place, (name, window) in enumerate(windows.items()):
        noted = (values[:, place] for values in (least, low, median, high, most))
        envelopes.append(Envelope(name, window.unit, window.meaning, times, *map(window.value, noted)))
    return tuple(envelopes)
