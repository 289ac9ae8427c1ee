"""A plant on the loopback address or a serial line: lockstep has the bits of a simulation, real time keeps to the clock, and
nothing that is not valid moves it."""

import json
import socket
import time

import numpy as np
import pytest

import starhold as sh
from starhold.link import server
from starhold.link.plant import Ending, summary
from starhold.link.protocol import Fault, Kind, Message, binary
from starhold.report.timing import write_timing
from tests.link.clients import OVER, Client, Dealer, mutated, served
from tests.tiers import fewer

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


@pytest.mark.parametrize("text", [False, True])
@pytest.mark.parametrize("over", OVER)
def test_lockstep_has_the_bits_of_a_simulation(over, text):
    scenario = short("three-laws-noise")
    whole = sh.simulate(scenario)
    with served(scenario, over=over) as (address, results):
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


def test_real_time_keeps_to_the_clock_and_counts_what_is_missing(tmp_path, monkeypatch):
    monkeypatch.setattr(server, "SECOND", 0.2)
    looks = []
    scenario = short("three-laws", 20)
    period = scenario.table.simulation.control_period / 2.0
    with served(scenario, rate=2.0, missing="zero", watch=looks.append) as (address, results):
        client, begun = Client(address), time.monotonic()
        client.greet()
        # A command for the first period and one that is much too late; none for the others.
        client.send(Kind.COMMAND, 0, (1e-3, 0.0, 0.0))
        while client.until(Kind.READINGS).step < 5:
            pass
        client.send(Kind.COMMAND, 1, (5e-3, 0.0, 0.0))
        assert client.until(Kind.REFUSED).text == Fault.LATE
        assert client.until(Kind.STOP).text == Ending.FLOWN
        spent = time.monotonic() - begun
        client.close()
    result = results.get()
    plant = result.plant
    # Each fourth period, or later.
    assert 2 <= len(looks) <= 6
    assert write_timing(result.timing, tmp_path).read_bytes().startswith(b"\x89PNG")
    kept = json.loads((tmp_path / "timing.json").read_text())
    assert (kept["period"], kept["periods"], kept["missed"]) == (period, 21, plant.missed)
    assert (kept["latencies"], kept["lateness"]) == (plant.latencies, plant.lateness)
    assert spent >= 20.5 * period
    assert result.recording.attrs["without_command"] == "zero"
    assert plant.missed + plant.commanded == 21
    assert plant.commanded <= 1
    assert plant.faults[Fault.LATE] >= 1
    commands = plant.flight.recording()["command"]
    assert commands[1:].max() == commands[1:].min() == 0.0
    assert f"Real time at rate 2: {plant.missed} missed periods (zero)" in "\n".join(summary(plant))


@pytest.mark.parametrize("over", ["tcp", "zmq", "serial"])
def test_a_killed_peer_ends_the_flight_and_its_recording_is_kept(over):
    scenario = short("three-laws", 50)
    with served(scenario, over=over) as (address, results):
        client = Client(address)
        client.greet()
        for step in range(7):
            client.send(Kind.COMMAND, step, (1e-3, 0.0, 0.0))
            client.until(Kind.READINGS)
        client.socket.sendall(binary(Message(Kind.COMMAND, 7, (1.0, 0.0, 0.0)))[:-5])
        client.close()
    result = results.get()
    assert result.ending is Ending.GONE
    # What a serial line has not delivered is lost with it.
    assert result.plant.faults == {Fault.MALFORMED: 1} or (over == "serial" and not result.plant.faults)
    assert len(result.recording["time"]) == 7


def test_a_request_has_one_reply():
    with served(short("three-laws", 20), over="zmq") as (address, results):
        with socket.create_connection(("127.0.0.1", int(address.rsplit(":", 1)[1]))) as noise:
            # No peer of ZeroMQ.
            noise.sendall(np.random.default_rng(2).bytes(1000))
        client = Client(address, link=Dealer(address.split()[1], "REQ"))
        readings = client.greet()[1]
        client.send(Kind.COMMAND, 7, (0.0, 0.0, 0.0))
        assert client.receive().text == Fault.ORDER
        for step in range(21):
            assert readings.step == step
            client.send(Kind.COMMAND, step, (1e-3, 0.0, 0.0))
            readings = client.receive()
        assert (readings.kind, readings.text) == (Kind.STOP, Ending.FLOWN)
        client.close()
    assert results.get().plant.faults[Fault.ORDER] == 1


def test_a_second_peer_is_left_alone():
    scenario = short("three-laws", 3)
    with served(scenario) as (address, results):
        # Who says hello first commands, whoever came before.
        other, client = Client(address), Client(address)
        other.socket.sendall(b"SHL")
        client.greet()
        other.send(Kind.HELLO)
        assert other.receive() is None
        other.close()
        client.send(Kind.STOP)
        assert client.until(Kind.STOP).text == Ending.STOPPED
        client.close()
    result = results.get()
    assert result.ending is Ending.STOPPED
    assert result.plant.faults[Fault.STRANGER] == 1


@pytest.mark.parametrize("over", ["udp", "zmq"])
def test_only_the_first_address_commands_by_datagrams(over):
    with served(short("three-laws", 3), over=over) as (address, results):
        client, other = Client(address), Client(address, text=True)
        client.greet()
        other.send(Kind.STOP)
        other.send(Kind.COMMAND, 0, (1.0, 0.0, 0.0))
        other.close()
        # Two peers of ZeroMQ take turns: these come after what the other one sent.
        for _ in range(10):
            client.greet()
        client.socket.sendall(b"SHLK")
        assert client.until(Kind.REFUSED).text == Fault.MALFORMED
        client.send(Kind.STOP)
        client.until(Kind.STOP)
        client.close()
    plant = results.get().plant
    assert plant.flight.steps == 0
    assert plant.faults == {Fault.STRANGER: 2, Fault.MALFORMED: 1}


@pytest.mark.parametrize("over", OVER)
def test_noise_on_the_line_neither_moves_nor_stops_the_plant(over):
    rng, count = np.random.default_rng(7), fewer(10_000, 100)
    with served(short("three-laws"), over=over) as (address, results):
        client = Client(address)
        client.greet()
        for k in range(count):
            client.socket.sendall(mutated(rng, 0))
            if k % 20 == 19:
                for _ in range(2 if over in ("tcp", "serial") else 0):
                    # A stream may take them for the rest of what was cut.
                    client.send(Kind.HELLO)
                # The plant goes on: it answers, at the step where it was.
                assert client.greet()[1].step == 0
        for _ in range(2):
            client.send(Kind.HELLO)
        client.send(Kind.COMMAND, 0, (0.0, 0.0, 0.0))
        while client.until(Kind.READINGS).step != 1:
            pass
        client.send(Kind.STOP)
        client.until(Kind.STOP)
        client.close()
    plant = results.get().plant
    assert plant.flight.steps == plant.commanded == 1
    assert plant.faults[Fault.MALFORMED] > count / 50
