"""The same numbers, bit for bit, however a flight is computed."""

from dataclasses import replace

import numpy as np
import pytest

from starhold.algebra.structure import flatten
from starhold.conformance.bench import random_quaternions, sample_loop
from starhold.laws.catalogue import catalogue
from starhold.loop.kernels import make_step
from starhold.models.sensor import Noise
from starhold.simulation.lane import fly, simulate
from starhold.simulation.lanes import _carries, simulate_many

STEPS, LANES = 60, 300


def flown(name="sliding", **options):
    law = catalogue()[name]
    return replace(sample_loop(law, law.examples()[0]), noise=Noise(1e-4, 1e-4, 1e-4), **options)


def test_every_lane_equals_its_own_single_flight():
    loop = flown()
    random = np.random.default_rng(3)
    starts = [loop.start._replace(rate=tuple(random.normal(scale=0.05, size=3))) for _ in range(LANES)]
    batch = simulate_many(loop, starts, STEPS, first_run=17)
    for lane in (0, 1, 127, 128, 255, 256, LANES - 1):
        alone = fly(replace(loop, start=starts[lane]), STEPS, run=17 + lane)[1].state
        assert batch.states[:, lane].tolist() == flatten(alone)
    assert (batch.lost_at == -1).all()


@pytest.mark.parametrize("target", ["orbital", (0.6, 0.0, 0.8, 0.0)])
def test_lanes_start_like_single_flights(target):
    loop = flown(target=target)
    starts = [loop.start._replace(attitude=q) for q in random_quaternions(40)]
    columns = _carries(loop, np.array([flatten(s) for s in starts]).T)
    for lane, start in enumerate(starts):
        assert columns[:, lane].tolist() == flatten(loop.carry(start))
    assert set(columns[16 if target != "orbital" else 20]) == {-1.0, 1.0}


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_threads_change_nothing(threads):
    loop = flown()
    starts = np.tile(np.array(flatten(loop.start))[:, None], (1, LANES))
    one = simulate_many(loop, starts, STEPS, threads=1)
    other = simulate_many(loop, starts, STEPS, threads=threads)
    assert np.array_equal(one.states, other.states)
    # Noise differs between lanes, so they must not all be alike.
    assert len(np.unique(one.states[0])) == LANES


def test_plain_python_equals_compiled_with_noise():
    loop = flown("lyapunov")
    step, carry, setup = make_step(loop.parts()), loop.carry(), loop.setup()
    for k in range(20):
        carry = step.decide(step.check(carry, k, setup), k, 5, loop.gains, loop.craft, setup)
        carry = step.hold(carry, loop.craft, setup)
    assert flatten(carry.state) == flatten(fly(loop, 20, run=5)[1].state)


def test_gains_may_differ_between_lanes():
    loop = flown("lyapunov")
    rates = np.linspace(0.05, 0.2, LANES)
    gains = np.vstack([rates, np.full(LANES, 0.009)])
    starts = np.tile(np.array(flatten(loop.start))[:, None], (1, LANES))
    batch = simulate_many(loop, starts, STEPS, gains=gains)
    for lane in (0, 130, LANES - 1):
        alone = fly(replace(loop, gains=loop.law.gains(rates[lane], 0.009)), STEPS, run=lane)[1].state
        assert batch.states[:, lane].tolist() == flatten(alone)


def test_chunks_and_recording_change_nothing():
    loop = flown()
    whole, end = fly(loop, 200)
    chunked, other = fly(loop, 200, progress=lambda done, total: None)
    sparse, third = fly(loop, 200, record_every=7)
    assert np.array_equal(whole, chunked)
    assert flatten(end.state) == flatten(other.state) == flatten(third.state)
    assert np.array_equal(whole[:, ::7], sparse)


def test_compiled_only_law_is_the_same_in_a_batch():
    loop = flown("mpc")
    starts = [loop.start, loop.start._replace(rate=(0.0, 0.01, 0.0)), loop.start]
    batch = simulate_many(loop, starts, 15, threads=2)
    for lane, start in enumerate(starts):
        assert batch.states[:, lane].tolist() == flatten(fly(replace(loop, start=start), 15, run=lane)[1].state)


def test_seed_changes_noise_and_nothing_else():
    a, b, c = (fly(flown(seed=seed), 30)[1].state for seed in (1, 1, 2))
    assert flatten(a) == flatten(b)
    assert flatten(a) != flatten(c)


def test_progress_is_reported_to_the_end():
    calls = []
    simulate(flown(), 500, progress=lambda done, total: calls.append((done, total)))
    assert calls[-1] == (500, 500)
    assert calls == sorted(set(calls))


def test_dataset_is_labelled():
    run = simulate(flown(), 50, record_every=5)
    assert run.sizes == {"time": 11, "quaternion": 4, "axis": 3}
    assert run["time"].values[-1] == pytest.approx(5.0)
    assert {name: run[name].attrs["units"] for name in ("attitude", "rate", "torque", "position", "velocity")} == {
        "attitude": "1",
        "rate": "rad/s",
        "torque": "N m",
        "position": "m",
        "velocity": "m/s",
    }
    assert "diverged_at" not in run.attrs
    assert all(np.isfinite(run[name].values).all() for name in run)
