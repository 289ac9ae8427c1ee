"""A plant that listens on ZeroMQ."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

from starhold.errors import optional
from starhold.link.protocol import LINE
from starhold.link.server import Line, refused

FAREWELL = 1000
"""Time in which the last message may be sent (ms)."""


async def zeromq(line: Line, host: str, port: int) -> tuple[str, Callable[[], None]]:
    """Listen with a ROUTER, to which flight software connects as DEALER or, in lockstep, as REQ.

    Each ZeroMQ message contains complete messages of the protocol, and all answers to it form one message. Raise InputError
    if the address cannot be used, or without the extra `zmq`."""
    zmq, sockets = optional("zmq", "serve --zmq", "zmq"), optional("zmq.asyncio", "serve --zmq", "zmq")
    from zmq.utils.monitor import parse_monitor_message

    context = sockets.Context()
    router = context.socket(zmq.ROUTER)
    router.setsockopt(zmq.MAXMSGSIZE, LINE)
    monitor = router.get_monitor_socket(zmq.EVENT_DISCONNECTED)
    commander: set[int] = set()

    async def receive() -> None:
        while True:
            *envelope, last = await router.recv_multipart(copy=False)
            answers: list[bytes] = []

            def heed(data: bytes = last.bytes) -> None:
                line.plant.datagram(data)

            if line.heed(envelope[0].bytes, answers.append, heed):
                line.plant.send = lambda data, back=envelope: router.send_multipart([*back, data])
                if line.plant.greeted:
                    commander.add(last.get(zmq.SRCFD))
                if answers:
                    line.plant.send(b"".join(answers))

    async def notice_ends() -> None:
        while True:
            event: Any = parse_monitor_message(await monitor.recv_multipart())
            if event["value"] in commander:
                line.gone()

    try:
        with refused("--host, --port", f"{host}:{port}"):
            try:
                router.bind(f"tcp://{host}:{port or '*'}")
            except zmq.ZMQError as error:
                raise OSError(str(error)) from None
    except BaseException:
        context.destroy(linger=0)
        raise
    tasks = [asyncio.create_task(work()) for work in (receive, notice_ends)]
    for task in tasks:
        task.add_done_callback(line.failed)

    def close() -> None:
        for task in tasks:
            task.cancel()
        router.disable_monitor()
        context.destroy(linger=FAREWELL)

    return f"ZeroMQ {router.getsockopt_string(zmq.LAST_ENDPOINT)}", close
