"""Runs as netCDF-4 files, written block by block."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from starhold.simulation.lane import Recording

BLOCK = 65_536
"""Samples that are copied at a time."""


class _Sink(io.FileIO):
    """A file that notes why it could not be written and lets the writer go on: the HDF5 library does not survive an error
    while it closes a file."""

    failure: OSError | None = None

    def write(self, data: Any) -> int:
        whole, done = memoryview(data).cast("B"), 0
        try:
            while self.failure is None and done < len(whole):
                done += super().write(whole[done:])
        except OSError as error:
            self.failure = error
        return len(whole)

    def truncate(self, size: int | None = None) -> int:
        try:
            return super().truncate(size)
        except OSError as error:
            self.failure = self.failure or error
            return size or 0


def write_netcdf(run: Recording, path: Path) -> None:
    """A run as a new file. OSError where it cannot be written."""
    # Loaded here, where alone it is needed; and not xarray, which takes longer to load than most flights.
    import h5netcdf
    import h5py

    variables, coordinates = run.variables()
    with _Sink(path, "w+b") as sink:
        with h5netcdf.File(sink, "w") as file:
            for name, values in (coordinates | variables).items():
                data = np.asarray(values.data)
                for dimension, size in zip(values.dimensions, data.shape, strict=True):
                    if dimension not in file.dimensions:
                        file.dimensions[dimension] = size
                text = data.dtype.kind == "U"
                made = file.create_variable(name, values.dimensions, h5py.string_dtype() if text else data.dtype)
                for first in range(0, len(data), BLOCK):
                    part = data[first : first + BLOCK]
                    made[first : first + len(part)] = part.astype(object) if text else part
                made.attrs.update(values.attrs)
            file.attrs.update(run.attrs)
        if sink.failure is not None:
            raise sink.failure
