"""A plant on the loopback address: lockstep has the bits of a simulation, real time keeps to the clock, and nothing that is
not valid moves it."""

import json
import time

import numpy as np
import pytest

import starhold as sh
from starhold.link.plant import Ending
from starhold.link.protocol import Fault, Kind, Message, binary
from tests.link.clients import PATIENCE, Client, served

STEPS = 60


def short(name, steps=STEPS):
    """A built-in scenario that lasts so many control periods."""
    scenario = sh.load(name)
    timing = scenario.table.simulation
    return scenario.with_({"simulation.duration": steps * timing.control_period})


def assert_same(run, other):
    assert list(run.data_vars) == list(other.data_vars)
    for name in run.data_vars:
        assert np.array_equal(run[name], other[name], equal_nan=True), name


@pytest.mark.parametrize(("udp", "text"), [(False, False), (False, True), (True, False), (True, True)])
def test_lockstep_has_the_bits_of_a_simulation(udp, text):
    scenario = short("three-laws-noise")
    whole = sh.simulate(scenario)
    with served(scenario, udp=udp) as (address, results):
        client = Client(address, text)
        hello, readings = client.greet()
        about = json.loads(hello.text)
        assert about["scenario"] == scenario.name
        assert hello.numbers[0] == scenario.table.simulation.control_period
        assert 1 + sum(size for _, size in about["fields"]) == hello.numbers[1] == len(readings.numbers)
        for step, command in enumerate(whole["command"].to_numpy()):
            assert (readings.step, readings.numbers[0]) == (step, whole["time"][step])
            client.send(Kind.COMMAND, step, command)
            if step < STEPS:
                readings = client.until(Kind.READINGS)
        assert client.until(Kind.STOP).text == Ending.FLOWN
        client.close()
    result = results.get()
    assert result.ending is Ending.FLOWN
    assert_same(whole, result.recording.dataset())
    assert not result.plant.faults
    assert len(result.plant.latencies) == STEPS + 1
    assert result.lines[0].startswith(f"Ended at step {STEPS} of {STEPS} (")
