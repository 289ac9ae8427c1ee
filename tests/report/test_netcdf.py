"""Runs are written as netCDF-4 by h5py alone: readers find what h5netcdf would have written."""

import h5py
import pytest
import xarray as xr

from starhold.report.results import write_run
from starhold.scenario.reading import load
from starhold.studies.compare import build, record
from tests.tiers import leading


@pytest.mark.parametrize("name", leading(["wheels-orbital", "three-laws", "l2-circle", "flexible-slew"], 2))
def test_a_written_run_reads_as_one_that_h5netcdf_writes(name, tmp_path):
    scenario = load(name)
    duration = 20.0 * scenario.table.simulation.control_period
    scenario = scenario.with_({"simulation.duration": duration})
    run = record(scenario, build(scenario, scenario.laws[0]))
    write_run(run, tmp_path / "run.nc")
    run.dataset().to_netcdf(tmp_path / "other.nc", engine="h5netcdf")
    ours, theirs = (xr.load_dataset(tmp_path / file, engine="h5netcdf") for file in ("run.nc", "other.nc"))
    assert ours.identical(theirs)
    assert [type(ours.attrs[key]) for key in theirs.attrs] == [type(value) for value in theirs.attrs.values()]
    assert ours.encoding["unlimited_dims"] == set()
    with h5py.File(tmp_path / "run.nc") as ours, h5py.File(tmp_path / "other.nc") as theirs:
        assert {*ours} == {*theirs}
        for variable in ours.values():
            other = theirs[variable.name]
            assert (variable.dtype, variable.shape, variable.maxshape) == (other.dtype, other.shape, other.maxshape)
            # Dimensions count in the order in which they are written.
            assert {*other.attrs} - {"_FillValue", "coordinates"} <= {*variable.attrs}
            scales = [[scale.name for scale in dimension.values()] for dimension in variable.dims]
            assert scales == [[scale.name for scale in dimension.values()] for dimension in other.dims]
            assert variable.is_scale == other.is_scale
