"""A plant that listens on TCP or UDP."""

from __future__ import annotations

import asyncio
import contextlib
import signal
import threading
from collections.abc import Callable, Generator
from typing import Any, cast

from starhold.errors import InputError
from starhold.link.plant import Ending, Plant
from starhold.link.protocol import Decoder

HOST, PORT = "127.0.0.1", 5750
UNREAD = 2**22
"""Bytes that wait for a peer; one that leaves more unread is gone."""


def serve(
    plant: Plant, host: str = HOST, port: int = PORT, udp: bool = False, announce: Callable[[str], None] | None = None
) -> int:
    """Listen until the plant's flight ends, and return the number of the signal that ended it, 0 for none.

    announce: called with the address, once it listens. The first peer that says hello commands; messages of others are
    counted. InputError where the address cannot be used."""
    return asyncio.run(_serve(plant, host, port, udp, announce))


async def _serve(plant: Plant, host: str, port: int, udp: bool, announce: Callable[[str], None] | None) -> int:
    loop, line = asyncio.get_running_loop(), _Line(plant)
    with _interrupts(line.interrupt):
        server: Any = None
        try:
            if udp:
                server, _ = await loop.create_datagram_endpoint(lambda: _Datagrams(line), (host, port))
                at = server.get_extra_info("sockname")
            else:
                server = await loop.create_server(lambda: _Stream(line), host, port)
                at = server.sockets[0].getsockname()
        except OSError as error:
            found = f"{host}:{port}, {error.strerror or error}"
            raise InputError(
                "serve", "--host, --port", found, "an address of this machine, and a port that is free"
            ) from None
        try:
            if announce is not None:
                announce(f"{'udp' if udp else 'tcp'}://{at[0]}:{at[1]}")
            await line.over
        finally:
            line.close()
            server.close()
    return line.signal


@contextlib.contextmanager
def _interrupts(end: Callable[[int], None]) -> Generator[None]:
    """Let Ctrl-C and a request to end call a function; leave the handlers as they were."""
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


class _Line:
    """The plant, the one peer that commands it, and the clock."""

    def __init__(self, plant: Plant) -> None:
        self.plant = plant
        self.over: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self.peer: Any = None
        """The connection or address that said hello first, and so commands."""
        self.transports: set[asyncio.BaseTransport] = set()
        self.signal = 0
        self._timer: asyncio.TimerHandle | None = None

    def heed(self, peer: Any, send: Callable[[bytes], None], heed: Callable[[], None]) -> bool:
        """Let the plant heed what a peer sent, unless another one commands: then it is counted, and the answer is False."""
        if self.peer not in (None, peer):
            self.plant.strange()
            return False
        # Until somebody has said hello, each is answered alone.
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

    def close(self) -> None:
        """Leave all peers."""
        if self._timer is not None:
            self._timer.cancel()
        for transport in self.transports:
            transport.close()

    def after(self) -> None:
        """Set the clock, or leave, after something happened."""
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


class _Stream(asyncio.Protocol):
    """One connection."""

    def __init__(self, line: _Line) -> None:
        self._line, self._decoder = line, Decoder()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.Transport, transport)
        self._line.transports.add(transport)

    def data_received(self, data: bytes) -> None:
        if not self._line.heed(self, self._send, lambda: self._line.plant.received(data, self._decoder)):
            self._transport.close()

    def connection_lost(self, exc: Exception | None) -> None:
        self._line.transports.discard(self._transport)
        self._gone()

    def _send(self, data: bytes) -> None:
        self._transport.write(data)
        if self._transport.get_write_buffer_size() > UNREAD:
            self._gone()

    def _gone(self) -> None:
        if self._line.peer is self:
            self._line.plant.hang_up(self._decoder)
            self._line.after()


class _Datagrams(asyncio.DatagramProtocol):
    """Datagrams, of which each holds whole messages."""

    def __init__(self, line: _Line) -> None:
        self._line = line

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.DatagramTransport, transport)

    def datagram_received(self, data: bytes, addr: Any) -> None:
        plant = self._line.plant
        self._line.heed(addr, lambda answer: self._transport.sendto(answer, addr), lambda: plant.datagram(data))
