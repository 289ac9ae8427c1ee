"""Flies a station-keeping loop and labels the result."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from starhold.loop.station import StationCarry, StationLoop, StationSample
from starhold.simulation.lane import Progress, Recording, fly

COLUMNS: dict[str, tuple[str, str, str]] = {
    "position": ("axis", "length unit", "from the libration point, turning axes"),
    "velocity": ("axis", "length unit * Omega", "relative to the turning axes"),
    "control": ("axis", "length unit * Omega^2", "acceleration that the control gives"),
    "command": ("axis", "length unit * Omega^2", "acceleration commanded, within the limit"),
}
"""Recorded quantities in the order of `StationSample`: dimension, unit, meaning."""


def simulate_station(loop: StationLoop, steps: int, record_every: int = 1, progress: Progress | None = None) -> Recording:
    """Fly a loop for `steps` control periods; a sample every `record_every`, scaled, `time` in 1/Omega.

    A motion that was lost ends the samples, and its time stands in `attrs["diverged_at"]`; else that is absent.
    """
    return label_station(loop, *fly(loop, steps, record_every, progress=progress), record_every)


def label_station(loop: StationLoop, samples: NDArray[np.float64], carry: StationCarry, record_every: int) -> Recording:
    """The samples of `fly` under their names."""
    arrays = {"time": np.arange(samples.shape[1]) * (loop.period * record_every)}
    for place, name in enumerate(StationSample._fields):
        arrays[name] = samples[3 * place : 3 * place + 3].T
    attrs = {
        "law": loop.law.name,
        "control_period": loop.period,
        "record_every": record_every,
        "control_limit": loop.limit,
        "limit": loop.limit_kind,
        "model": loop.model,
        "lag": loop.lag,
    }
    if carry.lost_at >= 0.0:
        attrs["diverged_at"] = carry.lost_at * loop.period
    return Recording(arrays, attrs, COLUMNS, "1/Omega")
