"""Messages are the same after a round trip in either form, in pieces of any size, and what is none is a fault."""

import json
import struct

import numpy as np
import pytest

import starhold as sh
from starhold.link.header import header, place_name
from starhold.link.layout import Layout
from starhold.link.protocol import HEAD, LINE, MAGIC, VERSION, Decoder, Fault, Kind, Message, binary, line
from starhold.scenario.building import build

SPECIAL = (0.0, -0.0, 5e-324, 1.7976931348623157e308, 0.1, 1 / 3, -2.5e-17)


def messages(rng):
    """One message of each kind, as the plant and flight software send them."""
    numbers = (*rng.choice(SPECIAL, 3), *rng.normal(size=4))
    yield Message(Kind.HELLO)
    yield Message(Kind.HELLO, 3, (0.1, 17.0, 4e9), json.dumps({"scenario": "ä", "fields": [["a", 3]]}))
    yield Message(Kind.READINGS, 2**32 - 1, numbers)
    yield Message(Kind.COMMAND, 7, numbers[:3])
    yield Message(Kind.RESET)
    yield Message(Kind.RESET, 0, (3.0, -4.0))
    yield Message(Kind.STOP, 5, (), "why not")
    yield Message(Kind.REFUSED, 5, (), "late")


@pytest.mark.parametrize("write", [binary, line])
def test_round_trips_in_pieces_of_any_size(write):
    rng = np.random.default_rng(1)
    for _ in range(20):
        given = list(messages(rng))
        text, decoder, found = b"".join(map(write, given)), Decoder(by_plant=True), []
        while text:
            size = int(rng.integers(1, 60))
            found += decoder.feed(text[:size])
            text = text[size:]
        assert found == given
        bits = [struct.pack(f"{len(one.numbers)}d", *one.numbers) for one in (*given, *found)]
        assert bits[: len(given)] == bits[len(given) :]
        assert list(decoder.end()) == []


def test_numbers_that_are_not_finite_are_null_in_text():
    text = line(Message(Kind.READINGS, 1, (1.0, np.nan, np.inf)))
    assert json.loads(text) == {"kind": "readings", "version": 1, "step": 1, "numbers": [1.0, None, None]}
    (found,) = Decoder(by_plant=True).feed(binary(Message(Kind.READINGS, 1, (1.0, np.inf))))
    assert found.numbers == (1.0, np.inf)


GOOD = {"kind": "command", "step": 3, "numbers": [1, 2.5, -3e-3]}


def test_a_line_is_what_it_says():
    assert list(Decoder().feed(json.dumps(GOOD).encode() + b"\r\n")) == [Message(Kind.COMMAND, 3, (1.0, 2.5, -3e-3))]


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"version": 2}, Fault.VERSION),
        ({"version": True}, Fault.VERSION),
        ({"kind": "Command"}, Fault.MALFORMED),
        ({"kind": "readings"}, Fault.MALFORMED),
        ({"kind": 3}, Fault.MALFORMED),
        ({"step": -1}, Fault.MALFORMED),
        ({"step": 3.0}, Fault.MALFORMED),
        ({"step": 2**32}, Fault.MALFORMED),
        ({"numbers": [1, 2]}, Fault.MALFORMED),
        ({"numbers": [1, 2, 3, 4]}, Fault.MALFORMED),
        ({"numbers": [1, 2, "3"]}, Fault.MALFORMED),
        ({"numbers": [1, 2, True]}, Fault.MALFORMED),
        ({"numbers": 3}, Fault.MALFORMED),
        ({"numbers": [1, 2, None]}, Fault.NOT_FINITE),
        ({"numbers": [1, 2, float("nan")]}, Fault.NOT_FINITE),
        ({"numbers": [1, 2, 10**400]}, Fault.NOT_FINITE),
        ({"numbers": [1, 2, -float("inf")]}, Fault.NOT_FINITE),
        ({"torque": [1, 2, 3]}, Fault.MALFORMED),
    ],
)
def test_what_is_no_message_in_text(change, fault):
    decoder = Decoder()
    assert list(decoder.feed(json.dumps(GOOD | change).encode() + b"\n")) == [fault]
    # The next line is heeded.
    assert [one.kind for one in decoder.feed(line(Message(Kind.HELLO)))] == [Kind.HELLO]


def test_a_command_without_a_step_is_none():
    assert list(Decoder().feed(b'{"kind": "command", "numbers": [1, 2, 3]}\n')) == [Fault.MALFORMED]


@pytest.mark.parametrize("text", [b"{" * 60_000, b'{"kind": ' + b"[" * 60_000, b'{"\xff": 1}', b"{}", b"{1}"])
def test_lines_that_are_no_json(text):
    assert list(Decoder().feed(text + b"\n")) == [Fault.MALFORMED]


def test_a_line_without_an_end_is_one_fault():
    decoder = Decoder()
    found = [one for _ in range(5) for one in decoder.feed(b"{" * LINE)]
    assert [*found, *decoder.feed(b"\n" + line(Message(Kind.STOP)))] == [Fault.MALFORMED, Message(Kind.STOP)]


def framed(version=VERSION, kind=Kind.COMMAND, size=24, zero=0):
    return HEAD.pack(MAGIC, version, kind, zero, size, 0)


@pytest.mark.parametrize(
    ("data", "faults"),
    [
        (b"garbage", [Fault.MALFORMED]),
        (b"SHL", [Fault.MALFORMED]),
        (framed(version=2), [Fault.VERSION]),
        (framed(kind=9), [Fault.MALFORMED]),
        (framed(kind=Kind.READINGS), [Fault.MALFORMED]),
        (framed(size=16), [Fault.MALFORMED]),
        (framed(size=2**32 - 1), [Fault.MALFORMED]),
        (framed(zero=1), [Fault.MALFORMED]),
        (framed() + bytes(28), [Fault.MALFORMED]),
        (2 * (framed() + bytes(28)), [Fault.MALFORMED, Fault.MALFORMED]),
        (binary(Message(Kind.COMMAND, 0, (1.0, np.nan, 0.0))), [Fault.NOT_FINITE]),
        (binary(Message(Kind.STOP, 0, (), "text")), [Fault.MALFORMED]),
    ],
)
def test_what_is_no_frame(data, faults):
    hello, decoder = Message(Kind.HELLO), Decoder()
    assert list(decoder.feed(data + binary(hello))) == [*faults, hello]
    decoder, found = Decoder(), []
    for byte in data + binary(hello):
        found += decoder.feed(bytes([byte]))
    assert found == [*faults, hello]


def test_the_header_has_the_layout():
    scenario = sh.load("cubesat-nadir")
    loop = build(scenario, scenario.laws[0])
    layout, text = Layout(loop), header(loop, scenario.name)
    flight = sh.stepper(scenario)
    for readings in (flight.reset(), flight.step()):
        numbers = layout.numbers(flight, readings)
        assert len(numbers) == 1 + layout.size
        assert numbers[0] == readings.time
        for name, expected in {
            "measurement.attitude": readings.measurement.attitude,
            "sensors.gyro.rate": readings.sensors["gyro"].rate,
            "estimate.gyro_bias": readings.estimate.gyro_bias,
            "state.rate": flight.state.rate,
        }.items():
            field = layout.place(name)
            assert numbers[1 + field.first : 1 + field.first + field.size].tolist() == list(expected)
            assert f"    {place_name(name)} = {1 + field.first} /* {field.size} */" in text
    assert f"#define STARHOLD_LAYOUT UINT32_C(0x{layout.check:08X})" in text
    assert "@" not in text
