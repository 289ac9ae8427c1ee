"""Flight software for tests: it talks to a plant over a socket, in either form of the protocol."""

import socket
import threading
from contextlib import contextmanager
from queue import Queue

from starhold.api import serve
from starhold.link.protocol import Decoder, Kind, Message, binary, line

PATIENCE = 30.0
"""Longer than any answer takes (s)."""


class Client:
    """Sends and receives messages; `text`: as lines of JSON."""

    def __init__(self, address, text=False):
        protocol, place = address.split("://")
        host, port = place.rsplit(":", 1)
        self.udp, self.write = protocol == "udp", line if text else binary
        self.socket = socket.socket(type=socket.SOCK_DGRAM if self.udp else socket.SOCK_STREAM)
        self.socket.settimeout(PATIENCE)
        self.socket.connect((host, int(port)))
        self._decoder, self._ready = Decoder(by_plant=True), []

    def send(self, kind, step=0, numbers=()):
        self.socket.sendall(self.write(Message(kind, step, tuple(numbers))))

    def receive(self):
        """The next message; None where the plant has hung up."""
        while not self._ready:
            data = self.socket.recv(2**16)
            if not data:
                return None
            self._ready += self._decoder.feed(data)
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


@contextmanager
def served(*about, **options):
    """A plant that is served in a thread: yields its address and the queue in which its result, or its error, comes."""
    addresses, results = Queue(), Queue()

    def work():
        try:
            results.put(serve(*about, port=0, announce=addresses.put, **options))
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
