"""Writes recorded runs as netCDF-4."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from starhold.version import __version__

if TYPE_CHECKING:
    from starhold.simulation.lane import Recording

BLOCK = 65_536
"""The number of samples copied at a time."""
NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable."
"""The beginning of the name of a dimension without a variable, by which libraries of netCDF-4 tell it."""


class _Sink(io.FileIO):
    """A file that stores a write error and lets the writer continue, because the HDF5 library does not survive an error
    while closing a file."""

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
    """Write a run as a new netCDF-4 file: HDF5 in which dimensions are dimension scales, each with a number, and variables
    name theirs. OSError if it cannot be written."""
    # Imported here, where it is needed. Not xarray, which takes longer to load than most flights, nor h5netcdf, which looks
    # up every object many times.
    import h5py

    variables, coordinates = run.variables()
    with _Sink(path, "w+b") as sink:
        with h5py.File(sink, "w", track_order=True) as file:
            places: dict[str, int] = {}
            for name, values in (coordinates | variables).items():
                data = np.asarray(values.data)
                text = data.dtype.kind == "U"
                made = file.create_dataset(name, data.shape, h5py.string_dtype() if text else data.dtype, track_order=True)
                for dimension, size in zip(values.dimensions, data.shape, strict=True):
                    if dimension not in places:
                        places[dimension] = len(places)
                        is_named = dimension == name
                        scale = made if is_named else file.create_dataset(dimension, (size,), ">f4", track_order=True)
                        scale.make_scale(name if is_named else f"{NO_VARIABLE}{size:10}")
                        scale.attrs["_Netcdf4Dimid"] = np.int32(places[dimension])
                numbers = np.array([places[dimension] for dimension in values.dimensions], np.int32)
                made.attrs["_Netcdf4Coordinates"] = numbers
                if name not in places:
                    made.attrs["_Netcdf4Dimid"] = numbers[0]
                    for axis, dimension in enumerate(values.dimensions):
                        made.dims[axis].attach_scale(file[dimension])
                for first in range(0, len(data), BLOCK):
                    part = data[first : first + BLOCK]
                    made[first : first + len(part)] = part.astype(object) if text else part
                made.attrs.update(values.attrs)
            for key, value in run.attrs.items():
                file.attrs[key] = value if isinstance(value, str) else np.atleast_1d(value)
            made_by = f"version=2,starhold={__version__},hdf5={h5py.version.hdf5_version},h5py={h5py.__version__}"
            file.attrs["_NCProperties"] = np.bytes_(made_by)
        if sink.failure is not None:
            raise sink.failure
