"""Flight software for tests: it talks to a plant over any transport, in either form of the protocol."""

import os
import select
import socket
import threading
import tty
from contextlib import contextmanager
from queue import Queue

import numpy as np
import pytest

from starhold.api import serve
from starhold.link.protocol import Decoder, Kind, Message, binary, line

PATIENCE = 30.0
"""Longer than any answer takes (s)."""


OVER = ("tcp", "udp", "zmq", "serial")
"""All transports, as `served` knows them."""
BOARDS: dict[str, int] = {}
"""The other ends of the pseudo-terminals that are served."""


class Dealer:
    """A socket of ZeroMQ, used as one of the system's."""

    def __init__(self, place, kind="DEALER"):
        zmq = pytest.importorskip("zmq")
        self._context = zmq.Context()
        self._socket = self._context.socket(getattr(zmq, kind))
        self._socket.setsockopt(zmq.RCVTIMEO, int(1000 * PATIENCE))
        self._socket.connect(place)
        self.sendall = self._socket.send

    def recv(self, most):
        return self._socket.recv()

    def close(self):
        # What was sent leaves first.
        self._context.destroy(linger=1000)


class Board:
    """The far end of a serial line, used as a socket."""

    def __init__(self, end):
        self.end = end

    def sendall(self, data):
        while data:
            data = data[os.write(self.end, data) :]

    def recv(self, most):
        assert select.select([self.end], [], [], PATIENCE)[0]
        try:
            return os.read(self.end, most)
        except OSError:
            # The plant has left.
            return b""

    def close(self):
        os.close(self.end)


def connected(address):
    """What a client sends to and receives from, at an address that a plant has told."""
    if " at " in address:
        return Board(BOARDS.pop(address.split(" at ")[0]))
    protocol, place = address.split("://")
    if protocol.startswith("ZeroMQ"):
        return Dealer(address.split()[1])
    host, port = place.rsplit(":", 1)
    link = socket.socket(type=socket.SOCK_DGRAM if protocol == "udp" else socket.SOCK_STREAM)
    link.settimeout(PATIENCE)
    link.connect((host, int(port)))
    return link


class Client:
    """Sends and receives messages; `text`: as lines of JSON; link: a connection that is there."""

    def __init__(self, address, text=False, link=None):
        self.write, self.socket = line if text else binary, link or connected(address)
        # Of datagrams each has a form of its own.
        self._whole = isinstance(self.socket, Dealer) or getattr(self.socket, "type", None) is socket.SOCK_DGRAM
        self._decoder, self._ready = Decoder(by_plant=True), []

    def send(self, kind, step=0, numbers=()):
        self.socket.sendall(self.write(Message(kind, step, tuple(numbers))))

    def receive(self):
        """The next message; None where the plant has hung up."""
        while not self._ready:
            data = self.socket.recv(2**16)
            if not data:
                return None
            self._ready += (Decoder(by_plant=True) if self._whole else self._decoder).feed(data)
        return self._ready.pop(0)

    def until(self, kind):
        """The next message of a kind."""
        while (message := self.receive()) is not None:
            if message.kind is kind:
                return message
        raise AssertionError(f"hung up before {kind.name}")

    def greet(self):
        """What hello is answered: the plant's hello, and readings."""
        self.send(Kind.HELLO)
        return self.until(Kind.HELLO), self.until(Kind.READINGS)

    def close(self):
        self.socket.close()


def transport(over):
    """The options with which a plant is served over a transport; skips where its package is missing."""
    if over != "serial":
        if over == "zmq":
            pytest.importorskip("zmq")
        return {"port": 0} | ({} if over == "tcp" else {over: True})
    pytest.importorskip("serial")
    end, other = os.openpty()
    tty.setraw(other)
    BOARDS[os.ttyname(other)] = end
    return {"serial": os.ttyname(other)}


@contextmanager
def served(*about, over="tcp", **options):
    """A plant that is served in a thread: yields its address and the queue in which its result, or its error, comes."""
    options |= transport(over)
    addresses, results = Queue(), Queue()

    def work():
        try:
            results.put(serve(*about, announce=addresses.put, **options))
        except BaseException as error:
            addresses.put(None)
            results.put(error)

    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    address = addresses.get(timeout=PATIENCE)
    assert address is not None, results.get()
    yield address, results
    thread.join(PATIENCE)
    assert not thread.is_alive()


def mutated(rng, step):
    """Bytes that hold no valid command for a step: random ones, and messages that were cut, changed, or are for another."""
    good = Message(Kind.COMMAND, step, tuple(rng.normal(size=3)))
    write = (binary, line)[rng.integers(2)]
    kind = rng.integers(6)
    if kind == 0:
        return rng.bytes(int(rng.integers(1, 200)))
    if kind == 1:
        numbers = list(good.numbers)
        numbers[rng.integers(3)] = rng.choice([np.nan, np.inf, -np.inf])
        return write(good._replace(numbers=numbers))
    if kind == 2:
        return write(good._replace(step=int(rng.choice([step + 1, step + 2, 2**32 - 1]))))
    if kind == 3:
        return write(good._replace(numbers=good.numbers[: rng.integers(3)]))
    text = bytearray(write(good))
    if kind == 4:
        return bytes(text[: rng.integers(1, len(text) - 1)])
    if write is line:
        words = [b"[" * 3000, b"9" * 5000, b'"step": 1e99', b'"step": true', b"null", b'{"kind": 3}', b'"\\ud800"', b"\xff{"]
        at = int(rng.integers(1, len(text) - 2))
        text[at:at] = words[rng.integers(len(words))] + b"{"
        return bytes(text)
    at = int(rng.integers(len(text)))
    text[at] ^= int(rng.integers(1, 256))
    return bytes(text)
