"""Campaigns on a GPU: the text for it is run by a machine for tests in place of a driver, and gives the bits of threads."""

import sys

import numpy as np
import pytest

import starhold as sh
from starhold.campaign import job as jobs
from starhold.campaign.engines import Gpu, engine_of, flying
from starhold.scenario.reading import load
from starhold.simulation.lanes import ThreadPool
from starhold.trace.device import Device
from tests.campaign.flown import SMALL, normal, short, uniform
from tests.refusals import refused
from tests.tiers import leading
from tests.trace.machines import need_target
from tests.trace.ptx_machine import Driver

LYAPUNOV = SMALL["law"][1]
SHARE = normal("4 %", relative=True)


@pytest.fixture
def driver(monkeypatch):
    need_target("nvptx64", "nvptx64-nvidia-cuda")
    made = Driver()
    monkeypatch.setitem(sys.modules, "cuda.bindings.driver", made)
    return made


def heavier():
    """A body whose inertia changes on the way."""
    return short(0.8, (LYAPUNOV,), fault=[{"time": 0.4, "inertia": [2.4, 3.1, 4.4], "action": "none"}])


def few():
    """A few control steps."""
    return short(0.4, (LYAPUNOV,))


def mission():
    """A craft with a filter, wheels, a field, drag and sunlight."""
    return load("cubesat-nadir").with_({"simulation.duration": "3 s", "fault": None, "requirement": None})


CASES = {
    "more than a block of threads": (heavier, {"spacecraft.inertia": SHARE, "initial.rate": normal(0.01)}, "lyapunov", 131)
}
MISSION = (mission, {"orbit.raan": uniform("0 deg", "360 deg"), "part.mekf.cross": SHARE}, "wheel", 3)


@pytest.mark.parametrize("case", [*CASES.values(), pytest.param(MISSION, marks=pytest.mark.slow)], ids=[*CASES, "a mission"])
def test_a_gpu_flies_the_bits_of_threads(case, driver, tmp_path):
    make, over, law, runs = case
    scenario = make()
    given = {"runs": runs, "over": over, "law": law, "search": False}
    there = sh.campaign(scenario, tmp_path / "there", gpu=True, **given)
    here = sh.campaign(scenario, tmp_path / "here", threads=1, **given)
    assert there.digest == here.digest
    assert {*driver.launched} == {128 * -(-runs // 128)}
    frame = there.frame()
    assert len(frame) == runs
    assert frame["effort"].nunique() == runs


def test_lanes_that_are_no_neighbours_have_their_own_random_numbers(driver):
    """As where one is refused, or a block has lots."""
    scenario = sh.load("three-laws-noise").with_({"simulation.duration": "1 s", "campaign": {"runs": 9}})
    job = jobs.Job(jobs.Source.of(scenario), scenario.table.campaign)
    runs = np.array([1, 4, 5, 8])
    columns = job.plan.columns(0, 9)
    drawn = {name: values[runs] for name, values in columns.items()}
    with ThreadPool(1) as pool:
        here = job.measure("lyapunov", drawn, runs, pool)()
    there = job.measure("lyapunov", drawn, runs, Device())()
    assert here.keys() == there.keys()
    assert [name for name in here if here[name].tobytes() != there[name].tobytes()] == []


def test_nothing_is_left_in_the_memory_of_a_gpu_and_kernels_are_made_once(driver):
    scenario = few().with_({"campaign": {"runs": 12, "over": {"initial.rate": normal(0.01)}}})
    job = jobs.Job(jobs.Source.of(scenario), scenario.table.campaign)
    with flying(job, Gpu(), 4) as fly:
        flown = list(fly([("lyapunov", first, 4) for first in (0, 4, 8)]))
    assert [chunk.first for chunk in flown] == [0, 4, 8]
    assert driver.loaded == 2
    assert not driver.memory.parts


def campaign(**more):
    return sh.campaign(few(), runs=4, over={"initial.rate": normal(0.01)}, law="lyapunov", search=False, gpu=True, **more)


@pytest.mark.parametrize("run", leading([3, 0]))
def test_other_bits_are_refused(run, driver, monkeypatch):
    plainly = driver.cuMemcpyDtoH

    def worn(to, start, size):
        """Memory with bad bits of a lane."""
        part, place = driver.memory.at(start, size // 8)
        part[place + run : place + size // 8 : 4] = np.nextafter(part[place + run : place + size // 8 : 4], np.inf)
        return plainly(to, start, size)

    monkeypatch.setattr(driver, "cuMemcpyDtoH", worn)
    with refused("the GPU: sm_90", f"other numbers in run {run} of lyapunov", "those of this machine"):
        campaign()


@pytest.mark.parametrize(
    ("name", "result", "words"),
    [
        ("cuInit", (100,), "gpu: found no driver that works (cuInit: 100); allowed: an NVIDIA GPU from sm_80 on"),
        ("cuMemAlloc", (2, 0), "gpu: found cuMemAlloc: 2; allowed: a working GPU"),
        ("cuModuleLoadData", (218, None), "gpu: found cuModuleLoadData: 218"),
        ("cuLaunchKernel", (700,), "gpu: found cuLaunchKernel: 700"),
    ],
)
def test_what_the_driver_refuses_is_told_in_a_line(name, result, words, driver, monkeypatch):
    monkeypatch.setattr(driver, name, lambda *given: result)
    with refused(words, start="campaign: "):
        campaign()


def test_a_machine_without_driver_bindings_or_a_young_gpu_is_refused(driver, monkeypatch):
    driver.capability = (7, 5)
    with refused("gpu: found sm_75", "from sm_80 on"):
        campaign()

    def missing(flags):
        raise RuntimeError("libcuda.so.1 was not there")

    monkeypatch.setattr(driver, "cuInit", missing)
    with refused("gpu: found", "libcuda.so.1 was not there", "with its driver"):
        campaign()
    monkeypatch.setitem(sys.modules, "cuda.bindings.driver", None)
    with refused("need cuda: pip install 'starhold[gpu]'"):
        campaign()


def test_a_gpu_is_no_engine_beside_another():
    assert engine_of(None, None, None, gpu=True) == Gpu()
    with refused("gpu: found", "beside workers", "one of threads, workers, scheduler and gpu"):
        engine_of(None, 2, None, gpu=True)
