"""The same numbers, bit for bit, however a flight is computed."""

from dataclasses import replace

import numpy as np
import pytest

from starhold.algebra.structure import flatten, places
from starhold.conformance.bench import random_quaternions, sample_loop
from starhold.laws.catalogue import catalogue
from starhold.loop import kernels
from starhold.parts.catalogue import fit
from starhold.parts.craft import make_craft
from starhold.simulation.lane import fly, label
from starhold.simulation.lanes import carry_columns, simulate_many, stacked
from tests.making import ORBITAL, aimed, noise

pytestmark = pytest.mark.usefixtures("optimised")
STEPS, LANES = 60, 300
TURNED = (0.6, 0.0, 0.8, 0.0)


def flown(name="sliding", **options):
    law = catalogue()[name]
    return replace(sample_loop(law, law.examples()[0]).with_parts(*noise(1e-4, 1e-4, 1e-4)), **options)


@pytest.mark.parametrize("target", [ORBITAL, aimed((0.6, 0.0, 0.8, 0.0))], ids=["orbital", "inertial"])
def test_lanes_start_like_single_flights(target):
    loop = flown().without("target").with_parts(target)
    starts = [loop.start._replace(attitude=q) for q in random_quaternions(40)]
    columns = carry_columns(loop, np.array([flatten(s) for s in starts]).T)
    for lane, start in enumerate(starts):
        assert columns[:, lane].tolist() == flatten(loop.carry(start))
    assert set(columns[places(loop.carry()).h]) == {-1.0, 1.0}


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_threads_change_nothing(threads):
    loop = flown()
    starts = np.tile(np.array(flatten(loop.start))[:, None], (1, LANES))
    one = simulate_many(loop, starts, STEPS, threads=1)
    other = simulate_many(loop, starts, STEPS, threads=threads)
    assert np.array_equal(one.states, other.states)
    # Noise differs between lanes, so they must not all be alike.
    assert len(np.unique(one.states[0])) == LANES


def test_lanes_may_differ_in_any_number():
    law, random = catalogue()["sliding"], np.random.default_rng(5)
    loops = []
    for moments in (np.array([2.0, 3.0, 4.0]) * random.uniform(0.9, 1.1, size=(11, 3))).tolist():
        slope, layer, limit = random.uniform(0.05, 0.1, size=3).tolist(), float(random.uniform(1e-3, 1e-2)), 0.02
        gains = law.gains(tuple(slope), (5e-3, 5e-3, 5e-3), layer)
        random_parts = noise(*random.uniform(1e-5, 1e-4, size=3).tolist())
        craft = make_craft(moments, limit * float(random.uniform(0.5, 2.0)))
        lag = fit("actuator", "lag", float(random.uniform(0.2, 0.4)), float(random.uniform(0.01, 0.1)))
        start = flown().start._replace(rate=tuple(random.normal(scale=0.05, size=3).tolist()))
        loop = flown().with_parts(*random_parts, lag, aimed(TURNED))
        loops.append(replace(loop, craft=craft, gains=gains, start=start))
    phases = stacked([loop.phases(STEPS) for loop in loops])
    batch = simulate_many(loops[0], [loop.start for loop in loops], STEPS, phases=phases, width=4)
    for lane, loop in enumerate(loops):
        assert batch.states[:, lane].tolist() == flatten(fly(loop, STEPS, run=lane)[1].state)


def test_what_is_a_constant_of_the_kernel_may_not_differ():
    law = catalogue()["pd"]
    plain = flown("pd")
    clipped = replace(plain, gains=law.gains(0.09, 0.009, 1))
    with pytest.raises(ValueError, match="constant of their kernel"):
        stacked([plain.phases(5), clipped.phases(5)])
    with pytest.raises(ValueError, match="more than numbers"):
        stacked([plain.phases(5), replace(plain, craft=make_craft([2.0, 3.0, 4.0])).phases(5)])


def test_chunks_and_recording_change_nothing():
    loop = flown()
    whole, end = fly(loop, 200)
    chunked, other = fly(loop, 200, progress=lambda done, total: None)
    sparse, third = fly(loop, 200, record_every=7)
    assert np.array_equal(whole, chunked)
    assert flatten(end.state) == flatten(other.state) == flatten(third.state)
    assert np.array_equal(whole[:, ::7], sparse)


def test_a_long_flight_is_optimised_and_gives_the_same_numbers(monkeypatch):
    loop, load, asked = flown(), kernels.load, []

    def noted(program, width, passes=None):
        asked.append(passes)
        return load(program, width, passes)

    monkeypatch.setattr(kernels, "_KERNELS", {})
    monkeypatch.setattr(kernels, "load", noted)
    short, _ = fly(loop, 200)
    monkeypatch.setattr("starhold.simulation.lane.LONG", 200)
    long, _ = fly(loop, 200)
    assert asked == [None, True]
    assert np.array_equal(short, long)


def test_seed_changes_noise_and_nothing_else():
    a, b, c = (fly(flown(seed=seed), 30)[1].state for seed in (1, 1, 2))
    assert flatten(a) == flatten(b)
    assert flatten(a) != flatten(c)


def test_progress_is_reported_to_the_end():
    calls = []
    fly(flown(), 500, progress=lambda done, total: calls.append((done, total)))
    assert calls[-1] == (500, 500)
    assert calls == sorted(set(calls))


def test_dataset_is_labelled():
    run = label(flown(), *fly(flown(), 50, 5), 5).dataset()
    assert run.sizes == {"time": 11, "quaternion": 4, "axis": 3}
    assert run["time"].values[-1] == pytest.approx(5.0)
    units = {"attitude": "1", "rate": "rad/s", "torque": "N m", "position": "m", "velocity": "m/s"}
    assert {name: run[name].attrs["units"] for name in units} == units
    assert "diverged_at" not in run.attrs
    assert all(np.isfinite(run[name].values).all() for name in run)
