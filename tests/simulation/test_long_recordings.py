"""Recordings that are too long for memory."""

import shutil
from types import SimpleNamespace

import numpy as np
import pytest

from starhold.errors import InputError
from starhold.report.netcdf import BLOCK
from starhold.report.results import write_run
from starhold.scenario.reading import load
from starhold.simulation import lane
from starhold.studies.compare import build, record


def test_samples_on_disk_are_those_in_memory(monkeypatch):
    scenario = load("wheels-orbital")
    loop = build(scenario, scenario.laws[0])
    held = record(scenario, loop)
    monkeypatch.setattr(lane, "IN_MEMORY", 0)
    mapped = record(scenario, loop)
    assert isinstance(mapped["attitude"], np.memmap)
    assert held.arrays.keys() == mapped.arrays.keys()
    for name, values in held.arrays.items():
        assert np.array_equal(values, mapped[name])


def test_a_run_longer_than_a_block_is_written_whole(tmp_path):
    import xarray as xr

    scenario = load("three-laws")
    entry = scenario.laws[0]
    samples, carry = lane.fly(build(scenario, entry), BLOCK + 100)
    run = lane.label(build(scenario, entry), samples, carry, 1)
    write_run(run, tmp_path / "run.nc")
    with xr.open_dataset(tmp_path / "run.nc", engine="h5netcdf") as written:
        for name in ("attitude", "torque"):
            assert np.array_equal(written[name], run[name])


def test_more_samples_than_the_disk_holds_are_refused_at_once(monkeypatch):
    scenario = load("three-laws")
    monkeypatch.setattr(shutil, "disk_usage", lambda path: SimpleNamespace(free=10**6))
    monkeypatch.setattr(lane, "IN_MEMORY", 10**6)
    loop = build(scenario, scenario.laws[0])
    with pytest.raises(InputError, match=r"record_every: found 1, 60001 samples; allowed: at least 13$"):
        lane.fly(loop, 60_000)
    assert lane.fly(loop, 60_000, 13)[0].shape[1] == 60_000 // 13 + 1
