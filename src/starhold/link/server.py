"""A plant that listens until its flight ends: the common part of all transports, and TCP and UDP."""

from __future__ import annotations

import asyncio
import contextlib
import signal
import threading
from collections.abc import Callable, Coroutine, Generator
from typing import Any, TypeAlias, cast

from starhold.errors import InputError
from starhold.link.plant import Ending, Plant
from starhold.link.protocol import Decoder

HOST, PORT = "127.0.0.1", 5750
UNREAD = 2**22
"""Most bytes waiting for a peer; one that leaves more unread is disconnected."""
SECOND = 1.0
"""The least time between two calls of `watch` in real time (s)."""

Listen: TypeAlias = Callable[["Line"], Coroutine[Any, Any, tuple[str, Callable[[], None]]]]
"""A transport: it starts to listen for a line, and returns its address and a function that closes it."""


def serve(
    plant: Plant, listen: Listen, announce: Callable[[str], None] | None = None, watch: Callable[[Plant], None] | None = None
) -> int:
    """Listen until the plant's flight ends, and return the number of the signal that ended it, 0 for none.

    announce: called with the address, once it listens; watch: called with the plant in real time, at most once per second.
    The first peer that says hello commands; messages from others are counted. Raise InputError if the address cannot be
    used."""
    return asyncio.run(_serve(plant, listen, announce, watch))


async def _serve(
    plant: Plant, listen: Listen, announce: Callable[[str], None] | None, watch: Callable[[Plant], None] | None
) -> int:
    line = Line(plant, watch)
    with _interrupts(line.interrupt):
        address, close = await listen(line)
        try:
            if announce is not None:
                announce(address)
            await line.over
        finally:
            line.close()
            close()
    return line.signal


@contextlib.contextmanager
def refused(keys: str, given: str, allowed: str = "an address of this machine, and a port that is free") -> Generator[None]:
    """Inside this context, turn the error of an unusable address into an InputError."""
    try:
        yield
    except OSError as error:
        raise InputError("serve", keys, f"{given}, {error.strerror or error}", allowed) from None


async def tcp(line: Line, host: str, port: int) -> tuple[str, Callable[[], None]]:
    """Listen on TCP, where each connection is a stream of messages."""
    with refused("--host, --port", f"{host}:{port}"):
        server = await asyncio.get_running_loop().create_server(lambda: Stream(line), host, port)
    at = server.sockets[0].getsockname()
    return f"tcp://{at[0]}:{at[1]}", server.close


async def udp(line: Line, host: str, port: int) -> tuple[str, Callable[[], None]]:
    """Listen on UDP, where each datagram contains complete messages."""
    with refused("--host, --port", f"{host}:{port}"):
        transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(lambda: _Datagrams(line), (host, port))
    at = transport.get_extra_info("sockname")
    return f"udp://{at[0]}:{at[1]}", transport.close


@contextlib.contextmanager
def _interrupts(end: Callable[[int], None]) -> Generator[None]:
    """Inside this context, Ctrl-C and SIGTERM call a function; the old handlers are restored at its end."""
    numbers = (signal.SIGINT, signal.SIGTERM)
    before = {number: signal.getsignal(number) for number in numbers}
    loop = asyncio.get_running_loop()
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    with contextlib.suppress(NotImplementedError):
        for number in numbers:
            loop.add_signal_handler(number, end, number)
    try:
        yield
    finally:
        for number, handler in before.items():
            loop.remove_signal_handler(number)
            signal.signal(number, handler)


class Line:
    """The plant, the one peer that commands it, and the clock."""

    def __init__(self, plant: Plant, watch: Callable[[Plant], None] | None = None) -> None:
        self.plant, self._watch, self._watched = plant, watch, plant.clock()
        self.over: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self.peer: Any = None
        """The connection or address that said hello first, and so commands."""
        self.transports: set[asyncio.BaseTransport] = set()
        self.signal = 0
        self._timer: asyncio.TimerHandle | None = None

    def heed(self, peer: Any, send: Callable[[bytes], None], heed: Callable[[], None]) -> bool:
        """Let the plant process a peer's message. If another peer commands, count the message and return False."""
        if self.peer not in (None, peer):
            self.plant.strange()
            return False
        # Until a peer has said hello, each peer is answered separately.
        self.plant.send = send
        heed()
        self.peer = peer if self.plant.greeted else None
        self.after()
        return True

    def interrupt(self, signal: int) -> None:
        """End the flight because of a signal."""
        self.signal = signal
        self.plant.end(Ending.INTERRUPTED)
        self.after()

    def gone(self) -> None:
        """End the flight because the commanding peer has disconnected."""
        self.plant.end(Ending.GONE)
        self.after()

    def failed(self, task: asyncio.Task[None]) -> None:
        """Pass an error in a transport's task on to the server."""
        if not task.cancelled() and (error := task.exception()) is not None and not self.over.done():
            self.over.set_exception(error)

    def close(self) -> None:
        """Close the connections to all peers."""
        if self._timer is not None:
            self._timer.cancel()
        for transport in self.transports:
            transport.close()

    def after(self) -> None:
        """After an event, set the timer, or end the server if the flight has ended."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if self.plant.ending is not None:
            if not self.over.done():
                self.over.set_result(None)
        elif self.plant.due is not None:
            delay = max(0.0, self.plant.due - self.plant.clock())
            self._timer = asyncio.get_running_loop().call_later(delay, self._tick)

    def _tick(self) -> None:
        self._timer = None
        self.plant.tick()
        self.after()
        if self._watch is not None and self.plant.clock() >= self._watched + SECOND:
            self._watched = self.plant.clock()
            self._watch(self.plant)


class Stream(asyncio.Protocol):
    """A byte stream: a connection, or a serial line; writer: the transport for writing, if it differs from that for
    reading."""

    def __init__(self, line: Line, writer: asyncio.WriteTransport | None = None) -> None:
        self._line, self._decoder, self._writer = line, Decoder(), writer

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = transport
        self._line.transports.add(transport)

    def data_received(self, data: bytes) -> None:
        if not self._line.heed(self, self._send, lambda: self._line.plant.received(data, self._decoder)):
            self._transport.close()

    def connection_lost(self, exc: Exception | None) -> None:
        self._line.transports.discard(self._transport)
        self._gone()

    def _send(self, data: bytes) -> None:
        writer = self._writer or cast(asyncio.WriteTransport, self._transport)
        writer.write(data)
        if writer.get_write_buffer_size() > UNREAD:
            self._gone()

    def _gone(self) -> None:
        if self._line.peer is self:
            self._line.plant.faults.update(self._decoder.end())
            self._line.gone()


class _Datagrams(asyncio.DatagramProtocol):
    """Datagrams, each with complete messages."""

    def __init__(self, line: Line) -> None:
        self._line = line

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.DatagramTransport, transport)

    def datagram_received(self, data: bytes, addr: Any) -> None:
        plant = self._line.plant
        self._line.heed(addr, lambda answer: self._transport.sendto(answer, addr), lambda: plant.datagram(data))
